//! The short timed warm-up at the start: every placement that can be had runs a few frames, and the fastest goes on.

use super::choice::{PREFERRED, contenders, named};
use super::{Alternative, StageCosts, choose, predicted_picture_ms};
use crate::compiled_sources::CompiledSources;
use crate::control::Control;
use crate::deform::Deformer;
use crate::error::ReceiverError;
use crate::inference::{Inference, ProviderChange};
use crate::plan::{PlacementRequest, Plan, unit_of};
use crate::pool::in_own_pool;
use crate::posing::computed;
use crate::profile::{Percentiles, Profile, StageSummary};
use crate::stage::{Stage, Unit};
use app_kernels::Blend;
use app_kernels::state::GaussianState;
use npu_runtime::{Availability, Landing, Origin, Provider, ProviderKind, Runtime};
use renderer_splat::camera::Camera;
use renderer_splat::drawing::{Drawing, Foreground, Part};
use renderer_splat::error::RenderError;
use renderer_splat::motion_bound::MotionBound;
use renderer_splat::posing::{Deformation, PosedInput, StateId};
use renderer_splat::renderer::SplatRenderer;
use renderer_splat::slot::ForegroundSlot;
use serde::Serialize;
use spmm3::{Avatar, MotionParams, SkinningTransforms, at_ease};
use std::sync::Arc;
use std::time::{Duration, Instant};

/// Frames of each placement that are timed, after one that is not.
const FRAMES: usize = 5;
/// No more frames once they took so long together: one frame on an emulated NPU may take half a minute.
const LONG_ENOUGH: Duration = Duration::from_secs(1);

/// What a machine offers to choose from.
#[derive(Debug, Clone, Copy)]
pub struct InferenceBackends<'a> {
    /// Runs graphs.
    pub runtime: &'a Runtime,
    /// Threads for providers on the CPU.
    pub threads: usize,
    /// From where compiled graphs are taken.
    pub compiled: &'a CompiledSources,
}

/// What was asked for, what was granted, and why.
#[derive(Debug, Clone, Serialize)]
pub struct PlacementReport {
    /// As it was asked for.
    pub requested: String,
    /// How stages are divided now.
    pub plan: Plan,
    /// What runs the graph now; nothing where the device runs the networks.
    pub provider: Option<Provider>,
    /// The unit of every stage.
    pub units: Vec<(Stage, Unit)>,
    /// Why, in a sentence.
    pub reason: String,
    /// All that was to choose from.
    pub alternatives: Vec<Alternative>,
    /// Which providers there are here, and why not others.
    pub providers: Vec<Availability>,
    /// Where the graph's nodes landed ...
    pub landing: Option<Landing>,
    /// ... and which form of the graph runs.
    pub graph: Option<Origin>,
    /// Providers that were given up during the call.
    pub changes: Vec<ProviderChange>,
}

impl PlacementReport {
    /// Takes note of what became of providers: the newest is what runs the graph now.
    pub fn follow(&mut self, changes: Vec<ProviderChange>) {
        if let Some(last) = changes.last() {
            self.provider = Some(last.to);
            self.landing = Some(last.landing.clone());
            self.graph = Some(last.graph);
        }
        self.changes = changes;
        let now = self.units();
        for ((_, unit), now) in self.units.iter_mut().zip(now) {
            *unit = now;
        }
    }

    /// The plan and what runs its graph, as tables name them.
    #[must_use]
    pub fn name(&self) -> String {
        named(self.plan, self.provider)
    }

    /// Whether `alternative` is what was granted.
    #[must_use]
    pub fn is_chosen(&self, alternative: &Alternative) -> bool {
        (alternative.plan, alternative.provider) == (self.plan, self.provider.map(Provider::kind))
    }

    /// The unit of every stage, in the order of [`Stage::ALL`].
    #[must_use]
    pub fn units(&self) -> [Unit; Stage::ALL.len()] {
        let inference = (self.provider).map_or(Unit::Gpu, |provider| unit_of(provider.kind()));
        Stage::ALL.map(|stage| self.plan.unit(stage, inference))
    }

