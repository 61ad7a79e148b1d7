//! The one way into a [`Scene`]: every Gaussian is checked here, whichever file it comes from. What no renderer could draw
//! is left out and counted; values with one sensible reading (a scale of zero, a quaternion that is not unit) are corrected.

use crate::scene::{Arrays, Scene};
use crate::{Dropped, Format, MAX_GAUSSIANS, MAX_SH_DEGREE, SceneError, rest_coefficients};

/// A position is at most this far from the origin on each axis, in the scene's units: squares stay far from overflow.
pub const MAX_COORDINATE: f32 = 1e9;
/// Log-scales above are left out; below the negative, they are raised to it (a Gaussian thinner than 1e-13 units).
pub const MAX_LOG_SCALE: f32 = 30.0;
/// An SH coefficient is at most this large: a sum of 16 stays finite.
pub const MAX_COEFFICIENT: f32 = 1e6;

/// A Gaussian to add to a scene, in OpenXR's frame (x right, y up, z back).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Splat {
    /// Centre, in the scene's units.
    pub position: [f32; 3],
    /// Quaternion x, y, z, w of any length but zero, turning the Gaussian's axes into the scene's.
    pub rotation: [f32; 4],
    /// Natural logarithm of the standard deviation along each own axis.
    pub log_scale: [f32; 3],
    /// Opacity at the centre, 0 to 1; outside is clamped.
    pub opacity: f32,
    /// SH coefficient of degree 0 for red, green and blue: `rgb = 0.5 + SH_C0 * colour`.
    pub colour: [f32; 3],
}

/// Collects checked Gaussians into a [`Scene`].
#[derive(Debug)]
pub struct SceneBuilder {
    arrays: Arrays,
    sh_degree: u8,
    rest_values: usize,
    dropped: Dropped,
}

impl SceneBuilder {
    /// An empty scene whose Gaussians have SH coefficients up to `sh_degree`.
    ///
    /// # Errors
    /// [`SceneError::ShDegree`] above 3.
    pub fn new(sh_degree: u8) -> Result<Self, SceneError> {
        if sh_degree > MAX_SH_DEGREE {
            return Err(SceneError::ShDegree(sh_degree));
        }
        Ok(Self {
            arrays: Arrays::default(),
            sh_degree,
            rest_values: 3 * rest_coefficients(sh_degree),
            dropped: Dropped::default(),
        })
    }

    /// Makes room for `count` Gaussians more.
    ///
    /// # Errors
    /// [`SceneError::OutOfMemory`] where there is none.
    pub fn reserve(&mut self, count: usize) -> Result<(), SceneError> {
        let arrays = &mut self.arrays;
        arrays
            .positions
            .try_reserve_exact(count)
            .and_then(|()| arrays.rotations.try_reserve_exact(count))
            .and_then(|()| arrays.log_scales.try_reserve_exact(count))
            .and_then(|()| arrays.opacities.try_reserve_exact(count))
            .and_then(|()| arrays.colours.try_reserve_exact(count))
            .and_then(|()| {
                let values = count.saturating_mul(self.rest_values);
                arrays.sh_rest.try_reserve_exact(values)
            })
            .map_err(|_| SceneError::OutOfMemory {
                count,
                sh_degree: self.sh_degree,
            })
    }

    /// Adds a Gaussian, or counts it as dropped where it cannot be drawn. `sh_rest` holds the coefficients above degree 0
    /// in 3DGS' order, red, green and blue of one coefficient side by side: `[3, 8 or 15][rgb]`.
    ///
    /// # Errors
    /// [`SceneError::ShRest`] for another number of values than the scene's degree has,
    /// [`SceneError::TooManyGaussians`] when the scene is full.
    pub fn push(&mut self, splat: &Splat, sh_rest: &[f32]) -> Result<(), SceneError> {
        if sh_rest.len() != self.rest_values {
            return Err(SceneError::ShRest {
                got: sh_rest.len(),
                expected: self.rest_values,
            });
        }
        if self.arrays.positions.len() >= MAX_GAUSSIANS {
            return Err(SceneError::TooManyGaussians {
                name: "the scene".to_owned(),
                count: MAX_GAUSSIANS as u64 + 1,
                limit: MAX_GAUSSIANS as u64,
            });
        }
        // Written so that NaN fails each test.
        if !splat.position.iter().all(|v| v.abs() <= MAX_COORDINATE) {
            self.dropped.position += 1;
            return Ok(());
        }
        let Some(rotation) = unit(splat.rotation) else {
            self.dropped.rotation += 1;
            return Ok(());
        };
        if !splat.log_scale.iter().all(|&v| v <= MAX_LOG_SCALE) {
            self.dropped.scale += 1;
            return Ok(());
        }
        if splat.opacity.is_nan() {
            self.dropped.opacity += 1;
            return Ok(());
        }
        let small = |v: &f32| v.abs() <= MAX_COEFFICIENT;
        if !splat.colour.iter().all(small) || !sh_rest.iter().all(small) {
            self.dropped.colour += 1;
            return Ok(());
        }
        let arrays = &mut self.arrays;
        arrays.positions.push(splat.position);
        arrays.rotations.push(rotation);
        arrays
            .log_scales
            .push(splat.log_scale.map(|v| v.max(-MAX_LOG_SCALE)));
        arrays.opacities.push(splat.opacity.clamp(0.0, 1.0));
        arrays.colours.push(splat.colour);
        arrays.sh_rest.extend_from_slice(sh_rest);
        Ok(())
    }

    /// The scene of all Gaussians pushed and not dropped.
    pub fn finish(self) -> Scene {
        self.finish_as(Format::Memory, false)
    }

    pub(crate) fn finish_as(self, format: Format, antialiased: bool) -> Scene {
        Scene::checked(
            self.arrays,
            self.sh_degree,
            self.dropped,
            format,
            antialiased,
        )
    }
}

/// The quaternion at length one, or nothing where it has no direction.
fn unit(rotation: [f32; 4]) -> Option<[f32; 4]> {
    // In f64 neither the squares of the smallest f32 nor those of the largest are lost.
    let square: f64 = rotation.iter().map(|&v| f64::from(v) * f64::from(v)).sum();
    if !(square.is_finite() && square > 1e-24) {
        return None;
    }
    let inverse = square.sqrt().recip();
    #[expect(
        clippy::cast_possible_truncation,
        reason = "a value between -1 and 1 rounded to f32"
    )]
    Some(rotation.map(|v| (f64::from(v) * inverse) as f32))
}
