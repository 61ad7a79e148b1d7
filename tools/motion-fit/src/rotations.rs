//! What models say in rotations and weights, in the avatar's own frames.

use crate::body::{BodyPose, Limb};
use crate::face::{self, FaceMeasures};
use crate::hands::{FINGER_JOINTS, HandPose};
use crate::landmarks::Camera;
use crate::landmarks::estimates::{BodyRotations, FaceExpression, HandRotations, JointRotation};
use glam::{DQuat, Quat, Vec2, Vec3};
use spmm3::{EXPRESSION, ExpressionBasis, Expressions, Joint, MotionParams, Skeleton};

/// Weights beyond are no face: components are in standard deviations, shapes 0..=1.
const MOST_WEIGHT: f32 = 6.0;
/// Widest turn of a jaw and of an eye, radians.
const MOST_JAW: f32 = 0.6;
const MOST_EYE: f32 = 0.8;

/// A rotation in the camera's own axes, of one that a network saw along the line of sight through `sight`.
pub(crate) fn in_camera(rotation: Quat, sight: Option<Vec2>, camera: &Camera) -> DQuat {
    let aside = sight.map_or(DQuat::IDENTITY, |at| camera.line_of_sight(at.as_dvec2()));
    aside * rotation.as_dquat()
}

/// Puts a body's known rotations into `pose`, which landmarks or nothing made. The pelvis stays above its place, and the lowest foot at
/// its height.
pub(crate) fn turn_body(
    pose: &mut BodyPose,
    seen: &BodyRotations,
    camera: &Camera,
    skeleton: &Skeleton,
) {
    let before = lowest_foot(pose, skeleton);
    let mut sums = [(0.0f32, 0.0f32); 6];
    for (index, (joint, turned)) in Joint::ALL.into_iter().zip(&seen.joints).enumerate() {
        let Some(rotation) = turned.known() else {
            continue;
        };
        let rotation = if joint == Joint::Pelvis {
            let camera_from_world = Quat::from_mat3(&pose.camera.camera_from_world);
            camera_from_world.inverse() * in_camera(rotation, seen.sight, camera).as_quat()
        } else {
            rotation
        };
        if let Some(to) = pose
            .rotations
            .get_mut(index)
            .filter(|_| rotation.is_finite())
        {
            *to = rotation;
            let (sum, count) = &mut sums[Limb::of(joint) as usize];
            *sum += turned.confidence.min(1.0);
            *count += 1.0;
        }
    }
    for (confidence, (sum, count)) in pose.confidence.iter_mut().zip(sums) {
        if count > 0.0 {
            *confidence = sum / count;
            pose.seen = true;
        }
    }
    pose.root_translation.y += before - lowest_foot(pose, skeleton);
}

/// Height of the lowest joint of the feet against the pelvis at rest, metres.
fn lowest_foot(pose: &BodyPose, skeleton: &Skeleton) -> f32 {
    use Joint::{LeftAnkle, LeftFoot, RightAnkle, RightFoot};
    let rotation = |joint: Joint| pose.rotations.get(joint.index()).copied();
    let joints = skeleton.pose_rotations(|joint| rotation(joint).unwrap_or(Quat::IDENTITY));
    [LeftAnkle, LeftFoot, RightAnkle, RightFoot]
        .map(|joint| joints.position(joint).y)
        .into_iter()
        .fold(f32::INFINITY, f32::min)
}

/// The hand of known rotations; unknown joints are those of `landmarks`, the fit of the same hand's landmarks, or of a `relaxed` one.
pub(crate) fn hand_pose(
    seen: &HandRotations,
    camera: &Camera,
    landmarks: Option<HandPose>,
    relaxed: &[DQuat; FINGER_JOINTS],
) -> HandPose {
    let [wrist, fingers @ ..] = &seen.joints;
    let palm = wrist
        .known()
        .map(|rotation| in_camera(rotation, seen.sight, camera));
    let mut pose = landmarks.unwrap_or(HandPose {
        camera_from_palm: None,
        fingers: *relaxed,
        confidence: 0.0,
        palm_confidence: 0.0,
    });
    let known = seen.joints.iter().filter(|joint| joint.known().is_some());
    let (sum, count) = known.fold((0.0, 0.0), |(sum, count), joint| {
        (sum + f64::from(joint.confidence.min(1.0)), count + 1.0)
    });
    if count > 0.0 {
        pose.confidence = sum / count;
    }
    if let Some(palm) = palm {
        pose.camera_from_palm = Some(palm);
        pose.palm_confidence = f64::from(wrist.confidence.min(1.0));
    }
    for (to, from) in pose.fingers.iter_mut().zip(fingers) {
        if let Some(rotation) = from.known() {
            *to = rotation.as_dquat();
        }
    }
    pose
}

