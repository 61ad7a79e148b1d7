//! [`MotionFit`]: what the networks saw of body, hands and face becomes one frame of motion parameters.

use crate::body::{BodyFit, BodyPose, FitConfig, FootLock, Limb};
use crate::calibration::Calibration;
use crate::face::FaceFit;
use crate::hands::{FINGER_JOINTS, FlexionBias, HandFit, HandPose, Side};
use crate::head_only::head_of;
use crate::landmarks::Camera;
use crate::landmarks::estimates::{BodyEstimate, FaceEstimate, HandEstimate, Observation};
use crate::rotations::{self, FaceShown};
use crate::smoother::{Confidence, SmoothConfig, Smoother, smooth_all};
use glam::{Affine3A, DQuat, Mat3A, Quat, Vec3A};
use spmm3::{Avatar, ExpressionBasis, Expressions, Joint, MotionParams, Skeleton};

/// A hand or face that is no longer seen is kept for so long, then relaxes within [`RELAX`], seconds.
const HOLD: f64 = 0.3;
const RELAX: f64 = 0.6;
/// How fast the confidence of a hand or a face that is no longer seen fades, seconds.
const FADE: f64 = 0.15;
/// How fast the wrist follows a palm that is sure and one that is not, seconds.
const PALM_FOLLOW: [f64; 2] = [0.03, 0.3];
/// Farthest that a head turns against the chest, radians.
const MOST_HEAD: f32 = 1.4;
/// How much of the head's turn against the chest the neck makes.
const NECK_SHARE: f32 = 0.4;

/// Whose motion is fitted: the avatar's own skeleton and face.
#[derive(Debug, Clone, Copy)]
pub struct Subject<'a> {
    /// The avatar's skeleton.
    pub skeleton: &'a Skeleton,
    /// The avatar's named expressions.
    pub expressions: &'a Expressions,
    /// The basis of the avatar's expression coefficients.
    pub expression_basis: &'a ExpressionBasis,
}

impl<'a> From<&'a Avatar> for Subject<'a> {
    fn from(avatar: &'a Avatar) -> Self {
        Self {
            skeleton: &avatar.skeleton,
            expressions: &avatar.expressions,
            expression_basis: &avatar.expression_basis,
        }
    }
}

/// One frame.
#[derive(Debug, Clone, PartialEq)]
pub struct Fitted {
    /// The motion: smoothed, but for an [`Unsmoothed`]'s.
    pub motion: MotionParams,
    /// From the room that the motion is in (y up, the floor at y = 0) to the camera's axes (x right, y down, z away), metres.
    pub camera_from_room: Affine3A,
    /// Whether a body was seen; otherwise the person eases to rest.
    pub sees_person: bool,
    /// Of each limb, in the order of [`Limb::ALL`], 0..=1.
    pub limbs: [f32; 6],
    /// Of the left and the right hand's fingers, 0..=1.
    pub hands: [f32; 2],
    /// Of the face, 0..=1.
    pub face: f32,
    /// Root mean square distance of the body's landmarks from the fitted pose, pixels.
    pub reprojection_px: f32,
    /// Whether the network had left and right exchanged.
    pub swapped: bool,
}

/// One frame before it is smoothed.
#[derive(Debug, Clone)]
pub struct Unsmoothed {
    /// When the picture was taken, seconds.
    pub(crate) seconds: f64,
    pub(crate) fitted: Fitted,
    /// How sure its motion is.
    pub(crate) confidence: Confidence,
    /// As [`BodyPose::standing`].
    pub(crate) standing: [[bool; 2]; 2],
}

impl Unsmoothed {
    /// As [`Fitted::sees_person`].
    #[must_use]
    pub fn sees_person(&self) -> bool {
        self.fitted.sees_person
    }
}

/// Follows one person in one camera's pictures.
#[derive(Debug, Clone)]
pub struct MotionFit {
    skeleton: Skeleton,
    body: BodyFit,
    hands: [Hand; 2],
    face: Face,
    smoother: Smoother,
    feet: FootLock,
}

/// The face as last seen.
#[derive(Debug, Clone)]
struct Face {
    fit: FaceFit,
    camera: Camera,
    presets: Expressions,
    basis: ExpressionBasis,
    shown: Option<FaceShown>,
    last_seen: f64,
    /// Of the last picture.
    last_seconds: f64,
    confidence: f64,
    /// Whether it was said that a network's expression cannot be shown.
    said: bool,
}

#[derive(Debug, Clone)]
struct Hand {
    fit: HandFit,
    /// For landmarks in the middles of the joints.
    unbiased: HandFit,
    side: Side,
    /// The fingers of a relaxed hand, and those that are shown.
    relaxed: [DQuat; FINGER_JOINTS],
    shown: [DQuat; FINGER_JOINTS],
    /// Those that were last seen.
    fitted: [DQuat; FINGER_JOINTS],
    last_seen: Option<f64>,
    confidence: f64,
    /// What the palm's turn adds to the elbow's and the wrist's rotation by the body's landmarks, from the right.
    turn: [DQuat; 2],
    last_seconds: f64,
}

