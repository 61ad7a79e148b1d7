//! What a trial draws on, and how long each stage takes there.

use super::StageCosts;
use crate::control::Control;
use crate::error::ReceiverError;
use crate::inference::Inference;
use crate::posing::computed;
use crate::profile::Percentiles;
use app_kernels::Blend;
use app_kernels::state::GaussianState;
use renderer_splat::camera::Camera;
use renderer_splat::drawing::{Drawing, Foreground, Part};
use renderer_splat::error::RenderError;
use renderer_splat::motion_bound::MotionBound;
use renderer_splat::posing::{Deformation, PosedInput, StateId};
use renderer_splat::renderer::SplatRenderer;
use renderer_splat::slot::ForegroundSlot;
use spmm3::{Avatar, MotionParams, SkinningTransforms};
use std::time::{Duration, Instant};

/// Frames of each placement that are timed, after one that is not.
pub(super) const FRAMES: usize = 5;
/// No more frames once they took so long together: one frame on an emulated NPU may take half a minute.
pub(super) const LONG_ENOUGH: Duration = Duration::from_secs(1);

/// What states are drawn on, to time what every placement has in common.
pub(super) struct Canvas<'a> {
    pub(super) renderer: &'a mut SplatRenderer,
    pub(super) cameras: &'a [Camera],
    pub(super) control: &'a Control,
    pub(super) pose: MotionParams,
    /// Interpolation and drawing, ms, once they were measured.
    pub(super) times: Option<(f64, f64)>,
}

impl Canvas<'_> {
    /// Interpolation and drawing of a state that the CPU made, ms; measured once.
    pub(super) fn times(&mut self, state: &GaussianState) -> Result<(f64, f64), ReceiverError> {
        if let Some(times) = self.times {
            return Ok(times);
        }
        let control = self.control;
        let room = || -> Result<_, ReceiverError> { Ok(self.renderer.foreground_slot()?) };
        let mut slot = control.on_gpu(room)?;
        let (mut interpolate, mut draw) = (Vec::new(), Vec::new());
        let (mut spent, mut is_warm) = (Duration::ZERO, false);
        while draw.len() < FRAMES && spent <= LONG_ENOUGH {
            let [packing, drawing] = control.on_gpu(|| self.draw_state(&mut slot, state))?;
            if is_warm {
                interpolate.push(ms(packing));
                draw.push(ms(drawing));
                spent += packing + drawing;
            }
            is_warm = self.is_warm();
        }
        let step = control.step();
        drop(slot);
        drop(step);
        let times = (median(&interpolate), median(&draw));
        self.times = Some(times);
        Ok(times)
    }

    /// The first picture is drawn several times, to compare the renderer's back ends; where a pause interrupted that, so is the next.
    fn is_warm(&self) -> bool {
        !self.renderer.is_comparing()
    }

    /// Draws one picture of a state: how long packing it took, and drawing.
    fn draw_state(
        &mut self,
        slot: &mut ForegroundSlot,
        state: &GaussianState,
    ) -> Result<[Duration; 2], ReceiverError> {
        let started = Instant::now();
        let count = u32::try_from(state.len()).unwrap_or(u32::MAX);
        let gaussians = slot.gaussians_mut().get_mut(..state.len());
        let blend = Blend::new(state, state, 0.5)?;
        blend.pack(0..state.len(), gaussians.unwrap_or_default())?;
        slot.set(count, MotionBound::new())?;
        let packed = Instant::now();
        let parts = [Part::here(Foreground::Slot(slot))];
        not_too_costly(self.renderer.draw_with(&Drawing::new(self.cameras, &parts)))?;
        Ok([packed - started, packed.elapsed()])
    }

    /// Times what the device does of a frame, between two states of one pose: with the networks, unless `inference` runs them.
    pub(super) fn try_on_device(
        &mut self,
        avatar: &Avatar,
        mut inference: Option<&mut Inference>,
    ) -> Result<StageCosts, ReceiverError> {
        let control = self.control;
        let pose = self.pose.clone();
        let mut skinning = SkinningTransforms::default();
        let joints = avatar.skeleton.pose(&pose);
        avatar.skeleton.skinning(&joints, &mut skinning);
        let mut outputs = (inference.as_ref())
            .map(|inference| inference.outputs())
            .transpose()?;
        let (mut infer, mut bind, mut interpolate, mut draw) = (vec![], vec![], vec![], vec![]);
        let mut before: Option<StateId> = None;
        let (mut spent, mut is_warm) = (Duration::ZERO, false);
        while draw.len() < FRAMES && spent <= LONG_ENOUGH {
            control.checkpoint()?;
            let started = Instant::now();
            let deformation = match (&mut inference, &mut outputs) {
                (Some(inference), Some(outputs)) => {
                    inference.run(&pose, &skinning, outputs)?;
                    computed(outputs)
                }
                // At ease, within every avatar's range of poses.
                _ => Deformation::Parameters(pose.values()),
            };
            let inferred = started.elapsed();
            let input = PosedInput {
                deformation,
                skinning: &skinning.0,
                root: pose.root_translation.to_array(),
            };
            let drawing = control.on_gpu(|| self.draw_posed(&input, &mut before))?;
            if is_warm {
                let times = self.renderer.stage_times();
                infer.push(ms(inferred) + times.networks);
                bind.push(times.skin + times.attributes);
                interpolate.push(times.interpolate);
                draw.push(ms(drawing) - times.posing());
                spent += drawing;
            }
            is_warm = self.is_warm();
        }
        Ok(StageCosts {
            inference: median(&infer),
            bind: median(&bind),
            interpolate: median(&interpolate),
            draw: median(&draw),
        })
    }

    /// Draws one picture half way from the pose before to this one: how long that took.
    fn draw_posed(
        &mut self,
        input: &PosedInput<'_>,
        before: &mut Option<StateId>,
    ) -> Result<Duration, ReceiverError> {
        let to = self.renderer.push_state(input)?;
        let foreground = Foreground::Posed {
            from: before.replace(to).unwrap_or(to),
            to,
            share: 0.5,
            level: 0,
        };
        let handed = Instant::now();
        not_too_costly(
            self.renderer
                .draw_with(&Drawing::new(self.cameras, &[Part::here(foreground)])),
        )?;
        Ok(handed.elapsed())
    }
}

/// Where a person's Gaussians cover too many tiles, nothing was drawn, for any placement: that is looked after when they are shown.
fn not_too_costly(drawn: Result<(), RenderError>) -> Result<(), RenderError> {
    match drawn {
        Err(error) if error.costly_part().is_some() => Ok(()),
        drawn => drawn,
    }
}

fn median(times: &[f64]) -> f64 {
    Percentiles::of(times).map_or(0.0, |times| times.p50_ms)
}

fn ms(time: Duration) -> f64 {
    time.as_secs_f64() * 1e3
}
