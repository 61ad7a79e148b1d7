//! When the feet of a whole recording stand, and by how much each is moved so that it stands still meanwhile.

use nalgebra::Vector3;

/// A stance is found so many frames late: contact asks for a sole that rests in five pictures.
const LATE: usize = 5;
/// In those frames the sole has to be this near to where it stands, metres.
const NEAR: f64 = 0.06;
/// Two stances on the same place with so few frames between are one.
const BRIDGED: usize = 3;
/// A sole further from the middle of its stance does not stand, metres.
const TORN: f64 = 0.15;
/// The body is shifted evenly over about so many frames to each side.
const EVEN: usize = 4;

/// By how much a foot is moved in a frame, and which sole of it, heel 0 or ball 1.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(super) struct Held {
    pub(super) sole: usize,
    /// Metres.
    pub(super) offset: Vector3<f64>,
    /// Whether it stands.
    pub(super) stands: bool,
}

/// Frames of one foot in which the same sole stands.
struct Stance {
    sole: usize,
    first: usize,
    /// The frame after the last.
    end: usize,
}

/// One foot through the recording: where heel and ball would be by themselves, and whether they were found to stand.
pub(super) fn held(soles: &[[Vector3<f64>; 2]], standing: &[[bool; 2]]) -> Vec<Held> {
    let free = Held {
        sole: 1,
        offset: Vector3::zeros(),
        stands: false,
    };
    let mut held = vec![free; soles.len()];
    let mut end_before = 0;
    for mut stance in stances(soles, standing) {
        let sole = stance.sole;
        let middle = mean(&soles[stance.first..stance.end], sole);
        let earliest = stance.first.saturating_sub(LATE).max(end_before);
        while stance.first > earliest && (soles[stance.first - 1][sole] - middle).norm() < NEAR {
            stance.first -= 1;
        }
        end_before = stance.end;
        let middle = mean(&soles[stance.first..stance.end], sole);
        for frame in stance.first..stance.end {
            let offset = middle - soles[frame][sole];
            if offset.norm() < TORN {
                held[frame] = Held {
                    sole,
                    offset,
                    stands: true,
                };
            }
        }
    }
    roll(&mut held);
    swing(&mut held);
    held
}

/// The stances in order, those with a short gap on the same place joined.
fn stances(soles: &[[Vector3<f64>; 2]], standing: &[[bool; 2]]) -> Vec<Stance> {
    let mut all: Vec<Stance> = Vec::new();
    for (frame, ([heel, ball], places)) in standing.iter().zip(soles).enumerate() {
        // The ball stands longest; a foot rolls from the heel onto it.
        let sole = match (heel, ball) {
            (_, true) => 1,
            (true, false) => 0,
            (false, false) => continue,
        };
        let goes_on = |last: &&mut Stance| {
            last.sole == sole
                && frame <= last.end + BRIDGED
                && (places[sole] - soles[last.end - 1][sole]).norm() < NEAR
        };
        if let Some(last) = all.last_mut().filter(goes_on) {
            last.end = frame + 1;
        } else {
            all.push(Stance {
                sole,
                first: frame,
                end: frame + 1,
            });
        }
    }
    all
}

/// Where a foot rolls from one sole onto the other it does not jump: the later sole goes on from the earlier one's offset. A foot that rolls on and on is carried
/// no further than [`TORN`], and slides from there on.
fn roll(held: &mut [Held]) {
    let mut carried = Vector3::zeros();
    let mut before: Option<Held> = None;
    for now in held {
        if !now.stands {
            (carried, before) = (Vector3::zeros(), None);
            continue;
        }
        if let Some(before) = before.filter(|before| before.sole != now.sole) {
            carried = before.offset - now.offset;
        }
        now.offset = (now.offset + carried).cap_magnitude(TORN);
        before = Some(*now);
    }
}

fn mean(soles: &[[Vector3<f64>; 2]], sole: usize) -> Vector3<f64> {
    let sum: Vector3<f64> = soles.iter().map(|soles| soles[sole]).sum();
    sum / soles.len().max(1) as f64
}

/// Between stances the offset goes over smoothly from one to the next; before the first and after the last it stays.
fn swing(held: &mut [Held]) {
    let standing: Vec<usize> = (0..held.len()).filter(|k| held[*k].stands).collect();
    let (Some(first), Some(last)) = (standing.first(), standing.last()) else {
        return;
    };
    let (before, after) = (held[*first].offset, held[*last].offset);
    for held in &mut held[..*first] {
        held.offset = before;
    }
    for held in &mut held[last + 1..] {
        held.offset = after;
    }
    for pair in standing.windows(2) {
        let [a, b] = [pair[0], pair[1]];
        for frame in a + 1..b {
            let share = (frame - a) as f64 / (b - a) as f64;
            let share = share * share * (3.0 - 2.0 * share);
            held[frame].offset = held[a].offset.lerp(&held[b].offset, share);
        }
    }
}