impl MotionFit {
    /// A fit that has seen nothing.
    #[must_use]
    pub fn new(subject: &Subject<'_>, camera: Camera) -> Self {
        let Subject {
            skeleton,
            expressions,
            expression_basis,
        } = subject;
        Self {
            skeleton: (*skeleton).clone(),
            body: BodyFit::new(skeleton, FitConfig::new(camera)),
            hands: Side::BOTH.map(|side| Hand::new(skeleton, side)),
            face: Face {
                fit: FaceFit::new(),
                camera,
                presets: (*expressions).clone(),
                basis: (*expression_basis).clone(),
                shown: None,
                last_seen: f64::NEG_INFINITY,
                last_seconds: f64::NEG_INFINITY,
                confidence: 0.0,
                said: false,
            },
            smoother: Smoother::new(SmoothConfig::default()),
            feet: FootLock::new(skeleton),
        }
    }

    /// The pictures are another camera's from now on, or of another size. What was learnt of the person stays.
    pub fn set_camera(&mut self, camera: Camera) {
        self.body.set_camera(camera);
        self.face.camera = camera;
    }

    /// The next pictures are a calibration's: the neutral face is learnt anew from them.
    pub fn begin_calibration(&mut self) {
        self.face.fit = FaceFit::new();
    }

    /// Holds what a calibration found, and the neutral face as it is.
    pub fn hold(&mut self, calibration: &Calibration) {
        self.body.hold(calibration);
        self.face.fit.hold();
    }

    /// The motion of one picture. Never fails: what is not seen is held, then eases to rest.
    pub fn step(&mut self, seen: &Observation) -> Fitted {
        let look = self.look(seen);
        self.smooth(look)
    }

    /// The first half of [`Self::step`]: the pose, neither smoothed nor with feet that stand.
    pub fn look(&mut self, seen: &Observation) -> Unsmoothed {
        // A face alone places the head, and the body below it.
        let head = match (&seen.body, seen.face_landmarks()) {
            (None, Some(face)) => head_of(face),
            _ => None,
        };
        let body = seen.body_landmarks().or(head.as_ref());
        let mut pose = self.body.fit(seen.seconds, body);
        if let Some(BodyEstimate::Rotations(turned)) = &seen.body {
            rotations::turn_body(&mut pose, turned, &self.face.camera, &self.skeleton);
        }
        let mut motion = MotionParams::default();
        pose.write(&mut motion);
        let mut confidence = Confidence::default();
        for joint in Joint::ALL {
            confidence.joints[joint.index()] = pose.confidence[Limb::of(joint) as usize];
        }
        let camera_from_room = camera_from_room(&pose);
        self.head(seen, &pose, &mut motion, &mut confidence);
        for hand in 0..2 {
            self.hand(hand, seen, &pose, &mut motion, &mut confidence);
        }
        Unsmoothed {
            seconds: seen.seconds,
            fitted: Fitted {
                motion,
                camera_from_room,
                sees_person: pose.seen,
                limbs: pose.confidence,
                hands: self.hands.each_ref().map(|hand| narrow(hand.confidence)),
                face: narrow(self.face.confidence),
                reprojection_px: pose.reprojection_px,
                swapped: pose.swapped,
            },
            confidence,
            standing: pose.standing,
        }
    }

    /// The second half of [`Self::step`], by the pictures before this one.
    pub fn smooth(&mut self, look: Unsmoothed) -> Fitted {
        let Unsmoothed {
            seconds,
            mut fitted,
            confidence,
            standing,
        } = look;
        self.smoother
            .smooth(seconds, &mut fitted.motion, &confidence);
        // Last: what is smoothed slides.
        self.feet.apply(seconds, &mut fitted.motion, standing);
        fitted
    }

    /// In the place of [`Self::smooth`] for all looks of a recording, in the order of their time: smoothed forwards and backwards, so that nothing
    /// lags, and with feet held where they stand on average, from the picture in which they are put down.
    #[must_use]
    pub fn smooth_recording(&self, looks: Vec<Unsmoothed>) -> Vec<Fitted> {
        let mut frames: Vec<_> = (looks.iter())
            .map(|look| {
                let motion = look.fitted.motion.clone();
                (look.seconds, motion, look.confidence.clone())
            })
            .collect();
        smooth_all(&SmoothConfig::default(), &mut frames);
        let standing: Vec<_> = looks.iter().map(|look| look.standing).collect();
        let mut motions: Vec<_> = frames.into_iter().map(|(_, motion, _)| motion).collect();
        FootLock::new(&self.skeleton).apply_all(&mut motions, &standing);
        (looks.into_iter().zip(motions))
            .map(|(look, motion)| Fitted {
                motion,
                ..look.fitted
            })
            .collect()
    }

