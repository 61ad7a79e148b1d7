//! Operators that move elements: shapes, parts, pictures' sizes.

use super::{Emitter, PICTURE, STORED};
use crate::error::ConvertError;
use crate::graph::{Value, i64_of};
use crate::model::Operator;
use onnx_schema::Attribute;

/// Beyond every index.
const END: i64 = i32::MAX as i64;

impl Emitter<'_> {
    /// Axes of a tensor of `rank` dimensions, which may count from the end.
    pub(super) fn axes(&self, axes: &[i64], rank: usize) -> Result<Vec<usize>, ConvertError> {
        let rank = i64_of(rank);
        axes.iter()
            .map(|axis| {
                Some(axis)
                    .filter(|axis| (-rank..rank).contains(axis))
                    .and_then(|axis| usize::try_from(axis.rem_euclid(rank)).ok())
                    .ok_or_else(|| self.unsupported(format!("it has no axis {axis}")))
            })
            .collect()
    }
}

/// RESHAPE: to the result's shape.
pub(super) fn reshape(emitter: &mut Emitter<'_>, op: &Operator<'_>) -> Result<Value, ConvertError> {
    let input = emitter.input(op, 0)?;
    let shape = emitter.output_shape(op);
    let before = emitter.shape(input);
    if before.iter().product::<usize>() != shape.iter().product() {
        return Err(emitter.unsupported("its result has another number of elements"));
    }
    if before == shape {
        return emitter.value(input);
    }
    let value = emitter.stored(input)?;
    match *shape {
        // One channel or one pixel: straight to ONNX's order.
        [n, h, w, c] if c == 1 || h * w == 1 => Ok(emitter.graph.reshape(value, &[n, c, h, w])),
        _ => {
            let value = emitter.graph.reshape(value, shape);
            Ok(emitter.turned_from_stored(value, shape))
        }
    }
}

/// TRANSPOSE.
pub(super) fn transpose(
    emitter: &mut Emitter<'_>,
    op: &Operator<'_>,
) -> Result<Value, ConvertError> {
    let input = emitter.input(op, 0)?;
    let order = emitter.ints(emitter.input(op, 1)?)?;
    let rank = emitter.shape(input).len();
    let order = emitter.axes(&order, rank)?;
    let mut sorted = order.clone();
    sorted.sort_unstable();
    if !sorted.into_iter().eq(0..rank) {
        return Err(emitter.unsupported("its order leaves dimensions out"));
    }
    let order: Vec<i64> = order.into_iter().map(i64_of).collect();
    let value = emitter.stored(input)?;
    let value = emitter.graph.transpose(value, &order);
    Ok(emitter.turned_from_stored(value, emitter.output_shape(op)))
}

/// CONCATENATION. Its settings: axis, activation.
pub(super) fn concatenate(
    emitter: &mut Emitter<'_>,
    op: &Operator<'_>,
) -> Result<Value, ConvertError> {
    let rank = emitter.output_shape(op).len();
    let [axis] = emitter.axes(&[op.int(0, 0)?.into()], rank)?[..] else {
        return Err(emitter.unsupported("it has no axis"));
    };
    let axis = match PICTURE.get(axis) {
        Some(turned) if rank == 4 => *turned,
        _ => i64_of(axis),
    };
    let mut values = Vec::with_capacity(op.inputs.len());
    for k in 0..op.inputs.len() {
        let input = emitter.input(op, k)?;
        if emitter.shape(input).len() != rank {
            return Err(emitter.unsupported("its inputs have other numbers of dimensions"));
        }
        values.push(emitter.value(input)?);
    }
    let axis = vec![Attribute::int("axis", axis)];
    let value = emitter.graph.node("Concat", &values, axis);
    emitter.activate(value, op.byte(1)?)
}

/// PAD, with zeros.
pub(super) fn pad(emitter: &mut Emitter<'_>, op: &Operator<'_>) -> Result<Value, ConvertError> {
    let input = emitter.input(op, 0)?;
    let widths = emitter.ints(emitter.input(op, 1)?)?;
    let rank = emitter.shape(input).len();
    // Of each dimension, before and after.
    let (pairs, rest) = widths.as_chunks::<2>();
    if pairs.len() != rank || !rest.is_empty() || widths.iter().any(|width| *width < 0) {
        return Err(emitter.unsupported("its widths do not fit its input"));
    }
    let mut pairs = pairs.to_vec();
    if let [_, _, _, _] = pairs[..] {
        pairs = STORED.map(|k| pairs[k]).to_vec();
    }
    let before = pairs.iter().map(|[before, _]| *before);
    let after = pairs.iter().map(|[_, after]| *after);
    let widths: Vec<i64> = before.chain(after).collect();
    let widths = emitter.graph.ints(&widths);
    let value = emitter.value(input)?;
    Ok(emitter.graph.node("Pad", &[value, widths], Vec::new()))
}

