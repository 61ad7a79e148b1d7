//! A scan's Gaussians in memory, whatever file they came from.

use glam::{Mat3, Quat, Vec3};
use rayon::prelude::*;
use splat_scene::{SH_C0, Scene, SceneBuilder, SceneError, Splat};

/// Gaussians of a scan, one entry each in every array.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Scan {
    /// Centres, metres (before [`crate::prepare`]: the file's units).
    pub positions: Vec<Vec3>,
    /// Unit quaternions that turn a Gaussian's own axes into the scan's.
    pub rotations: Vec<Quat>,
    /// Standard deviations along the own axes, metres.
    pub scales: Vec<Vec3>,
    /// 0..=1.
    pub opacities: Vec<f32>,
    /// Display colours, 0..=1 as a rule: the constant part of the spherical harmonics.
    pub colours: Vec<Vec3>,
}

impl Scan {
    /// The Gaussians of a scene; of spherical harmonics only the constant part.
    #[must_use]
    pub fn from_scene(scene: &Scene) -> Self {
        Self {
            positions: scene.positions().iter().map(|p| Vec3::from(*p)).collect(),
            rotations: scene
                .rotations()
                .iter()
                .map(|q| Quat::from_array(*q).normalize())
                .collect(),
            scales: scene
                .log_scales()
                .iter()
                .map(|s| Vec3::from(s.map(f32::exp)))
                .collect(),
            opacities: scene.opacities().to_vec(),
            colours: scene
                .colours()
                .iter()
                .map(|c| Vec3::from(c.map(|c| 0.5 + SH_C0 * c)))
                .collect(),
        }
    }

    /// The same Gaussians as a scene, which the renderer draws. What cannot be drawn (not finite) is left out.
    ///
    /// # Errors
    /// If there are more than a scene may have.
    pub fn to_scene(&self) -> Result<Scene, SceneError> {
        let mut builder = SceneBuilder::new(0)?;
        builder.reserve(self.len())?;
        for at in 0..self.len() {
            builder.push(
                &Splat {
                    position: self.positions[at].into(),
                    rotation: self.rotations[at].into(),
                    log_scale: self.scales[at].to_array().map(f32::ln),
                    opacity: self.opacities[at],
                    colour: self.colours[at].to_array().map(|c| (c - 0.5) / SH_C0),
                },
                &[],
            )?;
        }
        Ok(builder.finish())
    }

    /// How many there are.
    #[must_use]
    pub fn len(&self) -> usize {
        self.positions.len()
    }

    /// Whether there is none.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.positions.is_empty()
    }

    /// The Gaussians for which `keep` is true, in the same order. `keep` is as long as the scan.
    #[must_use]
    pub fn filtered(&self, keep: &[bool]) -> Self {
        fn pick<T: Copy>(values: &[T], keep: &[bool]) -> Vec<T> {
            let pairs = values.iter().zip(keep);
            pairs.filter(|(_, keep)| **keep).map(|(v, _)| *v).collect()
        }
        Self {
            positions: pick(&self.positions, keep),
            rotations: pick(&self.rotations, keep),
            scales: pick(&self.scales, keep),
            opacities: pick(&self.opacities, keep),
            colours: pick(&self.colours, keep),
        }
    }

    /// Appends another scan's Gaussians.
    pub fn append(&mut self, mut other: Self) {
        self.positions.append(&mut other.positions);
        self.rotations.append(&mut other.rotations);
        self.scales.append(&mut other.scales);
        self.opacities.append(&mut other.opacities);
        self.colours.append(&mut other.colours);
    }

    /// Every Gaussian as `scale * rotation * p + translation`.
    pub fn transform(&mut self, scale: f32, rotation: Quat, translation: Vec3) {
        self.positions
            .par_iter_mut()
            .for_each(|p| *p = rotation * (*p * scale) + translation);
        self.rotations
            .par_iter_mut()
            .for_each(|q| *q = (rotation * *q).normalize());
        self.scales.par_iter_mut().for_each(|s| *s *= scale);
    }

    /// The longest axis of a Gaussian: from its centre one standard deviation along it, metres.
    #[must_use]
    pub fn longest(&self, at: usize) -> Vec3 {
        let scale = self.scales[at];
        let axis = (0..3).fold(0, |most, axis| {
            if scale[axis] > scale[most] {
                axis
            } else {
                most
            }
        });
        Mat3::from_quat(self.rotations[at]).col(axis) * scale[axis]
    }

    /// The covariance of a Gaussian, square metres.
    #[must_use]
    pub fn covariance(&self, at: usize) -> Mat3 {
        let turned = Mat3::from_quat(self.rotations[at]) * Mat3::from_diagonal(self.scales[at]);
        turned * turned.transpose()
    }
}
