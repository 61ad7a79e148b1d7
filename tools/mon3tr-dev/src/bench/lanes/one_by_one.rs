//! The yardstick for lanes: one thread that does what they do, one step after the other.

use super::turn::{Scene, WARM_UP};
use anyhow::{Context, ensure};
use app_kernels::Blend;
use app_kernels::state::GaussianState;
use app_pipeline::deform::Deformer;
use app_pipeline::inference::Inference;
use app_pipeline::placement::StageCosts;
use app_pipeline::posing::computed;
use app_pipeline::profile::{Percentiles, Profile};
use app_pipeline::stage::Stage;
use mon3tr::performance::MOTION_RATE;
use npu_runtime::Outputs;
use renderer_splat::camera::Camera;
use renderer_splat::drawing::{Drawing, Foreground, Part};
use renderer_splat::motion_bound::MotionBound;
use renderer_splat::posing::{Deformation, PosedInput, StateId};
use renderer_splat::renderer::SplatRenderer;
use renderer_splat::slot::ForegroundSlot;
use spmm3::{MotionParams, Skeleton, SkinningTransforms};
use std::time::Instant;

/// Nearly the newer state: the work is that of any place between two.
const SHARE: f32 = 0.99;

/// What a turn took.
#[derive(Debug)]
pub(super) struct OneByOne {
    pub(super) picture_ms: f64,
    pub(super) kinematics_ms: f64,
    /// Medians of each stage, which nothing disturbed.
    pub(super) costs: StageCosts,
}

/// Milliseconds, as they were taken.
#[derive(Debug, Default)]
struct Samples {
    kinematics: Vec<f64>,
    inference: Vec<f64>,
    bind: Vec<f64>,
    interpolate: Vec<f64>,
    draw: Vec<f64>,
}

/// Where Gaussians are made.
#[expect(
    clippy::large_enum_variant,
    reason = "there is one, and it stays where it is"
)]
enum Maker {
    Host {
        deformer: Deformer,
        before: GaussianState,
        slot: ForegroundSlot,
    },
    Device {
        /// Nothing where the device runs the networks.
        inference: Option<(Inference, Outputs)>,
        skeleton: Skeleton,
        skinning: SkinningTransforms,
        states: Option<[StateId; 2]>,
    },
}

impl Scene<'_> {
    /// Deforms when a motion frame is due, interpolates and draws for every picture.
    pub(super) fn one_by_one(&self) -> anyhow::Result<OneByOne> {
        let mut renderer = self.renderer()?;
        let first = self.frames.first().context("a motion without frames")?;
        let mut maker = Maker::new(self, &renderer, first)?;
        let mut samples = Samples::default();
        let start = Instant::now();
        let mut measuring: Option<Instant> = None;
        let mut taken = None;
        let mut motion = first;
        loop {
            let begun = Instant::now();
            let passed = begun - start;
            if measuring.is_none() && passed >= WARM_UP {
                measuring = Some(begun);
                samples = Samples::default();
            }
            if measuring.is_some_and(|since| begun - since >= self.seconds) {
                break;
            }
            #[expect(
                clippy::cast_possible_truncation,
                clippy::cast_sign_loss,
                reason = "a turn takes seconds"
            )]
            let due = (passed.as_secs_f64() * MOTION_RATE) as usize;
            if taken != Some(due) {
                taken = Some(due);
                motion = self.frames.get(due % self.frames.len()).unwrap_or(first);
                maker.deform(&mut renderer, motion, &mut samples)?;
            }
            maker.draw(&mut renderer, &self.cameras(motion), &mut samples)?;
        }
        let lasted = measuring.map_or(0.0, ms);
        let pictures = samples.draw.len();
        ensure!(
            pictures > 0,
            "no picture in {lasted:.0} ms: measure for longer"
        );
        let middle = |times: &[f64]| Percentiles::of(times).map_or(0.0, |times| times.p50_ms);
        Ok(OneByOne {
            picture_ms: lasted / pictures as f64,
            kinematics_ms: middle(&samples.kinematics),
            costs: StageCosts {
                inference: middle(&samples.inference),
                bind: middle(&samples.bind),
                interpolate: middle(&samples.interpolate),
                draw: middle(&samples.draw),
            },
        })
    }
}

