//! Whether the last picture's sort order can be reused.
//!
//! The order is by distance along the head's forward direction, so walking and swaying do not change it: only turning
//! does, by the splats' width across the line of sight times the angle. And the foreground changes it by moving.

use glam::{Affine3A, Mat3A};

use crate::camera::Camera;
use crate::limits::MOST_PARTS;
use crate::motion_bound::{KEPT_FOREGROUND_MOVE, MotionBound};

/// How far the head may turn, radians (0.25 degrees): two splats 2 cm apart across the line of sight whose order is
/// swapped differ by less than 0.1 mm in depth.
pub(crate) const KEPT_TURN: f32 = 0.004_36;

/// How far the head may move, metres. The order does not change; the bound is for Gaussians that enter at the picture's edge, for
/// which the sorted set has that much room.
pub(crate) const KEPT_MOVE: f32 = 0.005;

/// The assumed greatest distance of a part's Gaussians from its origin, metres, for the effect of a turn: a body's, with the feet or
/// the pelvis there.
const PART_REACH: f32 = 2.5;

/// What the last sort order was made for, if there is one.
#[derive(Debug, Default)]
pub(crate) struct Order {
    cameras: Vec<Camera>,
    foreground: Option<SortedForeground>,
}

/// What the sort order depends on in a foreground: its parts one after the other, then none.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub(crate) struct SortedForeground {
    parts: [Option<SortedPart>; MOST_PARTS],
}

/// The same of one part.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct SortedPart {
    /// How many Gaussians there are: a change shifts those that follow.
    pub(crate) count: u32,
    motion: MotionBound,
    pub(crate) world_from_part: Affine3A,
}

impl SortedForeground {
    /// Adds a part behind those that are there, which fits.
    pub(crate) fn add(&mut self, part: SortedPart) {
        if let Some(place) = self.parts.iter_mut().find(|place| place.is_none()) {
            *place = Some(part);
        }
    }

    /// Whether `holds` for every part here and the one in its place there, which are as many.
    fn is_like(&self, other: &Self, holds: impl Fn(&SortedPart, &SortedPart) -> bool) -> bool {
        let pairs = self.parts.iter().zip(&other.parts);
        pairs.into_iter().all(|pair| match pair {
            (Some(part), Some(other)) => holds(part, other),
            (part, other) => part.is_none() && other.is_none(),
        })
    }
}

impl SortedPart {
    pub(crate) fn new(count: u32, motion: MotionBound, world_from_part: Affine3A) -> Self {
        Self {
            count,
            motion,
            world_from_part,
        }
    }

    fn is_of(&self, then: &Self) -> bool {
        self.count == then.count && self.motion.is_of(&then.motion)
    }

    /// Whether no Gaussian can have moved farther than an order is kept for, relative to the part and with it.
    fn is_served_from(&self, then: &Self) -> bool {
        let (now, before) = (self.world_from_part, then.world_from_part);
        let carried = now.translation.distance(before.translation)
            + turn_between(now.matrix3, before.matrix3) * PART_REACH;
        let share = f64::from(carried / KEPT_FOREGROUND_MOVE);
        self.is_of(then) && self.motion.distance_from(&then.motion) + share <= 1.0
    }
}

/// The angle from one rotation to another, radians, where it is small, and what the farthest unit vector is moved by
/// (metres a metre). Exact for small angles, where an arc cosine is not.
fn turn_between(now: Mat3A, then: Mat3A) -> f32 {
    let change = now - then;
    let squares = (0..3).map(|row| change.row(row).length_squared());
    // Of the three eigenvalues of this difference's square one is 0 and two are that motion's square.
    (squares.sum::<f32>() / 2.0).sqrt()
}

impl Order {
    /// Makes the next picture sort.
    pub(crate) fn forget(&mut self) {
        self.foreground = None;
    }

    /// Whether it is an order of these very Gaussians, possibly from before they or the head moved.
    pub(crate) fn is_of(&self, now: &SortedForeground) -> bool {
        let then = self.foreground.as_ref();
        then.is_some_and(|then| now.is_like(then, SortedPart::is_of))
    }

    /// Whether it still shows this foreground to these cameras as a fresh one would.
    pub(crate) fn serves(&self, cameras: &[Camera], now: &SortedForeground) -> bool {
        let then = self.foreground.as_ref();
        then.is_some_and(|then| now.is_like(then, SortedPart::is_served_from))
            && cameras.len() == self.cameras.len()
            && cameras.iter().zip(&self.cameras).all(|(now, then)| {
                let lens =
                    |camera: &Camera| [camera.fx, camera.fy, camera.cx, camera.cy, camera.near];
                let matrix = |camera: &Camera| camera.camera_from_world.matrix3;
                lens(now) == lens(then)
                    && (now.width, now.height) == (then.width, then.height)
                    && turn_between(matrix(now), matrix(then)) <= KEPT_TURN
                    && now.position().distance(then.position()) <= KEPT_MOVE
            })
    }

