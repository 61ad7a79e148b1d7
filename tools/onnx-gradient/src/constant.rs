//! Small constants that say what an operator does: axes, shapes, exponents.

use onnx_schema::{Node, Tensor, data_type};

/// Numbers of the longest constant that is looked into.
const MOST: usize = 64;

/// Integers or numbers.
#[derive(Debug, Clone, PartialEq)]
pub(crate) enum Constant {
    Ints(Vec<i64>),
    Floats(Vec<f32>),
    /// Whether something is so.
    Truth(bool),
}

impl Constant {
    /// What a stored tensor holds, if it is short and of a kind that operators are told by.
    pub(crate) fn of_tensor(tensor: &Tensor) -> Option<Self> {
        let raw = tensor.raw_data.as_deref().unwrap_or_default();
        if raw.len() > 8 * MOST || tensor.int64_data.len().max(tensor.float_data.len()) > MOST {
            return None;
        }
        let of_raw = |size: usize| raw.chunks_exact(size);
        Some(match tensor.data_type? {
            data_type::INT64 if raw.is_empty() => Self::Ints(tensor.int64_data.clone()),
            data_type::INT64 => Self::Ints(
                of_raw(8)
                    .filter_map(|bytes| bytes.try_into().ok().map(i64::from_le_bytes))
                    .collect(),
            ),
            data_type::FLOAT if raw.is_empty() => Self::Floats(tensor.float_data.clone()),
            data_type::FLOAT => Self::Floats(
                of_raw(4)
                    .filter_map(|bytes| bytes.try_into().ok().map(f32::from_le_bytes))
                    .collect(),
            ),
            data_type::BOOL => match raw {
                [byte] => Self::Truth(*byte != 0),
                _ => return None,
            },
            _ => return None,
        })
    }

    /// What a `Constant` node gives, and the shape of it.
    pub(crate) fn of_node(node: &Node) -> Option<(Option<Self>, Vec<usize>)> {
        let attribute = node.attribute.first()?;
        let (constant, shape) = match attribute.name.as_deref()? {
            "value" => {
                let tensor = attribute.t.as_ref()?;
                return Some((Self::of_tensor(tensor), dims(tensor)?));
            }
            "value_int" => (Self::Ints(vec![attribute.i?]), vec![]),
            "value_ints" => (
                Self::Ints(attribute.ints.clone()),
                vec![attribute.ints.len()],
            ),
            "value_float" => (Self::Floats(vec![attribute.f?]), vec![]),
            "value_floats" => (
                Self::Floats(attribute.floats.clone()),
                vec![attribute.floats.len()],
            ),
            _ => return None,
        };
        Some((Some(constant), shape))
    }
}

/// A stored tensor's shape; nothing if a side is negative.
pub(crate) fn dims(tensor: &Tensor) -> Option<Vec<usize>> {
    let sides = tensor.dims.iter();
    sides.map(|side| usize::try_from(*side).ok()).collect()
}
