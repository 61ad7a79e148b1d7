//! The deform graph, or a part of it, on the first of several providers that runs it, and on the next when that one fails.

use crate::compiled_sources::CompiledSources;
use crate::error::ReceiverError;
use npu_runtime::{
    Graph, Landing, Origin, Outputs, Provider, ProviderKind, Runtime, Session, TensorSpec,
};
use serde::Serialize;
use spmm3::networks::{Dialect, GraphParts, Port};
use spmm3::{Avatar, MotionParams, SkinningTransforms};
use std::sync::atomic::{AtomicBool, Ordering::Relaxed};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

const MOTION: usize = 0;
const SKINNING: usize = 1;

/// A session, and what to do without it.
#[derive(Debug)]
pub struct Inference {
    runtime: Runtime,
    avatar: Arc<Avatar>,
    graph: GraphParts,
    session: Session,
    /// To go on with, the best last.
    spare: Vec<Provider>,
    compiled: CompiledSources,
    fault: Fault,
    changes: ProviderChanges,
    /// How long a run was measured to take, and how many have taken too long on end.
    expected: Option<Duration>,
    slow_runs: u32,
}

/// A provider was replaced by another.
#[derive(Debug, Clone, Serialize)]
pub struct ProviderChange {
    /// What ran the graph ...
    pub from: Provider,
    /// ... and what does since.
    pub to: Provider,
    /// Where the graph's nodes landed there, and which form of it runs.
    pub landing: Landing,
    /// See [`Origin`].
    pub graph: Origin,
    /// What was wrong with the one before.
    pub reason: String,
}

/// What became of providers, for who watches from outside.
#[derive(Debug, Clone, Default)]
pub struct ProviderChanges(Arc<Mutex<Vec<ProviderChange>>>);

impl ProviderChanges {
    /// All so far, in order.
    #[must_use]
    pub fn all(&self) -> Vec<ProviderChange> {
        self.0
            .lock()
            .unwrap_or_else(PoisonError::into_inner)
            .clone()
    }

    fn note(&self, change: ProviderChange) {
        (self.0.lock().unwrap_or_else(PoisonError::into_inner)).push(change);
    }
}

/// A provider that takes this many times as long as it was measured to take, for so many runs on end, and too long for motion
/// at 30 Hz, has degraded: chips throttle.
const DEGRADED: u32 = 2;
const DEGRADED_RUNS: u32 = 90;
const MOTION_PERIOD: Duration = Duration::from_millis(33);

/// Makes a session fail at its next run: for tests of what must come after.
#[derive(Debug, Clone, Default)]
pub struct Fault(Arc<AtomicBool>);

impl Fault {
    /// Strikes once.
    pub fn strike(&self) {
        self.0.store(true, Relaxed);
    }
}

impl Inference {
    /// Loads the avatar's graph for the first of `providers`; the others are for when that one fails. Compiled graphs are
    /// taken from `compiled`.
    ///
    /// # Errors
    /// If there are none, or the first does not take the graph.
    pub fn open(
        runtime: &Runtime,
        avatar: &Arc<Avatar>,
        graph: GraphParts,
        providers: &[Provider],
        compiled: &CompiledSources,
    ) -> Result<Self, ReceiverError> {
        let (first, spare) = providers.split_first().ok_or(ReceiverError::NoProvider)?;
        Ok(Self {
            runtime: runtime.clone(),
            avatar: Arc::clone(avatar),
            graph,
            session: session(runtime, avatar, graph, *first, compiled)?,
            spare: spare.iter().rev().copied().collect(),
            compiled: compiled.clone(),
            fault: Fault::default(),
            changes: ProviderChanges::default(),
            expected: None,
            slow_runs: 0,
        })
    }

    /// Memory for one run's results: vertices, and residuals or potentials.
    ///
    /// # Errors
    /// If there is none.
    pub fn outputs(&self) -> Result<Outputs, ReceiverError> {
        Ok(self.session.outputs()?)
    }

