//! Where the hips face, which nothing but a tracked body measures: after the head and the hands, but slowly, and not with every look aside.

use super::{ahead, wrapped};
use glam::DVec3;

/// How far a person looks aside before the hips follow, radians; one who walks looks where they go.
const ASIDE: f64 = 20f64.to_radians();
/// How far a head turns against hips at most, radians.
const MOST: f64 = 75f64.to_radians();
/// How soon they follow, seconds; of one who walks.
const FOLLOW: [f64; 2] = [0.8, 0.25];
/// Walking from this speed on, m/s.
const WALKS: f64 = 0.4;
/// Hands nearer than this to the head's plumb line say nothing of where a person faces, metres.
const HANDS_AHEAD: f64 = 0.2;
/// The hands' say against the head's.
const HANDS: f64 = 0.4;
/// The head's speed is averaged over this, seconds.
const SPEED_SECONDS: f64 = 0.15;

/// The hips' heading, and how fast the person goes.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Facing {
    yaw: f64,
    velocity: DVec3,
    last: Option<DVec3>,
}

impl Facing {
    /// The heading about y, radians from +z.
    pub(super) fn yaw(&self) -> f64 {
        self.yaw
    }

    /// Along the floor, m/s.
    pub(super) fn velocity(&self) -> DVec3 {
        self.velocity
    }

    /// The hips' heading is measured, and counts as `share` (0..=1).
    pub(super) fn know(&mut self, yaw: f64, share: f64) {
        self.yaw = wrapped(self.yaw + share * wrapped(yaw - self.yaw));
    }

    /// Follows a head that is at `head` and turned to `heading`, and wrists where they are known, `seconds` after the last time.
    pub(super) fn follow(
        &mut self,
        head: DVec3,
        heading: f64,
        wrists: [Option<DVec3>; 2],
        seconds: f64,
    ) {
        let flat = DVec3::new(head.x, 0.0, head.z);
        if let Some(last) = self.last.replace(flat).filter(|_| seconds > 0.0) {
            let share = 1.0 - (-seconds / SPEED_SECONDS).exp();
            self.velocity += ((flat - last) / seconds - self.velocity) * share;
        }
        let mut to = ahead(heading);
        if let [Some(left), Some(right)] = wrists {
            let middle = (left + right) / 2.0 - head;
            let middle = DVec3::new(middle.x, 0.0, middle.z);
            if middle.length() > HANDS_AHEAD && middle.dot(to) > 0.0 {
                to = to * (1.0 - HANDS) + middle.normalize() * HANDS;
            }
        }
        let walks = self.velocity.length() > WALKS;
        let [deaf, follow] = if walks {
            [0.0, FOLLOW[1]]
        } else {
            [ASIDE, FOLLOW[0]]
        };
        let off = wrapped(to.x.atan2(to.z) - self.yaw);
        let beyond = off - off.clamp(-deaf, deaf);
        self.yaw += beyond * (1.0 - (-seconds / follow).exp());
        // A neck turns only so far.
        let off = wrapped(heading - self.yaw);
        self.yaw = wrapped(self.yaw + off - off.clamp(-MOST, MOST));
    }
}
