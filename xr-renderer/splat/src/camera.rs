//! Pinhole cameras, from a look-at or from the asymmetric field of view of a headset's eye.

use glam::{Affine3A, Mat3A, Quat, Vec3, Vec3A};
use shaders_spirv::ViewParams;

/// How far beyond the picture's edge the Jacobian of the projection is still followed, as a share of
/// tan(fov / 2); from the public code of 3DGS (which says 1.3 for edge and margin together).
const JACOBIAN_MARGIN: f32 = 0.3;

/// Near plane of cameras made without naming one, metres.
pub const DEFAULT_NEAR: f32 = 0.05;

/// A view of the world and the picture it makes.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Camera {
    /// Rigid. As in `OpenXR` the camera looks along its -z, with y up and x right; metres.
    pub camera_from_world: Affine3A,
    /// Horizontal focal length, pixels.
    pub fx: f32,
    /// Vertical focal length, pixels.
    pub fy: f32,
    /// Where the axis meets the picture, pixels from its left edge.
    pub cx: f32,
    /// Where the axis meets the picture, pixels from its top edge.
    pub cy: f32,
    /// Picture width, pixels.
    pub width: u32,
    /// Picture height, pixels.
    pub height: u32,
    /// Gaussians whose centre is nearer than this along the axis are not drawn; metres.
    pub near: f32,
}

/// Half angles of a view in radians, signed as in `OpenXR`: left and down are negative as a rule.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Fov {
    /// Angle to the left edge.
    pub left: f32,
    /// Angle to the right edge.
    pub right: f32,
    /// Angle to the upper edge.
    pub up: f32,
    /// Angle to the lower edge.
    pub down: f32,
}

