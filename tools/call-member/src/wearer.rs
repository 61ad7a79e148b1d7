//! A headset's wearer as a source of motion: what the headset's loop saw of them, fitted to the avatar.

use app_session::headset::{WearerNews, WearerSlot};
use motion_fit::wearer::{
    Stance, WearerBody, WearerExpression, WearerFace, WearerFit, WearerGaze, WearerHand,
    WearerJoint, WearerSample,
};
use renderer_openxr::ext::body_tracking::Body;
use renderer_openxr::ext::face_tracking::{Face, FaceSource};
use renderer_openxr::wearer::Wearer;
use sender::{Capture, Captured, SendError};
use spmm3::{ExpressionBasis, Expressions, Skeleton};
use std::time::{Duration, Instant};

/// Motions a second of a headset's wearer, at most: more would cost bits that nobody sees, for viewers interpolate.
pub const WEARER_RATE: f64 = 36.0;

/// From one motion to the next, at least, with room for frames that come a little early.
const SHORTEST: Duration = Duration::from_millis(24);

/// A mouth that cameras are this sure of is taken as it is.
const SURE: f32 = 0.5;

/// Between two looks whether the headset has anything.
const LOOK: Duration = Duration::from_millis(200);

/// Follows the wearer until the headset's session is over.
#[derive(Debug)]
pub struct WearerCapture {
    slot: WearerSlot,
    fit: WearerFit,
    expression: WearerExpression,
    /// When the next motion is sent.
    next: Option<Instant>,
}

impl WearerCapture {
    /// Has the wearer whom `slot` is of drive the avatar of `skeleton`, whose face has that basis and those named expressions.
    #[must_use]
    pub fn new(
        slot: WearerSlot,
        skeleton: &Skeleton,
        (basis, expressions): (&ExpressionBasis, &Expressions),
        stance: Stance,
    ) -> Self {
        Self {
            slot,
            fit: WearerFit::new(skeleton, stance),
            expression: WearerExpression::new(basis, expressions),
            next: None,
        }
    }
}

impl Capture for WearerCapture {
    fn next(&mut self) -> Result<Option<Captured>, SendError> {
        loop {
            let wearer = match self.slot.wait(LOOK) {
                WearerNews::At(wearer) => wearer,
                WearerNews::Nothing => continue,
                WearerNews::Over => return Ok(None),
            };
            // Before the head is known for the first time there is nothing to send.
            let sample = sample(&wearer);
            let Some(mut fitted) = self.fit.step(&sample) else {
                continue;
            };
            if self.next.is_none_or(|next| wearer.at >= next) {
                self.next = Some(wearer.at + SHORTEST);
                // A face that is not tracked has its lips from the voice.
                let face = self.expression.show(&sample, &mut fitted.motion);
                return Ok(Some(Captured {
                    at: wearer.at,
                    motion: fitted.motion,
                    face,
                }));
            }
        }
    }
}

fn sample(wearer: &Wearer) -> WearerSample {
    WearerSample {
        seconds: wearer.seconds,
        floor_from_view: wearer.floor_from_view,
        hands: wearer.hands.map(|hand| WearerHand {
            joints: hand.joints,
            floor_from_grip: hand.floor_from_grip,
        }),
        body: wearer.body.as_ref().map(body),
        face: wearer.face.as_ref().map(face),
        gazes: wearer.gazes.map(|gaze| {
            gaze.map(|gaze| WearerGaze {
                floor_from_eye: gaze.floor_from_eye,
                confidence: gaze.confidence,
            })
        }),
        origin: wearer.origin,
    }
}

fn body(body: &Body) -> WearerBody {
    WearerBody {
        confidence: body.confidence,
        joints: body.joints.map(|joint| {
            joint.map(|joint| WearerJoint {
                floor_from_joint: joint.floor_from_joint,
                tracked: joint.tracked,
            })
        }),
        t_pose: body.t_pose,
    }
}

