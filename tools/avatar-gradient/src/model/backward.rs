//! The backward pass: from derivatives by Gaussians and vertices to those by all parameters and by the pose.

use super::Model;
use crate::bases;
use crate::basis_derivatives::BasisDerivatives;
use crate::binding::CORNERS;
use crate::correction::PoseCorrection;
use crate::error::{ModelError, check_count};
use crate::offsets;
use crate::parameters::Parameters;
use crate::planes::{RUN, add_scaled, planes};
use crate::posed::Posed;
use crate::skinning;
use rayon::prelude::*;
use splat_gradient::Attributes;
use spmm3::{ATTRIBUTES, PARAMS};

/// Derivatives of a loss by what [`Model::pose`] computed; what is absent counts as 0.
#[derive(Debug, Clone, Copy, Default)]
pub struct Derivatives<'a> {
    /// By the Gaussians, from `splat_gradient::Drawn::backward` and [`crate::loss`].
    pub gaussians: Option<&'a Attributes>,
    /// By the posed vertices in the world, row-major [3, N_v].
    pub vertices: Option<&'a [f32]>,
    /// By the controllers' offsets, row-major [C, 3], see [`Model::controller_offsets`].
    pub offsets: Option<&'a [f32]>,
}

impl Model {
    /// Adds the derivatives of a loss by all parameters to `gradients`, and returns those by the pose: by P and by the root translation,
    /// whether or not a correction was applied. Where `gradients.bases` is empty they are left to [`crate::step_bases`].
    ///
    /// Runs on rayon's current pool. An edge or height of a triangle below ten micrometres does not turn its Gaussians: no derivative is
    /// taken through it. A template's rotation of length 0 has none.
    ///
    /// # Errors
    /// Derivatives or gradients of other sizes; a pose that was not computed with these parts of this model.
    pub fn backward(
        &self,
        parameters: &Parameters,
        posed: &mut Posed,
        by: &Derivatives<'_>,
        gradients: &mut Parameters,
    ) -> Result<PoseCorrection, ModelError> {
        self.check_backward(parameters, posed, by, gradients)?;
        let (level, sizes) = (self.level, &self.sizes);
        let back = &mut posed.back;
        let mut by_p = [0.0; PARAMS];
        back.by_vertices.clear();
        back.by_vertices.resize(3 * sizes.vertices, 0.0);
        if let Some(by_gaussians) = by.gaussians {
            back.by_local.resize(ATTRIBUTES * sizes.gaussians, 0.0);
            back.by_corners.resize(CORNERS * sizes.gaussians, 0.0);
            self.binding.backward(
                level,
                &posed.vertices,
                &posed.local,
                by_gaussians.numbers(),
                &mut back.by_local,
                &mut back.by_corners,
            );
            self.binding
                .scatter(&back.by_corners, &mut back.by_vertices);
            add_scaled(&mut gradients.gaussians, &back.by_local, 1.0);
        } else {
            back.by_local.clear();
            back.by_local.resize(ATTRIBUTES * sizes.gaussians, 0.0);
        }
        if self.parts.attributes {
            self.attributes_backward(parameters, posed, by.offsets, gradients, &mut by_p);
        }
        self.mesh_backward(parameters, posed, by, gradients, &mut by_p)
    }

    /// F_attr's part, from `back.by_local` on.
    fn attributes_backward(
        &self,
        parameters: &Parameters,
        posed: &mut Posed,
        by_offsets: Option<&[f32]>,
        gradients: &mut Parameters,
        by_p: &mut [f32],
    ) {
        let (level, sizes, back) = (self.level, &self.sizes, &mut posed.back);
        bases::attributes_backward(
            level,
            &parameters.bases,
            &back.by_local,
            sizes.bases,
            &mut back.by_forces,
        );
        back.by_potentials.clear();
        back.by_potentials
            .resize(sizes.controllers * sizes.bases, 0.0);
        bases::forces_backward(
            &self.holds,
            &back.by_forces,
            sizes.bases,
            &mut back.by_basis,
            &mut back.by_potentials,
        );
        back.pulls.clear();
        if let Some(by_offsets) = by_offsets {
            offsets::backward(
                by_offsets,
                &posed.mean_bases,
                sizes.bases,
                &mut back.by_potentials,
            );
            offsets::pulls(
                &self.holds,
                &self.rest_frames,
                &self.inverse_masses,
                by_offsets,
                &mut back.pulls,
            );
        }
        if !gradients.bases.is_empty() {
            let derivatives = self.basis_derivatives(posed);
            let rows = gradients.bases.par_chunks_mut(sizes.gaussians.max(1));
            rows.enumerate().for_each(|(row, out)| {
                for (run, out) in out.chunks_mut(RUN).enumerate() {
                    derivatives.add_to(row, run * RUN, out);
                }
            });
        }
        posed.controllers.backward(
            level,
            parameters,
            &posed.inputs,
            &posed.back.by_potentials,
            gradients,
            by_p,
        );
    }

    /// The derivatives by the bases that the last backward pass of a pose left, as factors.
    pub(crate) fn basis_derivatives<'a>(&'a self, posed: &'a Posed) -> BasisDerivatives<'a> {
        BasisDerivatives {
            level: self.level,
            number_of_bases: self.sizes.bases,
            holds: &self.holds,
            forces: &posed.forces,
            by_local: &posed.back.by_local,
            potentials: &posed.controllers.potentials,
            pulls: &posed.back.pulls,
        }
    }

