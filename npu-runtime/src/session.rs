//! One graph, ready to run again and again without allocating tensors.

use crate::{Runtime, RuntimeError};
use ort::memory::Allocator;
use ort::session::IoBinding;
use ort::session::builder::{GraphOptimizationLevel, SessionBuilder};
use ort::value::{Outlet, Tensor, TensorElementType, ValueType};

/// Who runs a session.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Provider {
    /// ONNX Runtime's own CPU kernels on this many threads.
    Cpu {
        /// Threads within one operator, at least 1.
        threads: usize,
    },
}

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
}

/// A graph bound to its own input and output memory.
#[derive(Debug)]
pub struct Session {
    session: ort::session::Session,
    binding: IoBinding,
    inputs: Vec<Tensor<f32>>,
    outputs: Vec<Tensor<f32>>,
    provider: Provider,
}

impl Session {
    /// Loads `model` (an ONNX graph of static shapes), checks that it has exactly `inputs` and `outputs`, and allocates
    /// their memory once.
    ///
    /// # Errors
    /// If ONNX Runtime refuses the graph or its signature differs.
    pub fn new(
        runtime: &Runtime,
        model: &[u8],
        provider: Provider,
        inputs: &[TensorSpec],
        outputs: &[TensorSpec],
    ) -> Result<Self, RuntimeError> {
        let session = builder(runtime, provider)
            .map_err(RuntimeError::Graph)?
            .commit_from_memory(model)
            .map_err(RuntimeError::Graph)?;
        check("input", session.inputs(), inputs)?;
        check("output", session.outputs(), outputs)?;
        let mut binding = session.create_binding().map_err(RuntimeError::Graph)?;
        let inputs = allocate(inputs)?;
        let mut outputs_memory = allocate(outputs)?;
        for (tensor, outlet) in inputs.iter().zip(session.inputs()) {
            binding
                .bind_input(outlet.name(), tensor)
                .map_err(RuntimeError::Graph)?;
        }
        for (tensor, outlet) in outputs_memory.iter_mut().zip(session.outputs()) {
            binding
                .bind_output(outlet.name(), tensor)
                .map_err(RuntimeError::Graph)?;
        }
        Ok(Self {
            session,
            binding,
            inputs,
            outputs: outputs_memory,
            provider,
        })
    }

    /// The memory of input `index` (in the order given to [`Self::new`]), to fill before [`Self::run`].
    pub fn input_mut(&mut self, index: usize) -> &mut [f32] {
        self.inputs
            .get_mut(index)
            .map_or(&mut [], |tensor| tensor.extract_tensor_mut().1)
    }

    /// Runs the graph from the inputs' memory into the outputs'.
    ///
    /// # Errors
    /// [`RuntimeError::Run`] if the provider fails.
    pub fn run(&mut self) -> Result<(), RuntimeError> {
        self.session
            .run_binding(&self.binding)
            .map(drop)
            .map_err(RuntimeError::Run)
    }

    /// Output `index` of the last run (in the order given to [`Self::new`]); zeros before the first.
    #[must_use]
    pub fn output(&self, index: usize) -> &[f32] {
        self.outputs
            .get(index)
            .map_or(&[], |tensor| tensor.extract_tensor().1)
    }

    /// Who runs this session.
    #[must_use]
    pub fn provider(&self) -> Provider {
        self.provider
    }
}

fn builder(runtime: &Runtime, provider: Provider) -> Result<SessionBuilder, ort::Error> {
    let Provider::Cpu { threads } = provider;
    Ok(ort::session::Session::builder(&runtime.environment)?
        .with_optimization_level(GraphOptimizationLevel::Level3)?
        // Spinning would take the cores that sorting, interpolation and a software GPU need between frames.
        .with_intra_op_spinning(false)?
        // Numbers far below any visible effect must not take the slow path of denormal arithmetic.
        .with_flush_to_zero()?
        .with_intra_threads(threads.max(1))?)
}

/// The graph must declare `expected`, in this order, as static FP32 tensors.
fn check(
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

/// Zeroed tensors in ONNX Runtime's own memory, which is what bound outputs must live in.
fn allocate(specs: &[TensorSpec]) -> Result<Vec<Tensor<f32>>, RuntimeError> {
    let one = |spec: &TensorSpec| {
        let mut tensor = Tensor::<f32>::new(&Allocator::default(), spec.shape.clone())?;
        tensor.extract_tensor_mut().1.fill(0.0);
        Ok(tensor)
    };
    specs
        .iter()
        .map(one)
        .collect::<Result<_, ort::Error>>()
        .map_err(RuntimeError::Graph)
}
