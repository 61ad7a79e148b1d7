//! An avatar's forward pass, from motion to Gaussians.

mod backward;

pub use backward::Derivatives;

use crate::bases::{self, Hold};
use crate::binding::Binding;
use crate::correction::PoseCorrection;
use crate::error::{ModelError, check_count};
use crate::exchange::Networks;
use crate::offsets;
use crate::parameters::{Parameters, Sizes};
use crate::posed::Posed;
use crate::skinning;
use fearless_simd::Level;
use glam::Mat3;
use splat_gradient::Attributes;
use spmm3::{Controllers, Skeleton, SkinWeights, Template, triangle_frame};

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

/// What of an avatar is not learnt: skeleton, skinning, which triangle a Gaussian is bound to, which controllers pull it.
#[derive(Debug, Clone)]
pub struct Model {
    /// Which parts move the avatar.
    pub parts: Parts,
    /// What is added to what the networks see of a pose, `[215]`, and not to the skeleton's; nothing where it is empty. A training draws it anew for each
    /// step, so that networks learn what holds around a pose.
    pub jitter: Vec<f32>,
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
            jitter: Vec::new(),
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
        posed.inputs.clear();
        posed.inputs.extend_from_slice(posed.motion.values());
        for (input, jitter) in posed.inputs.iter_mut().zip(&self.jitter) {
            *input += jitter;
        }
        self.pose_mesh(parameters, posed);
        let (level, sizes) = (self.level, &self.sizes);
        posed.offsets.clear();
        posed.back.by_local.clear();
        if self.parts.attributes {
            let shape = [sizes.controller_hidden, sizes.bases];
            let p = &posed.inputs;
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
            &posed.inputs,
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
