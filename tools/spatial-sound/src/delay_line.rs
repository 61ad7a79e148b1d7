//! The last samples, read at any time between them.

/// Samples that are kept: the longest way around a head takes 32.
const KEPT: usize = 64;

/// Samples before which the interpolation needs one more, and is late by.
const MARGIN: f32 = 1.0;

/// The last samples of a voice.
#[derive(Debug, Clone)]
pub(crate) struct DelayLine {
    samples: [f32; KEPT],
    /// Where the newest one is.
    newest: usize,
}

impl Default for DelayLine {
    fn default() -> Self {
        Self {
            samples: [0.0; KEPT],
            newest: 0,
        }
    }
}

impl DelayLine {
    pub(crate) fn push(&mut self, sample: f32) {
        self.newest = (self.newest + 1) % KEPT;
        if let Some(place) = self.samples.get_mut(self.newest) {
            *place = sample;
        }
    }

    /// The sample of `delay` samples ago and [`MARGIN`] more, by Lagrange's interpolation of third order; the oldest, if it was before that.
    pub(crate) fn read(&self, delay: f32) -> f32 {
        let delay = delay.clamp(0.0, (KEPT - 4) as f32) + MARGIN;
        #[allow(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "it is within the line"
        )]
        let whole = delay as usize;
        let x = delay - whole as f32;
        let at = |ago: usize| {
            let place = (self.newest + KEPT - ago) % KEPT;
            self.samples.get(place).copied().unwrap_or_default()
        };
        let [a, b, c, d] = [whole - 1, whole, whole + 1, whole + 2].map(at);
        // The four of Lagrange's polynomials at -1, 0, 1 and 2.
        a * (-x * (x - 1.0) * (x - 2.0) / 6.0)
            + b * ((x + 1.0) * (x - 1.0) * (x - 2.0) / 2.0)
            + c * (-(x + 1.0) * x * (x - 2.0) / 2.0)
            + d * ((x + 1.0) * x * (x - 1.0) / 6.0)
    }
}
