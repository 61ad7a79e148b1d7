//! When two finger tips count as touching. Pure: it makes no OpenXR calls.

/// A pinch begins when the tips are nearer than this, metres.
const BEGINS_M: f32 = 0.015;

/// It ends when they are farther than this: so a trembling finger does not let go.
const ENDS_M: f32 = 0.025;

/// Two finger tips, touching or not.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Pinch {
    holds: bool,
}

impl Pinch {
    /// Takes the tips' distance; None where it is not known, which ends the pinch.
    pub(super) fn update(&mut self, metres: Option<f32>) -> bool {
        let limit = if self.holds { ENDS_M } else { BEGINS_M };
        self.holds = metres.is_some_and(|metres| metres < limit);
        self.holds
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_pinch_begins_close_and_ends_far_and_holds_in_between() {
        let mut pinch = Pinch::default();
        let mut at = |millimetres: f32| pinch.update(Some(millimetres * 1e-3));
        assert!(!at(20.0), "in between, from apart");
        assert!(at(14.0), "close");
        assert!(at(20.0), "in between, from close");
        assert!(at(24.0), "still");
        assert!(!at(26.0), "far");
        assert!(!at(20.0), "in between, from far");
    }

    #[test]
    fn a_lost_hand_lets_go() {
        let mut pinch = Pinch::default();
        pinch.update(Some(0.01));
        assert!(!pinch.update(None), "lost");
        assert!(
            !pinch.update(Some(0.02)),
            "and does not hold when found again"
        );
    }
}