/// What a face shows: joints relative to the head, and the expression in the avatar's basis.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct FaceShown {
    pub(crate) expression: [f32; EXPRESSION],
    pub(crate) jaw: Quat,
    pub(crate) eyes: [Quat; 2],
}

impl FaceShown {
    /// Of landmarks.
    pub(crate) fn measured(face: &FaceMeasures, presets: &Expressions) -> Self {
        let pose = face::apply(face, presets);
        #[allow(clippy::cast_possible_truncation, reason = "radians")]
        let jaw = pose.jaw as f32;
        Self {
            expression: pose.expression,
            jaw: Quat::from_rotation_x(jaw),
            eyes: pose.eyes.map(|eye| eye.as_quat()),
        }
    }

    /// Of weights in any basis, and whether the avatar can show them: else its face is at rest, but for joints and lids. Eyes that are
    /// not known look where the landmarks say, but for ARKit's shapes, which turn them. Nothing if a number is not finite or there is no face.
    pub(crate) fn expressed(
        seen: &FaceExpression,
        measured: Option<&FaceMeasures>,
        basis: &ExpressionBasis,
        presets: &Expressions,
    ) -> Option<(Self, bool)> {
        let lids = seen.eyelids.unwrap_or_default();
        let finite = seen.weights.iter().chain(&lids).all(|w| w.is_finite());
        let lids = lids.map(|lid| lid.clamp(0.0, 1.0));
        if !(finite && seen.confidence > 0.0) {
            return None;
        }
        let mut frame = MotionParams::default();
        // Lids that the network saw are more than those of the landmarks.
        let measured = measured.map(|measured| FaceMeasures {
            blink: (seen.eyelids).map_or(measured.blink, |_| lids.map(f64::from)),
            ..*measured
        });
        let shown = measured.map(|measured| Self::measured(&measured, presets));
        if seen.basis.is_some() {
            for (to, from) in frame.expression_mut().iter_mut().zip(&seen.weights) {
                *to = from.clamp(-MOST_WEIGHT, MOST_WEIGHT);
            }
        } else if let Some(shown) = shown {
            frame.expression_mut().copy_from_slice(&shown.expression);
            frame.set_rotation(Joint::Jaw, shown.jaw);
        }
        let turn = |frame: &mut MotionParams, joint, turn: &JointRotation, most: f32| {
            if let Some(rotation) = turn.known() {
                let rotation = if rotation.w < 0.0 {
                    -rotation
                } else {
                    rotation
                };
                let turn: Vec3 = rotation.to_scaled_axis().clamp_length_max(most);
                frame.set_axis_angle(joint, turn);
            }
        };
        turn(&mut frame, Joint::Jaw, &seen.jaw, MOST_JAW);
        for (side, joint) in [Joint::LeftEye, Joint::RightEye].into_iter().enumerate() {
            let gaze = shown.filter(|_| seen.basis != Some(ExpressionBasis::ARKIT_52));
            let looked = gaze.map_or(JointRotation::UNKNOWN, |shown| JointRotation {
                rotation: shown.eyes[side],
                confidence: 1.0,
            });
            let eye = Some(&seen.eyes[side]).filter(|eye| eye.known().is_some());
            turn(&mut frame, joint, eye.unwrap_or(&looked), MOST_EYE);
        }
        let known = (seen.basis.as_ref())
            .is_none_or(|from| spmm3::fit_expression(&mut frame, from, basis, presets));
        let add_lids = seen.eyelids.is_some() && (seen.basis.is_some() || shown.is_none());
        let [left, right] = lids;
        // As landmarks' blinks: one preset for both lids.
        let blink = left.min(right).max(left.max(right) * 2.0 - 1.0);
        if let Some(preset) = presets.get("blink").filter(|_| add_lids) {
            for (to, value) in frame.expression_mut().iter_mut().zip(preset.coefficients) {
                *to += blink * value;
            }
        }
        let mut expression = [0.0; EXPRESSION];
        expression.copy_from_slice(frame.expression());
        let face = Self {
            expression,
            jaw: frame.rotation(Joint::Jaw),
            eyes: [Joint::LeftEye, Joint::RightEye].map(|joint| frame.rotation(joint)),
        };
        Some((face, known))
    }
}

/// Where the head is turned: in camera axes, as a network says, else as the landmarks do.
pub(crate) fn camera_from_head(
    seen: &FaceExpression,
    measured: Option<&FaceMeasures>,
    camera: &Camera,
) -> Option<DQuat> {
    let said = seen
        .head
        .known()
        .map(|rotation| in_camera(rotation, seen.sight, camera));
    said.or(measured.map(|measured| measured.camera_from_head))
}
