//! The part of TensorFlow Lite's schema that converted networks need, read from a file and checked: tensors, operators, inputs, outputs.
//!
//! Source: schema.fbs of TensorFlow, version 3. The numbers of fields are their order there.

use crate::error::ConvertError;
use crate::flatbuffer::Table;

/// Most elements of one tensor: 256 MiB of floats.
const MAX_ELEMENTS: usize = 1 << 26;
const MAX_TENSORS: usize = 1 << 14;
const MAX_OPERATORS: usize = 1 << 13;
const MAX_RANK: usize = 6;
/// Most inputs or outputs of the network or of one operator.
const MAX_PORTS: usize = 256;

/// A network: the file's first subgraph.
#[derive(Debug)]
pub(crate) struct Model<'a> {
    pub(crate) tensors: Vec<Tensor<'a>>,
    pub(crate) operators: Vec<Operator<'a>>,
    /// Indices of tensors.
    pub(crate) inputs: Vec<usize>,
    /// Indices of tensors.
    pub(crate) outputs: Vec<usize>,
}

/// The type of a tensor's elements.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Element {
    Float32,
    Float16,
    Int32,
    /// `TensorType` of the schema.
    Other(u8),
}

/// A tensor: a constant if it has data, else what an operator computes.
#[derive(Debug)]
pub(crate) struct Tensor<'a> {
    /// Outermost dimension first; of pictures: number, height, width, channels.
    pub(crate) shape: Vec<usize>,
    pub(crate) element: Element,
    /// Little-endian; empty if it is no constant.
    pub(crate) data: &'a [u8],
    sparsity: Option<Table<'a>>,
}

/// How a sparse constant's values lie: a tree whose level `k` runs over a dimension.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct Sparsity<'a> {
    /// For each level, the dimension: those of the tensor, then those within blocks.
    pub(crate) order: Vec<usize>,
    /// The dimension of the tensor that each dimension within blocks is a part of.
    pub(crate) blocks: Vec<usize>,
    /// In the order of `order`.
    pub(crate) levels: Vec<Level<'a>>,
}

/// One level of a sparse constant.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) enum Level<'a> {
    /// All of the dimension's indices, as many as this.
    Dense(usize),
    /// Only some: those of parent `p` are `indices[segments[p]..segments[p + 1]]`.
    Sparse {
        segments: Integers<'a>,
        indices: Integers<'a>,
    },
}

/// A list of integers where it lies in the file.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Integers<'a> {
    pub(crate) bytes: &'a [u8],
    /// Bytes of each: 1, 2 or 4.
    pub(crate) size: usize,
}

impl Integers<'_> {
    /// Number `k`; nothing if there is none.
    pub(crate) fn get(&self, k: usize) -> Option<usize> {
        let at = k.checked_mul(self.size)?;
        let bytes = self.bytes.get(at..at.checked_add(self.size)?)?;
        // Little-endian. A negative one becomes too large for any tensor.
        let value = bytes
            .iter()
            .rev()
            .fold(0_u32, |value, byte| value << 8 | u32::from(*byte));
        usize::try_from(value).ok()
    }
}

/// One step of the network.
#[derive(Debug)]
pub(crate) struct Operator<'a> {
    pub(crate) kind: Kind,
    /// Indices of tensors; nothing where an input is left out.
    pub(crate) inputs: Vec<Option<usize>>,
    /// Indices of tensors.
    pub(crate) outputs: Vec<usize>,
    /// Its settings, by the schema's table of its kind.
    pub(crate) options: Option<Table<'a>>,
    /// A custom operator's settings.
    pub(crate) custom: &'a [u8],
}

/// The kinds of operators.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) enum Kind {
    Add,
    AveragePool,
    Concatenation,
    Conv,
    DepthwiseConv,
    DepthToSpace,
    Densify,
    Dequantize,
    Div,
    FullyConnected,
    HardSwish,
    Logistic,
    MaxPool,
    Mean,
    Mul,
    Neg,
    Pad,
    Prelu,
    Relu,
    Relu6,
    Reshape,
    ResizeBilinear,
    Rsqrt,
    Sqrt,
    SquaredDifference,
    StridedSlice,
    Sub,
    Sum,
    Transpose,
    /// MediaPipe's: the transform that cuts a part of the face out.
    LandmarksToTransform,
    /// MediaPipe's: a part of a picture by a transform.
    TransformTensor,
    /// MediaPipe's: landmarks by a transform.
    TransformLandmarks,
    /// Any other, by its name.
    Other(String),
}