    /// How long the graph took when it was tried.
    #[must_use]
    pub fn inference(&self) -> Option<Duration> {
        Duration::try_from_secs_f64(self.costs()?.inference * 1e-3).ok()
    }

    /// How long the GPU was at a picture at full quality when this placement was tried.
    #[must_use]
    pub fn picture(&self) -> Option<Duration> {
        let costs = self.costs()?;
        let posing = if self.plan.poses_on_device() {
            costs.interpolate
        } else {
            0.0
        };
        Duration::try_from_secs_f64((posing + costs.draw) * 1e-3).ok()
    }

    fn costs(&self) -> Option<StageCosts> {
        (self.alternatives.iter())
            .find(|alternative| self.is_chosen(alternative))?
            .costs
    }
}

/// A placement and the session it rests on.
#[derive(Debug)]
pub struct Placed {
    /// How stages are divided.
    pub plan: Plan,
    /// Runs the graph, if the plan leaves any; has the other providers to fall back on.
    pub inference: Option<Inference>,
    /// What is to be shown of how it came about.
    pub report: PlacementReport,
}

/// Tries what `request` leaves open, with the renderer that is to draw, and takes the fastest. `control` pauses or ends the trials
/// between any two of their steps.
///
/// # Errors
/// If nothing that was asked for can be had; the error of the last thing tried. [`ReceiverError::Left`] if `control` ends the trials.
pub fn place(
    backends: &InferenceBackends<'_>,
    avatar: &Arc<Avatar>,
    renderer: &mut SplatRenderer,
    cameras: &[Camera],
    request: PlacementRequest,
    control: &Control,
) -> Result<Placed, ReceiverError> {
    let runtime = backends.runtime.cancelled_by(control.cancel());
    let backends = InferenceBackends {
        runtime: &runtime,
        ..*backends
    };
    // Kernels run as they will in a lane, on threads that end with the trials.
    in_own_pool("placement", || {
        place_here(&backends, avatar, renderer, cameras, request, control)
    })?
}

