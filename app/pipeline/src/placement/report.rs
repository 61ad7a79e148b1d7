//! What was placed where, for those who ask why.

use super::choice::named;
use super::{Alternative, StageCosts};
use crate::inference::ProviderChange;
use crate::plan::{Plan, unit_of};
use crate::stage::{Stage, Unit};
use npu_runtime::{Availability, Landing, Origin, Provider};
use serde::Serialize;
use std::time::Duration;

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
