//! An avatar's forward pass, from motion to Gaussians, and its backward pass.

use crate::bases::{self, Hold};
use crate::basis_derivatives::BasisDerivatives;
use crate::binding::{Binding, CORNERS};
use crate::correction::PoseCorrection;
use crate::error::{ModelError, check_count};
use crate::exchange::Networks;
use crate::offsets;
use crate::parameters::{Parameters, Sizes};
use crate::planes::{RUN, add_scaled, planes};
use crate::posed::Posed;
use crate::skinning;
use fearless_simd::Level;
use glam::Mat3;
use rayon::prelude::*;
use splat_gradient::Attributes;
use spmm3::{ATTRIBUTES, Controllers, PARAMS, Skeleton, SkinWeights, Template, triangle_frame};

/// Which parts move the avatar; without both, the mean mesh drives the template Gaussians. Parts that are off cost nothing and have no
/// derivatives.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Parts {
    /// F_mesh's offset fields.
    pub mesh: bool,
    /// F_attr's residuals.
    pub attributes: bool,
}

impl Parts {
    /// The whole avatar.
    pub const ALL: Self = Self {
        mesh: true,
        attributes: true,
    };
}

/// Derivatives of a loss by what [`Model::pose`] computed; what is absent counts as 0.
#[derive(Debug, Clone, Copy, Default)]
pub struct Derivatives<'a> {
    /// By the Gaussians, from `splat_gradient::Drawn::backward` and [`crate::loss`].
    pub gaussians: Option<&'a Attributes>,
    /// By the posed vertices in the world, row-major [3, N_v].
    pub vertices: Option<&'a [f32]>,
    /// By the canonical vertices, row-major [3, N_v].
    pub canonical: Option<&'a [f32]>,
    /// By the controllers' offsets, row-major [C, 3], see [`Model::controller_offsets`].
    pub offsets: Option<&'a [f32]>,
}

/// What of an avatar is not learnt: skeleton, skinning, which triangle a Gaussian is bound to, which controllers pull it.
#[derive(Debug, Clone)]
pub struct Model {
    /// Which parts move the avatar.
    pub parts: Parts,
    level: Level,
    sizes: Sizes,
    skeleton: Skeleton,
    skin: Vec<SkinWeights>,
    /// [3, N_v].
    rest: Vec<f32>,
    binding: Binding,
    holds: Vec<Hold>,
    /// Of every Gaussian: its triangle's frame in T-pose.
    rest_frames: Vec<Mat3>,
    /// 1 / the sum of all masses by which each controller pulls.
    inverse_masses: Vec<f32>,
}

impl Model {
    /// Of an avatar's parts and the networks' sizes; the networks' numbers are [`Networks::parameters`].
    ///
    /// # Errors
    /// Parts that do not fit each other.
    pub fn new(
        skeleton: &Skeleton,
        template: &Template,
        controllers: &Controllers,
        networks: &Networks,
    ) -> Result<Self, ModelError> {
        let (vertices, bound) = (template.vertices(), &networks.gaussians);
        let sizes = networks.sizes(vertices.len(), controllers.vertices().len())?;
        let held = controllers.neighbours().len();
        check_count("Gaussians that controllers hold", held, sizes.gaussians)?;
        // Of another template, perhaps.
        let corners = bound.corners().as_flattened();
        let most = corners
            .iter()
            .max()
            .map_or(0, |vertex| *vertex as usize + 1);
        check_count(
            "template vertices",
            vertices.len(),
            most.max(vertices.len()),
        )?;
        let frames = bound.corners().iter();
        let frames = frames.map(|corners| triangle_frame(corners.map(|v| vertices[v as usize])));
        let mut masses = vec![0.0f32; sizes.controllers];
        let holds = bases::holds(controllers);
        for hold in &holds {
            for (controller, mass) in hold.controllers.iter().zip(hold.masses) {
                masses[usize::from(*controller)] += mass;
            }
        }
        let inverse = |mass: f32| if mass > 0.0 { 1.0 / mass } else { 0.0 };
        Ok(Self {
            parts: Parts::ALL,
            level: Level::new(),
            sizes,
            skeleton: skeleton.clone(),
            skin: template.skin().to_vec(),
            rest: (0..3)
                .flat_map(|axis| vertices.iter().map(move |vertex| vertex[axis]))
                .collect(),
            binding: Binding::new(bound),
            holds,
            rest_frames: frames.collect(),
            inverse_masses: masses.into_iter().map(inverse).collect(),
        })
    }

    /// The sizes.
    #[must_use]
    pub fn sizes(&self) -> &Sizes {
        &self.sizes
    }