    /// Turns neck and head to where the face looks, and sets jaw, eyes and expression.
    fn head(
        &mut self,
        seen: &Observation,
        pose: &BodyPose,
        motion: &mut MotionParams,
        confidence: &mut Confidence,
    ) {
        let face = &mut self.face;
        if let Some((shown, camera_from_head, sure)) = face.look(seen) {
            face.shown = Some(shown);
            face.last_seen = seen.seconds;
            face.confidence = sure;
            let joints = self.skeleton.pose(motion);
            let chest = Quat::from_mat3a(&joints.person_from_joint[Joint::Spine3.index()].matrix3);
            let camera = Quat::from_mat3(&pose.camera.camera_from_world);
            let turn = camera_from_head
                // Against the chest, and no further than a neck goes.
                .map(|head| chest.inverse() * camera.inverse() * head.as_quat())
                .map(|turn| if turn.w < 0.0 { -turn } else { turn })
                .map(|turn| turn.to_scaled_axis().clamp_length_max(MOST_HEAD));
            if let Some(turn) = turn
                .map(Quat::from_scaled_axis)
                .filter(|turn| turn.is_finite())
            {
                let neck = Quat::IDENTITY.slerp(turn, NECK_SHARE);
                motion.set_rotation(Joint::Neck, neck);
                motion.set_rotation(Joint::Head, neck.inverse() * turn);
            }
        } else {
            face.confidence *= faded(seen.seconds - face.last_seconds);
        }
        face.last_seconds = seen.seconds;
        let unseen = seen.seconds - face.last_seen;
        let kept = 1.0 - ((unseen - HOLD) / RELAX).clamp(0.0, 1.0);
        if let Some(shown) = &face.shown {
            let kept = narrow(kept);
            for (to, from) in motion.expression_mut().iter_mut().zip(shown.expression) {
                *to = kept * from;
            }
            motion.set_rotation(Joint::Jaw, Quat::IDENTITY.slerp(shown.jaw, kept));
            for (joint, eye) in [Joint::LeftEye, Joint::RightEye]
                .into_iter()
                .zip(shown.eyes)
            {
                motion.set_rotation(joint, Quat::IDENTITY.slerp(eye, kept));
            }
        }
        confidence.expression = narrow(face.confidence);
        for joint in [Joint::Jaw, Joint::LeftEye, Joint::RightEye] {
            confidence.joints[joint.index()] = narrow(face.confidence);
        }
    }

    /// Sets the fingers and the wrist of one hand.
    fn hand(
        &mut self,
        number: usize,
        seen: &Observation,
        pose: &BodyPose,
        motion: &mut MotionParams,
        confidence: &mut Confidence,
    ) {
        let hand = &mut self.hands[number];
        let fitted: Option<HandPose> = (seen.hands[number].as_ref())
            .and_then(|seen| {
                let marked = seen.landmarks().map(|landmarks| hand.fit.fit(landmarks));
                match seen {
                    HandEstimate::Landmarks(_) => marked,
                    HandEstimate::Joints(joints) => Some(hand.unbiased.fit(joints)),
                    HandEstimate::Rotations(turned) => {
                        let camera = &self.face.camera;
                        Some(rotations::hand_pose(turned, camera, marked, &hand.relaxed))
                    }
                }
            })
            .filter(|fitted| pose.seen && fitted.confidence > 0.0);
        let looked_at = !seen.hands_skipped[number];
        hand.follow(seen.seconds, fitted.as_ref(), looked_at);
        let first = hand.side.first_finger_joint().index();
        for (joint, rotation) in Joint::ALL.into_iter().skip(first).zip(hand.shown) {
            motion.set_rotation(joint, rotation.as_quat());
            confidence.joints[joint.index()] = narrow(hand.confidence);
        }
        let [elbow, wrist] = match hand.side {
            Side::Left => [Joint::LeftElbow, Joint::LeftWrist],
            Side::Right => [Joint::RightElbow, Joint::RightWrist],
        };
        let joints = self.skeleton.pose(motion);
        let forearm = joints.person_from_joint[elbow.index()].matrix3;
        let camera = Mat3A::from(pose.camera.camera_from_world);
        let forearm = Quat::from_mat3a(&(camera * forearm)).as_dquat();
        let palm =
            fitted.and_then(|fitted| Some((fitted.camera_from_palm?, fitted.palm_confidence)));
        let by_body = motion.rotation(wrist).as_dquat();
        let was_others_turn = palm.is_none() && !looked_at && pose.seen;
        let (wanted, sure) = palm.map_or(([DQuat::IDENTITY; 2], 0.0), |(palm, sure)| {
            let turn = hand.fit.wrist(forearm, palm);
            // The elbow's share moves the wrist as well, so both are blended by the same share.
            let added = [turn.elbow_share, by_body.inverse() * turn.wrist];
            (added.map(|added| DQuat::IDENTITY.slerp(added, sure)), sure)
        });
        let step = (seen.seconds - hand.last_seconds).clamp(0.0, 1.0);
        hand.last_seconds = seen.seconds;
        let [quick, slow] = PALM_FOLLOW;
        let share = 1.0 - (-step / (slow + (quick - slow) * sure)).exp();
        if share.is_finite() && !was_others_turn {
            for (turn, wanted) in hand.turn.iter_mut().zip(wanted) {
                *turn = turn.slerp(wanted, share).normalize();
            }
        }
        let [elbow_added, wrist_added] = hand.turn.map(|turn| turn.as_quat());
        motion.set_rotation(elbow, motion.rotation(elbow) * elbow_added);
        motion.set_rotation(wrist, motion.rotation(wrist) * wrist_added);
    }
}

