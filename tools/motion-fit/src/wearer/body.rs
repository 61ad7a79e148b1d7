//! The tracked body as goals of the solver: where hips and ankles are, how hips and chest are turned, and where limbs point.
//!
//! Limbs count by their direction, for the avatar's are not as long as the wearer's. Turns are read against the wearer's own T-pose, for
//! runtimes give joints axes of their own.

use super::sample::{HAND_JOINTS, WearerBody};
use super::space::Space;
use crate::body::chain::Attachment;
use crate::body::terms::Term;
use crate::hands::Side;
use glam::{DMat3, DQuat, DVec3};
use nalgebra::{Matrix3, UnitQuaternion, Vector3};
use spmm3::{Joint, Skeleton};

/// Joints of `XrFullBodyJointMETA`.
const HIPS: usize = 1;
const CHEST: usize = 5;
const ARM_UPPER: [usize; 2] = [10, 15];
const ARM_LOWER: [usize; 2] = [11, 16];
const WRIST: [usize; 2] = [19, 45];
/// The first of a hand's 26 joints, which come in the order of `XR_EXT_hand_tracking`.
const HAND: [usize; 2] = [18, 44];
const UPPER_LEG: [usize; 2] = [70, 77];
const LOWER_LEG: [usize; 2] = [71, 78];
const ANKLE: [usize; 2] = [73, 80];
const BALL: [usize; 2] = [76, 83];

/// The avatar's joints of the ankles.
const ANKLES: [Joint; 2] = [Joint::LeftAnkle, Joint::RightAnkle];
/// Bones of the limbs: the wearer's and the avatar's joint where each begins, and where it ends.
const BONES: [[(usize, Joint); 2]; 10] = {
    use Joint::{LeftAnkle, LeftElbow, LeftFoot, LeftHip, LeftKnee, LeftShoulder, LeftWrist};
    use Joint::{
        RightAnkle, RightElbow, RightFoot, RightHip, RightKnee, RightShoulder, RightWrist,
    };
    [
        [(ARM_UPPER[0], LeftShoulder), (ARM_LOWER[0], LeftElbow)],
        [(ARM_LOWER[0], LeftElbow), (WRIST[0], LeftWrist)],
        [(UPPER_LEG[0], LeftHip), (LOWER_LEG[0], LeftKnee)],
        [(LOWER_LEG[0], LeftKnee), (ANKLE[0], LeftAnkle)],
        [(ANKLE[0], LeftAnkle), (BALL[0], LeftFoot)],
        [(ARM_UPPER[1], RightShoulder), (ARM_LOWER[1], RightElbow)],
        [(ARM_LOWER[1], RightElbow), (WRIST[1], RightWrist)],
        [(UPPER_LEG[1], RightHip), (LOWER_LEG[1], RightKnee)],
        [(LOWER_LEG[1], RightKnee), (ANKLE[1], RightAnkle)],
        [(ANKLE[1], RightAnkle), (BALL[1], RightFoot)],
    ]
};

/// A body less sure of itself than this is not there.
const LEAST_CONFIDENCE: f32 = 0.3;
/// Standard deviations of measured joints; those that were inferred count as this much less sure.
const INFERRED: f64 = 2.0;
/// Hips and ankles, metres; hips of a body without legs, which are guessed by their nearest joint.
const HIPS_PLACE: f64 = 0.015;
const HIPS_ALONE: f64 = 0.03;
const ANKLE_PLACE: f64 = 0.006;
/// The end of a limb's bone against its beginning, metres.
const LIMB: f64 = 0.01;
/// Turns of hips and chest, radians.
const HIPS_TURN: f64 = 0.05;
const CHEST_TURN: f64 = 0.1;
/// After how long a body that was found counts in full, and one that was lost no more, seconds.
const CHANGE_SECONDS: f64 = 0.5;

/// A body in motion space.
#[derive(Debug, Clone)]
pub(super) struct MeasuredBody {
    /// The pelvis' joint, how sure it is (metres), and how it is turned.
    hips: Option<(DVec3, f64)>,
    hips_turn: Option<DQuat>,
    chest_turn: Option<DQuat>,
    /// Of each of [`BONES`], as long as the avatar's: the end against the beginning, and how sure it is (metres).
    bones: [Option<(DVec3, f64)>; BONES.len()],
    ankles: [Option<(DVec3, f64)>; 2],
    hands: [Option<BodyHand>; 2],
}

