//! How well a tracked motion follows a known one: the figures of the field, in f64.

use glam::{DMat3, DQuat, DVec3};
use nalgebra::{Matrix3, SVD};
use serde::Serialize;
use spmm3::{EXPRESSION, Joint};

/// Joints before the jaw, the eyes and the fingers.
pub(super) const BODY: usize = 22;
/// Finger joints of both hands.
pub(super) const FINGERS: usize = 30;

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

/// The left ankle in [`LIMBS`]; the right one follows.
const ANKLES: usize = 4;
/// A foot is in stance while its joint moves slower than this in truth, metres a second.
const STANCE: f64 = 0.1;
/// Labels count as swapped where that makes the error smaller than this share of it.
const SWAPPED: f64 = 0.85;
/// Joints that a frame has to show to be compared after its best similarity.
const LEAST_ALIGNED: usize = 4;

/// One frame, of truth or as tracked.
#[derive(Debug, Clone)]
pub(super) struct Posed {
    /// The body's joints, metres, camera axes (x right, y down, z away).
    pub(super) joints: [DVec3; BODY],
    /// The feet's joints, left and right, in the room, metres.
    pub(super) feet: [DVec3; 2],
    /// The pelvis in camera axes.
    pub(super) pelvis: DQuat,
    /// Each finger joint relative to its parent, left hand first.
    pub(super) fingers: [DQuat; FINGERS],
    /// Opening of the jaw, radians.
    pub(super) jaw: f64,
    /// Expression coefficients.
    pub(super) expression: [f64; EXPRESSION],
    /// The limbs' joints in the picture, pixels.
    pub(super) pixels: [[f64; 2]; LIMBS.len()],
    /// Which of the limbs' joints are in the picture; only truth's are asked for.
    pub(super) seen: [bool; LIMBS.len()],
}

/// The figures of one motion seen by one camera. Joints are compared relative to the middle of the hips.
#[derive(Debug, Clone, Default, Serialize)]
pub(super) struct Scores {
    /// Frames compared, and of how many.
    pub(super) frames: usize,
    pub(super) of: usize,
    /// Mean distance of the limbs' joints that are in the picture, millimetres; and the error that 95 % of them are below.
    pub(super) mpjpe_mm: f64,
    pub(super) mpjpe_p95_mm: f64,
    /// The same after the best similarity transform.
    pub(super) pa_mpjpe_mm: f64,
    /// By joint, in the order of `LIMBS`; none for a joint that was never in the picture.
    pub(super) limbs_mm: [Option<f64>; LIMBS.len()],
    /// Angle between the pelvis and its truth, degrees.
    pub(super) pelvis_degrees: f64,
    /// Mean angle of a finger joint from its truth, degrees: left, right.
    pub(super) finger_degrees: [f64; 2],
    /// Correlation of a hand's curl (the sum of its flexions, thumb left out) with truth while the wrist is in the picture; none where truth
    /// hardly moves.
    pub(super) curl_correlation: [Option<f64>; 2],
    /// Mean correlation of those expression coefficients that move in truth, and that of the jaw's opening.
    pub(super) expression_correlation: Option<f64>,
    pub(super) jaw_correlation: Option<f64>,
    /// Mean second difference of the limbs' joints, millimetres a frame squared, and that of truth.
    pub(super) jitter_mm: f64,
    pub(super) jitter_truth_mm: f64,
    /// Mean speed of a foot while it stands in truth, metres a second; none where no foot stands.
    pub(super) foot_slide: Option<f64>,
    /// The same of the frames in which that foot's ankle is in the picture.
    pub(super) foot_slide_seen: Option<f64>,
    /// Frames with left and right swapped, and the longest run of them.
    pub(super) swapped: usize,
    pub(super) longest_swap: usize,
    /// Mean distance of the limbs' joints in the picture, percent of the person's height in it.
    pub(super) reprojection_percent: f64,
}