    /// Runs the graph. When its provider fails, goes on with the next one, which takes as long as loading the graph does; when it
    /// has degraded, likewise after this run. Says so in the log and in [`Self::changes`].
    ///
    /// # Errors
    /// The last provider's.
    pub fn run(
        &mut self,
        motion: &MotionParams,
        skinning: &SkinningTransforms,
        outputs: &mut Outputs,
    ) -> Result<(), ReceiverError> {
        let begun = Instant::now();
        while let Err(error) = self.run_once(motion, skinning, outputs) {
            let Some(next) = self.spare.pop() else {
                return Err(error);
            };
            // If the next is not to be had either, the old one is tried once more, and then the one after.
            self.replace(next, &error.in_full());
        }
        self.watch(begun.elapsed());
        Ok(())
    }

    fn watch(&mut self, took: Duration) {
        let Some(expected) = self.expected else {
            return;
        };
        if took <= (expected * DEGRADED).max(MOTION_PERIOD) {
            self.slow_runs = 0;
            return;
        }
        self.slow_runs += 1;
        let present = self.session.provider().kind();
        if self.slow_runs >= DEGRADED_RUNS
            && let Some(next) = self.spare.pop_if(|next| next.kind() != present)
        {
            let (took, expected) = (took.as_millis(), expected.as_millis());
            self.replace(next, &format!("a run takes {took} ms, not {expected}"));
        }
    }

    fn replace(&mut self, next: Provider, reason: &str) {
        let from = self.session.provider();
        log::warn!("{from} is given up for {next}: {reason}");
        self.expected = None;
        self.slow_runs = 0;
        match session(
            &self.runtime,
            &self.avatar,
            self.graph,
            next,
            &self.compiled,
        ) {
            Ok(session) => {
                self.changes.note(ProviderChange {
                    from,
                    to: next,
                    landing: session.landing().clone(),
                    graph: session.origin(),
                    reason: reason.to_owned(),
                });
                self.session = session;
            }
            Err(error) => log::warn!("{next} cannot be had: {}", error.in_full()),
        }
    }

    /// What became of providers since the start.
    #[must_use]
    pub fn changes(&self) -> ProviderChanges {
        self.changes.clone()
    }

    /// Holds further runs against how long one was measured to take.
    pub fn expect(&mut self, a_run: Duration) {
        self.expected = Some(a_run);
    }

    fn run_once(
        &mut self,
        motion: &MotionParams,
        skinning: &SkinningTransforms,
        outputs: &mut Outputs,
    ) -> Result<(), ReceiverError> {
        if self.fault.0.swap(false, Relaxed) {
            return Err(ReceiverError::Struck);
        }
        (self.avatar).networks_see(motion, self.session.input_mut(MOTION));
        if self.graph != GraphParts::Networks {
            self.session
                .input_mut(SKINNING)
                .copy_from_slice(&skinning.0);
        }
        Ok(self.session.run(outputs)?)
    }

    /// Has another provider for when those there are have failed.
    pub fn fall_back_on(&mut self, provider: Provider) {
        self.spare.insert(0, provider);
    }

    /// What computes at present.
    #[must_use]
    pub fn provider(&self) -> Provider {
        self.session.provider()
    }

    /// Where its nodes landed, and which form of the graph it runs.
    #[must_use]
    pub fn landing(&self) -> (&Landing, Origin) {
        (self.session.landing(), self.session.origin())
    }

    /// A way to make it fail.
    #[must_use]
    pub fn fault(&self) -> Fault {
        self.fault.clone()
    }
}

fn session(
    runtime: &Runtime,
    avatar: &Avatar,
    graph: GraphParts,
    provider: Provider,
    compiled: &CompiledSources,
) -> Result<Session, ReceiverError> {
    let ports = graph.ports(&avatar.graph_sizes()?);
    let specs = |ports: &[Port]| -> Vec<TensorSpec> {
        let spec = |(name, shape): &Port| TensorSpec::new(name, shape);
        ports.iter().map(spec).collect()
    };
    let dialect = match provider.kind() {
        ProviderKind::Nnapi => Dialect::Nnapi,
        ProviderKind::Qnn | ProviderKind::Xnnpack | ProviderKind::Cpu => Dialect::Package,
    };
    let onnx = avatar.graph(graph, dialect)?;
    let precompiled = compiled.of_package(avatar, graph, provider);
    let form = Graph {
        onnx: &onnx,
        precompiled: &precompiled,
        cache: compiled.cache.as_deref(),
    };
    Ok(Session::new(
        runtime,
        form,
        provider,
        &specs(&ports.inputs),
        &specs(&ports.outputs),
    )?)
}
