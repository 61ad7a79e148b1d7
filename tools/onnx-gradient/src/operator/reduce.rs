//! Sums and means over axes.

use super::{Operator, Read, Reader};
use crate::emitter::Emitter;

/// `ReduceSum` or `ReduceMean`.
pub(super) fn read(node: &Reader<'_>, mean: bool) -> Result<Read, String> {
    let input = node.shape(0)?;
    let named = node.axes(1)?.unwrap_or_default();
    let mut axes = if named.is_empty() {
        if node.int("noop_with_empty_axes", 0) != 0 {
            return Ok(Read::new(Operator::Same, input.to_vec()));
        }
        (0..input.len()).collect()
    } else {
        super::arrange::axes(named, input.len())?
    };
    axes.sort_unstable();
    let kept = node.int("keepdims", 1) != 0;
    let shape = input.iter().enumerate();
    let shape = shape.filter_map(|(at, side)| match axes.contains(&at) {
        true => kept.then_some(1),
        false => Some(*side),
    });
    let shape = shape.collect();
    Ok(Read::new(Operator::Reduced { axes, mean }, shape))
}

pub(super) fn pull_back(
    axes: &[usize],
    mean: bool,
    emitter: &mut Emitter,
    input: &[usize],
    by_output: &str,
) -> String {
    let mut share = by_output.to_owned();
    if mean {
        let count: usize = axes.iter().map(|axis| input[*axis]).product();
        #[expect(clippy::cast_precision_loss, reason = "counts of pixels")]
        let each = emitter.scalar(1.0 / count.max(1) as f32);
        share = emitter.node("Mul", &[&share, &each], &[]);
    }
    let mut kept = input.to_vec();
    for axis in axes {
        kept[*axis] = 1;
    }
    let kept = emitter.reshape(&share, &kept);
    emitter.expand(&kept, input)
}
