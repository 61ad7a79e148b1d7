//! The order from front to back: exact, and by index among equals.

use crate::projection::NEVER;

/// Bits that one pass sorts by.
const BITS: u32 = 11;
const BINS: usize = 1 << BITS;

/// Memory of the sort, kept from picture to picture.
#[derive(Debug, Clone, Default)]
pub(crate) struct Sorter {
    /// (key, index) of what is drawn.
    pairs: Vec<(u32, u32)>,
    other: Vec<(u32, u32)>,
}

impl Sorter {
    /// Writes the indices of all keys but [`NEVER`] into `order`, by rising key; a radix sort from the lowest digit.
    #[expect(
        clippy::cast_possible_truncation,
        reason = "a digit is 11 bits; Gaussians are counted in 32"
    )]
    pub(crate) fn sort(&mut self, keys: &[u32], order: &mut Vec<u32>) {
        let drawn = keys.iter().enumerate().filter(|(_, key)| **key != NEVER);
        self.pairs.clear();
        self.pairs
            .extend(drawn.map(|(index, key)| (*key, index as u32)));
        self.other.resize(self.pairs.len(), (0, 0));
        for shift in [0, BITS, 2 * BITS] {
            let digit = |key: u32| (key >> shift) as usize % BINS;
            let mut starts = [0u32; BINS];
            for (key, _) in &self.pairs {
                starts[digit(*key)] += 1;
            }
            let mut sum = 0;
            for start in &mut starts {
                (*start, sum) = (sum, sum + *start);
            }
            for pair in &self.pairs {
                let start = &mut starts[digit(pair.0)];
                self.other[*start as usize] = *pair;
                *start += 1;
            }
            std::mem::swap(&mut self.pairs, &mut self.other);
        }
        order.clear();
        order.extend(self.pairs.iter().map(|(_, index)| *index));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn keys_are_ordered_as_the_standard_library_orders_them() {
        let mut state = 7u64;
        let mut keys: Vec<u32> = (0..5_000)
            .map(|_| {
                state = state
                    .wrapping_mul(6_364_136_223_846_793_005)
                    .wrapping_add(1);
                let bits = u32::try_from(state >> 32).expect("32 bits");
                // Equal keys, neighbours and every magnitude.
                bits >> (bits % 29)
            })
            .collect();
        keys[17] = NEVER;
        keys[3_000] = NEVER;
        let mut expected: Vec<u32> = (0..5_000).filter(|at| *at != 17 && *at != 3_000).collect();
        expected.sort_by_key(|at| keys[*at as usize]);
        let (mut sorter, mut order) = (Sorter::default(), vec![9; 3]);
        sorter.sort(&keys, &mut order);
        assert_eq!(order, expected, "order");
        sorter.sort(&[NEVER; 4], &mut order);
        assert!(order.is_empty(), "nothing is drawn: {order:?}");
    }
}
