//! Whether the last picture's order still serves.
//!
//! The order is by distance along the head's forward direction, so walking and swaying do not change it: only turning
//! does, by the splats' width across the line of sight times the angle. And the foreground changes it by moving.

use glam::Vec3;
use shaders_spirv::PackedGaussian;

use crate::camera::Camera;

/// The head may turn so far, radians (0.25 degrees): two splats 2 cm apart across the line of sight whose order is
/// swapped differ by less than 0.1 mm in depth.
pub(crate) const KEPT_TURN: f32 = 0.004_36;

/// The head may move so far, metres. The order does not suffer; the bound is for what enters the picture's edge, for
/// which the sorted set has that much room.
pub(crate) const KEPT_MOVE: f32 = 0.005;

/// Foreground Gaussians may move so far, metres: less than the spacing of a person's Gaussians.
pub(crate) const KEPT_FOREGROUND_MOVE: f32 = 0.000_25;

/// Steps of a packed scale, a hundredth, by which a foreground Gaussian may grow.
const KEPT_SCALE_STEPS: u16 = 29;

/// Steps of a packed opacity, a hundredth of full, by which one may rise.
const KEPT_OPACITY_STEPS: u16 = 655;

/// What the present order was made for.
#[derive(Debug, Default)]
pub(crate) struct Order {
    cameras: Vec<Camera>,
    /// The foreground when it was sorted ...
    sorted: Vec<Place>,
    /// ... and now.
    latest: Vec<Place>,
    /// Whether there is an order at all, and of this foreground.
    valid: bool,
}

/// What the order depends on of one Gaussian.
#[derive(Debug, Clone, Copy)]
struct Place {
    position: Vec3,
    /// What does not show is not in the order.
    shows: bool,
    /// What grows may come into a picture that it was not in.
    greatest_scale: u16,
    opacity: u16,
}

impl Place {
    fn of(gaussian: &PackedGaussian) -> Self {
        Self {
            position: gaussian.position().into(),
            shows: gaussian.shows(),
            greatest_scale: gaussian.greatest_scale_step(),
            opacity: gaussian.opacity_step(),
        }
    }

    /// Whether an order made for the Gaussian as it was `then` serves it as it is now.
    fn is_served_from(&self, then: &Self) -> bool {
        let grown = self.greatest_scale.saturating_sub(then.greatest_scale);
        let risen = self.opacity.saturating_sub(then.opacity);
        self.position.distance_squared(then.position) <= KEPT_FOREGROUND_MOVE * KEPT_FOREGROUND_MOVE
            && (then.shows || !self.shows)
            && grown <= KEPT_SCALE_STEPS
            && risen <= KEPT_OPACITY_STEPS
    }
}

impl Order {
    /// Makes the next picture sort.
    pub(crate) fn forget(&mut self) {
        self.valid = false;
    }

    /// Takes note of another foreground.
    pub(crate) fn foreground_changed(&mut self, gaussians: &[PackedGaussian]) {
        self.latest.clear();
        self.latest.extend(gaussians.iter().map(Place::of));
        self.valid = self.valid
            && self.latest.len() == self.sorted.len()
            && (self.latest.iter().zip(&self.sorted)).all(|(now, then)| now.is_served_from(then));
    }

    /// Whether the order still serves these cameras.
    pub(crate) fn serves(&self, cameras: &[Camera]) -> bool {
        self.valid
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
                    && turn <= KEPT_TURN * KEPT_TURN
                    && now.position().distance(then.position()) <= KEPT_MOVE
            })
    }

    /// Takes note of a fresh order.
    pub(crate) fn made(&mut self, cameras: &[Camera]) {
        self.cameras.clear();
        self.cameras.extend_from_slice(cameras);
        self.sorted.clone_from(&self.latest);
        self.valid = true;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use shaders_spirv::Gaussian;

    fn camera(x: f32, turn: f32) -> Camera {
        let eye = Vec3::new(x, 1.6, 3.0);
        let target = eye + Vec3::new(turn.sin(), 0.0, -turn.cos());
        Camera::look_at(eye, target, Vec3::Y, 0.8, 64, 64)
    }

    fn gaussian(x: f32) -> PackedGaussian {
        PackedGaussian::from(&Gaussian {
            position: [x, 0.0, 0.0],
            rotation: [0.0, 0.0, 0.0, 1.0],
            scale: [0.01; 3],
            opacity: 0.9,
            colour: [0.5; 3],
        })
    }

    #[test]
    fn an_order_serves_until_the_head_turns_or_moves_or_the_foreground_does() {
        let mut order = Order::default();
        assert!(!order.serves(&[camera(0.0, 0.0)]), "none yet");
        order.foreground_changed(&[gaussian(0.0)]);
        order.made(&[camera(0.0, 0.0)]);
        assert!(order.serves(&[camera(0.0, 0.0)]), "nothing changed");
        assert!(order.serves(&[camera(0.004, 0.004)]), "hardly anything");
        assert!(!order.serves(&[camera(0.0, 0.006)]), "a turn");
        assert!(!order.serves(&[camera(0.006, 0.0)]), "a step");
        assert!(!order.serves(&[camera(0.0, 0.0); 2]), "a second eye");
        order.foreground_changed(&[gaussian(0.0002)]);
        assert!(order.serves(&[camera(0.0, 0.0)]), "the foreground trembles");
        order.foreground_changed(&[gaussian(0.0003)]);
        assert!(!order.serves(&[camera(0.0, 0.0)]), "the foreground moves");
        order.foreground_changed(&[gaussian(0.0)]);
        order.made(&[camera(0.0, 0.0)]);
        order.foreground_changed(&[gaussian(0.0), gaussian(0.0)]);
        assert!(!order.serves(&[camera(0.0, 0.0)]), "one more Gaussian");
        order.foreground_changed(&[gaussian(0.0)]);
        order.made(&[camera(0.0, 0.0)]);
        order.forget();
        assert!(!order.serves(&[camera(0.0, 0.0)]), "forgotten");
    }

    #[test]
    fn a_gaussian_that_begins_to_show_is_not_in_the_order_yet() {
        let shown = gaussian(0.0);
        let hidden =
            PackedGaussian::new([0.0; 3], [0.0, 0.0, 0.0, 1.0], [-7.0; 3], 0.003, [0.5; 3]);
        let mut order = Order::default();
        order.foreground_changed(&[shown, hidden]);
        order.made(&[camera(0.0, 0.0)]);
        order.foreground_changed(&[hidden, hidden]);
        assert!(order.serves(&[camera(0.0, 0.0)]), "one is hidden");
        order.foreground_changed(&[shown, hidden]);
        assert!(order.serves(&[camera(0.0, 0.0)]), "and shows again");
        order.foreground_changed(&[shown, shown]);
        assert!(!order.serves(&[camera(0.0, 0.0)]), "the other shows");
    }

    #[test]
    fn small_steps_add_up_to_a_new_order() {
        let mut order = Order::default();
        order.foreground_changed(&[gaussian(0.0)]);
        order.made(&[camera(0.0, 0.0)]);
        order.foreground_changed(&[gaussian(0.0002)]);
        order.foreground_changed(&[gaussian(0.0004)]);
        assert!(
            !order.serves(&[camera(0.0, 0.0)]),
            "0.4 mm from where it was sorted"
        );
    }
}