    /// The mesh's part, from `back.by_vertices` on.
    fn mesh_backward(
        &self,
        parameters: &Parameters,
        posed: &mut Posed,
        by: &Derivatives<'_>,
        gradients: &mut Parameters,
        by_p: &mut [f32; PARAMS],
    ) -> Result<PoseCorrection, ModelError> {
        let (level, back) = (self.level, &mut posed.back);
        if let Some(more) = by.vertices {
            add_scaled(&mut back.by_vertices, more, 1.0);
        }
        let by_root = planes::<3>(&back.by_vertices).map(sum);
        back.by_canonical.clear();
        back.by_canonical.resize(back.by_vertices.len(), 0.0);
        let by_joints = skinning::backward(
            level,
            &self.skin,
            &skinning::columns(&posed.joints.posed_from_rest),
            &posed.canonical,
            &back.by_vertices,
            &mut back.by_canonical,
            &mut back.by_joints,
        );
        posed
            .joints
            .backward(&self.skeleton, &posed.motion, &by_joints, by_p);
        posed.mesh.backward(
            level,
            parameters,
            &posed.inputs,
            &back.by_canonical,
            gradients,
            by_p,
        );
        let mut by_pose = PoseCorrection::default();
        by_pose.0[..PARAMS].copy_from_slice(by_p);
        by_pose.0[PARAMS..].copy_from_slice(&by_root);
        Ok(by_pose)
    }

    fn check_backward(
        &self,
        parameters: &Parameters,
        posed: &Posed,
        by: &Derivatives<'_>,
        gradients: &Parameters,
    ) -> Result<(), ModelError> {
        let sizes = &self.sizes;
        parameters.check(sizes, false)?;
        gradients.check(sizes, true)?;
        self.check_posed(posed)?;
        if let Some(gaussians) = by.gaussians {
            check_count("derivatives by Gaussians", gaussians.len(), sizes.gaussians)?;
        }
        if let Some(vertices) = by.vertices {
            check_count(
                "derivatives by vertices",
                vertices.len(),
                3 * sizes.vertices,
            )?;
        }
        if let Some(offsets) = by.offsets {
            check_count(
                "derivatives by controllers' offsets",
                offsets.len(),
                3 * sizes.controllers,
            )?;
            if self.parts.attributes && posed.offsets.is_empty() && sizes.controllers > 0 {
                return Err(ModelError::NotPosed("the controllers' offsets"));
            }
        }
        Ok(())
    }
}

/// A sum in double precision, in the order of the numbers.
#[expect(
    clippy::cast_possible_truncation,
    reason = "derivatives are single precision"
)]
fn sum(numbers: &[f32]) -> f32 {
    numbers.iter().map(|x| f64::from(*x)).sum::<f64>() as f32
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::exchange::Networks;
    use fearless_simd::Level;
    use synthetic_person::{Puppet, Random};

    /// This processor's SIMD levels, the narrowest first.
    fn levels() -> Vec<Level> {
        let new = Level::new();
        #[cfg(target_arch = "x86_64")]
        let more = [
            new.as_sse4_2().map(Level::Sse4_2),
            new.as_avx2().map(Level::Avx2),
        ];
        #[cfg(not(target_arch = "x86_64"))]
        let more: [Option<Level>; 0] = [];
        let more = more.into_iter().flatten();
        [Level::baseline(), new].into_iter().chain(more).collect()
    }

    #[test]
    fn every_level_of_the_processor_gives_the_same_but_for_rounding() {
        let puppet = Puppet::small();
        let networks = Networks {
            gaussians: puppet.gaussians.clone(),
            mesh: puppet.mesh.clone(),
            attributes: puppet.attributes.clone(),
        };
        let (template, controllers) = (&puppet.template, &puppet.controllers);
        let mut model =
            Model::new(&puppet.skeleton, template, controllers, &networks).expect("fits");
        let parameters = networks.parameters();
        let mut random = Random::new(2);
        let motion = random.motion(0.6);
        let mut by_gaussians = Attributes::zeros(model.sizes.gaussians);
        for number in by_gaussians.numbers_mut() {
            *number = random.signed();
        }
        let by = Derivatives {
            gaussians: Some(&by_gaussians),
            ..Derivatives::default()
        };
        let mut results = Vec::new();
        for level in levels() {
            model.level = level;
            let mut posed = Posed::new();
            let mut gradients = Parameters::zeros(&model.sizes);
            model
                .pose(&parameters, &motion, None, &mut posed)
                .expect("fits");
            let by_pose = model.backward(&parameters, &mut posed, &by, &mut gradients);
            let mut arrays: Vec<Vec<f32>> =
                gradients.arrays().map(|(_, array)| array.to_vec()).into();
            arrays.push(posed.world.numbers().to_vec());
            arrays.push(by_pose.expect("fits").0.to_vec());
            results.push(arrays);
        }
        for other in &results[1..] {
            for (index, (first, other)) in results[0].iter().zip(other).enumerate() {
                let most = first.iter().fold(0.0f32, |most, x| most.max(x.abs()));
                assert!(most > 0.0, "array {index}: something to compare");
                for (a, b) in first.iter().zip(other) {
                    assert!(
                        (a - b).abs() < 1e-4 * most,
                        "array {index}: {a}, {b}, of {most}"
                    );
                }
            }
        }
    }
}
