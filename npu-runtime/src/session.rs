//! One graph, ready to run again and again without allocating.

use crate::commit::{Committed, commit};
use crate::tensors::{allocate_inputs, check, check_outputs};
use crate::{Graph, Landing, Origin, Outputs, Provider, Runtime, RuntimeError, TensorSpec};
use ort::session::SessionInputValue;
use std::fmt;
use std::sync::Arc;

/// A graph with its inputs' memory. What a run gives goes into [`Outputs`], which are the caller's.
pub struct Session {
    session: ort::session::Session,
    inputs: Vec<SessionInputValue<'static>>,
    outputs: Arc<[TensorSpec]>,
    provider: Provider,
    landing: Landing,
    origin: Origin,
}

impl Session {
    /// Loads `graph` for `provider`, checks that it has exactly `inputs` and `outputs`, and allocates the inputs' memory
    /// once. QNN takes a form of the graph compiled for its target where there is one, in `graph` or in its cache, and
    /// compiles else, which takes seconds.
    ///
    /// # Errors
    /// [`RuntimeError::Unavailable`] if the provider is not available here, [`RuntimeError::Refused`] if a provider that
    /// must run everything does not take all of the graph, and others if ONNX Runtime refuses the graph or its
    /// signature differs.
    pub fn new<'g>(
        runtime: &Runtime,
        graph: impl Into<Graph<'g>>,
        provider: Provider,
        inputs: &[TensorSpec],
        outputs: &[TensorSpec],
    ) -> Result<Self, RuntimeError> {
        let Committed {
            session,
            landing,
            origin,
        } = commit(runtime, &graph.into(), provider)?;
        log::debug!("a session on {provider} ({origin:?}): {landing}");
        check("input", session.inputs(), inputs)?;
        check("output", session.outputs(), outputs)?;
        Ok(Self {
            session,
            inputs: allocate_inputs(inputs).map_err(RuntimeError::Graph)?,
            outputs: outputs.into(),
            provider,
            landing,
            origin,
        })
    }

    /// The memory of input `index` (in the order given to [`Self::new`]), to fill before [`Self::run`]; empty if there is
    /// no such input.
    pub fn input_mut(&mut self, index: usize) -> &mut [f32] {
        match self.inputs.get_mut(index) {
            Some(SessionInputValue::Owned(tensor)) => tensor
                .try_extract_tensor_mut::<f32>()
                .map_or(&mut [], |(_, values)| values),
            _ => &mut [],
        }
    }

    /// A new set of this session's outputs, to run into.
    ///
    /// # Errors
    /// [`RuntimeError::Run`] if there is no memory for it.
    pub fn outputs(&self) -> Result<Outputs, RuntimeError> {
        Outputs::new(&self.outputs).map_err(RuntimeError::Run)
    }

    /// Runs the graph from the inputs' memory into `outputs`. Allocates nothing but what the provider does inside itself.
    ///
    /// # Errors
    /// [`RuntimeError::Run`] if the provider fails, [`RuntimeError::Signature`] if `outputs` are those of another graph.
    pub fn run(&mut self, outputs: &mut Outputs) -> Result<(), RuntimeError> {
        check_outputs(outputs.specs(), &self.outputs)?;
        outputs
            .fill(&mut self.session, &self.inputs)
            .map_err(RuntimeError::Run)
    }

    /// The provider that runs this session.
    #[must_use]
    pub fn provider(&self) -> Provider {
        self.provider
    }

    /// Where ONNX Runtime placed the graph's nodes.
    #[must_use]
    pub fn landing(&self) -> &Landing {
        &self.landing
    }

    /// Which form of the graph this session runs.
    #[must_use]
    pub fn origin(&self) -> Origin {
        self.origin
    }
}

impl fmt::Debug for Session {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Session")
            .field("provider", &self.provider)
            .field("landing", &self.landing)
            .field("origin", &self.origin)
            .field("outputs", &self.outputs)
            .finish_non_exhaustive()
    }
}
