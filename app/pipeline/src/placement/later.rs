//! Placing the stages of who joins while others are shown: as theirs, without trials, which would hold up everyone's pictures.

use super::{InferenceBackends, Placed, PlacementReport};
use crate::control::Control;
use crate::error::ReceiverError;
use crate::inference::Inference;
use crate::plan::{Plan, unit_of};
use crate::stage::Stage;
use npu_runtime::ProviderKind;
use spmm3::Avatar;
use std::sync::Arc;

/// Places the stages of `avatar` as those of another person, `like`, who is shown on the same device; on the host where theirs are on the device, which
/// poses one person only. Opens the graph's session, and draws nothing.
///
/// # Errors
/// If the provider cannot take this avatar's graph. [`ReceiverError::Left`] if `control` ends it.
pub fn place_like(
    backends: &InferenceBackends<'_>,
    avatar: &Arc<Avatar>,
    like: &PlacementReport,
    control: &Control,
) -> Result<Placed, ReceiverError> {
    control.checkpoint()?;
    let runtime = backends.runtime.cancelled_by(control.cancel());
    let plan = if like.plan.poses_on_device() {
        Plan::Cpu
    } else {
        like.plan
    };
    let provider = (like.provider).unwrap_or(ProviderKind::Cpu.with_threads(backends.threads));
    let graph = plan.graph().ok_or(ReceiverError::NoProvider)?;
    let mut inference = Inference::open(&runtime, avatar, graph, &[provider], backends.compiled)?;
    inference.fall_back_on(ProviderKind::Cpu.with_threads(backends.threads));
    if let (Some(expected), Some(_)) = (like.inference(), like.provider) {
        inference.expect(expected);
    }
    let (landing, graph) = inference.landing();
    let unit = unit_of(provider.kind());
    let report = PlacementReport {
        requested: like.requested.clone(),
        plan,
        provider: Some(inference.provider()),
        units: Stage::ALL
            .into_iter()
            .map(|stage| (stage, plan.unit(stage, unit)))
            .collect(),
        reason: "as the one who was here before".to_owned(),
        alternatives: Vec::new(),
        providers: like.providers.clone(),
        landing: Some(landing.clone()),
        graph: Some(graph),
        changes: Vec::new(),
    };
    Ok(Placed {
        plan,
        inference: Some(inference),
        report,
    })
}
