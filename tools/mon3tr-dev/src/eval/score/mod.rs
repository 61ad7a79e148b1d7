//! How well a tracked motion follows a known one: the figures of the field, in f64.

mod whole_body;

pub(super) use whole_body::{FINGERS, WholeBody};

use glam::DVec3;
use motion_fit::align::{Pair, Similarity};
use serde::Serialize;
use spmm3::Joint;
use whole_body::{Known, WholeBodyScores};

/// The limbs' joints, over which mean errors are taken, as in the literature on monocular capture.
pub(super) const LIMBS: [Joint; 12] = [
    Joint::LeftHip,
    Joint::RightHip,
    Joint::LeftKnee,
    Joint::RightKnee,
    Joint::LeftAnkle,
    Joint::RightAnkle,
    Joint::LeftShoulder,
    Joint::RightShoulder,
    Joint::LeftElbow,
    Joint::RightElbow,
    Joint::LeftWrist,
    Joint::RightWrist,
];

/// Labels count as swapped where that makes the error smaller than this share of it.
const SWAPPED: f64 = 0.85;
/// Joints that a frame has to show to be compared after its best similarity.
const LEAST_ALIGNED: usize = 4;

/// One frame, of truth or as tracked.
#[derive(Debug, Clone)]
pub(super) struct Posed {
    /// The limbs' joints, metres, camera axes (x right, y down, z away).
    pub(super) limbs: [DVec3; LIMBS.len()],
    /// The limbs' joints in the picture, pixels.
    pub(super) pixels: [[f64; 2]; LIMBS.len()],
    /// Which of the limbs' joints are known at all: of real footage, those that cameras agree on. Only truth's are asked for.
    pub(super) known: [bool; LIMBS.len()],
    /// Which of those that are known are in the picture; only truth's are asked for.
    pub(super) seen: [bool; LIMBS.len()],
    /// The rest of the body, where it is known: of real footage only the limbs are.
    pub(super) whole_body: Option<WholeBody>,
}

impl Posed {
    /// Whether truth knows both hips, to whose middle all else is relative.
    fn hips_known(&self) -> bool {
        self.known[0] && self.known[1]
    }
}

/// The figures of one motion seen by one camera. Joints are compared relative to the middle of the hips.
#[derive(Debug, Clone, Default, Serialize)]
pub(super) struct Scores {
    /// Frames compared, and of how many.
    pub(super) frames: usize,
    pub(super) of: usize,
    /// Limbs' joints of all frames that were left out, because truth does not know them; in frames whose hips are not known, all.
    pub(super) unknown: usize,
    /// Mean distance of the limbs' joints that are in the picture, millimetres; and the error that 95 % of them are below.
    pub(super) mpjpe_mm: f64,
    pub(super) mpjpe_p95_mm: f64,
    /// The same after the best similarity transform.
    pub(super) pa_mpjpe_mm: f64,
    /// By joint, in the order of `LIMBS`; none for a joint that was never in the picture.
    pub(super) limbs_mm: [Option<f64>; LIMBS.len()],
    /// Mean second difference of the limbs' joints, millimetres a frame squared, and that of truth.
    pub(super) jitter_mm: f64,
    pub(super) jitter_truth_mm: f64,
    /// Frames with left and right swapped, and the longest run of them.
    pub(super) swapped: usize,
    pub(super) longest_swap: usize,
    /// Mean distance of the limbs' joints in the picture, percent of the person's height in it.
    pub(super) reprojection_percent: f64,
    /// None where only the limbs are known.
    #[serde(flatten)]
    pub(super) whole_body: Option<WholeBodyScores>,
}