/// [`place`] in rayon's current pool.
fn place_here(
    backends: &InferenceBackends<'_>,
    avatar: &Arc<Avatar>,
    renderer: &mut SplatRenderer,
    cameras: &[Camera],
    request: PlacementRequest,
    control: &Control,
) -> Result<Placed, ReceiverError> {
    control.checkpoint()?;
    let poses_one = (request.plan).filter(|plan| request.for_several && plan.poses_on_device());
    if let Some(plan) = poses_one {
        return Err(ReceiverError::PosesOne(plan));
    }
    let found = backends.runtime.probe();
    let gpu_is_cpu = renderer.gpu().info().is_cpu;
    let mut canvas = Canvas {
        renderer,
        cameras,
        control,
        pose: at_ease(&avatar.skeleton),
        times: None,
    };
    let mut alternatives = Vec::new();
    let mut open = Vec::new();
    let mut last_error = None;
    for availability in &found {
        let kind = availability.provider;
        let not_to_be_tried = availability
            .lacking
            .clone()
            .or_else(|| not_asked_for(request, kind));
        for plan in Plan::ALL.into_iter().filter(|plan| plan.graph().is_some()) {
            let mut alternative = Alternative {
                plan,
                provider: Some(kind),
                unit: unit_of(kind),
                costs: None,
                predicted_ms: None,
                refused: not_to_be_tried
                    .clone()
                    .or_else(|| plan_not_asked_for(request, plan, Some(kind))),
            };
            let mut kept = None;
            if alternative.refused.is_none() {
                match try_one(
                    backends,
                    avatar,
                    plan,
                    kind.with_threads(backends.threads),
                    &mut canvas,
                ) {
                    Ok((costs, inference)) => {
                        let ms = predicted_picture_ms(plan, Some(kind), &costs, gpu_is_cpu);
                        alternative.costs = Some(costs);
                        alternative.predicted_ms = Some(ms);
                        kept = Some(inference);
                    }
                    // A cancelled load is no refusal.
                    Err(_) if control.is_leaving() => return Err(ReceiverError::Left),
                    Err(error) => {
                        alternative.refused = Some(error.in_full());
                        last_error = Some(error);
                    }
                }
            }
            alternatives.push(alternative);
            open.push(kept);
            // The memory of the sessions that can no longer be chosen is wanted.
            let contenders = contenders(&alternatives);
            for (at, session) in open.iter_mut().enumerate() {
                if !contenders.contains(&Some(at)) {
                    *session = None;
                }
            }
        }
    }
    let mut alone = Alternative {
        plan: Plan::GpuAlone,
        provider: None,
        unit: Unit::Gpu,
        costs: None,
        predicted_ms: None,
        refused: (request.provider)
            .map(|_| "not asked for".into())
            .or_else(|| plan_not_asked_for(request, Plan::GpuAlone, None)),
    };
    if alone.refused.is_none() {
        match canvas.try_on_device(avatar, None) {
            Ok(costs) => {
                let ms = predicted_picture_ms(alone.plan, None, &costs, gpu_is_cpu);
                alone.costs = Some(costs);
                alone.predicted_ms = Some(ms);
            }
            Err(_) if control.is_leaving() => return Err(ReceiverError::Left),
            Err(error) => {
                alone.refused = Some(error.in_full());
                last_error = Some(error);
            }
        }
    }
    alternatives.push(alone);
    open.push(None);
    let Some(at) = choose(&alternatives) else {
        return Err(last_error.unwrap_or(ReceiverError::NoProvider));
    };
    let Some(chosen) = alternatives.get(at) else {
        return Err(ReceiverError::NoProvider);
    };
    let mut inference = open.into_iter().nth(at).flatten();
    if inference.is_none() && chosen.provider.is_some() {
        return Err(ReceiverError::NoProvider);
    }
    if let Some(inference) = &mut inference {
        fall_back(inference, chosen, &alternatives, backends.threads);
    }
    let report = PlacementReport {
        requested: request.to_string(),
        plan: chosen.plan,
        provider: inference.as_ref().map(Inference::provider),
        units: Stage::ALL
            .into_iter()
            .map(|stage| (stage, chosen.plan.unit(stage, chosen.unit)))
            .collect(),
        reason: reason(chosen, &alternatives),
        landing: (inference.as_ref()).map(|inference| inference.landing().0.clone()),
        graph: inference.as_ref().map(|inference| inference.landing().1),
        changes: Vec::new(),
        alternatives,
        providers: found,
    };
    Ok(Placed {
        plan: report.plan,
        inference,
        report,
    })
}

/// Has the other providers of the same plan to fall back on, the fastest first, and says what a run of the chosen one takes.
fn fall_back(
    inference: &mut Inference,
    chosen: &Alternative,
    alternatives: &[Alternative],
    threads: usize,
) {
    let mut spare: Vec<&Alternative> = alternatives
        .iter()
        .filter(|one| one.predicted_ms.is_some() && one.provider != chosen.provider)
        .filter(|one| one.plan == chosen.plan)
        .collect();
    let predicted = |one: &Alternative| one.predicted_ms.unwrap_or(f64::INFINITY);
    spare.sort_by(|a, b| predicted(a).total_cmp(&predicted(b)));
    for kind in spare.into_iter().filter_map(|one| one.provider) {
        inference.fall_back_on(kind.with_threads(threads));
    }
    // The one that is always there comes last, measured or not; also anew after itself.
    inference.fall_back_on(ProviderKind::Cpu.with_threads(threads));
    if let Some(costs) = chosen.costs {
        inference.expect(Duration::from_secs_f64(costs.inference.max(0.0) / 1e3));
    }
}

fn not_asked_for(request: PlacementRequest, kind: ProviderKind) -> Option<String> {
    match request.provider {
        Some(asked) if asked == kind => None,
        Some(_) => Some("not asked for".into()),
        // Its times say nothing, and compiling for it takes half a minute.
        None if kind == ProviderKind::Qnn && cfg!(not(target_os = "android")) => {
            Some("an emulation here: only where npu=qnn asks for it".into())
        }
        None => None,
    }
}