impl Camera {
    /// The same view in a picture of `share` of the width and height, a pixel at least.
    #[must_use]
    pub fn scaled(&self, share: f32) -> Self {
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "a picture's side, which a float holds"
        )]
        let side = |pixels: u32| ((pixels as f32 * share).round() as u32).max(1);
        self.resized(side(self.width), side(self.height))
    }

    /// The same view in a picture of so many pixels.
    #[must_use]
    pub fn resized(&self, width: u32, height: u32) -> Self {
        let x = width as f32 / self.width.max(1) as f32;
        let y = height as f32 / self.height.max(1) as f32;
        Self {
            fx: self.fx * x,
            cx: self.cx * x,
            fy: self.fy * y,
            cy: self.cy * y,
            width,
            height,
            ..*self
        }
    }

    /// A camera at `eye` that sees `target` in its picture's centre, with square pixels.
    ///
    /// `vertical_fov` in radians. If `up` is (nearly) along the line of sight, another up is taken.
    pub fn look_at(
        eye: Vec3,
        target: Vec3,
        up: Vec3,
        vertical_fov: f32,
        width: u32,
        height: u32,
    ) -> Self {
        let back = (eye - target).normalize_or(Vec3::Z);
        let right = up
            .cross(back)
            .try_normalize()
            .unwrap_or_else(|| back.any_orthonormal_vector());
        let world_from_camera = Mat3A::from_cols(
            Vec3A::from(right),
            Vec3A::from(back.cross(right)),
            Vec3A::from(back),
        );
        let rotation = world_from_camera.transpose();
        let focal = pixels(height) / (2.0 * (vertical_fov / 2.0).tan());
        Self {
            camera_from_world: Affine3A {
                matrix3: rotation,
                translation: -(rotation * Vec3A::from(eye)),
            },
            fx: focal,
            fy: focal,
            cx: pixels(width) / 2.0,
            cy: pixels(height) / 2.0,
            width,
            height,
            near: DEFAULT_NEAR,
        }
    }

    /// An eye at a pose (`position` and `orientation` in the world, as `OpenXR` gives them).
    pub fn from_fov(position: Vec3, orientation: Quat, fov: Fov, width: u32, height: u32) -> Self {
        let (left, right) = (fov.left.tan(), fov.right.tan());
        let (up, down) = (fov.up.tan(), fov.down.tan());
        let fx = pixels(width) / (right - left);
        let fy = pixels(height) / (up - down);
        Self {
            camera_from_world: Affine3A::from_rotation_translation(orientation, position).inverse(),
            fx,
            fy,
            cx: -left * fx,
            cy: up * fy,
            width,
            height,
            near: DEFAULT_NEAR,
        }
    }

    /// The eye's position in the world.
    pub fn position(&self) -> Vec3 {
        self.camera_from_world.inverse().translation.into()
    }

    /// The direction the camera looks along, in the world.
    pub fn forward(&self) -> Vec3 {
        -Vec3::from(self.camera_from_world.matrix3.row(2))
    }

    /// What is wrong with this camera, if anything.
    pub(crate) fn problem(&self) -> Option<String> {
        let numbers = [self.fx, self.fy, self.cx, self.cy, self.near];
        if !self.camera_from_world.is_finite() || numbers.iter().any(|number| !number.is_finite()) {
            return Some("a number in it is not finite".to_owned());
        }
        if !is_rigid(&self.camera_from_world) {
            return Some("camera_from_world is not rigid".to_owned());
        }
        if self.fx <= 0.0 || self.fy <= 0.0 || self.near <= 0.0 {
            return Some("focal lengths and near plane must be greater than 0".to_owned());
        }
        None
    }

    /// As the shaders read it.
    pub(crate) fn params(&self) -> ViewParams {
        let row = |index: usize, sign: f32| {
            let axis = self.camera_from_world.matrix3.row(index) * sign;
            let offset = self.camera_from_world.translation[index] * sign;
            axis.extend(offset).to_array()
        };
        let (width, height) = (pixels(self.width), pixels(self.height));
        let margin_x = JACOBIAN_MARGIN * 0.5 * width / self.fx;
        let margin_y = JACOBIAN_MARGIN * 0.5 * height / self.fy;
        ViewParams {
            // OpenXR's y up and z back become the image's y down and z forward.
            image_from_world: [row(0, 1.0), row(1, -1.0), row(2, -1.0)],
            intrinsics: [self.fx, self.fy, self.cx, self.cy],
            slope_limits: [
                -self.cx / self.fx - margin_x,
                (width - self.cx) / self.fx + margin_x,
                -self.cy / self.fy - margin_y,
                (height - self.cy) / self.fy + margin_y,
            ],
            clip: self.position().extend(self.near).to_array(),
        }
    }
}

/// The plane through the middle of the eyes, facing their mean direction: the order of depth from it
/// is the order for all views. Eyes that look the same way agree with it exactly.
pub(crate) fn head_depth_plane(cameras: &[Camera]) -> [f32; 4] {
    let share = 1.0 / pixels(u32::try_from(cameras.len().max(1)).unwrap_or(1));
    let centre = cameras.iter().map(Camera::position).sum::<Vec3>() * share;
    let forward = cameras
        .iter()
        .map(Camera::forward)
        .sum::<Vec3>()
        .normalize_or(Vec3::NEG_Z);
    forward.extend(-forward.dot(centre)).to_array()
}

/// Pixel counts are at most 4096: exact in f32.
#[expect(clippy::cast_precision_loss, reason = "pixel counts are small")]
fn pixels(count: u32) -> f32 {
    count as f32
}

/// Whether a transform only turns and shifts, by finite numbers.
pub(crate) fn is_rigid(transform: &Affine3A) -> bool {
    let matrix = transform.matrix3;
    let gram = matrix * matrix.transpose();
    transform.is_finite() && gram.abs_diff_eq(Mat3A::IDENTITY, 1e-3) && matrix.determinant() > 0.0
}

#[cfg(test)]
mod tests {
    use super::*;