/// Compares `tracked` with `truth`, frame by frame; `skip` frames at the beginning are for finding the person.
pub(super) fn score(
    truth: &[Posed],
    tracked: &[Option<Posed>],
    rate_hz: f64,
    skip: usize,
) -> Scores {
    let compared = truth.iter().enumerate().skip(skip);
    let unknown = (compared.clone())
        .map(|(_, truth)| {
            let known = truth.known.iter().filter(|known| **known).count();
            LIMBS.len() - if truth.hips_known() { known } else { 0 }
        })
        .sum();
    let pairs: Vec<(usize, &Posed, &Posed)> = (compared.zip(tracked.iter().skip(skip)))
        .filter(|((_, truth), _)| truth.hips_known())
        .filter_map(|((k, truth), tracked)| Some((k, truth, tracked.as_ref()?)))
        .collect();
    let mut scores = Scores {
        frames: pairs.len(),
        of: truth.len().saturating_sub(skip),
        unknown,
        ..Scores::default()
    };
    if pairs.is_empty() {
        return scores;
    }
    let mut errors = Vec::with_capacity(pairs.len() * LIMBS.len());
    let mut run = 0;
    // Sums, and of how many joints and frames.
    let (mut aligned, mut reprojected) = ((0.0, 0), (0.0, 0));
    for (_, truth, tracked) in &pairs {
        let (a, b) = (limbs(tracked), limbs(truth));
        let (seen_a, seen_b) = (only_seen(&a, truth), only_seen(&b, truth));
        errors.extend(
            seen_a
                .iter()
                .zip(&seen_b)
                .map(|(a, b)| 1e3 * a.distance(*b)),
        );
        // A similarity fits three points nearly always: they say nothing.
        if seen_a.len() >= LEAST_ALIGNED {
            aligned.0 += 1e3 * aligned_error(&seen_a, &seen_b) * seen_a.len() as f64;
            aligned.1 += seen_a.len();
        }
        let exchanged = only_seen(&swap(&a), truth);
        let swapped =
            mean_distance(&exchanged, &seen_b) < SWAPPED * mean_distance(&seen_a, &seen_b);
        run = if swapped { run + 1 } else { 0 };
        scores.swapped += usize::from(swapped);
        scores.longest_swap = scores.longest_swap.max(run);
        if let Some(share) = reprojection(tracked, truth) {
            reprojected.0 += 100.0 * share;
            reprojected.1 += 1;
        }
    }
    scores.pa_mpjpe_mm = aligned.0 / aligned.1.max(1) as f64;
    scores.reprojection_percent = reprojected.0 / f64::from(reprojected.1.max(1));
    scores.limbs_mm = by_limb(&pairs);
    scores.mpjpe_mm = errors.iter().sum::<f64>() / errors.len().max(1) as f64;
    errors.sort_by(f64::total_cmp);
    scores.mpjpe_p95_mm = errors.get(errors.len() * 95 / 100).copied().unwrap_or(0.0);
    (scores.jitter_mm, scores.jitter_truth_mm) = jitter(&pairs);
    let known: Vec<Known<'_>> = pairs.iter().filter_map(Known::of).collect();
    scores.whole_body = WholeBodyScores::of(&known, rate_hz);
    scores
}

/// The limbs' joints relative to the middle of the hips.
fn limbs(posed: &Posed) -> [DVec3; LIMBS.len()] {
    let hips = (posed.limbs[0] + posed.limbs[1]) / 2.0;
    posed.limbs.map(|joint| joint - hips)
}

/// Those of one frame's points whose joints truth has in the picture.
fn only_seen(points: &[DVec3; LIMBS.len()], truth: &Posed) -> Vec<DVec3> {
    (points.iter().zip(truth.seen))
        .filter_map(|(point, seen)| seen.then_some(*point))
        .collect()
}

/// Mean error of each limb's joint over the frames that show it, millimetres.
fn by_limb(pairs: &[(usize, &Posed, &Posed)]) -> [Option<f64>; LIMBS.len()] {
    std::array::from_fn(|k| {
        let errors: Vec<f64> = (pairs.iter().filter(|(_, truth, _)| truth.seen[k]))
            .map(|(_, truth, tracked)| 1e3 * limbs(tracked)[k].distance(limbs(truth)[k]))
            .collect();
        (!errors.is_empty()).then(|| errors.iter().sum::<f64>() / errors.len() as f64)
    })
}

fn swap(limbs: &[DVec3; LIMBS.len()]) -> [DVec3; LIMBS.len()] {
    std::array::from_fn(|k| limbs[k ^ 1])
}

fn mean_distance(a: &[DVec3], b: &[DVec3]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a.distance(*b)).sum::<f64>() / a.len().max(1) as f64
}

/// Mean distance after the similarity transform of `a` that is best in the sense of least squares, metres; without one where `a` determines none.
fn aligned_error(a: &[DVec3], b: &[DVec3]) -> f64 {
    let pairs: Vec<Pair> = (a.iter().zip(b))
        .map(|(a, b)| Pair {
            from: *a,
            to: *b,
            weight: 1.0,
        })
        .collect();
    Similarity::fit(&pairs).map_or_else(
        || mean_distance(a, b),
        |best| {
            let moved: Vec<DVec3> = a.iter().map(|a| best.apply(*a)).collect();
            mean_distance(&moved, b)
        },
    )
}

