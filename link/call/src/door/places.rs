//! Which viewer makes room for another where all places are taken: one of the network that has the most, and there of
//! the key that has the most. So whoever has a link keeps others out only with as many networks as there are places.

use std::collections::HashMap;
use std::hash::Hash;

/// Where a viewer comes from, and who it is.
pub(super) type From<N, W> = (N, W);

/// The number of the viewer, of those that are `inside`, that makes room for `newcomer`; nothing if none has to.
pub(super) fn to_make_room<N, W>(inside: &[From<N, W>], newcomer: &From<N, W>) -> Option<usize>
where
    N: Eq + Hash,
    W: Eq + Hash,
{
    let (network, who) = newcomer;
    let networks = counts(inside.iter().map(|(network, _)| network));
    let largest = match larger(&networks, network) {
        Some(most) => {
            &newest(inside, |(of, _)| networks.get(of) == Some(&most))?
                .1
                .0
        }
        None => network,
    };
    let keys = counts(
        inside
            .iter()
            .filter_map(|(of, key)| (of == largest).then_some(key)),
    );
    let most = if largest == network {
        larger(&keys, who)?
    } else {
        keys.values().copied().max()?
    };
    let makes_room = |(of, key): &From<N, W>| of == largest && keys.get(key) == Some(&most);
    newest(inside, makes_room).map(|(at, _)| at)
}

/// How many there are of each group.
fn counts<'a, T: Eq + Hash>(all: impl Iterator<Item = &'a T>) -> HashMap<&'a T, usize> {
    let mut counts = HashMap::new();
    for one in all {
        *counts.entry(one).or_default() += 1;
    }
    counts
}

/// The size of the largest group, if it has so many more than `own` that it has no fewer once it has given one away.
/// Otherwise two would take turns without end.
fn larger<T: Eq + Hash>(counts: &HashMap<&T, usize>, own: &T) -> Option<usize> {
    let here = counts.get(own).copied().unwrap_or(0);
    let most = counts.values().copied().max()?;
    (here + 1 < most).then_some(most)
}

/// The last such viewer, with its number: it has been there for the shortest time, and decides between groups of one
/// size.
fn newest<T>(inside: &[T], is_one: impl Fn(&T) -> bool) -> Option<(usize, &T)> {
    inside.iter().enumerate().rev().find(|(_, one)| is_one(one))
}

#[cfg(test)]
mod tests {
    use super::to_make_room;

    #[test]
    fn the_network_with_the_most_makes_room_and_then_its_key_with_the_most() {
        let hers: Vec<(u8, u8)> = (0..32).map(|key| (1, key)).collect();
        assert_eq!(to_make_room(&hers, &(2, 99)), Some(31), "her newest");
        assert_eq!(
            to_make_room(&hers, &(1, 99)),
            None,
            "each key of one network has as good a right"
        );
        let keyless: Vec<(u8, u8)> = (0..32).map(|_| (1, 0)).collect();
        assert_eq!(to_make_room(&keyless, &(1, 99)), Some(31));
        assert_eq!(to_make_room(&keyless, &(1, 0)), None);
        let mixed = [(1, 0), (1, 7), (1, 7), (2, 0), (2, 0)];
        assert_eq!(to_make_room(&mixed, &(3, 0)), Some(2), "network 1, key 7");
        assert_eq!(to_make_room(&mixed, &(2, 5)), Some(4), "network 2, key 0");
        let even = [(1, 0), (1, 7), (1, 7), (2, 0), (2, 1)];
        assert_eq!(to_make_room(&even, &(2, 5)), None, "they would take turns");
        let each: Vec<(u8, u8)> = (0..32).map(|network| (network, 0)).collect();
        assert_eq!(to_make_room(&each, &(99, 0)), None);
    }
}
