//! Pinhole cameras as captures have them, and small motions of them.

use crate::error::GradientError;
use glam::{Affine3A, Mat3A, Quat, Vec3, Vec3A};

/// Gaussians whose centre is nearer than this along the camera's axis are not drawn; metres. As `renderer-splat`'s cameras have it.
pub const NEAR: f32 = 0.05;

/// Widest and highest picture, pixels; as `renderer-splat` draws them.
pub const MOST_PIXELS: usize = 4096;

/// How far beyond the picture's edge the Jacobian of the projection is still followed, as a share of tan(fov / 2); from the
/// public code of 3DGS (which says 1.3 for edge and margin together).
const JACOBIAN_MARGIN: f32 = 0.3;

/// A camera's small motion, or the derivatives of a loss by it: three numbers of a shift (metres), then three of a rotation vector
/// (radians), both in the camera's axes. See [`View::moved`].
pub type Twist = [f64; 6];

/// A camera without distortion, and the size of its picture.
///
/// Its axes are those of capturing cameras: x right, y down, z away from it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct View {
    camera_from_world: Affine3A,
    focal: [f32; 2],
    centre: [f32; 2],
    size: [usize; 2],
}

impl View {
    /// A camera at a rigid pose (metres), with its focal lengths and principal point in pixels (from the left and from the top edge,
    /// where the first pixel's centre is at 0.5) and its picture's width and height, 1 to 4096.
    ///
    /// # Errors
    /// Numbers that are not finite, a pose that is not rigid, a focal length or size out of range.
    pub fn new(
        camera_from_world: Affine3A,
        focal: [f32; 2],
        centre: [f32; 2],
        size: [usize; 2],
    ) -> Result<Self, GradientError> {
        let numbers = focal.iter().chain(&centre);
        let matrix = camera_from_world.matrix3;
        let gram = matrix * matrix.transpose();
        let problem = if !camera_from_world.is_finite() || !numbers.copied().all(f32::is_finite) {
            Some("a number in it is not finite")
        } else if !gram.abs_diff_eq(Mat3A::IDENTITY, 1e-3) || matrix.determinant() <= 0.0 {
            Some("its pose is not rigid")
        } else if focal.iter().any(|focal| *focal <= 0.0) {
            Some("a focal length is not greater than 0")
        } else if !size.iter().all(|side| (1..=MOST_PIXELS).contains(side)) {
            Some("its picture's width and height must be 1 to 4096 pixels")
        } else {
            None
        };
        if let Some(problem) = problem {
            return Err(GradientError::View(problem));
        }
        Ok(Self {
            camera_from_world,
            focal,
            centre,
            size,
        })
    }

    /// The rigid pose, metres.
    #[must_use]
    pub fn camera_from_world(&self) -> Affine3A {
        self.camera_from_world
    }

    /// Focal lengths, horizontal and vertical, pixels.
    #[must_use]
    pub fn focal(&self) -> [f32; 2] {
        self.focal
    }

    /// Where the axis meets the picture, pixels from its left and its top edge.
    #[must_use]
    pub fn centre(&self) -> [f32; 2] {
        self.centre
    }

    /// Width and height of the picture, pixels.
    #[must_use]
    pub fn size(&self) -> [usize; 2] {
        self.size
    }

    /// The view after a small motion: what the camera sees is turned about the camera by the rotation vector, then shifted, so that
    /// its pose becomes (exp(rotation), shift) * `camera_from_world`. A motion that is not finite changes nothing.
    #[must_use]
    #[expect(
        clippy::cast_possible_truncation,
        reason = "poses are single precision"
    )]
    pub fn moved(&self, motion: &Twist) -> Self {
        let [x, y, z, turn_x, turn_y, turn_z] = motion.map(|number| number as f32);
        let turn = Quat::from_scaled_axis(Vec3::new(turn_x, turn_y, turn_z));
        // Through a quaternion, so that many small motions leave the pose rigid.
        let now = Quat::from_mat3a(&self.camera_from_world.matrix3);
        let translation = turn * self.camera_from_world.translation + Vec3A::new(x, y, z);
        let moved =
            Affine3A::from_rotation_translation((turn * now).normalize(), translation.into());
        let camera_from_world = if moved.is_finite() {
            moved
        } else {
            self.camera_from_world
        };
        Self {
            camera_from_world,
            ..*self
        }
    }

    /// As projection reads it, on whatever device.
    #[expect(clippy::cast_precision_loss, reason = "pixel counts are small")]
    #[must_use]
    pub fn lens(&self) -> Lens {
        let matrix = self.camera_from_world.matrix3;
        let size = self.size.map(|side| side as f32);
        let least = |axis: usize, edge: f32| {
            let margin = JACOBIAN_MARGIN * 0.5 * size[axis] / self.focal[axis];
            (edge - self.centre[axis]) / self.focal[axis]
                + if edge > 0.0 { margin } else { -margin }
        };
        Lens {
            rows: [0, 1, 2].map(|row| matrix.row(row).to_array()),
            shift: self.camera_from_world.translation.to_array(),
            focal: self.focal,
            centre: self.centre,
            least_slope: [least(0, 0.0), least(1, 0.0)],
            most_slope: [least(0, size[0]), least(1, size[1])],
            size,
        }
    }
}

/// A view in the numbers that projection needs.
#[derive(Debug, Clone, Copy)]
pub struct Lens {
    /// Rows of the rotation: the camera's axes in the world.
    pub rows: [[f32; 3]; 3],
    /// The world's origin in the camera's axes, metres.
    pub shift: [f32; 3],
    /// Focal lengths, horizontal and vertical, pixels.
    pub focal: [f32; 2],
    /// Where the axis meets the picture, pixels.
    pub centre: [f32; 2],
    /// The least x / z and y / z at which the projection's Jacobian is taken: slopes are held within these ...
    pub least_slope: [f32; 2],
    /// ... and the greatest.
    pub most_slope: [f32; 2],
    /// Width and height, pixels.
    pub size: [f32; 2],
}
