//! The shapes of a graph's inputs and outputs, and the memory that runs write into.
//!
//! Outputs are apart from the session, so that a lane can hand a finished set on while it computes the next.

use crate::RuntimeError;
use ort::logging::LogLevel;
use ort::memory::Allocator;
use ort::session::{HasSelectedOutputs, OutputSelector, RunOptions, SessionInputValue};
use ort::value::{DynValue, Outlet, Tensor, TensorElementType, ValueType};
use std::fmt;
use std::sync::Arc;

/// Name and shape of a 32-bit float input or output.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct TensorSpec {
    /// The name in the graph.
    pub name: String,
    /// The static shape, outermost dimension first.
    pub shape: Vec<usize>,
}

impl TensorSpec {
    /// A specification of `name` with `shape`.
    #[must_use]
    pub fn new(name: &str, shape: &[usize]) -> Self {
        Self {
            name: name.to_owned(),
            shape: shape.to_vec(),
        }
    }

    fn describe(&self) -> String {
        format!("float{:?}", self.shape)
    }

    /// A zeroed tensor of this shape.
    fn allocate(&self) -> Result<Tensor<f32>, ort::Error> {
        let mut tensor = Tensor::<f32>::new(&Allocator::default(), self.shape.clone())?;
        tensor.extract_tensor_mut().1.fill(0.0);
        Ok(tensor)
    }
}

/// A set of output tensors, allocated once, that any thread may own while no run writes into it. It fits every session
/// with the outputs of the one that made it, on any provider.
pub struct Outputs {
    specs: Arc<[TensorSpec]>,
    /// Owns the tensors, and names them to ONNX Runtime.
    options: RunOptions<HasSelectedOutputs>,
    /// The same tensors, known once a run has given them back.
    tensors: Vec<DynValue>,
}

impl Outputs {
    pub(crate) fn new(specs: &Arc<[TensorSpec]>) -> Result<Self, ort::Error> {
        let mut selector = OutputSelector::default();
        for spec in specs.iter() {
            selector = selector.preallocate(spec.name.as_str(), spec.allocate()?);
        }
        let mut options = RunOptions::new()?;
        // A session listens to its log while it is made; runs log nothing.
        options.set_log_level(LogLevel::Warning)?;
        Ok(Self {
            specs: Arc::clone(specs),
            options: options.with_outputs(selector),
            tensors: Vec::with_capacity(specs.len()),
        })
    }

    /// Output `index` (in the order given to [`crate::Session::new`]) as the last run into this set left it; empty
    /// before the first run, and if there is no such output.
    #[must_use]
    pub fn get(&self, index: usize) -> &[f32] {
        self.tensors
            .get(index)
            .and_then(|tensor| tensor.try_extract_tensor::<f32>().ok())
            .map_or(&[], |(_, values)| values)
    }

    /// Names and shapes, in order.
    #[must_use]
    pub fn specs(&self) -> &[TensorSpec] {
        &self.specs
    }

    /// Runs `session` into this set. Binding outputs through `ort`'s `IoBinding` would allocate a handle for every
    /// output of every run; selecting them beforehand does not.
    pub(crate) fn fill(
        &mut self,
        session: &mut ort::session::Session,
        inputs: &[SessionInputValue<'static>],
    ) -> Result<(), ort::Error> {
        let mut filled = session.run_with_options::<_, 0>(inputs, &self.options)?;
        if self.tensors.is_empty() {
            let handles = self.specs.iter().map(|spec| filled.remove(&spec.name));
            self.tensors.extend(handles.flatten());
        }
        Ok(())
    }
}

impl fmt::Debug for Outputs {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Outputs")
            .field("specs", &self.specs)
            .finish_non_exhaustive()
    }
}

/// Zeroed tensors as inputs.
pub(crate) fn allocate_inputs(
    specs: &[TensorSpec],
) -> Result<Vec<SessionInputValue<'static>>, ort::Error> {
    specs
        .iter()
        .map(|spec| Ok(SessionInputValue::Owned(spec.allocate()?.into_dyn())))
        .collect()
}

/// The graph must declare `expected`, in this order, as static FP32 tensors.
pub(crate) fn check(
    side: &'static str,
    declared: &[Outlet],
    expected: &[TensorSpec],
) -> Result<(), RuntimeError> {
    for at in 0..declared.len().max(expected.len()) {
        let got = declared
            .get(at)
            .map(|outlet| (outlet.name(), describe(outlet.dtype())));
        let need = expected
            .get(at)
            .map(|spec| (spec.name.as_str(), spec.describe()));
        if got != need {
            let name = need.as_ref().or(got.as_ref()).map_or("", |(name, _)| name);
            let text = |side: Option<&(&str, String)>| {
                side.map_or("absent".into(), |(n, d)| format!("{n}: {d}"))
            };
            return Err(RuntimeError::Signature {
                side,
                name: name.to_owned(),
                got: text(got.as_ref()),
                expected: text(need.as_ref()),
            });
        }
    }
    Ok(())
}

/// A set of outputs that another session made serves if it has the same ones.
pub(crate) fn check_outputs(
    got: &[TensorSpec],
    expected: &[TensorSpec],
) -> Result<(), RuntimeError> {
    if got == expected {
        return Ok(());
    }
    let list = |specs: &[TensorSpec]| {
        let all: Vec<String> = specs
            .iter()
            .map(|spec| format!("{}: {}", spec.name, spec.describe()))
            .collect();
        all.join(", ")
    };
    Err(RuntimeError::Signature {
        side: "output",
        name: "set".into(),
        got: list(got),
        expected: list(expected),
    })
}

fn describe(declared: &ValueType) -> String {
    match declared {
        ValueType::Tensor {
            ty: TensorElementType::Float32,
            shape,
            ..
        } => format!("float{:?}", &shape[..]),
        other => format!("{other:?}"),
    }
}