impl<'a> Model<'a> {
    /// Reads `bytes` and checks that every index leads to something.
    pub(crate) fn read(bytes: &'a [u8]) -> Result<Self, ConvertError> {
        let root = Table::root(bytes, *b"TFL3")?;
        let kinds = root
            .tables(1, "kinds of operators", 1024)?
            .into_iter()
            .map(kind_of)
            .collect::<Result<Vec<_>, _>>()?;
        let buffers = root.tables(4, "buffers", 2 * MAX_TENSORS)?;
        let graph = root
            .tables(2, "subgraphs", 64)?
            .into_iter()
            .next()
            .ok_or_else(|| ConvertError::damaged("it has no subgraph"))?;
        let tensors = graph
            .tables(0, "tensors", MAX_TENSORS)?
            .into_iter()
            .map(|table| tensor(table, &buffers))
            .collect::<Result<Vec<_>, _>>()?;
        let operators = graph
            .tables(3, "operators", MAX_OPERATORS)?
            .into_iter()
            .map(|table| operator(table, &kinds, tensors.len()))
            .collect::<Result<_, _>>()?;
        let ports = |id| {
            let list = graph.ints(id, MAX_PORTS)?;
            list.into_iter()
                .map(|index| tensor_index(index, tensors.len()))
                .collect::<Result<Vec<_>, _>>()
        };
        Ok(Self {
            inputs: ports(1)?,
            outputs: ports(2)?,
            tensors,
            operators,
        })
    }
}

fn tensor_index(index: i32, tensors: usize) -> Result<usize, ConvertError> {
    usize::try_from(index)
        .ok()
        .filter(|index| *index < tensors)
        .ok_or_else(|| ConvertError::damaged(format!("tensor {index} is used, of {tensors}")))
}

fn non_negative(values: Vec<i32>, what: &str) -> Result<Vec<usize>, ConvertError> {
    values
        .into_iter()
        .map(|value| {
            usize::try_from(value)
                .map_err(|_| ConvertError::damaged(format!("{what} holds {value}")))
        })
        .collect()
}

fn kind_of(table: Table<'_>) -> Result<Kind, ConvertError> {
    // The first field had no room for numbers above 127: newer files write the larger of both.
    let code = i32::from(table.byte(0, 0)?).max(table.int(3, 0)?);
    Ok(match code {
        0 => Kind::Add,
        1 => Kind::AveragePool,
        2 => Kind::Concatenation,
        3 => Kind::Conv,
        4 => Kind::DepthwiseConv,
        5 => Kind::DepthToSpace,
        6 => Kind::Dequantize,
        9 => Kind::FullyConnected,
        14 => Kind::Logistic,
        17 => Kind::MaxPool,
        18 => Kind::Mul,
        19 => Kind::Relu,
        21 => Kind::Relu6,
        22 => Kind::Reshape,
        23 => Kind::ResizeBilinear,
        34 => Kind::Pad,
        39 => Kind::Transpose,
        40 => Kind::Mean,
        41 => Kind::Sub,
        42 => Kind::Div,
        45 => Kind::StridedSlice,
        54 => Kind::Prelu,
        59 => Kind::Neg,
        74 => Kind::Sum,
        75 => Kind::Sqrt,
        76 => Kind::Rsqrt,
        99 => Kind::SquaredDifference,
        117 => Kind::HardSwish,
        124 => Kind::Densify,
        32 => match table.bytes(1)? {
            b"Landmarks2TransformMatrix" => Kind::LandmarksToTransform,
            b"TransformTensorBilinear" => Kind::TransformTensor,
            b"TransformLandmarks" => Kind::TransformLandmarks,
            other => {
                let shown = other.get(..64).unwrap_or(other);
                Kind::Other(format!("custom {}", shown.escape_ascii()))
            }
        },
        code => Kind::Other(format!("BuiltinOperator {code}")),
    })
}