fn face(face: &Face) -> WearerFace {
    let [mouth, _] = face.confidences;
    WearerFace {
        weights: face.weights,
        // The extension tells how sure cameras are. A face that was heard is valid or not there.
        confidence: match face.source {
            FaceSource::Seen => (mouth / SURE).min(1.0),
            FaceSource::Heard => 1.0,
        },
        eyes_look: face.eyes_look,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::{Affine3A, Vec3};
    use renderer_openxr::ext::body_tracking::BodyJoint;
    use renderer_openxr::ext::eye_tracking::Gaze;
    use spmm3::{ExpressionPreset, Joint};
    use synthetic_person::Puppet;

    #[test]
    fn the_newest_place_of_the_wearer_is_sent_with_wrists_where_they_are_and_the_end_ends_it() {
        let skeleton = Puppet::small().skeleton;
        let rest = |joint: Joint| skeleton.rest_positions()[joint.index()];
        let eyes = (rest(Joint::LeftEye) + rest(Joint::RightEye)) / 2.0;
        let slot = WearerSlot::default();
        let face = (&ExpressionBasis::ARKIT_52, &Expressions::new());
        let mut capture = WearerCapture::new(slot.clone(), &skeleton, face, Stance::Standing);
        let wearer = |reach: f32| {
            let hand = |x: f32| {
                let mut joints = [None; 26];
                let wrist = Vec3::new(x, 1.25, -reach);
                joints[1] = Some(Affine3A::from_translation(wrist));
                renderer_openxr::wearer::WearerHand {
                    joints: Some(joints),
                    floor_from_grip: None,
                }
            };
            Wearer {
                at: Instant::now(),
                seconds: f64::from(reach),
                floor_from_view: Some(Affine3A::from_translation(Vec3::Y * eyes.y)),
                hands: [hand(-0.15), hand(0.15)],
                body: None,
                face: None,
                gazes: [None; 2],
                origin: 0,
            }
        };
        slot.put(wearer(0.2));
        slot.put(wearer(0.35));
        let captured = capture.next().expect("no failure").expect("a motion");
        let joints = skeleton.pose(&captured.motion);
        // Ahead is -z in the headset's floor space and +z in motion space.
        for (joint, x) in [(Joint::LeftWrist, 0.15), (Joint::RightWrist, -0.15)] {
            let at = joints.position(joint) + captured.motion.root_translation;
            let wanted = Vec3::new(x, 1.25, 0.35);
            assert!(at.distance(wanted) < 0.03, "{at}, not {wanted}");
        }
        slot.close();
        assert_eq!(capture.next().expect("no failure"), None, "over");
    }

    #[test]
    fn body_and_gaze_reach_the_fit_as_the_headset_gave_them() {
        let mut body = Body {
            confidence: 0.75,
            joints: [None; 84],
            t_pose: [None; 84],
        };
        let at = |x: f32| Affine3A::from_translation(Vec3::X * x);
        body.joints[71] = Some(BodyJoint {
            floor_from_joint: at(71.0),
            tracked: true,
        });
        body.t_pose[5] = Some(at(5.0));
        let gaze = Gaze {
            floor_from_eye: at(0.5),
            confidence: 0.25,
        };
        let sample = sample(&Wearer {
            at: Instant::now(),
            seconds: 2.5,
            floor_from_view: None,
            hands: Default::default(),
            body: Some(body),
            face: None,
            gazes: [None, Some(gaze)],
            origin: 3,
        });
        let body = sample.body.expect("a body");
        let joint = body.joints[71].expect("a knee");
        assert_eq!(
            (joint.floor_from_joint, joint.tracked),
            (at(71.0), true),
            "it"
        );
        assert_eq!(body.joints.iter().flatten().count(), 1, "no other");
        assert_eq!(body.t_pose[5], Some(at(5.0)), "the T-pose");
        assert_eq!(body.confidence, 0.75, "how sure");
        let [left, right] = sample.gazes;
        let right = right.expect("a gaze");
        assert_eq!(
            (left, right.floor_from_eye),
            (None, at(0.5)),
            "the right eye"
        );
        assert_eq!((right.confidence, sample.origin), (0.25, 3), "the rest");
    }

    #[test]
    fn a_face_that_is_seen_or_heard_is_the_avatars_and_how_sure_it_is_goes_with_it() {
        let skeleton = Puppet::small().skeleton;
        let mut coefficients = [0.0; spmm3::EXPRESSION];
        coefficients[4] = 2.0;
        let smile = ExpressionPreset {
            coefficients,
            jaw: 0.0,
        };
        let expressions = [("smile".to_owned(), smile)].into();
        let slot = WearerSlot::default();
        let face = (&ExpressionBasis::MAKEHUMAN_1, &expressions);
        let mut capture = WearerCapture::new(slot.clone(), &skeleton, face, Stance::Standing);
        let mut at = Instant::now();
        let mut smiles = |face: Option<(f32, FaceSource)>| {
            at += SHORTEST;
            let mut weights = [0.0; 70];
            // LIP_CORNER_PULLER_L and _R.
            weights[32..34].fill(0.5);
            slot.put(Wearer {
                at,
                seconds: 0.0,
                floor_from_view: Some(Affine3A::from_translation(Vec3::Y * 1.6)),
                hands: Default::default(),
                body: None,
                face: face.map(|(mouth, source)| Face {
                    weights,
                    confidences: [mouth, 0.1],
                    eyes_look: false,
                    source,
                }),
                gazes: [None; 2],
                origin: 0,
            });
            let captured = capture.next().expect("no failure").expect("a motion");
            (captured.motion.expression()[4], captured.face)
        };
        assert_eq!(smiles(None), (0.0, None), "not tracked: the voice's");
        let seen = smiles(Some((0.7, FaceSource::Seen)));
        assert_eq!(seen, (1.0, Some(1.0)), "seen: no lips by the voice");
        let seen = smiles(Some((0.2, FaceSource::Seen)));
        assert_eq!(seen, (1.0, Some(0.4)), "hardly seen");
        let heard = smiles(Some((0.0, FaceSource::Heard)));
        assert_eq!(heard, (1.0, Some(1.0)), "heard");
    }
}