/// A hand of the tracked body in motion space.
#[derive(Debug, Clone, Copy)]
pub(super) struct BodyHand {
    pub(super) wrist: DVec3,
    /// `motion_from_wrist` of the avatar's wrist joint, if the T-pose is known.
    pub(super) turn: Option<DQuat>,
    /// The joints in the order of `XR_EXT_hand_tracking`, where they are known.
    pub(super) points: [Option<DVec3>; HAND_JOINTS],
}

impl MeasuredBody {
    /// Where the hips face about y, radians from +z, if that is known.
    pub(super) fn yaw(&self) -> Option<f64> {
        self.hips_turn.map(super::space::heading)
    }

    /// Where the pelvis is, metres.
    pub(super) fn hips(&self) -> Option<DVec3> {
        self.hips.map(|(place, _)| place)
    }

    /// Whether both legs are known.
    pub(super) fn has_legs(&self) -> bool {
        self.ankles.iter().all(Option::is_some)
    }

    pub(super) fn hand(&self, side: Side) -> Option<&BodyHand> {
        self.hands.get(side.index())?.as_ref()
    }
}

/// Reads tracked bodies for one avatar.
#[derive(Debug, Clone)]
pub(super) struct BodyReader {
    /// Lengths of [`BONES`], metres.
    lengths: [f64; BONES.len()],
    /// The pelvis against the middle between the hips' joints, at rest.
    pelvis_from_hips: DVec3,
    /// The heights of the ankles at rest: no lower one stands on the floor.
    ankle_height: f64,
}

impl BodyReader {
    pub(super) fn new(skeleton: &Skeleton) -> Self {
        let rest = |joint: Joint| skeleton.rest_positions()[joint.index()].as_dvec3();
        let hips = (rest(Joint::LeftHip) + rest(Joint::RightHip)) / 2.0;
        Self {
            lengths: BONES.map(|[(_, from), (_, to)]| rest(from).distance(rest(to))),
            pelvis_from_hips: rest(Joint::Pelvis) - hips,
            ankle_height: rest(Joint::LeftAnkle).y.min(rest(Joint::RightAnkle).y),
        }
    }

    /// What a sample says of the body; nothing where it is not sure enough.
    pub(super) fn measure(&self, body: &WearerBody, space: &Space) -> Option<MeasuredBody> {
        if !(body.confidence.is_finite() && body.confidence >= LEAST_CONFIDENCE) {
            return None;
        }
        let body = Joints::of(body);
        let place = |joint: usize| {
            let (place, doubt) = body.place(joint)?;
            Some((space.point(place), doubt))
        };
        let turn = |joint: usize| Some(space.turn(body.turn(joint)?));
        let hips_turn = turn(HIPS);
        let legs = place(UPPER_LEG[0]).zip(place(UPPER_LEG[1]));
        let hips = match legs.zip(hips_turn) {
            Some((((left, a), (right, b)), turn)) => Some((
                (left + right) / 2.0 + turn * self.pelvis_from_hips,
                HIPS_PLACE * a.max(b),
            )),
            None => place(HIPS).map(|(place, doubt)| (place, HIPS_ALONE * doubt)),
        };
        let mut bones = [None; BONES.len()];
        for ((bone, [from, to]), length) in bones.iter_mut().zip(BONES).zip(self.lengths) {
            *bone = place(from.0)
                .zip(place(to.0))
                .and_then(|((from, a), (to, b))| {
                    Some(((to - from).try_normalize()? * length, LIMB * a.max(b)))
                });
        }
        let ankles = ANKLE.map(|ankle| {
            let (mut place, doubt) = place(ankle)?;
            place.y = place.y.max(self.ankle_height);
            Some((place, ANKLE_PLACE * doubt))
        });
        let hands = [0, 1].map(|side: usize| {
            let (wrist, _) = place(WRIST[side])?;
            Some(BodyHand {
                wrist,
                turn: turn(WRIST[side]),
                points: std::array::from_fn(|joint| {
                    place(HAND[side] + joint).map(|(place, _)| place)
                }),
            })
        });
        Some(MeasuredBody {
            hips,
            hips_turn,
            chest_turn: turn(CHEST),
            bones,
            ankles,
            hands,
        })
    }
}

/// A sample's joints, and the axes of its T-pose.
struct Joints<'a> {
    body: &'a WearerBody,
    /// From the avatar's axes (x to the person's left, y up, z ahead) to those of the T-pose's space.
    t_from_avatar: Option<DQuat>,
}

