//! From motion parameters to the Gaussians of one frame: kinematics on the CPU, the deform graph on its provider's unit,
//! F_m2g on the CPU.

use crate::{Profile, ReceiverError, Stage, Unit};
use npu_runtime::{Provider, Runtime, Session, TensorSpec};
use spmm3::networks::{input, output};
use spmm3::{
    ATTRIBUTES, Avatar, BoundGaussians, GaussianSet, JOINTS, MotionParams, PARAMS, PlanarVertices,
    Skeleton, SkinningTransforms,
};
use std::time::Instant;

const MOTION: usize = 0;
const SKINNING: usize = 1;
const VERTICES: usize = 0;
const RESIDUALS: usize = 1;

/// An avatar ready to be moved. Allocates at construction, not per frame.
#[derive(Debug)]
pub struct Deformer {
    skeleton: Skeleton,
    gaussians: BoundGaussians,
    vertices: usize,
    session: Session,
    skinning: SkinningTransforms,
    state: GaussianSet,
}

impl Deformer {
    /// Loads the avatar's deform graph for `provider`.
    ///
    /// # Errors
    /// If ONNX Runtime refuses the graph or its inputs and outputs are not those of the avatar.
    pub fn new(
        runtime: &Runtime,
        avatar: &Avatar,
        provider: Provider,
    ) -> Result<Self, ReceiverError> {
        let vertices = avatar.template.vertices().len();
        let count = avatar.gaussians.len();
        let session = Session::new(
            runtime,
            &avatar.deform_graph,
            provider,
            &[
                TensorSpec::new(input::MOTION, &[1, PARAMS]),
                TensorSpec::new(input::SKINNING, &[12, JOINTS]),
            ],
            &[
                TensorSpec::new(output::VERTICES, &[3, vertices]),
                TensorSpec::new(output::RESIDUALS, &[ATTRIBUTES, count]),
            ],
        )?;
        Ok(Self {
            skeleton: avatar.skeleton.clone(),
            gaussians: avatar.gaussians.clone(),
            vertices,
            session,
            skinning: SkinningTransforms::default(),
            state: GaussianSet::zeroed(count),
        })
    }

    /// Deforms the avatar to `motion` and returns its Gaussians in world space, metres.
    ///
    /// # Errors
    /// If the graph fails to run.
    pub fn deform(
        &mut self,
        motion: &MotionParams,
        profile: &mut Profile,
    ) -> Result<&GaussianSet, ReceiverError> {
        let started = Instant::now();
        self.skeleton
            .skinning(&self.skeleton.pose(motion), &mut self.skinning);
        self.session
            .input_mut(MOTION)
            .copy_from_slice(motion.values());
        self.session
            .input_mut(SKINNING)
            .copy_from_slice(&self.skinning.0);
        profile.record(Stage::Kinematics, started.elapsed());

        let started = Instant::now();
        self.session.run()?;
        profile.record(Stage::Deform, started.elapsed());

        let started = Instant::now();
        let posed = PlanarVertices::new(self.session.output(VERTICES), self.vertices)?;
        let residuals = self.session.output(RESIDUALS);
        self.gaussians.pose(
            posed,
            Some(residuals),
            motion.root_translation,
            &mut self.state,
        )?;
        profile.record(Stage::Bind, started.elapsed());
        Ok(&self.state)
    }

    /// The skeleton that [`Self::deform`] poses.
    #[must_use]
    pub fn skeleton(&self) -> &Skeleton {
        &self.skeleton
    }

    /// Number of Gaussians N_g.
    #[must_use]
    pub fn gaussians(&self) -> usize {
        self.gaussians.len()
    }

    /// The unit that the deform graph's provider computes on.
    #[must_use]
    pub fn unit(&self) -> Unit {
        match self.session.provider() {
            Provider::Cpu { .. } => Unit::Cpu,
        }
    }
}
