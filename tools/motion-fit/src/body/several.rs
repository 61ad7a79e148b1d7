//! One body in the pictures of several calibrated, synchronous cameras: one solve a frame with the 2-D terms of all of them.
//!
//! The whole recording is there, so frames are smoothed by what comes before and after: nothing lags.

use super::bindings::{self, Binding, COUNT};
use super::chain::{Attachment, BODY_JOINTS, Chain, Posture};
use super::lengths::{Places, as_long_as};
use super::prior::PosePrior;
use super::reading::Exchange;
use super::so3;
use super::solver::SkeletonSolver;
use super::terms::{Term, View};
use super::triangulate::{LocatedBody, label, locate, pixel};
use crate::landmarks::blazepose::{HIPS, SHOULDERS};
use crate::landmarks::{BODY_LANDMARKS, BodyLandmarks};
use glam::{Quat, Vec3};
use nalgebra::{Matrix3, Rotation3, UnitQuaternion, Vector3};
use spmm3::{Joint, MotionParams, Skeleton};

/// Standard deviation of a landmark's pixel, metres at its depth, and its bounds in pixels.
const PIXEL: f64 = 0.02;
const PIXELS: (f64, f64) = (0.5, 40.0);
/// How far one camera's landmark may be off before it counts less, standard deviations.
const ROBUST: f64 = 2.0;
/// What a pose is like beforehand counts this much of what it does for one camera: several cameras see depth.
const PRIOR: f64 = 0.01;
/// How fast a joint's turn and the pelvis' move may change: standard deviations in a frame per second of its length, rad/s and m/s.
const TURN_CHANGE: f64 = 4.0;
const MOVE_CHANGE: f64 = 1.5;
/// Iterations of the first frame, of further ones, and of each of the sweeps that smooth.
const FIRST: usize = 60;
const FURTHER: usize = 12;
const SWEEP: usize = 5;
const SWEEPS: usize = 2;
/// Lengths are measured in so many frames, each posed alone by so many iterations, so many times.
const MEASURED: usize = 24;
const ALONE: usize = 30;
const MEASURINGS: usize = 4;

/// One frame of a body in the room.
#[derive(Debug, Clone, PartialEq)]
pub struct RoomPose {
    /// The pelvis joint in the world, metres.
    pub pelvis: Vec3,
    /// Of each body joint relative to its parent, the pelvis relative to the world.
    pub rotations: [Quat; BODY_JOINTS],
    /// Whether any camera saw a body; otherwise the pose is between its neighbours.
    pub seen: bool,
    /// Root mean square distance of each camera's landmarks from the pose, pixels; `None` where it saw no body.
    pub reprojection_px: Vec<Option<f64>>,
    /// The cameras in which the network had left and right exchanged, at least in a half of the body.
    pub exchanged: Vec<bool>,
}

impl RoomPose {
    /// Writes the body's joints into `motion`; face, fingers and root stay.
    pub fn write(&self, motion: &mut MotionParams) {
        for (joint, rotation) in Joint::ALL.into_iter().zip(self.rotations) {
            motion.set_rotation(joint, rotation);
        }
    }
}

/// A recording's body.
#[derive(Debug, Clone, PartialEq)]
pub struct RoomMotion {
    /// A pose for each frame.
    pub poses: Vec<RoomPose>,
    /// The skeleton that was fitted: as long as the person.
    pub skeleton: Skeleton,
    /// The landmarks in the world for each frame, where two cameras agree; not smoothed.
    pub located: Vec<LocatedBody>,
}