impl<'a> Joints<'a> {
    fn of(body: &'a WearerBody) -> Self {
        let at = |joint: usize| Some(finite(body.t_pose.get(joint)?.as_ref())?.translation);
        let across = at(ARM_UPPER[0])
            .zip(at(ARM_UPPER[1]))
            .map(|(left, right)| (left - right).as_dvec3() * DVec3::new(1.0, 0.0, 1.0));
        let t_from_avatar = across
            .and_then(DVec3::try_normalize)
            .map(|left| DQuat::from_mat3(&DMat3::from_cols(left, DVec3::Y, left.cross(DVec3::Y))));
        Self {
            body,
            t_from_avatar,
        }
    }

    /// Where a joint is in floor space, and how much less sure than a measured one.
    fn place(&self, joint: usize) -> Option<(DVec3, f64)> {
        let joint = self.body.joints.get(joint)?.as_ref()?;
        let pose = finite(Some(&joint.floor_from_joint))?;
        let doubt = if joint.tracked { 1.0 } else { INFERRED };
        Some((pose.translation.as_dvec3(), doubt))
    }

    /// `floor_from_joint` of the avatar's joint there.
    fn turn(&self, joint: usize) -> Option<DQuat> {
        let now = finite(Some(
            &self.body.joints.get(joint)?.as_ref()?.floor_from_joint,
        ))?;
        let rest = finite(self.body.t_pose.get(joint)?.as_ref())?;
        Some(rotation(&now) * rotation(&rest).inverse() * self.t_from_avatar?)
    }
}

fn rotation(pose: &glam::Affine3A) -> DQuat {
    let (_, rotation, _) = pose.to_scale_rotation_translation();
    rotation.as_dquat().normalize()
}

fn finite(pose: Option<&glam::Affine3A>) -> Option<glam::Affine3A> {
    pose.copied().filter(|pose| pose.is_finite())
}

/// A body that comes and goes.
#[derive(Debug, Clone, Default)]
pub(super) struct BodyFollower {
    last: Option<MeasuredBody>,
    /// How much it counts, 0..=1.
    share: f64,
}

impl BodyFollower {
    /// Takes what was measured, `seconds` after the last time; the `first` body of a wearer counts at once.
    pub(super) fn follow(&mut self, measured: Option<MeasuredBody>, seconds: f64, first: bool) {
        let step = if first { 1.0 } else { seconds / CHANGE_SECONDS };
        let step = if measured.is_some() { step } else { -step };
        self.share = (self.share + step).clamp(0.0, 1.0);
        if measured.is_some() {
            self.last = measured;
        } else if self.share <= 0.0 {
            self.last = None;
        }
    }

    /// The body, and how much it counts (0..=1); nothing where there is none.
    pub(super) fn body(&self) -> Option<(&MeasuredBody, f64)> {
        let eased = self.share * self.share * (3.0 - 2.0 * self.share);
        Some((self.last.as_ref()?, eased))
    }

    /// The solver's goals.
    pub(super) fn aim(&self, terms: &mut Vec<Term>) {
        let Some((body, share)) = self.body() else {
            return;
        };
        let sure = |spread: f64| Matrix3::identity() * (share / (spread * spread));
        if let Some((place, spread)) = body.hips {
            let hips = Attachment::centre(Joint::Pelvis);
            terms.push(Term::at(hips, vector(place), sure(spread)));
        }
        for (joint, turned, spread) in [
            (Joint::Pelvis, body.hips_turn, HIPS_TURN),
            (Joint::Spine3, body.chest_turn, CHEST_TURN),
        ] {
            terms.extend(turned.map(|turned| Term::Orientation {
                joint,
                target: turn(turned),
                information: sure(spread),
                robust: None,
            }));
        }
        for ([(_, from), (_, to)], along) in BONES.into_iter().zip(body.bones) {
            terms.extend(along.map(|(along, spread)| {
                let ends = [
                    (Attachment::centre(to), 1.0),
                    (Attachment::centre(from), -1.0),
                ];
                Term::sum(&ends, vector(along), sure(spread))
            }));
        }
        for (ankle, place) in ANKLES.into_iter().zip(body.ankles) {
            terms.extend(place.map(|(place, spread)| {
                Term::at(Attachment::centre(ankle), vector(place), sure(spread))
            }));
        }
    }
}

fn vector(v: DVec3) -> Vector3<f64> {
    Vector3::new(v.x, v.y, v.z)
}

fn turn(q: DQuat) -> UnitQuaternion<f64> {
    UnitQuaternion::new_normalize(nalgebra::Quaternion::new(q.w, q.x, q.y, q.z))
}
