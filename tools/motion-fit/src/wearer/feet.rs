//! Feet that nothing measures: they stand where they are until the person has left them behind, and then step.

use super::{ahead, wrapped};
use glam::DVec3;

/// A foot this far from its place of rest steps, metres, or turned so far from it, radians.
const OFF: f64 = 0.2;
const TURNED: f64 = 30f64.to_radians();
/// A foot so far away does not wait until the other one stands.
const LEFT_BEHIND: f64 = 0.55;
/// A foot is in the air for so long, seconds; of one who hurries, at least.
const SWING: [f64; 2] = [0.32, 0.2];
/// From this speed on a person hurries, m/s.
const HURRY: f64 = 1.5;
/// How high it is lifted, metres.
const LIFT: f64 = 0.06;
/// A step is this far ahead of the place of rest, in seconds of the way: until the other foot has stepped too.
const LEAD: f64 = 0.22;

/// Where a foot is.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Spot {
    /// The middle between heel and ball, metres; y is the sole's height above the floor.
    pub(super) place: DVec3,
    /// Radians about y from +z.
    pub(super) yaw: f64,
}

#[derive(Debug, Clone, Copy)]
struct Swing {
    from: Spot,
    /// 0..=1.
    done: f64,
}

/// Both feet, left and right.
#[derive(Debug, Clone)]
pub(super) struct Feet {
    spots: [Spot; 2],
    swings: [Option<Swing>; 2],
    /// The foot that stepped last.
    last: usize,
}

impl Feet {
    /// Feet that stand at rest.
    pub(super) fn new(rest: [Spot; 2]) -> Self {
        Self {
            spots: rest,
            swings: [None; 2],
            last: 1,
        }
    }

    /// Feet that were seen there stand there.
    pub(super) fn put(&mut self, spots: [Spot; 2]) {
        self.spots = spots;
        self.swings = [None; 2];
    }

    /// Whether a foot is in the air.
    pub(super) fn swings(&self, foot: usize) -> bool {
        self.swings.get(foot).is_some_and(Option::is_some)
    }

    /// The feet `seconds` later, of a person whose feet would rest at `rest` and who goes at `velocity` along the floor, m/s.
    pub(super) fn step(&mut self, rest: [Spot; 2], velocity: DVec3, seconds: f64) -> [Spot; 2] {
        let hurry = (velocity.length() / HURRY).clamp(0.0, 1.0);
        let length = SWING[0] + (SWING[1] - SWING[0]) * hurry;
        // Twice as far as a standing foot falls behind it until the other one has stepped.
        let goal = |foot: usize, left: f64| Spot {
            place: rest[foot].place + velocity * (left * length + LEAD),
            yaw: rest[foot].yaw,
        };
        for foot in 0..2 {
            if let Some(swing) = &mut self.swings[foot] {
                swing.done += seconds / length;
                let done = swing.done.clamp(0.0, 1.0);
                let to = goal(foot, 1.0 - done);
                self.spots[foot] = between(&swing.from, &to, done);
                if swing.done >= 1.0 {
                    self.swings[foot] = None;
                }
            }
        }
        // The foot that has not stepped last goes first where both want to.
        for foot in [1 - self.last, self.last] {
            let (at, rest) = (self.spots[foot], rest[foot]);
            let off = (at.place - rest.place) * DVec3::new(1.0, 0.0, 1.0);
            let wants = off.length() > OFF || wrapped(at.yaw - rest.yaw).abs() > TURNED;
            // One that still swings ahead of the person comes to its place by itself.
            let behind = off.dot(velocity) <= 0.0 || velocity.length() < 0.1;
            let may = !self.swings(1 - foot) || off.length() > LEFT_BEHIND;
            if wants && behind && may && !self.swings(foot) {
                self.swings[foot] = Some(Swing {
                    from: at,
                    done: 0.0,
                });
                self.last = foot;
            }
        }
        self.spots
    }
}

/// A foot on its way.
fn between(from: &Spot, to: &Spot, done: f64) -> Spot {
    let eased = done * done * (3.0 - 2.0 * done);
    let lift = 4.0 * done * (1.0 - done) * LIFT;
    let flat = from.place + (to.place - from.place) * eased;
    Spot {
        place: DVec3::new(flat.x, lift, flat.z),
        yaw: wrapped(from.yaw + wrapped(to.yaw - from.yaw) * eased),
    }
}

/// The place of rest of feet that are `beside` (left, right) the hips' plumb line and `before` it, metres.
pub(super) fn at_rest(hips: DVec3, yaw: f64, beside: [f64; 2], before: f64) -> [Spot; 2] {
    let (ahead, left) = (ahead(yaw), ahead(yaw + std::f64::consts::FRAC_PI_2));
    beside.map(|beside| Spot {
        place: DVec3::new(hips.x, 0.0, hips.z) + ahead * before + left * beside,
        yaw,
    })
}
