//! Sparse constants made dense.
//!
//! TensorFlow Lite stores the values that are not zero, in the order of a tree: each level runs over one dimension, or over one within
//! blocks, and lists either all indices or some (<https://tensor-compiler.org>, the format that the schema's `SparsityParameters` names).

use crate::error::ConvertError;
use crate::model::{Level, Sparsity};

/// The tensor of `shape` (outermost dimension first) whose values that are not zero are `values`, in the order of the tree.
pub(crate) fn densify(
    shape: &[usize],
    sparsity: &Sparsity<'_>,
    values: &[f32],
) -> Result<Vec<f32>, ConvertError> {
    let strides = strides(shape, sparsity)?;
    let mut dense = vec![0.0; shape.iter().product()];
    let mut walk = Walk {
        levels: &sparsity.levels,
        strides: &strides,
        values: values.iter(),
        dense: &mut dense,
    };
    walk.level(0, 0, 0)?;
    if walk.values.next().is_some() {
        return Err(damaged("more values than places"));
    }
    Ok(dense)
}

fn damaged(why: &str) -> ConvertError {
    ConvertError::damaged(format!("a sparse tensor has {why}"))
}

/// For each level: how many indices its dimension has, and how far apart they are in the dense tensor.
fn strides(shape: &[usize], sparsity: &Sparsity<'_>) -> Result<Vec<(usize, usize)>, ConvertError> {
    let Sparsity {
        order,
        blocks,
        levels,
    } = sparsity;
    let dimensions = shape.len() + blocks.len();
    let mut sorted = order.clone();
    sorted.sort_unstable();
    if !sorted.into_iter().eq(0..dimensions) || levels.len() != dimensions {
        return Err(damaged("another number of levels than dimensions"));
    }
    // Dimensions of the tensor first, those within blocks after them.
    let mut all: Vec<(usize, usize)> = Vec::with_capacity(dimensions);
    let mut apart = shape.iter().product::<usize>();
    for &length in shape {
        apart = apart.checked_div(length).unwrap_or(0);
        all.push((length, apart));
    }
    for (k, &of) in blocks.iter().enumerate() {
        let place = order.iter().position(|d| *d == shape.len() + k);
        let size = match place.and_then(|place| levels.get(place)) {
            Some(Level::Dense(size)) => *size,
            _ => return Err(damaged("blocks with holes")),
        };
        let outer = all
            .get_mut(of)
            .filter(|(length, _)| of < shape.len() && size > 0 && *length % size == 0)
            .ok_or_else(|| damaged("blocks that do not fit its shape"))?;
        let inner = (size, outer.1);
        *outer = (outer.0 / size, outer.1 * size);
        all.push(inner);
    }
    Ok(order.iter().filter_map(|d| all.get(*d).copied()).collect())
}

struct Walk<'a> {
    levels: &'a [Level<'a>],
    strides: &'a [(usize, usize)],
    values: std::slice::Iter<'a, f32>,
    dense: &'a mut [f32],
}

impl Walk<'_> {
    /// Fills in what is below node `parent` of the level above `depth`; `at` is where its indices so far lead.
    fn level(&mut self, depth: usize, parent: usize, at: usize) -> Result<(), ConvertError> {
        let (Some(level), Some(&(length, stride))) =
            (self.levels.get(depth), self.strides.get(depth))
        else {
            let value = self.values.next();
            match (self.dense.get_mut(at), value) {
                (Some(place), Some(value)) => *place = *value,
                _ => return Err(damaged("fewer values than places")),
            }
            return Ok(());
        };
        match level {
            Level::Dense(size) => {
                if *size != length {
                    return Err(damaged("a level that does not fit its shape"));
                }
                for index in 0..length {
                    self.level(depth + 1, parent * length + index, at + index * stride)?;
                }
            }
            Level::Sparse { segments, indices } => {
                let range = segments.get(parent).zip(segments.get(parent + 1));
                let (from, to) = range.ok_or_else(|| damaged("segments that lead nowhere"))?;
                // Rising indices below the length: a node has at most as many children as its dimension has indices.
                let mut next = 0;
                for child in from..to {
                    let index = indices
                        .get(child)
                        .filter(|index| (next..length).contains(index))
                        .ok_or_else(|| damaged("indices that do not rise within its shape"))?;
                    next = index + 1;
                    self.level(depth + 1, child, at + index * stride)?;
                }
            }
        }
        Ok(())
    }
}
