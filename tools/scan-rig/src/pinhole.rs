//! A view of the scan: a pinhole camera in double precision, for what is computed from pictures; and the renderer's camera of the same view.

use glam::{DMat3, DVec2, DVec3, Vec3};
use renderer_splat::camera::Camera;

/// A pinhole camera with square pixels whose axis meets the picture's middle.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Pinhole {
    /// Where it is, metres.
    pub eye: DVec3,
    /// Its axes as columns: right, down, forward.
    pub world_from_camera: DMat3,
    /// Focal length, pixels.
    pub focal: f64,
    /// Width of the picture, pixels.
    pub width: u32,
    /// Height of the picture, pixels.
    pub height: u32,
}

impl Pinhole {
    /// A camera at `eye` that sees `target` in its picture's middle, with `up` (not along the line of sight) upwards.
    #[must_use]
    pub fn look_at(
        eye: DVec3,
        target: DVec3,
        up: DVec3,
        focal: f64,
        width: u32,
        height: u32,
    ) -> Self {
        let forward = (target - eye).normalize();
        let right = forward.cross(up).normalize();
        let down = forward.cross(right);
        Self {
            eye,
            world_from_camera: DMat3::from_cols(right, down, forward),
            focal,
            width,
            height,
        }
    }

    /// A point in camera axes: x right, y down, z forward, metres.
    #[must_use]
    pub fn camera_point(&self, point: DVec3) -> DVec3 {
        self.world_from_camera.transpose() * (point - self.eye)
    }

    /// Where a point is in the picture, pixels; nothing if it is not in front of the camera. The first pixel's centre is (0.5, 0.5).
    #[must_use]
    pub fn project(&self, point: DVec3) -> Option<DVec2> {
        let seen = self.camera_point(point);
        (seen.z > 1e-6).then(|| DVec2::new(seen.x, seen.y) * (self.focal / seen.z) + self.centre())
    }

    /// The pixel in which a point is, counted row by row from the top; nothing if it is not in the picture.
    #[must_use]
    pub fn pixel(&self, point: DVec3) -> Option<usize> {
        let at = self.project(point)?;
        let size = DVec2::new(f64::from(self.width), f64::from(self.height));
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "in the picture"
        )]
        let pixel = || at.y as usize * self.width as usize + at.x as usize;
        (at.cmpge(DVec2::ZERO).all() && at.cmplt(size).all()).then(pixel)
    }

    /// The unit direction, in the world, in which a pixel looks.
    #[must_use]
    pub fn ray(&self, pixel: DVec2) -> DVec3 {
        let on_plane = (pixel - self.centre()) / self.focal;
        (self.world_from_camera * on_plane.extend(1.0)).normalize()
    }

    /// The picture's middle, pixels.
    #[must_use]
    pub fn centre(&self) -> DVec2 {
        DVec2::new(f64::from(self.width), f64::from(self.height)) / 2.0
    }

    /// The renderer's camera of the same view.
    #[must_use]
    #[expect(
        clippy::cast_possible_truncation,
        reason = "the renderer computes in single precision"
    )]
    pub fn camera(&self) -> Camera {
        let [_, down, forward] = [0, 1, 2].map(|axis| self.world_from_camera.col(axis).as_vec3());
        let eye: Vec3 = self.eye.as_vec3();
        let fov = 2.0 * (f64::from(self.height) / 2.0 / self.focal).atan();
        Camera::look_at(
            eye,
            eye + forward,
            -down,
            fov as f32,
            self.width,
            self.height,
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_point_is_on_the_ray_of_its_pixel_and_up_is_up_in_the_picture() {
        let view = Pinhole::look_at(
            DVec3::new(1.0, 1.2, 3.0),
            DVec3::new(0.0, 0.9, 0.0),
            DVec3::Y,
            1400.0,
            640,
            900,
        );
        let point = DVec3::new(0.2, 1.5, -0.1);
        let pixel = view.project(point).unwrap_or_default();
        let along = (point - view.eye).normalize();
        assert!(
            (view.ray(pixel) - along).length() < 1e-12,
            "the ray misses the point"
        );
        assert!(
            pixel.y < 450.0,
            "what is above the target is not in the upper half: {pixel}"
        );
        assert!(
            view.project(view.eye - view.ray(view.centre())).is_none(),
            "behind the camera"
        );
    }
}