    /// The joints in T-pose. A frame whose pelvis stands at p (world, metres) has the root translation p less the pelvis' rest position.
    #[must_use]
    pub fn skeleton(&self) -> &Skeleton {
        &self.skeleton
    }

    /// Poses the avatar into `posed`. Runs on rayon's current pool; allocates only where `posed` is too small.
    ///
    /// # Errors
    /// Parameters of other sizes.
    pub fn pose(
        &self,
        parameters: &Parameters,
        motion: &spmm3::MotionParams,
        correction: Option<&PoseCorrection>,
        posed: &mut Posed,
    ) -> Result<(), ModelError> {
        parameters.check(&self.sizes, false)?;
        posed.motion = correction.map_or_else(|| motion.clone(), |c| c.applied(motion));
        self.pose_mesh(parameters, posed);
        let (level, sizes) = (self.level, &self.sizes);
        posed.offsets.clear();
        posed.back.by_local.clear();
        if self.parts.attributes {
            let shape = [sizes.controller_hidden, sizes.bases];
            let p = posed.motion.values();
            posed.controllers.forward(level, parameters, p, shape);
            let potentials = &posed.controllers.potentials;
            bases::forces(&self.holds, potentials, sizes.bases, &mut posed.forces);
        } else {
            posed.controllers.potentials.clear();
            posed.forces.clear();
        }
        bases::attributes(
            level,
            &parameters.gaussians,
            &parameters.bases,
            &posed.forces,
            &mut posed.local,
        );
        if posed.world.len() != sizes.gaussians {
            posed.world = Attributes::zeros(sizes.gaussians);
        }
        let world = posed.world.numbers_mut();
        self.binding
            .forward(level, &posed.vertices, &posed.local, world);
        Ok(())
    }

    /// Position offset that each controller causes, row-major [C, 3], metres in the template's axes, for [`crate::loss::guide`]: the mean
    /// over the Gaussians that it holds, by their masses, of the position residual that its potentials alone would give them in T-pose.
    /// Empty where F_attr is switched off.
    ///
    /// # Errors
    /// Parameters of other sizes; a pose that was not computed with these parts of this model.
    pub fn controller_offsets<'a>(
        &self,
        parameters: &Parameters,
        posed: &'a mut Posed,
    ) -> Result<&'a [f32], ModelError> {
        parameters.check(&self.sizes, false)?;
        self.check_posed(posed)?;
        if self.parts.attributes {
            let bases = self.sizes.bases;
            offsets::mean_bases(
                &self.holds,
                &self.rest_frames,
                &self.inverse_masses,
                &parameters.bases,
                bases,
                &mut posed.mean_bases,
            );
            let potentials = &posed.controllers.potentials;
            offsets::forward(potentials, &posed.mean_bases, bases, &mut posed.offsets);
        }
        Ok(&posed.offsets)
    }

    fn pose_mesh(&self, parameters: &Parameters, posed: &mut Posed) {
        let level = self.level;
        posed.joints.forward(&self.skeleton, &posed.motion);
        posed.mesh.forward(
            level,
            parameters,
            posed.motion.values(),
            &self.rest,
            self.parts.mesh,
            &mut posed.canonical,
        );
        posed.vertices.resize(self.rest.len(), 0.0);
        skinning::forward(
            level,
            &self.skin,
            &skinning::columns(&posed.joints.posed_from_rest),
            posed.motion.root_translation,
            &posed.canonical,
            &mut posed.vertices,
        );
    }

    /// Adds the derivatives of a loss by all parameters to `gradients`, and returns those by the pose: by P and by the root translation,
    /// whether or not a correction was applied. Where `gradients.bases` is empty they are left to [`crate::BasisAdam::step`].
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
            posed.motion.values(),
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
        if let Some(more) = by.canonical {
            back.by_canonical.copy_from_slice(more);
        }
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
            posed.motion.values(),
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
        for (what, array) in [
            ("derivatives by vertices", by.vertices),
            ("derivatives by canonical vertices", by.canonical),
        ] {
            check_count(
                what,
                array.map_or(3 * sizes.vertices, <[f32]>::len),
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

    fn check_posed(&self, posed: &Posed) -> Result<(), ModelError> {
        let sizes = &self.sizes;
        if posed.world.len() != sizes.gaussians || posed.vertices.len() != 3 * sizes.vertices {
            return Err(ModelError::NotPosed("the Gaussians"));
        }
        let forces = if self.parts.attributes {
            sizes.bases * sizes.gaussians
        } else {
            0
        };
        if posed.forces.len() != forces {
            return Err(ModelError::NotPosed("F_attr's residuals"));
        }
        if !posed.mesh.fits(self.parts.mesh, sizes.rank) {
            return Err(ModelError::NotPosed("F_mesh's offsets"));
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
