//! When two finger tips count as touching. Pure: it calls nothing.

/// A pinch begins when the tips are nearer than this, metres.
const BEGINS_M: f32 = 0.015;

/// It ends when they are farther than this: a trembling finger does not let go.
const ENDS_M: f32 = 0.025;

/// Two finger tips, touching or not.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Pinch {
    holds: bool,
}

impl Pinch {
    /// Takes the tips' distance, None where it is not known: then nothing is held.
    pub(super) fn update(&mut self, metres: Option<f32>) -> bool {
        let limit = if self.holds { ENDS_M } else { BEGINS_M };
        self.holds = metres.is_some_and(|metres| metres < limit);
        self.holds
    }
}
