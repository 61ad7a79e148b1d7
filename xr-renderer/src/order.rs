//! Whether the last picture's order still serves.
//!
//! The order is by distance along the head's forward direction, so walking and swaying do not change it: only turning
//! does, by the splats' width across the line of sight times the angle. And the foreground changes it by moving.

use crate::camera::Camera;
use crate::path::ForegroundPath;

/// The head may turn so far, radians (0.25 degrees): two splats 2 cm apart across the line of sight whose order is
/// swapped differ by less than 0.1 mm in depth.
pub(crate) const KEPT_TURN: f32 = 0.004_36;

/// The head may move so far, metres. The order does not suffer; the bound is for what enters the picture's edge, for
/// which the sorted set has that much room.
pub(crate) const KEPT_MOVE: f32 = 0.005;

/// What the present order was made for, if there is one.
#[derive(Debug, Default)]
pub(crate) struct Order {
    cameras: Vec<Camera>,
    foreground: Option<Sorted>,
}

/// A foreground as far as its order depends on it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Sorted {
    /// How many Gaussians there are: another number shifts those of the background.
    pub(crate) count: u32,
    pub(crate) path: ForegroundPath,
}

impl Order {
    /// Makes the next picture sort.
    pub(crate) fn forget(&mut self) {
        self.foreground = None;
    }

    /// Whether it is an order of these very Gaussians, if maybe one from when they and the head were elsewhere.
    pub(crate) fn is_of(&self, now: Sorted) -> bool {
        (self.foreground).is_some_and(|then| now.count == then.count && now.path.is_of(&then.path))
    }

    /// Whether it still shows this foreground to these cameras as a fresh one would.
    pub(crate) fn serves(&self, cameras: &[Camera], now: Sorted) -> bool {
        self.is_of(now)
            && (self.foreground).is_some_and(|then| now.path.is_served_from(&then.path))
            && cameras.len() == self.cameras.len()
            && cameras.iter().zip(&self.cameras).all(|(now, then)| {
                let lens =
                    |camera: &Camera| [camera.fx, camera.fy, camera.cx, camera.cy, camera.near];
                // For a small angle this norm is sqrt(2) times it, and exact where an arc cosine is not.
                let change = now.camera_from_world.matrix3 - then.camera_from_world.matrix3;
                let turn = (0..3)
                    .map(|row| change.row(row).length_squared())
                    .sum::<f32>()
                    / 2.0;
                lens(now) == lens(then)
                    && (now.width, now.height) == (then.width, then.height)
                    && turn <= KEPT_TURN * KEPT_TURN
                    && now.position().distance(then.position()) <= KEPT_MOVE
            })
    }

    /// Takes note of a fresh order.
    pub(crate) fn made(&mut self, cameras: &[Camera], foreground: Sorted) {
        self.cameras.clear();
        self.cameras.extend_from_slice(cameras);
        self.foreground = Some(foreground);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::path::Change;
    use glam::Vec3;

    fn camera(x: f32, turn: f32) -> Camera {
        let eye = Vec3::new(x, 1.6, 3.0);
        let target = eye + Vec3::new(turn.sin(), 0.0, -turn.cos());
        Camera::look_at(eye, target, Vec3::Y, 0.8, 64, 64)
    }

    #[test]
    fn an_order_serves_until_the_head_turns_or_moves_or_the_foreground_does() {
        let mut order = Order::default();
        let then = Sorted {
            count: 1,
            path: ForegroundPath::new(),
        };
        let moved = |metres| {
            let mut now = then;
            now.path.advance(Change {
                metres,
                ..Change::default()
            });
            now
        };
        assert!(!order.serves(&[camera(0.0, 0.0)], then), "none yet");
        assert!(!order.is_of(then), "none at all");
        order.made(&[camera(0.0, 0.0)], then);
        assert!(order.serves(&[camera(0.0, 0.0)], then), "nothing changed");
        assert!(
            order.serves(&[camera(0.004, 0.004)], then),
            "hardly anything"
        );
        assert!(!order.serves(&[camera(0.0, 0.006)], then), "a turn");
        assert!(!order.serves(&[camera(0.006, 0.0)], then), "a step");
        assert!(!order.serves(&[camera(0.0, 0.0); 2], then), "a second eye");
        let mut wider = camera(0.0, 0.0);
        wider.width += 1;
        assert!(!order.serves(&[wider], then), "more to see");
        assert!(
            order.serves(&[camera(0.0, 0.0)], moved(0.000_2)),
            "the foreground trembles"
        );
        assert!(
            !order.serves(&[camera(0.0, 0.0)], moved(0.000_3)),
            "the foreground moves"
        );
        assert!(order.is_of(moved(1.0)), "but is the same");
        let more = Sorted { count: 2, ..then };
        assert!(
            !order.serves(&[camera(0.0, 0.0)], more),
            "one more Gaussian"
        );
        assert!(!order.is_of(more), "which is another foreground");
        order.forget();
        assert!(!order.serves(&[camera(0.0, 0.0)], then), "forgotten");
        assert!(!order.is_of(then), "wholly");
    }
}