/// Fits one body to what cameras saw, `frames[frame][camera]` with pixels on the camera's [`View`], `step_seconds` apart. With a single view the
/// depth is only as good as the skeleton's size: [`super::BodyFit`] knows more of that case.
#[must_use]
pub fn fit(
    skeleton: &Skeleton,
    views: &[View],
    frames: &[Vec<Option<BodyLandmarks>>],
    step_seconds: f64,
) -> RoomMotion {
    let (labels, located) = located(views, frames);
    let (skeleton, mut recording) = measured(skeleton, views, frames, &labels, &located);
    recording.step = step_seconds.clamp(1e-3, 1.0);
    let mut postures = recording.follow(&located);
    for _ in 0..SWEEPS {
        recording.smooth(&mut postures);
    }
    let poses = recording.poses(&postures);
    RoomMotion {
        poses,
        skeleton,
        located,
    }
}

/// A skeleton as long as the person whom the cameras saw: that of [`fit`], without the motion.
#[must_use]
pub fn measure(
    skeleton: &Skeleton,
    views: &[View],
    frames: &[Vec<Option<BodyLandmarks>>],
) -> Skeleton {
    let (labels, located) = located(views, frames);
    measured(skeleton, views, frames, &labels, &located).0
}

/// For each frame, whose sides each camera has exchanged, and where the landmarks are.
fn located(
    views: &[View],
    frames: &[Vec<Option<BodyLandmarks>>],
) -> (Vec<Vec<Exchange>>, Vec<LocatedBody>) {
    let mut labels = Vec::with_capacity(frames.len());
    let mut located: Vec<LocatedBody> = Vec::with_capacity(frames.len());
    for seen in frames {
        let before = located.last().filter(|before| {
            let known = before.iter().flatten().count();
            known > before.len() / 2
        });
        let exchanges = label(views, seen, before);
        located.push(locate(views, seen, &exchanges));
        labels.push(exchanges);
    }
    (labels, located)
}

/// The skeleton with the person's lengths, and the recording to be followed with it.
fn measured<'a>(
    skeleton: &Skeleton,
    views: &[View],
    frames: &'a [Vec<Option<BodyLandmarks>>],
    labels: &'a [Vec<Exchange>],
    located: &[LocatedBody],
) -> (Skeleton, Recording<'a>) {
    let mut skeleton = skeleton.clone();
    let mut recording = Recording {
        bindings: bindings::bind(&skeleton),
        solver: solver(&skeleton, views),
        frames,
        labels,
        // Lengths are measured frame by frame, without time.
        step: 1.0,
    };
    // Distances between landmarks depend on the pose, and the pose on the lengths.
    let every = frames.len().div_ceil(MEASURED).max(1);
    let chosen: Vec<usize> = (0..frames.len()).step_by(every).collect();
    let measured: Vec<LocatedBody> = chosen.iter().map(|frame| located[*frame]).collect();
    for _ in 0..MEASURINGS {
        let own: Vec<Places> = (chosen.iter())
            .map(|frame| recording.places(*frame, &located[*frame]))
            .collect();
        skeleton = as_long_as(&skeleton, &measured, &own);
        recording.bindings = bindings::bind(&skeleton);
        recording.solver = solver(&skeleton, views);
    }
    (skeleton, recording)
}

/// A solver of the skeleton's bones for several views.
fn solver(skeleton: &Skeleton, views: &[View]) -> SkeletonSolver {
    let mut solver = SkeletonSolver::new(Chain::new(skeleton), PosePrior::default());
    solver.views = views.to_vec();
    solver.prior_weight = PRIOR;
    solver
}

struct Recording<'a> {
    bindings: [Binding; COUNT],
    solver: SkeletonSolver,
    frames: &'a [Vec<Option<BodyLandmarks>>],
    labels: &'a [Vec<Exchange>],
    step: f64,
}

