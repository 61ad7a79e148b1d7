//! Silence by choice: faded within one frame, so that nothing clicks.

use link_voice::FRAME;

/// What is let through of a voice.
#[derive(Debug)]
pub(crate) struct Mute {
    /// 1 while it is let through.
    gain: f32,
}

impl Default for Mute {
    fn default() -> Self {
        Self { gain: 1.0 }
    }
}

impl Mute {
    /// Fades out, or in again, within this frame; in a mute nothing of the next ones is left.
    pub(crate) fn apply(&mut self, muted: bool, frame: &mut [f32; FRAME]) {
        let target = if muted { 0.0 } else { 1.0 };
        let step = (target - self.gain) / FRAME as f32;
        for (sample, number) in frame.iter_mut().zip(1u16..) {
            *sample *= self.gain + step * f32::from(number);
        }
        self.gain = target;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_voice_fades_out_within_a_frame_stays_out_and_fades_in_again() {
        let mut mute = Mute::default();
        let mut pass = |muted| {
            let mut frame = [0.5; FRAME];
            mute.apply(muted, &mut frame);
            frame
        };
        let steepest = |frame: &[f32; FRAME]| {
            frame
                .windows(2)
                .map(|pair| (pair[1] - pair[0]).abs())
                .fold(0.0, f32::max)
        };
        assert!(pass(false).iter().all(|sample| *sample == 0.5), "as it is");
        let out = pass(true);
        assert!(out[0] > 0.49 && out[FRAME - 1].abs() < 1e-6, "{out:?}");
        assert!(steepest(&out) < 0.001, "no click");
        assert_eq!(pass(true), [0.0; FRAME], "silence");
        let back = pass(false);
        assert!(back[0] < 0.01 && (back[FRAME - 1] - 0.5).abs() < 1e-6);
        assert!(steepest(&back) < 0.001, "no click");
    }
}
