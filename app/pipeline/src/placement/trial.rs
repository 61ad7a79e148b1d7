//! The short timed warm-up at the start: every placement that can be had runs a few frames, and the fastest goes on.

use super::canvas::{Canvas, FRAMES, LONG_ENOUGH};
use super::choice::{PREFERRED, contenders};
use super::{Alternative, PlacementReport, StageCosts, choose, predicted_picture_ms};
use crate::compiled_sources::CompiledSources;
use crate::control::Control;
use crate::deform::Deformer;
use crate::error::ReceiverError;
use crate::inference::Inference;
use crate::plan::{PlacementRequest, Plan, unit_of};
use crate::pool::in_own_pool;
use crate::profile::{Profile, StageSummary};
use crate::stage::{Stage, Unit};
use npu_runtime::{Provider, ProviderKind, Runtime};
use renderer_splat::camera::Camera;
use renderer_splat::renderer::SplatRenderer;
use spmm3::{Avatar, at_ease};
use std::sync::Arc;
use std::time::{Duration, Instant};

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
    let with_graph = (found.iter()).flat_map(|availability| {
        let plans = Plan::ALL.into_iter().filter(|plan| plan.graph().is_some());
        plans.map(move |plan| (plan, Some(availability)))
    });
    for (plan, availability) in with_graph.chain([(Plan::GpuAlone, None)]) {
        let kind = availability.map(|availability| availability.provider);
        let mut alternative = Alternative {
            plan,
            provider: kind,
            unit: kind.map_or(Unit::Gpu, unit_of),
            costs: None,
            predicted_ms: None,
            refused: (availability.and_then(|availability| availability.lacking.clone()))
                .or_else(|| not_asked_for(request, plan, kind)),
        };
        let mut kept = None;
        if alternative.refused.is_none() {
            let provider = kind.map(|kind| kind.with_threads(backends.threads));
            match try_one(backends, avatar, plan, provider, &mut canvas) {
                Ok((costs, inference)) => {
                    let ms = predicted_picture_ms(plan, kind, &costs, gpu_is_cpu);
                    alternative.costs = Some(costs);
                    alternative.predicted_ms = Some(ms);
                    kept = inference;
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

/// Why a placement is not tried, as far as the request says.
fn not_asked_for(
    request: PlacementRequest,
    plan: Plan,
    kind: Option<ProviderKind>,
) -> Option<String> {
    let is_other_provider = request.provider.is_some_and(|asked| kind != Some(asked));
    let is_other_plan = request.plan.is_some_and(|asked| asked != plan);
    let why = if is_other_provider {
        "not asked for"
    } else if kind == Some(ProviderKind::Qnn)
        && request.provider.is_none()
        && cfg!(not(target_os = "android"))
    {
        // Its times say nothing, and compiling for it takes half a minute.
        "an emulation here: only where npu=qnn asks for it"
    } else if request.for_several && plan.poses_on_device() {
        "the device poses one person only, and here people come and go"
    } else if is_other_plan {
        "not asked for"
    } else if kind == Some(ProviderKind::Qnn) && request.plan.is_none() && plan != Plan::Npu {
        // Compiled anew for each.
        "the NPU takes the whole graph"
    } else {
        return None;
    };
    Some(why.into())
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
    provider: Option<Provider>,
    canvas: &mut Canvas<'_>,
) -> Result<(StageCosts, Option<Inference>), ReceiverError> {
    let control = canvas.control;
    control.checkpoint()?;
    let (graph, provider) = match (plan.graph(), provider) {
        (Some(graph), Some(provider)) => (graph, provider),
        (None, None) => return Ok((canvas.try_on_device(avatar, None)?, None)),
        _ => return Err(ReceiverError::NoProvider),
    };
    let mut inference = Inference::open(
        backends.runtime,
        avatar,
        graph,
        &[provider],
        backends.compiled,
    )?;
    if plan.poses_on_device() {
        let costs = canvas.try_on_device(avatar, Some(&mut inference))?;
        return Ok((costs, Some(inference)));
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
    Ok((costs, Some(deformer.into_inference())))
}
