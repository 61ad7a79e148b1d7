//! Postures between and after others.

use super::super::chain::Posture;
use super::super::so3;

/// The posture after `last` at the speed from `before`.
pub(super) fn ahead(before: &Posture, last: &Posture) -> Posture {
    between(before, last, 2.0)
}

/// The posture at `share` of the way from `a` (0) to `b` (1): the pelvis on a line, each joint on the shortest arc. Beyond 1 it goes on at the same speed.
pub(super) fn between(a: &Posture, b: &Posture, share: f64) -> Posture {
    let mut out = *a;
    out.position += (b.position - a.position) * share;
    for ((out, a), b) in out.rotations.iter_mut().zip(&a.rotations).zip(&b.rotations) {
        *out = so3::exp(&(so3::log(&(b * a.inverse())) * share)) * a;
        out.renormalize();
    }
    out
}

/// The posture of `frame` by those that are known in one frame before it and in one after: between them, or that of the only neighbour. `None`
/// where neither is known.
pub(super) fn filled(
    before: Option<(usize, Posture)>,
    after: Option<(usize, Posture)>,
    frame: usize,
) -> Option<Posture> {
    match (before, after) {
        (Some((a, before)), Some((b, after))) if a < b => {
            let share = (frame - a) as f64 / (b - a) as f64;
            Some(between(&before, &after, share))
        }
        (one, other) => one.or(other).map(|(_, posture)| posture),
    }
}

/// Every frame's posture: its own where it is known, else [`filled`] from the nearest known ones. `None` where no frame is known.
pub(super) fn all_filled(known: &[Option<Posture>]) -> Vec<Option<Posture>> {
    let mut frames = known.iter().enumerate();
    let mut next = move || frames.find_map(|(frame, posture)| Some((frame, (*posture)?)));
    let (mut before, mut after) = (None, next());
    (0..known.len())
        .map(|frame| {
            if after.is_some_and(|(known, _)| known <= frame) {
                (before, after) = (after, next());
            }
            known[frame].or_else(|| filled(before, after, frame))
        })
        .collect()
}

/// The frames from the first that is seen to the last, cut where the person was unseen for two frames or more.
pub(super) fn stretches(seen: &[bool]) -> Vec<std::ops::Range<usize>> {
    let mut all: Vec<std::ops::Range<usize>> = Vec::new();
    for (frame, _) in seen.iter().enumerate().filter(|(_, seen)| **seen) {
        match all.last_mut() {
            Some(last) if frame <= last.end + 1 => last.end = frame + 1,
            _ => all.push(frame..frame + 1),
        }
    }
    all
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Vector3;

    #[test]
    fn a_gap_of_one_frame_joins_a_stretch_and_one_of_two_ends_it() {
        let seen = [0, 1, 1, 0, 1, 0, 0, 1, 0].map(|seen| seen == 1);
        assert_eq!(stretches(&seen), [1..5, 7..8]);
        assert_eq!(stretches(&[false; 4]), []);
        assert_eq!(stretches(&[]), []);
    }

    #[test]
    fn frames_between_are_on_the_line_and_the_arc_and_those_outside_are_held() {
        let at = |x: f64, turn: f64| {
            let mut posture = Posture::default();
            posture.position.x = x;
            posture.rotations[4] = so3::exp(&(Vector3::x() * turn));
            posture
        };
        let mut known = [None; 8];
        (known[2], known[6]) = (Some(at(1.0, 0.2)), Some(at(3.0, 1.0)));
        let filled = all_filled(&known);
        assert_eq!(filled.len(), known.len());
        for (frame, x, turn) in [
            (0, 1.0, 0.2),
            (2, 1.0, 0.2),
            (3, 1.5, 0.4),
            (5, 2.5, 0.8),
            (7, 3.0, 1.0),
        ] {
            let found = filled[frame].expect("two are known");
            let angle = so3::log(&found.rotations[4]).x;
            assert!(
                (found.position.x - x).abs() < 1e-12 && (angle - turn).abs() < 1e-12,
                "{frame}: {} m, {angle} rad",
                found.position.x
            );
        }
        assert_eq!(all_filled(&[None; 3]), [None; 3], "nothing is known");
    }
}
