//! Operators that treat each element alone.

use super::{Emitter, STORED};
use crate::error::ConvertError;
use crate::graph::Value;
use crate::model::Operator;

impl Emitter<'_> {
    /// `value` after the activation that operators carry as a setting (`ActivationFunctionType`).
    pub(super) fn activate(&mut self, value: Value, activation: u8) -> Result<Value, ConvertError> {
        match activation {
            0 => Ok(value),
            1 => Ok(self.graph.node("Relu", &[value], Vec::new())),
            3 => Ok(self.clip(value, 6.0)),
            other => Err(self.unsupported(format!("its activation {other} is not known"))),
        }
    }

    fn clip(&mut self, value: Value, above: f32) -> Value {
        let bounds = [0.0, above].map(|bound| self.graph.scalar(bound));
        let [low, high] = bounds;
        self.graph.node("Clip", &[value, low, high], Vec::new())
    }

    /// An operand of an operator whose result has `rank` dimensions: missing outer ones are added, since a picture's order is turned.
    fn operand(&mut self, tensor: usize, rank: usize) -> Result<Value, ConvertError> {
        let shape = self.shape(tensor);
        if shape.len() > rank {
            return Err(self.unsupported("an operand has more dimensions than the result"));
        }
        if rank != 4 || shape.len() == 4 {
            return self.value(tensor);
        }
        let mut wide = vec![1; 4 - shape.len()];
        wide.extend(shape);
        if self.is_constant(tensor) {
            let mut array = self.floats(tensor)?;
            array.shape = wide;
            let array = array.permuted(STORED)?;
            return Ok(self.graph.floats(&array.shape, &array.values));
        }
        let value = self.value(tensor)?;
        let value = self.graph.reshape(value, &wide);
        Ok(self.turned_from_stored(value, &wide))
    }

    /// Both operands.
    fn operands(&mut self, op: &Operator<'_>) -> Result<[Value; 2], ConvertError> {
        let rank = self.output_shape(op).len();
        let (a, b) = (self.input(op, 0)?, self.input(op, 1)?);
        Ok([self.operand(a, rank)?, self.operand(b, rank)?])
    }
}

/// ADD, SUB, MUL or DIV, ONNX's `kind`. Its setting: activation.
pub(super) fn binary(
    emitter: &mut Emitter<'_>,
    op: &Operator<'_>,
    kind: &str,
) -> Result<Value, ConvertError> {
    let operands = emitter.operands(op)?;
    let value = emitter.graph.node(kind, &operands, Vec::new());
    emitter.activate(value, op.byte(0)?)
}

/// SQUARED_DIFFERENCE.
pub(super) fn squared_difference(
    emitter: &mut Emitter<'_>,
    op: &Operator<'_>,
) -> Result<Value, ConvertError> {
    let operands = emitter.operands(op)?;
    let difference = emitter.graph.node("Sub", &operands, Vec::new());
    Ok(emitter
        .graph
        .node("Mul", &[difference, difference], Vec::new()))
}

/// PRELU. As the larger of x and a x where no slope a is above 1: ONNX Runtime does that faster than its own operator.
pub(super) fn prelu(emitter: &mut Emitter<'_>, op: &Operator<'_>) -> Result<Value, ConvertError> {
    let slopes = emitter.input(op, 1)?;
    let steep = !emitter.floats(slopes)?.values.iter().all(|a| *a <= 1.0);
    let [value, slopes] = emitter.operands(op)?;
    if steep {
        return Ok(emitter.graph.node("PRelu", &[value, slopes], Vec::new()));
    }
    let scaled = emitter.graph.node("Mul", &[value, slopes], Vec::new());
    Ok(emitter.graph.node("Max", &[value, scaled], Vec::new()))
}

/// An operator of one operand that ONNX has as `kind`.
pub(super) fn unary(
    emitter: &mut Emitter<'_>,
    op: &Operator<'_>,
    kind: &str,
) -> Result<Value, ConvertError> {
    let input = emitter.input(op, 0)?;
    let input = emitter.value(input)?;
    Ok(emitter.graph.node(kind, &[input], Vec::new()))
}

/// RELU6.
pub(super) fn relu6(emitter: &mut Emitter<'_>, op: &Operator<'_>) -> Result<Value, ConvertError> {
    let input = emitter.input(op, 0)?;
    let input = emitter.value(input)?;
    Ok(emitter.clip(input, 6.0))
}

/// RSQRT.
pub(super) fn rsqrt(emitter: &mut Emitter<'_>, op: &Operator<'_>) -> Result<Value, ConvertError> {
    let root = unary(emitter, op, "Sqrt")?;
    Ok(emitter.graph.node("Reciprocal", &[root], Vec::new()))
}