impl Recording<'_> {
    /// Frame after frame, each near to where the ones before lead.
    fn follow(&mut self, located: &[LocatedBody]) -> Vec<Posture> {
        let mut postures: Vec<Posture> = Vec::with_capacity(self.frames.len());
        // Before the person is seen, they stand where they will be.
        let mut known = false;
        for (frame, located) in located.iter().enumerate() {
            let seen = self.is_seen(frame);
            let predicted = match postures.as_slice() {
                [.., before, last] if known => Some(ahead(before, last)),
                [last] if known => Some(*last),
                _ => None,
            };
            let mut posture =
                predicted.unwrap_or_else(|| first(&self.solver, &self.bindings, located));
            if let Some(predicted) = predicted {
                self.pixel_terms(frame, &posture);
                self.near_terms(&predicted, 1.0);
                self.solver.solve(&mut posture, FURTHER);
            } else if seen {
                self.pixel_terms(frame, &posture);
                self.solver.solve(&mut posture, FIRST);
                known = true;
                postures.fill(posture);
            }
            postures.push(posture);
        }
        postures
    }

    /// The landmarks on the skeleton, posed by one frame alone.
    fn places(&mut self, frame: usize, located: &LocatedBody) -> Places {
        let mut posture = first(&self.solver, &self.bindings, located);
        self.pixel_terms(frame, &posture);
        self.solver.solve(&mut posture, ALONE);
        let placed = self.solver.chain().place(&posture);
        let mut places = [None; BODY_LANDMARKS];
        for binding in &self.bindings {
            if let Some(place) = places.get_mut(binding.landmark) {
                *place = Some(placed.point(&binding.drawn));
            }
        }
        places
    }

    /// Each frame once more, near to the middle of its neighbours.
    fn smooth(&mut self, postures: &mut [Posture]) {
        for frame in (1..postures.len().saturating_sub(1)).rev() {
            let middle = between(&postures[frame - 1], &postures[frame + 1]);
            let mut posture = postures[frame];
            self.pixel_terms(frame, &posture);
            // Half of the change from frame to frame.
            self.near_terms(&middle, 0.5);
            self.solver.solve(&mut posture, SWEEP);
            postures[frame] = posture;
        }
    }

    fn is_seen(&self, frame: usize) -> bool {
        self.frames[frame].iter().any(Option::is_some)
    }

    fn pixel_terms(&mut self, frame: usize, near: &Posture) {
        self.solver.terms.clear();
        let placed = self.solver.chain().place(near);
        let (frames, labels) = (&self.frames[frame], &self.labels[frame]);
        for (index, (seen, exchange)) in frames.iter().zip(labels).enumerate() {
            let Some(view) = self.solver.views.get(index).copied() else {
                continue;
            };
            for binding in &self.bindings {
                let (target, sure) = pixel(seen.as_ref(), binding.landmark, *exchange);
                if sure <= 0.0 {
                    continue;
                }
                let at = placed.point(&binding.drawn);
                let depth = (view.camera_from_world * at + view.translation).z;
                let deviation = (PIXEL * view.focal / depth.max(0.2)).clamp(PIXELS.0, PIXELS.1);
                self.solver.terms.push(Term::Pixel {
                    point: binding.drawn,
                    view: index,
                    target,
                    information: (sure * binding.pixel / deviation).powi(2),
                    robust: Some(ROBUST),
                });
            }
        }
    }

    fn near_terms(&mut self, posture: &Posture, share: f64) {
        let turn = (TURN_CHANGE * self.step * share).powi(-2);
        let shift = (MOVE_CHANGE * self.step * share).powi(-2);
        for joint in Joint::ALL.into_iter().take(BODY_JOINTS) {
            self.solver.terms.push(Term::Rotation {
                joint,
                target: posture.rotations[joint.index()],
                information: Matrix3::identity() * turn,
                robust: None,
            });
        }
        let pelvis = Attachment::centre(Joint::Pelvis);
        let shift = Matrix3::identity() * shift;
        self.solver
            .terms
            .push(Term::at(pelvis, posture.position, shift));
    }

    fn poses(&self, postures: &[Posture]) -> Vec<RoomPose> {
        (postures.iter().enumerate())
            .map(|(frame, posture)| {
                let placed = self.solver.chain().place(posture);
                let (frames, labels) = (&self.frames[frame], &self.labels[frame]);
                let reprojection_px = (frames.iter().zip(labels).zip(&self.solver.views))
                    .map(|((seen, exchange), view)| {
                        let (mut sum, mut weights) = (0.0, 0.0);
                        for binding in &self.bindings {
                            let (target, sure) = pixel(seen.as_ref(), binding.landmark, *exchange);
                            let off = view.project(&placed.point(&binding.drawn)) - target;
                            let weight = sure * binding.pixel;
                            sum += weight * off.norm_squared();
                            weights += weight;
                        }
                        (weights > 0.0).then(|| f64::sqrt(sum / weights))
                    })
                    .collect();
                RoomPose {
                    pelvis: Vec3::from_array(posture.position.map(single).into()),
                    rotations: posture.rotations.map(|q| {
                        let [x, y, z, w] = [q.i, q.j, q.k, q.w].map(single);
                        Quat::from_xyzw(x, y, z, w).normalize()
                    }),
                    seen: self.is_seen(frame),
                    reprojection_px,
                    exchanged: labels.iter().map(|e| *e != Exchange::NONE).collect(),
                }
            })
            .collect()
    }
}