/// RESIZE_BILINEAR. Its settings: two that are no longer used, whether corners are aligned, whether pixels' centres are at a half.
pub(super) fn resize_bilinear(
    emitter: &mut Emitter<'_>,
    op: &Operator<'_>,
) -> Result<Value, ConvertError> {
    let [number, height, width, channels] = emitter.picture(emitter.output_shape(op))?;
    let input = emitter.input(op, 0)?;
    let coordinates = match (op.byte(2)?, op.byte(3)?) {
        (0, 0) => "asymmetric",
        (0, _) => "half_pixel",
        (_, 0) => "align_corners",
        _ => return Err(emitter.unsupported("it has two kinds of coordinates at once")),
    };
    let size = [number, channels, height, width].map(i64_of);
    let size = emitter.graph.ints(&size);
    let value = emitter.value(input)?;
    Ok(emitter.graph.node(
        "Resize",
        &[value, Value::NONE, Value::NONE, size],
        vec![
            Attribute::string("mode", "linear"),
            Attribute::string("coordinate_transformation_mode", coordinates),
        ],
    ))
}

/// DEPTH_TO_SPACE. Its setting: the side of a block.
pub(super) fn depth_to_space(
    emitter: &mut Emitter<'_>,
    op: &Operator<'_>,
) -> Result<Value, ConvertError> {
    let side = op.int(0, 0)?;
    if !(1..=64).contains(&side) {
        return Err(emitter.unsupported(format!("blocks of {side} are out of range")));
    }
    let input = emitter.input(op, 0)?;
    let value = emitter.value(input)?;
    Ok(emitter.graph.node(
        "DepthToSpace",
        &[value],
        vec![
            Attribute::int("blocksize", side.into()),
            Attribute::string("mode", "DCR"),
        ],
    ))
}

/// STRIDED_SLICE. Its settings are masks, a bit for each dimension: of beginnings and ends that are not used, of an ellipsis, of new
/// dimensions, of dimensions of which one index is taken and that are then left out.
pub(super) fn strided_slice(
    emitter: &mut Emitter<'_>,
    op: &Operator<'_>,
) -> Result<Value, ConvertError> {
    let input = emitter.input(op, 0)?;
    let rank = emitter.shape(input).len();
    let list = |k| emitter.ints(emitter.input(op, k)?);
    let (mut begins, mut ends, strides) = (list(1)?, list(2)?, list(3)?);
    let [no_begin, no_end, ellipsis, new, single] = [0, 1, 2, 3, 4].map(|id| op.int(id, 0));
    let (no_begin, no_end, single) = (no_begin?, no_end?, single?);
    if ellipsis? != 0 || new? != 0 {
        return Err(emitter.unsupported("it adds dimensions"));
    }
    if [begins.len(), ends.len(), strides.len()] != [rank; 3] || strides.iter().any(|s| *s < 1) {
        return Err(emitter.unsupported("its steps do not fit its input"));
    }
    for (k, (begin, end)) in begins.iter_mut().zip(&mut ends).enumerate() {
        let set = |mask: i32| mask >> k & 1 != 0;
        if set(no_begin) {
            *begin = 0;
        }
        if set(single) {
            *end = if *begin == -1 { END } else { *begin + 1 };
        } else if set(no_end) {
            *end = END;
        }
    }
    let shape = emitter.output_shape(op);
    // A picture stays as it is: its axes are named in TensorFlow Lite's order.
    let turned = rank == 4 && shape.len() == 4 && single == 0;
    let axes: Vec<i64> = if turned {
        PICTURE.to_vec()
    } else {
        (0..rank).map(i64_of).collect()
    };
    let value = if turned {
        emitter.value(input)?
    } else {
        emitter.stored(input)?
    };
    let lists = [begins, ends, axes, strides].map(|list| emitter.graph.ints(&list));
    let [begins, ends, axes, strides] = lists;
    let operands = [value, begins, ends, axes, strides];
    let value = emitter.graph.node("Slice", &operands, Vec::new());
    if turned {
        return Ok(value);
    }
    let value = emitter.graph.reshape(value, shape);
    Ok(emitter.turned_from_stored(value, shape))
}