/// By how much the whole body is shifted in each frame: as its standing feet are moved, evenly from frame to frame.
pub(super) fn shifts(feet: &[Vec<Held>; 2]) -> Vec<Vector3<f64>> {
    let raw: Vec<Vector3<f64>> = (feet[0].iter().zip(&feet[1]))
        .map(|(left, right)| match (left.stands, right.stands) {
            (true, false) => left.offset,
            (false, true) => right.offset,
            _ => (left.offset + right.offset) / 2.0,
        })
        .collect();
    let frames = raw.len();
    (0..frames)
        .map(|frame| {
            let (mut sum, mut weights) = (Vector3::zeros(), 0.0);
            let first = frame.saturating_sub(2 * EVEN);
            let end = (frame + 2 * EVEN + 1).min(frames);
            for (other, shift) in (first..end).zip(&raw[first..end]) {
                let away = (other as f64 - frame as f64) / EVEN as f64;
                let weight = (-away * away / 2.0).exp();
                sum += shift * weight;
                weights += weight;
            }
            sum / weights
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A foot that stands at 0 until frame 12, swings, and stands at 0.6 m from frame 20 on; while it stands its sole slides by `slide` a frame.
    fn walk(slide: f64) -> Vec<[Vector3<f64>; 2]> {
        (0..32)
            .map(|k| {
                let swung = ((f64::from(k) - 12.0) / 8.0).clamp(0.0, 1.0);
                let ball = Vector3::new(0.6 * swung + slide * f64::from(k), 0.0, 0.0);
                [ball - Vector3::x() * 0.2, ball]
            })
            .collect()
    }

    #[test]
    fn a_foot_stands_from_the_frame_in_which_it_is_put_down_though_that_is_noticed_late() {
        let soles = walk(0.004);
        // Found five frames late, with a hole.
        let standing: Vec<[bool; 2]> = (0..32)
            .map(|k| [false, (5..12).contains(&k) || (k >= 25 && k != 28)])
            .collect();
        let held = held(&soles, &standing);
        let at = |k: usize| soles[k][1] + held[k].offset;
        for (frame, now) in held.iter().enumerate() {
            let first = if frame < 12 { 0 } else { 20 };
            let swings = (12..20).contains(&frame);
            assert_eq!(now.stands, !swings, "frame {frame}");
            let off = (at(frame) - at(first)).norm();
            assert!(swings || off < 1e-12, "{off} m in frame {frame}");
        }
        // No jump: the swing takes the one offset over into the other.
        for frame in 1..32 {
            let jump = (held[frame].offset - held[frame - 1].offset).norm();
            assert!(jump < 0.02, "{jump} m in frame {frame}");
        }
    }

    #[test]
    fn a_foot_that_rolls_from_heel_to_ball_does_not_jump() {
        let soles = walk(0.003);
        let standing: Vec<[bool; 2]> = (0..12).map(|k| [k < 6, k >= 6]).collect();
        let held = held(&soles, &standing);
        for frame in 1..12 {
            let jump = (held[frame].offset - held[frame - 1].offset).norm();
            assert!(jump < 0.004, "{jump} m in frame {frame}");
        }
        assert_eq!((held[5].sole, held[6].sole), (0, 1));
    }

    #[test]
    fn a_foot_that_rolls_on_and_on_is_carried_a_bounded_way_without_a_jump() {
        // It slides ahead by 4 mm a frame while it rolls to and fro: two metres after 500 frames.
        let soles: Vec<[Vector3<f64>; 2]> = (0..500)
            .map(|k| {
                let ball = Vector3::x() * (0.004 * f64::from(k));
                [ball - Vector3::x() * 0.2, ball]
            })
            .collect();
        let standing: Vec<[bool; 2]> = (0..500).map(|k| [k / 8 % 2 == 0, k / 8 % 2 == 1]).collect();
        let held = held(&soles, &standing);
        assert!(held.iter().all(|held| held.stands));
        let furthest = held.iter().map(|held| held.offset.norm());
        assert!(furthest.fold(0.0, f64::max) > 0.9 * TORN);
        for frame in 1..500 {
            let offset = held[frame].offset;
            assert!(offset.norm() < TORN + 1e-9, "{offset} in frame {frame}");
            let jump = (offset - held[frame - 1].offset).norm();
            assert!(jump < 0.0041, "{jump} m in frame {frame}");
        }
    }

    #[test]
    fn a_foot_that_never_stands_stays_and_one_that_is_torn_away_does_not_stand() {
        let soles = walk(0.0);
        assert!(
            held(&soles, &[[false; 2]; 32])
                .iter()
                .all(|h| h.offset.norm() == 0.0)
        );
        assert!(
            held(&soles, &[]).iter().all(|held| !held.stands),
            "uneven lengths"
        );
        assert!(held(&[], &[[true; 2]; 4]).is_empty(), "no frames");
        let torn = held(&walk(0.05), &[[false, true]; 32]);
        assert!(torn.iter().all(|held| held.offset.norm() < TORN));
    }

    #[test]
    fn the_body_is_shifted_as_its_standing_foot_is() {
        let still = |x: f64, stands| {
            vec![
                Held {
                    sole: 1,
                    offset: Vector3::x() * x,
                    stands,
                };
                20
            ]
        };
        for (feet, expected) in [
            ([still(0.04, true), still(0.0, false)], 0.04),
            ([still(0.0, false), still(0.02, true)], 0.02),
            ([still(0.04, true), still(0.02, true)], 0.03),
        ] {
            for shift in shifts(&feet) {
                assert!((shift.x - expected).abs() < 1e-12, "{}", shift.x);
            }
        }
    }
}
