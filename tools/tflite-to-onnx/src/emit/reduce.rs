//! Operators that sum over elements: means, sums, fully connected layers.

use super::{Emitter, PICTURE};
use crate::error::ConvertError;
use crate::graph::{Value, i64_of};
use crate::model::Operator;
use onnx_schema::Attribute;

/// MEAN or SUM, ONNX's `kind`. Their setting: whether the dimensions stay, with length 1.
pub(super) fn reduce(
    emitter: &mut Emitter<'_>,
    op: &Operator<'_>,
    kind: &str,
) -> Result<Value, ConvertError> {
    let input = emitter.input(op, 0)?;
    let axes = emitter.ints(emitter.input(op, 1)?)?;
    let rank = emitter.shape(input).len();
    let mut axes = emitter.axes(&axes, rank)?;
    let keep = op.byte(0)? != 0;
    // What is left of a picture has the same order either way if its height and width are gone.
    let turned = rank == 4 && (keep || [1, 2].iter().all(|axis| axes.contains(axis)));
    let value = if turned {
        for axis in &mut axes {
            *axis = picture_axis(*axis);
        }
        emitter.value(input)?
    } else {
        emitter.stored(input)?
    };
    let axes: Vec<i64> = axes.into_iter().map(i64_of).collect();
    let axes = emitter.graph.ints(&axes);
    let keep = Attribute::int("keepdims", i64::from(keep));
    let value = emitter.graph.node(kind, &[value, axes], vec![keep]);
    if turned {
        return Ok(value);
    }
    // What is left of five dimensions, or of four none of which goes, is a picture.
    Ok(emitter.turned_from_stored(value, emitter.output_shape(op)))
}

/// Where axis `axis` of a stored picture is in ONNX's order.
fn picture_axis(axis: usize) -> usize {
    PICTURE
        .get(axis)
        .and_then(|axis| usize::try_from(*axis).ok())
        .unwrap_or(axis)
}

/// FULLY_CONNECTED. Its settings: activation, the order of its weights.
pub(super) fn fully_connected(
    emitter: &mut Emitter<'_>,
    op: &Operator<'_>,
) -> Result<Value, ConvertError> {
    if op.byte(1)? != 0 {
        return Err(emitter.unsupported("its weights are shuffled"));
    }
    let input = emitter.input(op, 0)?;
    let weights = emitter.input(op, 1)?;
    let weights = emitter.floats(weights)?;
    let elements: usize = emitter.shape(input).iter().product();
    let [outputs, inputs] = weights.shape[..] else {
        return Err(emitter.unsupported("its weights are no matrix"));
    };
    if inputs == 0 || !elements.is_multiple_of(inputs) {
        return Err(emitter.unsupported("its weights do not fit its input"));
    }
    let rows = elements / inputs;
    let shape = emitter.output_shape(op);
    if shape.iter().product::<usize>() != rows * outputs {
        return Err(emitter.unsupported("its weights do not fit its result"));
    }
    let value = emitter.stored(input)?;
    let value = emitter.graph.reshape(value, &[rows, inputs]);
    let mut operands = vec![value, emitter.graph.floats(&weights.shape, &weights.values)];
    if let Some(bias) = Emitter::optional(op, 2) {
        let bias = emitter.floats(bias)?;
        if bias.values.len() != outputs {
            return Err(emitter.unsupported("its bias has another length than its result"));
        }
        operands.push(emitter.graph.floats(&[outputs], &bias.values));
    }
    let transposed = vec![Attribute::int("transB", 1)];
    let value = emitter.graph.node("Gemm", &operands, transposed);
    let value = emitter.activate(value, op.byte(0)?)?;
    if *shape == [rows, outputs] {
        return Ok(value);
    }
    let value = emitter.graph.reshape(value, shape);
    Ok(emitter.turned_from_stored(value, shape))
}