impl Maker {
    fn new(
        scene: &Scene<'_>,
        renderer: &SplatRenderer,
        first: &MotionParams,
    ) -> anyhow::Result<Self> {
        let inference = scene.inference()?;
        if scene.plan.poses_on_device() {
            let with_outputs = |inference: Inference| -> anyhow::Result<_> {
                let outputs = inference.outputs()?;
                Ok((inference, outputs))
            };
            return Ok(Self::Device {
                inference: inference.map(with_outputs).transpose()?,
                skeleton: scene.avatar.skeleton.clone(),
                skinning: SkinningTransforms::default(),
                states: None,
            });
        }
        let inference = inference.context("the plan leaves no graph")?;
        let mut deformer = Deformer::new(scene.avatar, inference, scene.plan)?;
        let before = deformer.deform(first, &mut Profile::default())?.clone();
        Ok(Self::Host {
            deformer,
            before,
            slot: renderer.foreground_slot()?,
        })
    }

    fn deform(
        &mut self,
        renderer: &mut SplatRenderer,
        motion: &MotionParams,
        samples: &mut Samples,
    ) -> anyhow::Result<()> {
        match self {
            Self::Host { deformer, .. } => {
                let mut profile = Profile::default();
                deformer.deform(motion, &mut profile)?;
                let rows = profile.summary(|stage| stage.legal_units()[0]);
                let took = |stage: Stage| {
                    let row = rows.iter().find(|row| row.stage == stage);
                    row.map_or(0.0, |row| row.times.p50_ms)
                };
                samples.kinematics.push(took(Stage::Kinematics));
                samples.inference.push(took(Stage::Inference));
                samples.bind.push(took(Stage::Skin) + took(Stage::Bind));
            }
            Self::Device {
                inference,
                skeleton,
                skinning,
                states,
            } => {
                let posing = Instant::now();
                skeleton.skinning(&skeleton.pose(motion), skinning);
                samples.kinematics.push(ms(posing));
                let inferring = Instant::now();
                let deformation = match inference {
                    Some((inference, outputs)) => {
                        inference.run(motion, skinning, outputs)?;
                        samples.inference.push(ms(inferring));
                        computed(outputs)
                    }
                    None => Deformation::Parameters(motion.values()),
                };
                let newest = renderer.push_state(&PosedInput {
                    deformation,
                    skinning: &skinning.0,
                    root: motion.root_translation.to_array(),
                })?;
                *states = Some([states.map_or(newest, |[_, before]| before), newest]);
            }
        }
        Ok(())
    }

    fn draw(
        &mut self,
        renderer: &mut SplatRenderer,
        cameras: &[Camera],
        samples: &mut Samples,
    ) -> anyhow::Result<()> {
        match self {
            Self::Host {
                deformer,
                before,
                slot,
            } => {
                let interpolating = Instant::now();
                let state = deformer.state();
                let out = slot.gaussians_mut().get_mut(..state.len());
                Blend::new(before, state, SHARE)?.pack(0..state.len(), out.unwrap_or_default())?;
                slot.set(u32::try_from(state.len())?, MotionBound::new())?;
                samples.interpolate.push(ms(interpolating));
                let drawing = Instant::now();
                renderer.draw_with(&Drawing::new(
                    cameras,
                    &[Part::here(Foreground::Slot(slot))],
                ))?;
                samples.draw.push(ms(drawing));
            }
            Self::Device { states, .. } => {
                let [from, to] = states.context("drawn before the first state")?;
                let drawing = Instant::now();
                let foreground = Foreground::Posed {
                    from,
                    to,
                    share: SHARE,
                    level: 0,
                };
                renderer.draw_with(&Drawing::new(cameras, &[Part::here(foreground)]))?;
                let whole = ms(drawing);
                let times = renderer.stage_times();
                let bind = times.skin + times.attributes;
                if times.networks > 0.0 {
                    samples.inference.push(times.networks);
                }
                // Only pictures after a new state make one.
                if bind > 0.0 {
                    samples.bind.push(bind);
                }
                samples.interpolate.push(times.interpolate);
                samples.draw.push(whole - times.posing());
            }
        }
        Ok(())
    }
}

fn ms(since: Instant) -> f64 {
    since.elapsed().as_secs_f64() * 1e3
}