/// Compares `tracked` with `truth`, frame by frame; `skip` frames at the beginning are for finding the person.
pub(super) fn score(
    truth: &[Posed],
    tracked: &[Option<Posed>],
    rate_hz: f64,
    skip: usize,
) -> Scores {
    let pairs: Vec<(usize, &Posed, &Posed)> = (truth.iter().zip(tracked).enumerate().skip(skip))
        .filter_map(|(k, (truth, tracked))| Some((k, truth, tracked.as_ref()?)))
        .collect();
    let mut scores = Scores {
        frames: pairs.len(),
        of: truth.len().saturating_sub(skip),
        ..Scores::default()
    };
    if pairs.is_empty() {
        return scores;
    }
    let count = pairs.len() as f64;
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
        scores.pelvis_degrees += angle(tracked.pelvis, truth.pelvis) / count;
        for (hand, degrees) in scores.finger_degrees.iter_mut().enumerate() {
            let of = |posed: &Posed, k: usize| posed.fingers[hand * FINGERS / 2 + k];
            *degrees += (0..FINGERS / 2)
                .map(|k| angle(of(tracked, k), of(truth, k)))
                .sum::<f64>()
                / (count * (FINGERS / 2) as f64);
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
    [scores.foot_slide, scores.foot_slide_seen] = foot_slide(&pairs, rate_hz);
    for (hand, correlation) in scores.curl_correlation.iter_mut().enumerate() {
        // A hand that is out of the picture says nothing of the fit.
        let wrist = LIMBS.len() - 2 + hand;
        let shown: Vec<_> = pairs
            .iter()
            .filter(|(_, truth, _)| truth.seen[wrist])
            .copied()
            .collect();
        *correlation = correlate(&shown, 0.05, |posed| curl(posed, hand));
    }
    scores.jaw_correlation = correlate(&pairs, 0.01, |posed| posed.jaw);
    let moving: Vec<f64> = (0..EXPRESSION)
        .filter_map(|k| correlate(&pairs, 0.05, |posed| posed.expression[k]))
        .collect();
    scores.expression_correlation =
        (!moving.is_empty()).then(|| moving.iter().sum::<f64>() / moving.len() as f64);
    scores
}

/// The limbs' joints relative to the middle of the hips.
fn limbs(posed: &Posed) -> [DVec3; LIMBS.len()] {
    let at = |joint: Joint| posed.joints[joint.index()];
    let hips = (at(Joint::LeftHip) + at(Joint::RightHip)) / 2.0;
    LIMBS.map(|joint| at(joint) - hips)
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

/// Degrees between two rotations.
fn angle(a: DQuat, b: DQuat) -> f64 {
    a.angle_between(b).to_degrees()
}

/// Mean distance after the similarity transform of `a` that is best in the sense of least squares (Umeyama, 1991), metres.
fn aligned_error(a: &[DVec3], b: &[DVec3]) -> f64 {
    let centre = |points: &[DVec3]| points.iter().sum::<DVec3>() / points.len().max(1) as f64;
    let (ca, cb) = (centre(a), centre(b));
    let mut covariance = DMat3::ZERO;
    let mut spread = 0.0;
    for (a, b) in a.iter().zip(b) {
        let (a, b) = (*a - ca, *b - cb);
        covariance += DMat3::from_cols(b * a.x, b * a.y, b * a.z);
        spread += a.length_squared();
    }
    let svd = SVD::new(
        Matrix3::from_column_slice(&covariance.to_cols_array()),
        true,
        true,
    );
    let (Some(u), Some(v_t)) = (svd.u, svd.v_t) else {
        return mean_distance(a, b);
    };
    let mut signs = nalgebra::Vector3::new(1.0, 1.0, 1.0);
    if (u * v_t).determinant() < 0.0 {
        // The least singular value's axis; nalgebra sorts them.
        signs.z = -1.0;
    }
    let turn = u * Matrix3::from_diagonal(&signs) * v_t;
    let scale = svd.singular_values.dot(&signs) / spread.max(f64::MIN_POSITIVE);
    let turn = DMat3::from_cols_slice(turn.as_slice());
    let moved: Vec<DVec3> = a.iter().map(|a| scale * (turn * (*a - ca)) + cb).collect();
    mean_distance(&moved, b)
}

/// Mean distance in the picture as a share of the person's height in it; nothing where no joint is in the picture.
fn reprojection(tracked: &Posed, truth: &Posed) -> Option<f64> {
    let ys = truth.pixels.iter().map(|p| p[1]);
    let height = ys.clone().fold(f64::MIN, f64::max) - ys.fold(f64::MAX, f64::min);
    let seen = truth.seen.iter().filter(|seen| **seen).count();
    let distance: f64 = (tracked.pixels.iter().zip(&truth.pixels).zip(truth.seen))
        .filter(|(_, seen)| *seen)
        .map(|((a, b), _)| (a[0] - b[0]).hypot(a[1] - b[1]))
        .sum();
    (seen > 0).then(|| distance / (seen as f64 * height.max(1.0)))
}

/// Mean second differences of tracked and true joints over runs of three neighbouring frames, millimetres.
fn jitter(pairs: &[(usize, &Posed, &Posed)]) -> (f64, f64) {
    let (mut sums, mut count) = ([0.0; 2], 0);
    for window in pairs.windows(3) {
        let [a, b, c] = window else { continue };
        if c.0 != a.0 + 2 {
            continue;
        }
        count += 1;
        for (sum, pick) in sums.iter_mut().zip([2, 1]) {
            let of =
                |entry: &(usize, &Posed, &Posed)| limbs(if pick == 2 { entry.2 } else { entry.1 });
            let (a, b, c) = (of(a), of(b), of(c));
            *sum += (0..LIMBS.len())
                .map(|k| 1e3 * (a[k] - 2.0 * b[k] + c[k]).length())
                .sum::<f64>()
                / LIMBS.len() as f64;
        }
    }
    let count = f64::from(count.max(1));
    (sums[0] / count, sums[1] / count)
}

/// Mean speed of tracked feet while they stand in truth: of all, and of those whose ankles are in the picture.
fn foot_slide(pairs: &[(usize, &Posed, &Posed)], rate_hz: f64) -> [Option<f64>; 2] {
    let mut sums = [(0.0, 0u32); 2];
    for window in pairs.windows(2) {
        let [a, b] = window else { continue };
        if b.0 != a.0 + 1 {
            continue;
        }
        for foot in 0..2 {
            if a.1.feet[foot].distance(b.1.feet[foot]) * rate_hz >= STANCE {
                continue;
            }
            let speed = a.2.feet[foot].distance(b.2.feet[foot]) * rate_hz;
            let seen = a.1.seen[ANKLES + foot] && b.1.seen[ANKLES + foot];
            for (sum, count) in &mut sums[..=usize::from(seen)] {
                *sum += speed;
                *count += 1;
            }
        }
    }
    sums.map(|(sum, count)| (count > 0).then(|| sum / f64::from(count)))
}

/// Sum of the flexions of a hand's four fingers, radians.
fn curl(posed: &Posed, hand: usize) -> f64 {
    // Index, middle, little and ring finger; the thumb's joints are the last.
    let joints = &posed.fingers[hand * FINGERS / 2..][..12];
    joints
        .iter()
        .map(|q| q.angle_between(DQuat::IDENTITY))
        .sum()
}

/// Pearson's correlation of `of` between tracked and true frames; none where truth deviates by less than `least`.
fn correlate(
    pairs: &[(usize, &Posed, &Posed)],
    least: f64,
    of: impl Fn(&Posed) -> f64,
) -> Option<f64> {
    let count = pairs.len().max(1) as f64;
    let mean = |pick: &dyn Fn(&(usize, &Posed, &Posed)) -> f64| {
        pairs.iter().map(pick).sum::<f64>() / count
    };
    let (tracked, truth) = (mean(&|p| of(p.2)), mean(&|p| of(p.1)));
    let (mut both, mut a, mut b) = (0.0, 0.0, 0.0);
    for (_, one, other) in pairs {
        let (x, y) = (of(other) - tracked, of(one) - truth);
        both += x * y;
        a += x * x;
        b += y * y;
    }
    let moves = (b / count).sqrt() >= least;
    moves.then(|| if a > 0.0 { both / (a * b).sqrt() } else { 0.0 })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn posed(seed: f64, moved: impl Fn(DVec3) -> DVec3) -> Posed {
        let joints: [DVec3; BODY] = std::array::from_fn(|k| {
            let k = k as f64;
            moved(DVec3::new(
                (k * 1.3 + seed).sin(),
                (k * 0.7 + seed).cos(),
                (k * 2.1).sin(),
            ))
        });
        Posed {
            joints,
            feet: [DVec3::ZERO; 2],
            pelvis: DQuat::IDENTITY,
            fingers: [DQuat::from_rotation_z(seed); FINGERS],
            jaw: seed,
            expression: [seed; EXPRESSION],
            pixels: std::array::from_fn(|k| [k as f64, 100.0 * k as f64]),
            seen: [true; LIMBS.len()],
        }
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
            (scores.jaw_correlation.unwrap_or(0.0) - 1.0).abs() < 1e-9,
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
                    for pair in LIMBS.chunks_exact(2) {
                        frame.joints.swap(pair[0].index(), pair[1].index());
                    }
                }
                frame.feet[0].x = 0.01 * f64::from(k);
                Some(frame)
            })
            .collect();
        let scores = score(&truth, &tracked, 30.0, 0);
        assert_eq!((scores.swapped, scores.longest_swap), (2, 2));
        let slide = scores.foot_slide.unwrap_or(0.0);
        assert!(
            (slide - 0.15).abs() < 1e-9,
            "one foot of two at 0.3 m/s: {slide}"
        );
        assert_eq!(scores.foot_slide_seen, scores.foot_slide, "both are seen");
        let mut hidden = truth.clone();
        for frame in &mut hidden {
            frame.seen[ANKLES] = false;
        }
        let scores = score(&hidden, &tracked, 30.0, 0);
        assert_eq!(scores.foot_slide_seen, Some(0.0), "the other foot stands");
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
