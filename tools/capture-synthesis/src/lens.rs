//! A camera without distortion, as the rasteriser projects with it.

use glam::{DAffine3, DVec3, Vec3};

/// A pinhole camera. Axes: x right, y down, z away from it; pixel (0, 0) has its centre at (0.5, 0.5).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Lens {
    /// Rigid pose, metres.
    pub camera_from_world: DAffine3,
    /// Focal lengths, horizontal and vertical, pixels.
    pub focal: [f64; 2],
    /// Where the axis meets the picture, pixels from its left and its top edge.
    pub centre: [f64; 2],
    /// Width and height of the picture, pixels.
    pub size: [u32; 2],
}

impl Lens {
    /// A camera at `eye` whose axis passes through `target`, with `up` (not along the axis) upwards; metres. The axis meets the picture's
    /// middle.
    #[must_use]
    pub fn look_at(eye: DVec3, target: DVec3, up: DVec3, focal: f64, size: [u32; 2]) -> Self {
        let forward = (target - eye).normalize();
        let right = forward.cross(up).normalize();
        let down = forward.cross(right);
        let camera_from_world_rotation = glam::DMat3::from_cols(right, down, forward).transpose();
        Self {
            camera_from_world: DAffine3 {
                matrix3: camera_from_world_rotation,
                translation: -(camera_from_world_rotation * eye),
            },
            focal: [focal; 2],
            centre: size.map(|side| f64::from(side) / 2.0),
            size,
        }
    }

    /// Where the camera is, metres.
    #[must_use]
    pub fn eye(&self) -> DVec3 {
        let rotation = self.camera_from_world.matrix3;
        -(rotation.transpose() * self.camera_from_world.translation)
    }

    /// A point in the camera's axes, metres.
    #[must_use]
    pub fn camera_point(&self, world: Vec3) -> DVec3 {
        self.camera_from_world.transform_point3(world.as_dvec3())
    }
}