fn tensor<'a>(table: Table<'a>, buffers: &[Table<'a>]) -> Result<Tensor<'a>, ConvertError> {
    let shape = non_negative(table.ints(0, MAX_RANK)?, "a tensor's shape")?;
    // A length of 0 counts as 1: an empty tensor must not have other lengths without bounds.
    let elements = shape
        .iter()
        .try_fold(1_usize, |product, length| {
            product.checked_mul((*length).max(1))
        })
        .filter(|product| *product <= MAX_ELEMENTS);
    if elements.is_none() {
        return Err(ConvertError::TooLarge {
            what: format!("a tensor has the shape {shape:?}"),
            limit: MAX_ELEMENTS,
        });
    }
    let index = table.index(2)?;
    let buffer = buffers.get(index).ok_or_else(|| {
        ConvertError::damaged(format!("buffer {index} is used, of {}", buffers.len()))
    })?;
    if buffer.long(1)? > 1 {
        return Err(ConvertError::TooLarge {
            what: "its constants lie behind the file's structure, as beyond 2 GB".into(),
            limit: 1 << 31,
        });
    }
    Ok(Tensor {
        shape,
        element: match table.byte(1, 0)? {
            0 => Element::Float32,
            1 => Element::Float16,
            2 => Element::Int32,
            other => Element::Other(other),
        },
        data: buffer.bytes(0)?,
        sparsity: table.table(6)?,
    })
}

impl<'a> Tensor<'a> {
    /// How its values lie, if it is sparse.
    pub(crate) fn sparsity(&self) -> Result<Option<Sparsity<'a>>, ConvertError> {
        let Some(table) = self.sparsity else {
            return Ok(None);
        };
        Ok(Some(Sparsity {
            order: non_negative(table.ints(0, 2 * MAX_RANK)?, "a sparse tensor's order")?,
            blocks: non_negative(table.ints(1, MAX_RANK)?, "a sparse tensor's blocks")?,
            levels: table
                .tables(2, "levels of a sparse tensor", 2 * MAX_RANK)?
                .into_iter()
                .map(level)
                .collect::<Result<_, _>>()?,
        }))
    }
}

fn level(table: Table<'_>) -> Result<Level<'_>, ConvertError> {
    if table.byte(0, 0)? == 0 {
        let length = table.int(1, 0)?;
        return usize::try_from(length)
            .map(Level::Dense)
            .map_err(|_| ConvertError::damaged(format!("a sparse level has {length} indices")));
    }
    Ok(Level::Sparse {
        segments: indices(table, 2)?,
        indices: indices(table, 4)?,
    })
}

/// A union `SparseIndexVector`: its type in field `id`, its table in the next.
fn indices(table: Table<'_>, id: usize) -> Result<Integers<'_>, ConvertError> {
    let damaged = || ConvertError::damaged("a sparse tensor lacks its indices");
    let size = match table.byte(id, 0)? {
        1 => 4,
        2 => 2,
        3 => 1,
        _ => return Err(damaged()),
    };
    let values = table.table(id + 1)?.ok_or_else(damaged)?;
    Ok(Integers {
        bytes: values.elements(0, size)?,
        size,
    })
}

fn operator<'a>(
    table: Table<'a>,
    kinds: &[Kind],
    tensors: usize,
) -> Result<Operator<'a>, ConvertError> {
    let index = table.index(0)?;
    let kind = kinds.get(index).ok_or_else(|| {
        ConvertError::damaged(format!("operator kind {index} is used, of {}", kinds.len()))
    })?;
    Ok(Operator {
        kind: kind.clone(),
        inputs: table
            .ints(1, MAX_PORTS)?
            .into_iter()
            .map(|index| match index {
                -1 => Ok(None),
                index => tensor_index(index, tensors).map(Some),
            })
            .collect::<Result<_, _>>()?,
        outputs: table
            .ints(2, MAX_PORTS)?
            .into_iter()
            .map(|index| tensor_index(index, tensors))
            .collect::<Result<_, _>>()?,
        options: table.table(4)?,
        custom: table.bytes(5)?,
    })
}

impl Operator<'_> {
    /// Field `id` of its settings, of 8 bits; zero where it is left out.
    pub(crate) fn byte(&self, id: usize) -> Result<u8, ConvertError> {
        self.options.map_or(Ok(0), |table| table.byte(id, 0))
    }

    /// Field `id` of its settings, of 32 bits; `default` where it is left out.
    pub(crate) fn int(&self, id: usize, default: i32) -> Result<i32, ConvertError> {
        self.options
            .map_or(Ok(default), |table| table.int(id, default))
    }
}