/// The most likely pose, turned and placed as hips and shoulders are.
fn first(solver: &SkeletonSolver, bindings: &[Binding; COUNT], located: &LocatedBody) -> Posture {
    let mut posture = solver.prior.posture();
    let at = |landmark: usize| located[landmark].map(|located| located.place);
    let (hips, shoulders) = (HIPS.map(at), SHOULDERS.map(at));
    if let ([Some(a), Some(b)], [Some(c), Some(d)]) = (hips, shoulders) {
        let (across, along) = (a - b + c - d, (c + d) - (a + b));
        let forward = across.cross(&along).try_normalize(1e-6);
        if let (Some(forward), Some(x)) = (forward, across.try_normalize(1e-6)) {
            let axes = Matrix3::from_columns(&[x, forward.cross(&x), forward]);
            posture.rotations[0] =
                UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(axes));
        }
    }
    // The mean of what is located goes to the mean of the same on the body.
    let placed = solver.chain().place(&posture);
    let (mut shift, mut count) = (Vector3::zeros(), 0.0);
    for binding in bindings {
        if let Some(place) = at(binding.landmark) {
            shift += place - placed.point(&binding.drawn);
            count += 1.0;
        }
    }
    if count > 0.0 {
        posture.position += shift / count;
    }
    posture
}

/// The posture after `last` at the speed from `before`.
fn ahead(before: &Posture, last: &Posture) -> Posture {
    let mut out = *last;
    out.position += last.position - before.position;
    for ((out, last), before) in
        (out.rotations.iter_mut().zip(&last.rotations)).zip(&before.rotations)
    {
        *out = (last * before.inverse()) * last;
        out.renormalize();
    }
    out
}

/// The posture in the middle.
fn between(a: &Posture, b: &Posture) -> Posture {
    let mut out = *a;
    out.position = (a.position + b.position) / 2.0;
    for ((out, a), b) in out.rotations.iter_mut().zip(&a.rotations).zip(&b.rotations) {
        *out = so3::exp(&(so3::log(&(b * a.inverse())) / 2.0)) * a;
        out.renormalize();
    }
    out
}

/// The view of a camera that stands still.
#[must_use]
pub fn view(
    camera_from_world: glam::DMat3,
    translation: glam::DVec3,
    focal: f64,
    centre: glam::DVec2,
) -> View {
    let [x, y, z] = [0, 1, 2].map(|row| {
        let row = camera_from_world.row(row);
        nalgebra::RowVector3::new(row.x, row.y, row.z)
    });
    View {
        camera_from_world: Matrix3::from_rows(&[x, y, z]),
        translation: Vector3::new(translation.x, translation.y, translation.z),
        focal,
        centre: nalgebra::Vector2::new(centre.x, centre.y),
    }
}

#[expect(
    clippy::cast_possible_truncation,
    reason = "metres and quaternions of motion are f32"
)]
fn single(value: f64) -> f32 {
    value as f32
}

