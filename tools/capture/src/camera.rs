//! Calibrated cameras.

use crate::error::CaptureError;
use crate::lens;
use glam::{DAffine3, DMat3, DVec2, DVec3};

/// The longest side of a picture, pixels.
pub const LARGEST_SIDE: u32 = 8192;
/// The most cameras of a capture.
pub const MOST_CAMERAS: usize = 1024;

/// Most bytes of a camera's name, which is a folder's name as well.
const MAX_NAME: usize = 64;
/// Points nearer than this along the axis are seen nowhere, metres.
const NEAR: f64 = 1e-3;
/// Furthest camera from the origin, metres.
const FURTHEST: f64 = 1e4;

/// A calibrated camera. Axes: x right, y down, z away from it; the world is in metres with y up.
#[derive(Debug, Clone, PartialEq)]
pub struct Camera {
    /// Names its folder: letters, digits, `-`, `_` and `.` of ASCII, at most 64, the first no dot.
    pub name: String,
    /// Width and height of its pictures, pixels.
    pub size: [u32; 2],
    /// Focal lengths, horizontal and vertical, pixels.
    pub focal: [f64; 2],
    /// Where the axis meets the picture, pixels from its left and top edge: the first pixel's centre is at 0.5. OpenCV's principal point is
    /// half a pixel less.
    pub centre: [f64; 2],
    /// OpenCV's k1, k2, p1, p2, k3 (Brown and Conrady).
    pub distortion: [f64; 5],
    /// The rigid pose, metres.
    pub camera_from_world: DAffine3,
}

impl Camera {
    /// Checks every number.
    ///
    /// # Errors
    /// [`CaptureError::Camera`] with the name of the field: a name that is no folder's, a size out of 1..=[`LARGEST_SIDE`], numbers that
    /// are not finite, a focal length that is not positive, a centre further away than ten pictures, a pose that is not rigid.
    pub fn check(&self) -> Result<(), CaptureError> {
        self.fault().map_or(Ok(()), |(field, reason)| {
            Err(CaptureError::Camera {
                name: self.name.chars().take(MAX_NAME).collect(),
                reason: format!("`{field}` {reason}"),
            })
        })
    }

    /// The first field that is wrong, and what is wrong with it.
    pub(crate) fn fault(&self) -> Option<(&'static str, String)> {
        let plain = |b: u8| b.is_ascii_alphanumeric() || b"-_.".contains(&b);
        let matrix = self.camera_from_world.matrix3;
        let away = (matrix * matrix.transpose() - DMat3::IDENTITY).to_cols_array();
        let reach = |axis: usize| 10.0 * f64::from(self.size[axis]);
        if self.name.is_empty()
            || self.name.len() > MAX_NAME
            || self.name.starts_with('.')
            || !self.name.bytes().all(plain)
        {
            let reason = "must be 1 to 64 letters, digits, `-`, `_` or `.`, the first no dot";
            Some(("name", reason.to_owned()))
        } else if !self.size.iter().all(|s| (1..=LARGEST_SIDE).contains(s)) {
            let reason = format!(
                "is {:?}; 1 to {LARGEST_SIDE} pixels are possible",
                self.size
            );
            Some(("size", reason))
        } else if !self.focal.iter().all(|f| *f > 0.0 && *f < 1e7) {
            let reason = format!("is {:?}; pixels greater than 0 are needed", self.focal);
            Some(("focal", reason))
        } else if !(0..2).all(|axis| self.centre[axis].abs() <= reach(axis)) {
            let reason = format!("is {:?}; a pixel near the picture is needed", self.centre);
            Some(("centre", reason))
        } else if !self.distortion.iter().all(|k| k.abs() < 1e4) {
            let reason = format!("is {:?}; small numbers are needed", self.distortion);
            Some(("distortion", reason))
        } else if !away.iter().all(|v| v.abs() < 1e-4) || matrix.determinant() <= 0.0 {
            let reason =
                "is no rotation: its rows must be perpendicular, of length 1, right-handed";
            Some(("camera_from_world", reason.to_owned()))
        } else if self.far_away() {
            let reason = format!(
                "has the translation {}; metres are needed",
                self.camera_from_world.translation
            );
            Some(("camera_from_world", reason))
        } else {
            None
        }
    }

    /// Whether its translation is none in metres; data sets have a field of its own for it.
    pub(crate) fn far_away(&self) -> bool {
        let translation = self.camera_from_world.translation;
        !translation.is_finite() || translation.abs().max_element() >= FURTHEST
    }

    /// The pixel at which a point of the world is seen, distortion included: possibly outside the picture. `None` for a point behind the
    /// camera, or so far aside that the distortion's model has no meaning.
    #[must_use]
    pub fn project(&self, world: DVec3) -> Option<DVec2> {
        let sight = self.camera_from_world.transform_point3(world);
        if sight.z.is_nan() || sight.z <= NEAR {
            return None;
        }
        let slopes = lens::distort(&self.distortion, sight.truncate() / sight.z)?;
        Some(slopes * DVec2::from(self.focal) + DVec2::from(self.centre))
    }

    /// The slopes (x / z, y / z) in the camera's axes of the ray that is seen at a pixel: distortion is undone. `None` where no ray is.
    #[must_use]
    pub fn slopes(&self, pixel: DVec2) -> Option<DVec2> {
        let seen = (pixel - DVec2::from(self.centre)) / DVec2::from(self.focal);
        lens::undistort(&self.distortion, seen)
    }

    /// Where the camera stands in the world, metres.
    #[must_use]
    pub fn position(&self) -> DVec3 {
        let pose = self.camera_from_world;
        -(pose.matrix3.transpose() * pose.translation)
    }

    /// The same camera without distortion: the pinhole that a [`crate::Photograph`] has.
    #[must_use]
    pub fn undistorted(&self) -> Self {
        Self {
            distortion: [0.0; 5],
            ..self.clone()
        }
    }

    /// The camera of a part of its pictures: `size` pixels from the pixel `corner` (left, top) on.
    #[must_use]
    pub fn cropped(&self, corner: [u32; 2], size: [u32; 2]) -> Self {
        Self {
            size,
            centre: [0, 1].map(|axis| self.centre[axis] - f64::from(corner[axis])),
            ..self.clone()
        }
    }

    /// The camera of its pictures at another size, the whole of each.
    #[must_use]
    pub fn scaled(&self, size: [u32; 2]) -> Self {
        let share = |axis: usize| f64::from(size[axis]) / f64::from(self.size[axis].max(1));
        Self {
            size,
            focal: [0, 1].map(|axis| self.focal[axis] * share(axis)),
            centre: [0, 1].map(|axis| self.centre[axis] * share(axis)),
            ..self.clone()
        }
    }
}