impl Face {
    /// What the face shows, where the head is turned in camera axes, and how sure that is.
    fn look(&mut self, seen: &Observation) -> Option<(FaceShown, Option<DQuat>, f64)> {
        let estimate = seen.face.as_ref()?;
        let measured = (estimate.landmarks())
            .and_then(|landmarks| (self.fit).measure(landmarks, seen.seconds, Some(&self.camera)));
        let measured = measured.as_ref();
        match estimate {
            FaceEstimate::Landmarks(_) => measured.map(|measured| {
                let shown = FaceShown::measured(measured, &self.presets);
                (shown, Some(measured.camera_from_head), measured.confidence)
            }),
            FaceEstimate::Expression(said) => {
                let (shown, known) =
                    FaceShown::expressed(said, measured, &self.basis, &self.presets)?;
                if !(known || self.said) {
                    self.said = true;
                    log::warn!(
                        "the face's expression is left out: its network's weights are of the basis {}, this avatar's are of {}, and there \
                         is no map between them; jaw, eyes and lids move",
                        said.basis.as_ref().map_or("", ExpressionBasis::name),
                        self.basis
                    );
                }
                let head = rotations::camera_from_head(said, measured, &self.camera);
                Some((shown, head, f64::from(said.confidence.min(1.0))))
            }
        }
    }
}

impl Hand {
    fn new(skeleton: &Skeleton, side: Side) -> Self {
        let ease = spmm3::at_ease(skeleton);
        let first = side.first_finger_joint().index();
        let mut relaxed = [DQuat::IDENTITY; FINGER_JOINTS];
        for (rotation, joint) in relaxed.iter_mut().zip(Joint::ALL.into_iter().skip(first)) {
            *rotation = ease.rotation(joint).as_dquat();
        }
        Self {
            unbiased: HandFit::new(skeleton, side),
            fit: HandFit::new(skeleton, side).with_bias(FlexionBias::MEDIAPIPE),
            side,
            relaxed,
            shown: relaxed,
            fitted: relaxed,
            last_seen: None,
            confidence: 0.0,
            turn: [DQuat::IDENTITY; 2],
            last_seconds: f64::NEG_INFINITY,
        }
    }

    /// Shows the fingers that were fitted; without any, the last ones, which relax after a while. Where hands take turns, one is looked at
    /// in every second picture, and nothing is known of it in the others.
    fn follow(&mut self, seconds: f64, fitted: Option<&HandPose>, looked_at: bool) {
        if let Some(fitted) = fitted {
            self.fitted = fitted.fingers;
            self.shown = fitted.fingers;
            self.last_seen = Some(seconds);
            self.confidence = fitted.confidence;
            return;
        }
        let unseen = self.last_seen.map_or(f64::INFINITY, |last| seconds - last);
        if unseen > HOLD {
            let share = ((unseen - HOLD) / RELAX).clamp(0.0, 1.0);
            for ((shown, fitted), relaxed) in
                self.shown.iter_mut().zip(self.fitted).zip(self.relaxed)
            {
                *shown = fitted.slerp(relaxed, share);
            }
        }
        if looked_at {
            self.confidence *= faded(seconds - self.last_seconds);
        }
    }
}

/// What is left of a confidence after so many seconds.
fn faded(seconds: f64) -> f64 {
    (-seconds.max(0.0) / FADE).exp()
}

fn camera_from_room(pose: &BodyPose) -> Affine3A {
    let rotation = Mat3A::from(pose.camera.camera_from_world);
    Affine3A {
        matrix3: rotation,
        translation: -(rotation * Vec3A::from(pose.camera.position)),
    }
}

#[allow(clippy::cast_possible_truncation, reason = "a confidence, or radians")]
fn narrow(value: f64) -> f32 {
    value as f32
}
