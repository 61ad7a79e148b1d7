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
                let (from, to) = range
                    .filter(|(from, to)| from <= to)
                    .ok_or_else(|| damaged("segments that lead nowhere"))?;
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::Integers;
    use proptest::prelude::*;

    /// The list as a file has it, in `size` bytes each.
    fn stored(values: &[u32], size: usize) -> Vec<u8> {
        let bytes = values.iter().map(|value| value.to_le_bytes());
        bytes.flat_map(|b| b[..size].to_vec()).collect()
    }

    fn sparse<'a>(segments: &'a [u8], indices: &'a [u8], size: usize) -> Level<'a> {
        Level::Sparse {
            segments: Integers {
                bytes: segments,
                size,
            },
            indices: Integers {
                bytes: indices,
                size,
            },
        }
    }

    /// The example of compressed sparse rows in every textbook.
    #[test]
    fn compressed_rows_become_a_matrix() {
        let sparsity = Sparsity {
            order: vec![0, 1],
            blocks: vec![],
            levels: vec![Level::Dense(3), sparse(&[0, 2, 2, 3], &[0, 3, 1], 1)],
        };
        let dense = densify(&[3, 4], &sparsity, &[1.0, 2.0, 3.0]).unwrap();
        let rows = [1.0, 0.0, 0.0, 2.0, 0.0, 0.0, 0.0, 0.0, 0.0, 3.0, 0.0, 0.0];
        assert_eq!(dense, rows, "row by row");
    }

    /// Blocks of 2x2: the example of TensorFlow Lite's schema.fbs, whose second row of blocks holds two.
    #[test]
    fn blocks_lie_where_their_indices_say() {
        let sparsity = Sparsity {
            order: vec![0, 1, 2, 3],
            blocks: vec![0, 1],
            levels: vec![
                Level::Dense(2),
                sparse(&[0, 1, 3], &[1, 0, 1], 1),
                Level::Dense(2),
                Level::Dense(2),
            ],
        };
        let values: Vec<f32> = (1_u8..=12).map(f32::from).collect();
        let dense = densify(&[4, 4], &sparsity, &values).unwrap();
        let rows = [
            0.0, 0.0, 1.0, 2.0, //
            0.0, 0.0, 3.0, 4.0, //
            5.0, 6.0, 9.0, 10.0, //
            7.0, 8.0, 11.0, 12.0,
        ];
        assert_eq!(dense, rows, "row by row");
    }

    #[test]
    fn trees_that_do_not_fit_are_refused() {
        let rows = |segments: &'static [u8], indices: &'static [u8]| Sparsity {
            order: vec![0, 1],
            blocks: vec![],
            levels: vec![Level::Dense(2), sparse(segments, indices, 1)],
        };
        let good = rows(&[0, 1, 2], &[0, 1]);
        assert_eq!(
            densify(&[2, 2], &good, &[1.0, 2.0]),
            Ok(vec![1.0, 0.0, 0.0, 2.0]),
            "the good one"
        );
        let refused = |shape: &[usize], sparsity: &Sparsity<'_>, values: &[f32], why: &str| {
            assert!(densify(shape, sparsity, values).is_err(), "{why}");
        };
        refused(&[2, 2], &good, &[1.0], "a value is missing");
        refused(&[2, 2], &good, &[1.0; 3], "a value is too many");
        refused(&[3, 2], &good, &[1.0; 2], "another shape");
        refused(&[2, 2, 2], &good, &[1.0; 2], "more dimensions");
        refused(
            &[2, 2],
            &rows(&[0, 1], &[0, 1]),
            &[1.0; 2],
            "segments cut short",
        );
        refused(
            &[2, 2],
            &rows(&[0, 1, 9], &[0, 1]),
            &[1.0; 2],
            "segments beyond the indices",
        );
        refused(
            &[2, 2],
            &rows(&[1, 0, 2], &[0, 1]),
            &[1.0; 2],
            "segments that go back",
        );
        refused(
            &[2, 2],
            &rows(&[0, 1, 2], &[0, 2]),
            &[1.0; 2],
            "an index beyond the shape",
        );
        refused(
            &[2, 2],
            &rows(&[0, 2, 2], &[1, 1]),
            &[1.0; 2],
            "an index twice",
        );
        let order = Sparsity {
            order: vec![0, 0],
            ..good.clone()
        };
        refused(&[2, 2], &order, &[1.0; 2], "a dimension twice");
        let blocks = Sparsity {
            order: vec![0, 1, 2],
            blocks: vec![1],
            levels: vec![Level::Dense(2), Level::Dense(1), Level::Dense(3)],
        };
        refused(
            &[2, 4],
            &blocks,
            &[1.0; 8],
            "blocks that do not divide the shape",
        );
    }

    proptest! {
        /// A matrix is stored in blocks of columns by a search for those that are not zero, and comes back.
        #[test]
        fn what_was_stored_sparsely_comes_back(
            rows in 1..6_usize,
            columns in 1..6_usize,
            block in 1..4_usize,
            size in prop::sample::select(vec![1_usize, 2, 4]),
            seed in prop::collection::vec(prop::option::of(1.0..2.0_f32), 125),
        ) {
            let width = columns * block;
            let matrix: Vec<f32> = (0..rows * width).map(|k| seed[k].unwrap_or(0.0)).collect();
            let (mut segments, mut indices, mut values) = (vec![0], vec![], vec![]);
            for row in matrix.chunks_exact(width) {
                for (index, part) in row.chunks_exact(block).enumerate() {
                    if part.iter().any(|value| *value != 0.0) {
                        indices.push(u32::try_from(index).unwrap());
                        values.extend_from_slice(part);
                    }
                }
                segments.push(u32::try_from(indices.len()).unwrap());
            }
            let (segments, indices) = (stored(&segments, size), stored(&indices, size));
            let sparsity = Sparsity {
                order: vec![0, 1, 2],
                blocks: vec![1],
                levels: vec![
                    Level::Dense(rows),
                    sparse(&segments, &indices, size),
                    Level::Dense(block),
                ],
            };
            prop_assert_eq!(densify(&[rows, width], &sparsity, &values), Ok(matrix));
        }
    }
}