fn plan_not_asked_for(
    request: PlacementRequest,
    plan: Plan,
    kind: Option<ProviderKind>,
) -> Option<String> {
    match request.plan {
        _ if request.for_several && plan.poses_on_device() => {
            Some("the device poses one person only, and here people come and go".into())
        }
        Some(asked) if asked == plan => None,
        Some(_) => Some("not asked for".into()),
        // Compiled anew for each.
        None if kind == Some(ProviderKind::Qnn) && plan != Plan::Npu => {
            Some("the NPU takes the whole graph".into())
        }
        None => None,
    }
}

fn reason(chosen: &Alternative, alternatives: &[Alternative]) -> String {
    let mut others: Vec<&Alternative> = alternatives
        .iter()
        .filter(|one| one.predicted_ms.is_some() && *one != chosen)
        .collect();
    others.sort_by(|a, b| {
        let ms = |one: &Alternative| one.predicted_ms.unwrap_or(f64::INFINITY);
        ms(a).total_cmp(&ms(b))
    });
    let ms = |one: &Alternative| one.predicted_ms.unwrap_or_default();
    match others.first() {
        None => "nothing else can be had of what was asked for".into(),
        Some(next) if ms(next) < ms(chosen) => format!(
            "{:.1} ms a picture is predicted, as good as {} with {:.1} ms: then plan {PREFERRED} goes first",
            ms(chosen),
            next.name(),
            ms(next),
        ),
        Some(next) => format!(
            "{:.1} ms a picture is predicted, {} would take {:.1} ms",
            ms(chosen),
            next.name(),
            ms(next),
        ),
    }
}

/// Runs a placement and times its stages.
fn try_one(
    backends: &InferenceBackends<'_>,
    avatar: &Arc<Avatar>,
    plan: Plan,
    provider: Provider,
    canvas: &mut Canvas<'_>,
) -> Result<(StageCosts, Inference), ReceiverError> {
    let control = canvas.control;
    control.checkpoint()?;
    let graph = plan.graph().ok_or(ReceiverError::NoProvider)?;
    let mut inference = Inference::open(
        backends.runtime,
        avatar,
        graph,
        &[provider],
        backends.compiled,
    )?;
    if plan.poses_on_device() {
        let costs = canvas.try_on_device(avatar, Some(&mut inference))?;
        return Ok((costs, inference));
    }
    let mut deformer = Deformer::new(avatar, inference, plan)?;
    let mut profile = Profile::default();
    let mut spent = Duration::ZERO;
    for frame in 0..=FRAMES {
        control.checkpoint()?;
        let started = Instant::now();
        deformer.deform(&canvas.pose, &mut profile)?;
        spent += started.elapsed();
        if spent > LONG_ENOUGH {
            break;
        }
        if frame == 0 {
            profile.clear();
        }
    }
    let rows = profile.summary(|_| Unit::Cpu);
    let took = |stage: Stage| {
        let row: Option<&StageSummary> = rows.iter().find(|row| row.stage == stage);
        row.map_or(0.0, |row| row.times.p50_ms)
    };
    let (interpolate, draw) = canvas.times(deformer.state())?;
    let costs = StageCosts {
        inference: took(Stage::Inference),
        bind: took(Stage::Skin) + took(Stage::Bind),
        interpolate,
        draw,
    };
    Ok((costs, deformer.into_inference()))
}

/// What states are drawn on, to time what every placement has in common.
struct Canvas<'a> {
    renderer: &'a mut SplatRenderer,
    cameras: &'a [Camera],
    control: &'a Control,
    pose: MotionParams,
    /// Interpolation and drawing, ms, once they were measured.
    times: Option<(f64, f64)>,
}

impl Canvas<'_> {
    fn times(&mut self, state: &GaussianState) -> Result<(f64, f64), ReceiverError> {
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
    fn try_on_device(
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
