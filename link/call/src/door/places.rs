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
    let all = inside.iter().map(|(network, _)| network);
    if let Some(largest) = larger(all, network) {
        let theirs = (inside.iter()).filter(|(network, _)| network == largest);
        let identity = most(theirs.map(|(_, who)| who))?.0;
        return newest(inside, |viewer| {
            viewer.0 == *largest && viewer.1 == *identity
        });
    }
    let near = inside.iter().filter(|(other, _)| other == network);
    let identity = larger(near.map(|(_, who)| who), who)?;
    newest(inside, |viewer| {
        viewer.0 == *network && viewer.1 == *identity
    })
}

/// The group with the most, if it has so many more than `own` that it has no fewer once it has given one away.
/// Otherwise two would take turns without end.
fn larger<'a, T: Eq + Hash>(all: impl Iterator<Item = &'a T> + Clone, own: &T) -> Option<&'a T> {
    let here = all.clone().filter(|other| *other == own).count();
    let (largest, count) = most(all)?;
    (here + 1 < count).then_some(largest)
}

fn most<'a, T: Eq + Hash>(all: impl Iterator<Item = &'a T>) -> Option<(&'a T, usize)> {
    let mut counts: HashMap<&T, usize> = HashMap::new();
    for one in all {
        *counts.entry(one).or_default() += 1;
    }
    counts.into_iter().max_by_key(|(_, count)| *count)
}

/// Who came last has been there for the shortest time.
fn newest<T>(inside: &[T], is_one: impl Fn(&T) -> bool) -> Option<usize> {
    inside.iter().rposition(is_one)
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
        assert_eq!(to_make_room(&mixed, &(2, 5)), None, "they would take turns");
        let each: Vec<(u8, u8)> = (0..32).map(|network| (network, 0)).collect();
        assert_eq!(to_make_room(&each, &(99, 0)), None);
    }
}