/// Mean distance in the picture as a share of the person's height in it; nothing where no joint is in the picture, or where the height is not
/// known: no shoulder or no ankle is.
fn reprojection(tracked: &Posed, truth: &Posed) -> Option<f64> {
    let any = |joints: &[Joint]| {
        (LIMBS.iter().zip(truth.known)).any(|(joint, known)| known && joints.contains(joint))
    };
    if !any(&[Joint::LeftShoulder, Joint::RightShoulder])
        || !any(&[Joint::LeftAnkle, Joint::RightAnkle])
    {
        return None;
    }
    let known = truth.pixels.iter().zip(truth.known);
    let ys = known.filter(|(_, known)| *known).map(|(p, _)| p[1]);
    let height = ys.clone().fold(f64::MIN, f64::max) - ys.fold(f64::MAX, f64::min);
    let seen = truth.seen.iter().filter(|seen| **seen).count();
    let distance: f64 = (tracked.pixels.iter().zip(&truth.pixels).zip(truth.seen))
        .filter(|(_, seen)| *seen)
        .map(|((a, b), _)| (a[0] - b[0]).hypot(a[1] - b[1]))
        .sum();
    (seen > 0).then(|| distance / (seen as f64 * height.max(1.0)))
}

/// Mean second differences of tracked and true joints over runs of three neighbouring frames that know them, millimetres.
fn jitter(pairs: &[(usize, &Posed, &Posed)]) -> (f64, f64) {
    let (mut sums, mut count) = ([0.0; 2], 0);
    for window in pairs.windows(3) {
        let [a, b, c] = window else { continue };
        if c.0 != a.0 + 2 {
            continue;
        }
        let known = |k: &usize| window.iter().all(|(_, truth, _)| truth.known[*k]);
        let joints: Vec<usize> = (0..LIMBS.len()).filter(known).collect();
        count += joints.len();
        for (sum, pick) in sums.iter_mut().zip([2, 1]) {
            let of =
                |entry: &(usize, &Posed, &Posed)| limbs(if pick == 2 { entry.2 } else { entry.1 });
            let (a, b, c) = (of(a), of(b), of(c));
            *sum += (joints.iter())
                .map(|k| 1e3 * (a[*k] - 2.0 * b[*k] + c[*k]).length())
                .sum::<f64>();
        }
    }
    let count = count.max(1) as f64;
    (sums[0] / count, sums[1] / count)
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::DQuat;
    use spmm3::EXPRESSION;
    use whole_body::ANKLES;

    fn posed(seed: f64, moved: impl Fn(DVec3) -> DVec3) -> Posed {
        let limbs = std::array::from_fn(|k| {
            let k = k as f64;
            moved(DVec3::new(
                (k * 1.3 + seed).sin(),
                (k * 0.7 + seed).cos(),
                (k * 2.1).sin(),
            ))
        });
        Posed {
            limbs,
            whole_body: Some(WholeBody {
                feet: [DVec3::ZERO; 2],
                pelvis: DQuat::IDENTITY,
                fingers: [DQuat::from_rotation_z(seed); FINGERS],
                jaw: seed,
                expression: [seed; EXPRESSION],
            }),
            pixels: std::array::from_fn(|k| [k as f64, 100.0 * k as f64]),
            known: [true; LIMBS.len()],
            seen: [true; LIMBS.len()],
        }
    }

    fn whole(scores: &Scores) -> &WholeBodyScores {
        scores.whole_body.as_ref().expect("all is known")
    }

    #[test]
    fn truth_against_itself_has_no_error() {
        let truth: Vec<_> = (0..9).map(|k| posed(0.1 * f64::from(k), |p| p)).collect();
        let tracked: Vec<_> = truth.iter().cloned().map(Some).collect();
        let scores = score(&truth, &tracked, 30.0, 2);
        assert_eq!((scores.frames, scores.of, scores.swapped), (7, 7, 0));
        assert!(
            scores.mpjpe_mm < 1e-9 && scores.pa_mpjpe_mm < 1e-6,
            "{scores:?}"
        );
        assert!(
            (whole(&scores).jaw_correlation.unwrap_or(0.0) - 1.0).abs() < 1e-9,
            "{scores:?}"
        );
        assert_eq!(scores.jitter_mm, scores.jitter_truth_mm);
    }

    #[test]
    fn a_similarity_transform_is_seen_by_the_plain_error_alone() {
        let turn = DQuat::from_rotation_x(0.4);
        let truth = [posed(0.3, |p| p)];
        let tracked = [Some(posed(0.3, |p| 1.2 * (turn * p) + DVec3::X))];
        let scores = score(&truth, &tracked, 30.0, 0);
        assert!(scores.pa_mpjpe_mm < 1e-6, "{scores:?}");
        assert!(scores.mpjpe_mm > 100.0, "{scores:?}");
        let mirrored = [Some(posed(0.3, |p| DVec3::new(-p.x, p.y, p.z)))];
        let scores = score(&truth, &mirrored, 30.0, 0);
        assert!(scores.pa_mpjpe_mm > 10.0, "no rotation mirrors: {scores:?}");
    }

    #[test]
    fn swapped_labels_and_sliding_feet_are_counted() {
        let truth: Vec<_> = (0..4).map(|_| posed(0.3, |p| p)).collect();
        let tracked: Vec<_> = (0..4)
            .map(|k| {
                let mut frame = posed(0.3, |p| p);
                if k == 1 || k == 2 {
                    for pair in frame.limbs.chunks_exact_mut(2) {
                        pair.swap(0, 1);
                    }
                }
                if let Some(whole_body) = &mut frame.whole_body {
                    whole_body.feet[0].x = 0.01 * f64::from(k);
                }
                Some(frame)
            })
            .collect();
        let scores = score(&truth, &tracked, 30.0, 0);
        assert_eq!((scores.swapped, scores.longest_swap), (2, 2));
        let slide = whole(&scores).foot_slide.unwrap_or(0.0);
        assert!(
            (slide - 0.15).abs() < 1e-9,
            "one foot of two at 0.3 m/s: {slide}"
        );
        assert_eq!(whole(&scores).foot_slide_seen, Some(slide), "both are seen");
        let mut hidden = truth.clone();
        for frame in &mut hidden {
            frame.seen[ANKLES] = false;
        }
        let scores = score(&hidden, &tracked, 30.0, 0);
        assert_eq!(
            whole(&scores).foot_slide_seen,
            Some(0.0),
            "the other foot stands"
        );
    }

    #[test]
    fn of_frames_whose_limbs_alone_are_known_nothing_else_is_said() {
        let truth: Vec<_> = (0..4).map(|k| posed(0.1 * f64::from(k), |p| p)).collect();
        let limbs_alone = |frame: &Posed| Posed {
            whole_body: None,
            ..frame.clone()
        };
        let tracked: Vec<_> = truth.iter().map(|frame| Some(limbs_alone(frame))).collect();
        let scores = score(&truth, &tracked, 30.0, 0);
        assert!(scores.whole_body.is_none(), "{scores:?}");
        let json = serde_json::to_value(&scores).expect("figures");
        assert!(json.get("foot_slide").is_none(), "{json}");
        assert!(json.get("mpjpe_mm").is_some(), "{json}");
    }

    #[test]
    fn joints_that_truth_does_not_know_are_left_out_and_counted() {
        let plain: Vec<_> = (0..5).map(|k| posed(0.1 * f64::from(k), |p| p)).collect();
        let tracked: Vec<_> = plain.iter().cloned().map(Some).collect();
        let mut truth = plain.clone();
        // A wrist that was not located, and a frame in which a hip was not.
        for (frame, joint) in [(1, 11), (2, 11), (4, 0)] {
            truth[frame].limbs[joint] = DVec3::ZERO;
            truth[frame].pixels[joint] = [1e6; 2];
            (truth[frame].known[joint], truth[frame].seen[joint]) = (false, false);
        }
        let scores = score(&truth, &tracked, 30.0, 1);
        assert_eq!((scores.frames, scores.of), (3, 4), "the last has no hips");
        assert_eq!(scores.unknown, 2 + LIMBS.len());
        assert!(
            scores.mpjpe_mm < 1e-9 && scores.mpjpe_p95_mm < 1e-9 && scores.pa_mpjpe_mm < 1e-6,
            "{scores:?}"
        );
        assert_eq!(scores.jitter_mm, scores.jitter_truth_mm);
        assert!(scores.reprojection_percent < 1e-9, "{scores:?}");
        assert!(score(&plain, &tracked, 30.0, 1).unknown == 0, "all known");
    }

    #[test]
    fn frames_without_a_person_are_left_out() {
        let truth: Vec<_> = (0..3).map(|_| posed(0.3, |p| p)).collect();
        let tracked = [None, Some(posed(0.3, |p| p)), None];
        let scores = score(&truth, &tracked, 30.0, 0);
        assert_eq!((scores.frames, scores.of), (1, 3));
        assert_eq!(score(&truth, &[None, None, None], 30.0, 0).frames, 0);
    }
}