#[cfg(test)]
mod tests {
    use super::super::chain::wide;
    use super::*;
    use crate::landmarks::BodyPoint;
    use glam::{DMat3, DVec2, DVec3, Vec2};

    /// A person of the demo's size, roughly; only the body's joints matter.
    fn skeleton() -> Skeleton {
        use Joint::*;
        let mut rest = [Vec3::new(0.0, 0.95, 0.0); spmm3::JOINTS];
        let sides = [
            ([LeftHip, RightHip], [0.09, 0.88, 0.0]),
            ([LeftKnee, RightKnee], [0.1, 0.48, 0.0]),
            ([LeftAnkle, RightAnkle], [0.1, 0.08, -0.03]),
            ([LeftFoot, RightFoot], [0.12, 0.03, 0.1]),
            ([LeftCollar, RightCollar], [0.05, 1.38, 0.0]),
            ([LeftShoulder, RightShoulder], [0.18, 1.42, -0.01]),
            ([LeftElbow, RightElbow], [0.45, 1.41, -0.03]),
            ([LeftWrist, RightWrist], [0.7, 1.41, -0.01]),
            ([LeftIndex1, RightIndex1], [0.8, 1.41, 0.02]),
            ([LeftPinky1, RightPinky1], [0.78, 1.40, -0.03]),
        ];
        for (pair, at) in sides {
            let at = Vec3::from_array(at);
            rest[pair[0].index()] = at;
            rest[pair[1].index()] = at * Vec3::new(-1.0, 1.0, 1.0);
        }
        for (joint, y) in [
            (Spine1, 1.05),
            (Spine2, 1.18),
            (Spine3, 1.25),
            (Neck, 1.48),
            (Head, 1.57),
        ] {
            rest[joint.index()] = Vec3::new(0.0, y, 0.0);
        }
        Skeleton::new(rest).expect("in range")
    }

    fn ring(cameras: usize) -> Vec<View> {
        (0..cameras)
            .map(|k| {
                let angle = std::f64::consts::TAU * k as f64 / cameras as f64;
                // y up becomes y down: half a turn about x, after the turn about the person.
                let turn = DMat3::from_rotation_x(std::f64::consts::PI + 0.15)
                    * DMat3::from_rotation_y(angle);
                let eye = turn.transpose() * DVec3::new(0.0, 0.0, -3.5) + DVec3::Y;
                view(turn, -(turn * eye), 1100.0, DVec2::new(540.0, 700.0))
            })
            .collect()
    }

    fn motion(frame: usize) -> MotionParams {
        let swing = (frame as f32 * 0.1).sin();
        let mut motion = MotionParams::default();
        motion.root_translation = Vec3::new(0.02 * frame as f32, 0.03, -0.1);
        let turns = [
            (Joint::Pelvis, [0.05, 0.5, 0.0]),
            (Joint::LeftHip, [-0.3 * swing, 0.0, 0.05]),
            (Joint::RightHip, [0.3 * swing, 0.0, -0.05]),
            (Joint::LeftKnee, [0.4, 0.0, 0.0]),
            (Joint::LeftShoulder, [0.0, 0.3 * swing, -1.0]),
            (Joint::RightShoulder, [0.0, 0.0, 1.1]),
            (Joint::LeftElbow, [0.0, -0.7, 0.0]),
            (Joint::RightElbow, [0.0, 0.9 + 0.2 * swing, 0.0]),
        ];
        for (joint, turn) in turns {
            motion.set_axis_angle(joint, Vec3::from_array(turn));
        }
        motion
    }

    /// What the cameras see of the motion without any error, by the skeleton's own forward kinematics.
    fn seen(
        skeleton: &Skeleton,
        views: &[View],
        motion: &MotionParams,
    ) -> Vec<Option<BodyLandmarks>> {
        let places = bindings::landmark_places(skeleton, motion);
        (views.iter())
            .map(|view| {
                let mut points = [BodyPoint::default(); BODY_LANDMARKS];
                for (point, place) in points.iter_mut().zip(places) {
                    if let Some(place) = place {
                        let pixel = view.project(&wide(place));
                        point.pixel = Vec2::new(single(pixel.x), single(pixel.y));
                        point.confidence = 1.0;
                    }
                }
                Some(BodyLandmarks { points })
            })
            .collect()
    }