    fn image_point(camera: &Camera, world: Vec3) -> [f32; 2] {
        let params = camera.params();
        let point = world.extend(1.0);
        let [x, y, z] = params
            .image_from_world
            .map(|row| glam::Vec4::from(row).dot(point));
        [
            x / z * params.intrinsics[0] + params.intrinsics[2],
            y / z * params.intrinsics[1] + params.intrinsics[3],
        ]
    }

    #[test]
    fn a_look_at_camera_sees_its_target_in_the_centre_and_up_above_it() {
        let camera = Camera::look_at(
            Vec3::new(1.0, 2.0, 3.0),
            Vec3::new(0.0, 1.0, 0.0),
            Vec3::Y,
            0.8,
            640,
            480,
        );
        let [x, y] = image_point(&camera, Vec3::new(0.0, 1.0, 0.0));
        assert!(
            (x - 320.0).abs() < 1e-3 && (y - 240.0).abs() < 1e-3,
            "target at {x}, {y}"
        );
        let [_, above] = image_point(&camera, Vec3::new(0.0, 1.1, 0.0));
        assert!(
            above < y,
            "higher in the world is higher in the picture (y down): {above}"
        );
        assert!(camera.problem().is_none(), "{:?}", camera.problem());
    }

    #[test]
    fn a_look_straight_down_is_still_a_camera() {
        let camera = Camera::look_at(Vec3::Y * 3.0, Vec3::ZERO, Vec3::Y, 0.8, 64, 64);
        assert!(camera.problem().is_none(), "{:?}", camera.problem());
    }

    #[test]
    fn the_edges_of_an_asymmetric_view_land_on_the_edges_of_the_picture() {
        let fov = Fov {
            left: -0.9,
            right: 0.7,
            up: 0.6,
            down: -0.8,
        };
        let camera = Camera::from_fov(Vec3::ZERO, Quat::IDENTITY, fov, 800, 600);
        let [left, top] = image_point(&camera, Vec3::new(fov.left.tan(), fov.up.tan(), -1.0));
        assert!(
            left.abs() < 1e-3 && top.abs() < 1e-3,
            "upper left corner at {left}, {top}"
        );
        let [right, bottom] =
            image_point(&camera, Vec3::new(fov.right.tan(), fov.down.tan(), -1.0));
        assert!(
            (right - 800.0).abs() < 1e-2 && (bottom - 600.0).abs() < 1e-2,
            "{right}, {bottom}"
        );
    }

    #[test]
    fn eyes_side_by_side_share_one_depth_with_each_of_them() {
        let eye = |x| {
            Camera::look_at(
                Vec3::new(x, 1.6, 2.0),
                Vec3::new(x, 1.2, 0.0),
                Vec3::Y,
                1.0,
                64,
                64,
            )
        };
        let eyes = [eye(-0.03), eye(0.03)];
        let plane = glam::Vec4::from(head_depth_plane(&eyes));
        let point = Vec3::new(0.3, 1.0, -0.5);
        for eye in eyes {
            let own = -eye.camera_from_world.transform_point3(point).z;
            let shared = plane.dot(point.extend(1.0));
            assert!((own - shared).abs() < 1e-5, "{own} against {shared}");
        }
    }

    #[test]
    fn a_scaled_or_broken_camera_is_refused_with_the_reason() {
        let mut camera = Camera::look_at(Vec3::Z, Vec3::ZERO, Vec3::Y, 1.0, 64, 64);
        camera.camera_from_world.matrix3 *= 2.0;
        assert!(
            camera
                .problem()
                .is_some_and(|problem| problem.contains("rigid")),
            "scaled"
        );
        camera = Camera::look_at(Vec3::Z, Vec3::ZERO, Vec3::Y, 1.0, 64, 64);
        camera.fx = f32::NAN;
        assert!(
            camera
                .problem()
                .is_some_and(|problem| problem.contains("finite")),
            "NaN"
        );
    }
}
