//! A constant's values, in 32-bit floats, and their order.

use crate::error::ConvertError;
use crate::model::{Element, Tensor};
use crate::sparse::densify;
use half::f16;

/// Most integers of one list: settings of operators, at most two for each dimension.
const MAX_INTEGERS: usize = 64;

/// Values with their shape, outermost dimension first.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Array {
    pub(crate) shape: Vec<usize>,
    pub(crate) values: Vec<f32>,
}

impl Array {
    /// The values of the constant `tensor`: 32-bit or 16-bit floats, dense or sparse.
    pub(crate) fn floats(tensor: &Tensor<'_>) -> Result<Self, ConvertError> {
        let values: Vec<f32> = match tensor.element {
            Element::Float32 => chunks(tensor.data)?.map(f32::from_le_bytes).collect(),
            Element::Float16 => chunks(tensor.data)?
                .map(|bytes| f16::from_le_bytes(bytes).to_f32())
                .collect(),
            other => {
                return Err(ConvertError::damaged(format!(
                    "a constant of {other:?} stands where floats belong"
                )));
            }
        };
        let shape = tensor.shape.clone();
        let values = match tensor.sparsity()? {
            Some(sparsity) => densify(&shape, &sparsity, &values)?,
            None => values,
        };
        if values.len() != shape.iter().product() {
            return Err(ConvertError::damaged(format!(
                "a constant of the shape {shape:?} has {} values",
                values.len()
            )));
        }
        Ok(Self { shape, values })
    }

    /// With dimension `order[k]` as dimension `k`.
    pub(crate) fn permuted<const N: usize>(self, order: [usize; N]) -> Result<Self, ConvertError> {
        let shape: [usize; N] = self.shape[..]
            .try_into()
            .map_err(|_| ConvertError::damaged(format!("a constant has not {N} dimensions")))?;
        let mut strides = [1; N];
        for k in (1..N).rev() {
            strides[k - 1] = strides[k] * shape[k];
        }
        let new = order.map(|d| shape[d]);
        let strides = order.map(|d| strides[d]);
        // What keeps the order in memory, as 1x1 kernels do, needs no copy.
        let moves = (0..N).filter(|k| new[*k] != 1).map(|k| order[k]);
        if moves.is_sorted() {
            return Ok(Self {
                shape: new.to_vec(),
                values: self.values,
            });
        }
        let mut values = Vec::with_capacity(self.values.len());
        let mut index = [0; N];
        let mut at = 0;
        for _ in 0..self.values.len() {
            values.push(self.values[at]);
            for k in (0..N).rev() {
                index[k] += 1;
                at += strides[k];
                if index[k] < new[k] {
                    break;
                }
                at -= strides[k] * new[k];
                index[k] = 0;
            }
        }
        Ok(Self {
            shape: new.to_vec(),
            values,
        })
    }
}

/// The integers of the constant `tensor`.
pub(crate) fn integers(tensor: &Tensor<'_>) -> Result<Vec<i64>, ConvertError> {
    if tensor.element != Element::Int32 {
        return Err(ConvertError::damaged(format!(
            "a constant of {:?} stands where integers belong",
            tensor.element
        )));
    }
    if tensor.data.len() > 4 * MAX_INTEGERS {
        return Err(ConvertError::TooLarge {
            what: format!("a list of settings has {} bytes", tensor.data.len()),
            limit: 4 * MAX_INTEGERS,
        });
    }
    let values = chunks(tensor.data)?.map(i32::from_le_bytes).map(i64::from);
    Ok(values.collect())
}

fn chunks<const N: usize>(
    bytes: &[u8],
) -> Result<impl Iterator<Item = [u8; N]> + '_, ConvertError> {
    let (chunks, []) = bytes.as_chunks::<N>() else {
        return Err(ConvertError::damaged("a constant ends within a number"));
    };
    Ok(chunks.iter().copied())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_permuted_constant_has_each_value_where_its_indices_say() {
        let shape = [2, 3, 4, 5];
        let values = (0_u16..120).map(f32::from).collect();
        let array = Array {
            shape: shape.to_vec(),
            values,
        };
        let permuted = array.clone().permuted([0, 3, 1, 2]).unwrap();
        assert_eq!(permuted.shape, [2, 5, 3, 4], "the shape");
        for (n, h, w, c) in (0..120).map(|k| (k / 60, k / 20 % 3, k / 5 % 4, k % 5)) {
            assert_eq!(
                permuted.values[((n * 5 + c) * 3 + h) * 4 + w],
                array.values[((n * 3 + h) * 4 + w) * 5 + c],
                "{n} {h} {w} {c}"
            );
        }
    }
}