    #[test]
    fn limbs_that_four_cameras_see_without_error_are_found_to_a_millimetre() {
        let (skeleton, views) = (skeleton(), ring(4));
        let frames: Vec<_> = (0..6)
            .map(|frame| seen(&skeleton, &views, &motion(frame)))
            .collect();
        let fitted = fit(&skeleton, &views, &frames, 1.0 / 30.0);
        use Joint::*;
        for (frame, pose) in fitted.poses.iter().enumerate() {
            let truth = motion(frame);
            let mut found = MotionParams::default();
            pose.write(&mut found);
            let (true_joints, joints) = (skeleton.pose(&truth), fitted.skeleton.pose(&found));
            let root = pose.pelvis - fitted.skeleton.rest_positions()[0];
            // The shoulder joints are not here: no landmark tells the collar's turn about itself. Their landmarks are, below.
            for joint in [
                Pelvis, LeftHip, RightHip, LeftKnee, RightKnee, LeftAnkle, RightAnkle, LeftElbow,
                RightElbow, LeftWrist, RightWrist,
            ] {
                let off = joints.position(joint) + root
                    - (true_joints.position(joint) + truth.root_translation);
                let name = joint.name();
                let millimetres = off.length() * 1e3;
                assert!(
                    millimetres < 1.0,
                    "{name} is {millimetres:.2} mm off in frame {frame}"
                );
            }
            found.root_translation = root;
            let places = bindings::landmark_places(&fitted.skeleton, &found);
            let true_places = bindings::landmark_places(&skeleton, &truth);
            for landmark in SHOULDERS {
                let off = places[landmark]
                    .zip(true_places[landmark])
                    .map(|(a, b)| a.distance(b));
                assert!(
                    off.is_some_and(|off| off < 1e-3),
                    "a shoulder is {off:?} m off in frame {frame}"
                );
            }
        }
    }

    #[test]
    fn a_person_of_other_lengths_is_measured() {
        let (own, views) = (skeleton(), ring(3));
        let person = Skeleton::new(own.rest_positions().map(|p| p * 1.1)).expect("in range");
        let frames: Vec<_> = (0..5).map(|f| seen(&person, &views, &motion(f))).collect();
        let fitted = fit(&own, &views, &frames, 1.0 / 30.0);
        for joint in [Joint::LeftKnee, Joint::RightElbow, Joint::LeftAnkle] {
            let share =
                fitted.skeleton.rest_offset(joint).length() / own.rest_offset(joint).length();
            assert!((share - 1.1).abs() < 0.02, "{}: {share}", joint.name());
        }
    }

    #[test]
    fn frames_without_a_person_are_filled_from_their_neighbours() {
        let (skeleton, views) = (skeleton(), ring(4));
        let mut frames: Vec<_> = (0..7)
            .map(|frame| seen(&skeleton, &views, &motion(frame)))
            .collect();
        for unseen in [0, 3] {
            frames[unseen] = vec![None; views.len()];
        }
        let fitted = fit(&skeleton, &views, &frames, 1.0 / 30.0);
        assert!(!fitted.poses[3].seen && fitted.poses[4].seen, "said");
        let off = (fitted.poses[3].pelvis.x - fitted.poses[2].pelvis.x - 0.02).abs();
        assert!(off < 0.01, "{off} m from the way");
        let nobody = vec![vec![None; views.len()]; 2];
        let fitted = fit(&skeleton, &views, &nobody, 1.0 / 30.0);
        assert!(
            fitted
                .poses
                .iter()
                .all(|pose| !pose.seen && pose.pelvis.is_finite()),
            "nobody"
        );
    }
}
