//! Static shapes.

/// Most dimensions of a value.
pub(crate) const MOST_RANK: usize = 8;

/// Numbers of a value of this shape; nothing if they are more than fit.
pub(crate) fn elements(shape: &[usize]) -> Option<usize> {
    shape
        .iter()
        .try_fold(1usize, |product, side| product.checked_mul(*side))
}

/// A dimension or index as ONNX writes it. All that are used are far smaller.
pub(crate) fn i64_of(value: usize) -> i64 {
    i64::try_from(value).unwrap_or(i64::MAX)
}

/// A shape as ONNX writes it.
pub(crate) fn i64s(shape: &[usize]) -> Vec<i64> {
    shape.iter().map(|side| i64_of(*side)).collect()
}

/// A dimension's index from one that may count from the end; nothing if there is none.
pub(crate) fn axis(index: i64, rank: usize) -> Option<usize> {
    let from_start = if index < 0 {
        index.checked_add(i64_of(rank))?
    } else {
        index
    };
    usize::try_from(from_start).ok().filter(|axis| *axis < rank)
}

/// The shape of an elementwise operation's result: dimensions are aligned at the end, and one of 1 is repeated. Nothing where two differ.
pub(crate) fn broadcast(a: &[usize], b: &[usize]) -> Option<Vec<usize>> {
    let rank = a.len().max(b.len());
    let side = |shape: &[usize], at: usize| {
        (at + shape.len())
            .checked_sub(rank)
            .map_or(1, |at| shape[at])
    };
    (0..rank)
        .map(|at| match (side(a, at), side(b, at)) {
            (one, other) if one == other => Some(one),
            (1, other) => Some(other),
            (one, 1) => Some(one),
            _ => None,
        })
        .collect()
}

/// Dimensions of `whole` along which a value of shape `part` was repeated.
pub(crate) fn repeated(part: &[usize], whole: &[usize]) -> Vec<usize> {
    let added = whole.len().saturating_sub(part.len());
    (0..whole.len())
        .filter(|at| match at.checked_sub(added) {
            None => true,
            Some(own) => part[own] == 1 && whole[*at] != 1,
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shapes_are_broadcast_as_onnx_has_it() {
        assert_eq!(broadcast(&[2, 1, 4], &[3, 1]), Some(vec![2, 3, 4]), "both");
        assert_eq!(broadcast(&[], &[3]), Some(vec![3]), "a number");
        assert_eq!(broadcast(&[2], &[3]), None, "neither is 1");
        assert_eq!(repeated(&[3, 1], &[2, 3, 4]), [0, 2], "added and repeated");
        assert_eq!(repeated(&[1, 3], &[1, 3]), [0usize; 0], "as it was");
    }

    #[test]
    fn dimensions_may_count_from_the_end() {
        assert_eq!(axis(-1, 4), Some(3), "the last");
        assert_eq!(axis(0, 4), Some(0), "the first");
        assert_eq!(axis(4, 4), None, "beyond");
        assert_eq!(axis(i64::MIN, 4), None, "before");
    }
}
