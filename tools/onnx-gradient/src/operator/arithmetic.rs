//! Elementwise operators.

use super::{Operator, Read, Reader, Shapes};
use crate::constant::Constant;
use crate::emitter::Emitter;
use crate::shape::{broadcast, repeated};

/// Which of the four.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Kind {
    Add,
    Sub,
    Mul,
    Div,
}

/// `Add`, `Sub`, `Mul` or `Div`.
pub(super) fn two(node: &Reader<'_>) -> Result<Read, String> {
    let kind = match super::name(node.node) {
        "Add" => Kind::Add,
        "Sub" => Kind::Sub,
        "Mul" => Kind::Mul,
        _ => Kind::Div,
    };
    let (a, b) = (node.shape(0)?, node.shape(1)?);
    let shape = broadcast(a, b)
        .ok_or_else(|| format!("its inputs have shapes that do not fit: {a:?} and {b:?}"))?;
    Ok(Read::new(Operator::Arithmetic(kind), shape))
}

/// `Pow` with a constant exponent.
pub(super) fn power(node: &Reader<'_>) -> Result<Read, String> {
    let exponent = match node.constant(1)? {
        Some(Constant::Floats(one)) if one.len() == 1 => f64::from(one[0]),
        #[expect(clippy::cast_precision_loss, reason = "2 is told from the others")]
        Some(Constant::Ints(one)) if one.len() == 1 => one[0] as f64,
        _ => return Err("its exponent is no constant number".to_owned()),
    };
    let (base, exponent_shape) = (node.shape(0)?, node.shape(1)?);
    if exponent_shape.len() > base.len() {
        return Err("its exponent has more dimensions than its base".to_owned());
    }
    let operator = if exponent == 2.0 {
        Operator::Square
    } else if exponent == 0.5 {
        Operator::Root
    } else {
        return Err(format!("its exponent is {exponent}, neither 2 nor 0.5"));
    };
    Ok(Read::new(operator, base.to_vec()))
}

/// What was repeated is summed.
fn gathered(emitter: &mut Emitter, value: String, shape: &[usize], whole: &[usize]) -> String {
    let axes = repeated(shape, whole);
    if axes.is_empty() {
        return value;
    }
    let sums = emitter.reduce_sum(&value, &axes);
    emitter.reshape(&sums, shape)
}

pub(super) fn pull_back(
    kind: Kind,
    emitter: &mut Emitter,
    of: &Shapes<'_>,
    by_output: &str,
) -> Result<String, String> {
    let (_, shape) = of.own()?;
    let (output, whole) = of.output;
    let first = of.at == 0;
    let (a, b) = (of.input(0)?.0, of.input(1)?.0);
    let by_input = match kind {
        Kind::Add => by_output.to_owned(),
        Kind::Sub if first => by_output.to_owned(),
        Kind::Sub => emitter.node("Neg", &[by_output], &[]),
        Kind::Mul => emitter.node("Mul", &[by_output, if first { b } else { a }], &[]),
        Kind::Div if first => emitter.node("Div", &[by_output, b], &[]),
        Kind::Div => {
            // a / b by b is -(a / b) / b.
            let product = emitter.node("Mul", &[by_output, output], &[]);
            let quotient = emitter.node("Div", &[&product, b], &[]);
            emitter.node("Neg", &[&quotient], &[])
        }
    };
    Ok(gathered(emitter, by_input, shape, whole))
}

pub(super) fn pull_back_relu(emitter: &mut Emitter, output: &str, by_output: &str) -> String {
    let open = emitter.node("Sign", &[output], &[]);
    emitter.node("Mul", &[by_output, &open], &[])
}

pub(super) fn pull_back_square(emitter: &mut Emitter, input: &str, by_output: &str) -> String {
    let two = emitter.scalar(2.0);
    let slope = emitter.node("Mul", &[input, &two], &[]);
    emitter.node("Mul", &[by_output, &slope], &[])
}

/// 1 / (2 sqrt(x)), and 0 at 0.
pub(super) fn pull_back_root(emitter: &mut Emitter, output: &str, by_output: &str) -> String {
    let [half, zero] = [0.5, 0.0].map(|value| emitter.scalar(value));
    let halved = emitter.node("Mul", &[by_output, &half], &[]);
    let slope = emitter.node("Div", &[&halved, output], &[]);
    let rises = emitter.node("Greater", &[output, &zero], &[]);
    emitter.node("Where", &[&rises, &slope, &zero], &[])
}
