//! The same numbers, arranged otherwise.

use super::{Operator, Read, Reader, Shapes};
use crate::constant::Constant;
use crate::emitter::Emitter;
use crate::shape::{axis, elements};

/// `Identity`: a constant stays one.
pub(super) fn identity(node: &Reader<'_>) -> Result<Read, String> {
    let mut read = Read::new(Operator::Same, node.shape(0)?.to_vec());
    read.constant = node.constant(0).ok().flatten().cloned();
    Ok(read)
}

/// `Dropout` as it is in inference: nothing is dropped.
pub(super) fn dropout(node: &Reader<'_>) -> Result<Read, String> {
    match node.constant(2)? {
        None | Some(Constant::Truth(false)) => {
            Ok(Read::new(Operator::Same, node.shape(0)?.to_vec()))
        }
        _ => Err("it drops at random: export the network for inference (eval())".to_owned()),
    }
}

/// Different axes, from ones that may count from the end.
pub(super) fn axes(named: &[i64], rank: usize) -> Result<Vec<usize>, String> {
    let found: Option<Vec<usize>> = named.iter().map(|index| axis(*index, rank)).collect();
    let mut axes = found.ok_or_else(|| format!("its axes are {named:?} of {rank}"))?;
    axes.sort_unstable();
    if axes.windows(2).any(|pair| pair[0] == pair[1]) {
        return Err(format!("its axes are {named:?}: one is there twice"));
    }
    Ok(axes)
}

/// The same numbers in a shape that has as many.
fn arranged(from: &[usize], to: Vec<usize>) -> Result<Read, String> {
    if elements(from) != elements(&to) {
        return Err(format!("{from:?} cannot be arranged as {to:?}"));
    }
    Ok(Read::new(Operator::Arranged, to))
}

/// `Flatten` to two dimensions.
pub(super) fn flatten(node: &Reader<'_>) -> Result<Read, String> {
    let from = node.shape(0)?;
    let at = node.int("axis", 1);
    let at = if at == super::rank(from) {
        from.len()
    } else {
        axis(at, from.len()).ok_or_else(|| format!("its axis is {at}"))?
    };
    let sides = [&from[..at], &from[at..]].map(elements);
    match sides {
        [Some(outer), Some(inner)] => arranged(from, vec![outer, inner]),
        _ => Err("it has too many numbers".to_owned()),
    }
}

/// `Reshape` to a constant shape, in which 0 is a side as it was and -1 what is left.
pub(super) fn reshape(node: &Reader<'_>) -> Result<Read, String> {
    let from = node.shape(0)?;
    let wanted = node.ints(1)?.ok_or("it has no shape")?;
    let strange = || format!("{from:?} cannot be arranged as {wanted:?}");
    let keeps = node.int("allowzero", 0) == 0;
    let mut open = None;
    let mut to = Vec::with_capacity(wanted.len());
    for (at, side) in wanted.iter().enumerate() {
        to.push(match side {
            -1 if open.is_none() => {
                open = Some(at);
                1
            }
            0 if keeps => *from.get(at).ok_or_else(strange)?,
            side => usize::try_from(*side).map_err(|_| strange())?,
        });
    }
    if let Some(at) = open {
        let rest = elements(&to).filter(|rest| *rest > 0);
        let all = elements(from).ok_or_else(strange)?;
        to[at] = all / rest.ok_or_else(strange)?;
    }
    arranged(from, to)
}

/// `Squeeze`: sides of 1 are left out, the named ones or all.
pub(super) fn squeeze(node: &Reader<'_>) -> Result<Read, String> {
    let from = node.shape(0)?;
    let dropped = match node.axes(1)? {
        Some(named) => axes(named, from.len())?,
        None => (0..from.len()).filter(|at| from[*at] == 1).collect(),
    };
    let kept = from.iter().enumerate();
    let kept = kept.filter_map(|(at, side)| (!dropped.contains(&at)).then_some(*side));
    arranged(from, kept.collect())
}

/// `Unsqueeze`: sides of 1 are put in.
pub(super) fn unsqueeze(node: &Reader<'_>) -> Result<Read, String> {
    let from = node.shape(0)?;
    let named = node.axes(1)?.ok_or("it has no axes")?;
    let rank = from.len() + named.len();
    let added = axes(named, rank)?;
    let mut sides = from.iter();
    let to = (0..rank).map(|at| match added.contains(&at) {
        true => 1,
        false => sides.next().copied().unwrap_or(1),
    });
    arranged(from, to.collect())
}

/// `Concat` along an axis.
pub(super) fn concat(node: &Reader<'_>) -> Result<Read, String> {
    let mut to = node.shape(0)?.to_vec();
    let named = node.int("axis", 0);
    let axis = axis(named, to.len()).ok_or_else(|| format!("its axis is {named}"))?;
    to[axis] = 0;
    for at in 0..node.node.input.len() {
        let part = node.shape(at)?;
        let fits = part.len() == to.len()
            && (0..to.len()).all(|side| side == axis || part[side] == to[side]);
        if !fits {
            return Err(format!("its input {at} has the shape {part:?}"));
        }
        to[axis] = to[axis].saturating_add(part[axis]);
    }
    Ok(Read::new(Operator::Joined { axis }, to))
}

/// The part of the derivatives that is of one of the values that were joined.
pub(super) fn part(
    axis: usize,
    emitter: &mut Emitter,
    of: &Shapes<'_>,
    by_output: &str,
) -> Result<String, String> {
    let mut start = 0;
    for at in 0..of.at {
        start += of.input(at)?.1[axis];
    }
    let end = start + of.own()?.1[axis];
    Ok(emitter.slice(by_output, &[axis], &[start], &[end], &[1]))
}