    /// Takes note of a fresh order.
    pub(crate) fn made(&mut self, cameras: &[Camera], foreground: SortedForeground) {
        self.cameras.clear();
        self.cameras.extend_from_slice(cameras);
        self.foreground = Some(foreground);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::motion_bound::Change;
    use glam::{Quat, Vec3};

    fn camera(x: f32, turn: f32) -> Camera {
        let eye = Vec3::new(x, 1.6, 3.0);
        let target = eye + Vec3::new(turn.sin(), 0.0, -turn.cos());
        Camera::look_at(eye, target, Vec3::Y, 0.8, 64, 64)
    }

    fn gone(mut motion: MotionBound, metres: f32) -> MotionBound {
        motion.advance(Change {
            metres,
            ..Change::default()
        });
        motion
    }

    fn foreground(parts: &[SortedPart]) -> SortedForeground {
        let mut sorted = SortedForeground::default();
        parts.iter().for_each(|part| sorted.add(*part));
        sorted
    }

    #[test]
    fn an_order_serves_until_the_head_turns_or_moves_or_the_foreground_does() {
        let mut order = Order::default();
        let start = MotionBound::new();
        let of = |count, motion| foreground(&[SortedPart::new(count, motion, Affine3A::IDENTITY)]);
        let then = of(1, start);
        let moved = |metres| of(1, gone(start, metres));
        assert!(!order.serves(&[camera(0.0, 0.0)], &then), "none yet");
        assert!(!order.is_of(&then), "none at all");
        order.made(&[camera(0.0, 0.0)], then);
        assert!(order.serves(&[camera(0.0, 0.0)], &then), "nothing changed");
        assert!(
            order.serves(&[camera(0.004, 0.004)], &then),
            "hardly anything"
        );
        assert!(!order.serves(&[camera(0.0, 0.006)], &then), "a turn");
        assert!(!order.serves(&[camera(0.006, 0.0)], &then), "a step");
        assert!(!order.serves(&[camera(0.0, 0.0); 2], &then), "a second eye");
        let mut wider = camera(0.0, 0.0);
        wider.width += 1;
        assert!(!order.serves(&[wider], &then), "more to see");
        assert!(
            order.serves(&[camera(0.0, 0.0)], &moved(0.000_2)),
            "the foreground trembles"
        );
        assert!(
            !order.serves(&[camera(0.0, 0.0)], &moved(0.000_3)),
            "the foreground moves"
        );
        assert!(order.is_of(&moved(1.0)), "but is the same");
        let more = of(2, start);
        assert!(
            !order.serves(&[camera(0.0, 0.0)], &more),
            "one more Gaussian"
        );
        assert!(!order.is_of(&more), "which is another foreground");
        order.forget();
        assert!(!order.serves(&[camera(0.0, 0.0)], &then), "forgotten");
        assert!(!order.is_of(&then), "wholly");
    }

    #[test]
    fn an_order_serves_until_any_part_is_carried_farther_than_it_may_move() {
        let paths = [MotionBound::new(), MotionBound::new()];
        let turned = |angle: f32, x: f32| {
            let turn = Quat::from_rotation_y(0.4 + angle);
            Affine3A::from_rotation_translation(turn, Vec3::new(0.5 + x, 0.0, -1.0))
        };
        let two = |second: Affine3A, motion| {
            foreground(&[
                SortedPart::new(3, paths[0], Affine3A::IDENTITY),
                SortedPart::new(4, motion, second),
            ])
        };
        let then = two(turned(0.0, 0.0), paths[1]);
        let mut order = Order::default();
        let cameras = [camera(0.0, 0.0)];
        order.made(&cameras, then);
        for (angle, x, metres, serves) in [
            (0.0, 0.0, 0.0, true),
            (0.0, 0.000_24, 0.0, true),
            (0.0, 0.000_26, 0.0, false),
            // 2.5 m away it is 0.24 mm, then 0.26 mm.
            (0.000_096, 0.0, 0.0, true),
            (0.000_104, 0.0, 0.0, false),
            // Each of them may be, together they may not.
            (0.000_04, 0.000_06, 0.000_06, true),
            (0.000_04, 0.000_06, 0.000_12, false),
            (0.000_06, 0.000_06, 0.000_06, false),
        ] {
            let now = two(turned(angle, x), gone(paths[1], metres));
            let what = format!("{angle} rad, {x} m, and {metres} m by itself");
            assert_eq!(order.serves(&cameras, &now), serves, "{what}");
            assert!(order.is_of(&now), "{what}: the same Gaussians");
        }
    }

    #[test]
    fn parts_that_come_go_or_change_places_are_sorted_again() {
        let [first, second] =
            [2, 2].map(|count| SortedPart::new(count, MotionBound::new(), Affine3A::IDENTITY));
        let cameras = [camera(0.0, 0.0)];
        let mut order = Order::default();
        order.made(&cameras, foreground(&[first, second]));
        let is_of = |order: &Order, parts: &[SortedPart]| order.is_of(&foreground(parts));
        assert!(is_of(&order, &[first, second]), "the same");
        assert!(!is_of(&order, &[second, first]), "the other way round");
        assert!(!is_of(&order, &[first]), "one left");
        assert!(!is_of(&order, &[first, second, first]), "one came");
        assert!(!is_of(&order, &[]), "none");
        order.made(&cameras, foreground(&[]));
        assert!(is_of(&order, &[]), "none again");
        assert!(!is_of(&order, &[first]), "one came where there was none");
    }
}
