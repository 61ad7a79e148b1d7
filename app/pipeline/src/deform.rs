//! From motion parameters to the Gaussians of one frame, one step after the other on one thread: for stills, and to measure
//! stages by themselves. A call does the same in lanes (`lanes/`).

use crate::error::ReceiverError;
use crate::inference::Inference;
use crate::plan::{Plan, unit_of};
use crate::posing::Posing;
use crate::profile::Profile;
use crate::stage::{Stage, Unit};
use app_kernels::state::GaussianState;
use npu_runtime::Outputs;
use spmm3::{Avatar, MotionParams, Skeleton, SkinningTransforms};
use std::time::Instant;

/// An avatar ready to be moved. Allocates at construction, not per frame.
#[derive(Debug)]
pub struct Deformer {
    skeleton: Skeleton,
    inference: Inference,
    plan: Plan,
    posing: Posing,
    outputs: Outputs,
    skinning: SkinningTransforms,
    state: GaussianState,
}

impl Deformer {
    /// For an avatar whose graph `inference` runs as `plan` leaves it to it.
    ///
    /// # Errors
    /// If there is no memory for results, or the avatar's networks cannot be read back.
    pub fn new(avatar: &Avatar, inference: Inference, plan: Plan) -> Result<Self, ReceiverError> {
        let posing = Posing::new(avatar, plan)?;
        Ok(Self {
            skeleton: avatar.skeleton.clone(),
            outputs: inference.outputs()?,
            inference,
            plan,
            state: GaussianState::new(posing.gaussians()),
            posing,
            skinning: SkinningTransforms::default(),
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
    ) -> Result<&GaussianState, ReceiverError> {
        let started = Instant::now();
        self.skeleton
            .skinning(&self.skeleton.pose(motion), &mut self.skinning);
        profile.record(Stage::Kinematics, started.elapsed());

        let started = Instant::now();
        self.inference
            .run(motion, &self.skinning, &mut self.outputs)?;
        profile.record(Stage::Inference, started.elapsed());

        let started = Instant::now();
        if self.posing.skin(&self.outputs, &self.skinning)? {
            profile.record(Stage::Skin, started.elapsed());
        }
        let started = Instant::now();
        let all = 0..self.posing.gaussians();
        self.posing
            .pose(&self.outputs, motion, all, None, &mut self.state)?;
        profile.record(Stage::Bind, started.elapsed());
        Ok(&self.state)
    }

    /// What [`Self::deform`] gave last.
    #[must_use]
    pub fn state(&self) -> &GaussianState {
        &self.state
    }

    /// The session alone, to be used elsewhere.
    pub(crate) fn into_inference(self) -> Inference {
        self.inference
    }

    /// The skeleton that [`Self::deform`] poses.
    #[must_use]
    pub fn skeleton(&self) -> &Skeleton {
        &self.skeleton
    }

    /// Number of Gaussians N_g.
    #[must_use]
    pub fn gaussians(&self) -> usize {
        self.posing.gaussians()
    }

    /// The unit that a stage runs on.
    #[must_use]
    pub fn unit(&self, stage: Stage) -> Unit {
        let inference = unit_of(self.inference.provider().kind());
        self.plan.unit(stage, inference)
    }
}
