//! A hand from its 21 landmarks: how it is turned in the camera's axes, and the rotations of the avatar's 15 finger joints.
//!
//! Only directions count, so neither the hand's distance nor its size matters. The palm's five points (wrist and knuckles) are
//! laid on the avatar's own palm; the directions of the bones in the palm's axes then give flexion and abduction relative to the
//! avatar's own rest pose, within what joints can do. No finger turns about its own length. A hand that is small in the picture
//! or doubtful is blended towards a relaxed one, whose fingers say nothing.

mod bias;
mod finger;

pub use bias::FlexionBias;

use crate::align::{Pair, Similarity};
use crate::landmarks::{HAND_LANDMARKS, HandLandmarks};
use finger::{Angles, Finger, Limits};
use glam::{DQuat, DVec3};
use spmm3::{Joint, Skeleton};

/// Landmark of the root of each finger in the order of SMPL-X's joints: index, middle, little (pinky), ring, thumb.
const ROOTS: [usize; 5] = [5, 9, 17, 13, 1];
/// Which of them is the thumb.
const THUMB: usize = 4;
/// Joints of a hand: three for each finger.
pub const FINGER_JOINTS: usize = 15;

const FINGER_LIMITS: Limits = Limits {
    flexion: [
        [-20f64.to_radians(), 95f64.to_radians()],
        [0.0, 110f64.to_radians()],
        [0.0, 80f64.to_radians()],
    ],
    abduction: [[-20f64.to_radians(), 20f64.to_radians()], [0.0, 0.0]],
    // The last joint's tendon passes the one before it.
    coupling: Some((2.0 / 3.0, 30f64.to_radians())),
};
const THUMB_LIMITS: Limits = Limits {
    flexion: [
        [-30f64.to_radians(), 45f64.to_radians()],
        [-15f64.to_radians(), 60f64.to_radians()],
        [-20f64.to_radians(), 80f64.to_radians()],
    ],
    abduction: [
        [-40f64.to_radians(), 40f64.to_radians()],
        [-15f64.to_radians(), 15f64.to_radians()],
    ],
    coupling: None,
};
/// Flexion of a relaxed hand's finger joints and of its thumb's.
const RELAXED: [[f64; 3]; 2] = [
    [22f64.to_radians(), 30f64.to_radians(), 18f64.to_radians()],
    [4f64.to_radians(), 8f64.to_radians(), 12f64.to_radians()],
];

/// Diagonal in pixels of the box around a hand's landmarks below which its fingers are not believed, and from which on they are.
const SIZE: [f64; 2] = [20.0, 50.0];
/// The same for the network's own probability.
const SCORE: [f64; 2] = [0.3, 0.7];

/// The same for the palm's turn: on renders its error is 42 degrees (median) below 70 pixels, and 11 above 150; and 40 below a probability of
/// 0.8, 20 above 0.9.
const PALM_SIZE: [f64; 2] = [40.0, 110.0];
const PALM_SCORE: [f64; 2] = [0.6, 0.95];

/// Share of the palm's length that lies across the line of sight below which its fingers are not believed, and from which on they are.
const END_ON: [f64; 2] = [0.4, 0.7];

/// How far the wrist bends about the axis that the fingers curl about, and sideways, radians.
const WRIST: [f64; 2] = [80f64.to_radians(), 30f64.to_radians()];
/// How far the palm turns about the forearm, either way, radians.
const FOREARM_TWIST: f64 = 95f64.to_radians();

/// One of a person's own sides: which hand.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Side {
    /// The left one.
    Left,
    /// The right one.
    Right,
}

impl Side {
    /// Both, in the order of pairs.
    pub const BOTH: [Self; 2] = [Self::Left, Self::Right];

    /// Its place in a pair.
    #[must_use]
    pub const fn index(self) -> usize {
        match self {
            Self::Left => 0,
            Self::Right => 1,
        }
    }

    /// The first finger joint; 14 more follow in SMPL-X's order.
    #[must_use]
    pub const fn first_finger_joint(self) -> Joint {
        match self {
            Self::Left => Joint::LeftIndex1,
            Self::Right => Joint::RightIndex1,
        }
    }

    /// The wrist's joint.
    #[must_use]
    pub const fn wrist(self) -> Joint {
        match self {
            Self::Left => Joint::LeftWrist,
            Self::Right => Joint::RightWrist,
        }
    }
}

/// A hand's pose in one picture.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct HandPose {
    /// From the axes of the avatar's T-pose (y up, facing +z) to the camera's (x right, y down, z away), as the hand turned them:
    /// the wrist joint's own rotation in the camera's axes. Nothing where the landmarks show no palm.
    pub camera_from_palm: Option<DQuat>,
    /// Rotations of the finger joints relative to their parents, in SMPL-X's order: index, middle, pinky, ring, thumb, three each.
    pub fingers: [DQuat; FINGER_JOINTS],
    /// How far the fingers are measured and not those of a relaxed hand, 0..=1.
    pub confidence: f64,
    /// How far [`Self::camera_from_palm`] is to be believed, 0..=1.
    pub palm_confidence: f64,
}

/// The palm's turn against the forearm, shared by two joints.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct WristTurn {
    /// To be multiplied onto the elbow's rotation from the right: half of the twist about the forearm.
    pub elbow_share: DQuat,
    /// The wrist's rotation relative to the elbow that was turned so.
    pub wrist: DQuat,
}

/// Fits one hand of one avatar.
#[derive(Debug, Clone)]
pub struct HandFit {
    /// Rest positions of the wrist and of the four knuckles, in the order of [`ROOTS`].
    palm: [DVec3; 5],
    /// Along the forearm, the axis that the fingers curl about, and square to both; at rest.
    wrist_axes: [DVec3; 3],
    fingers: [Option<Finger>; 5],
    bias: Option<FlexionBias>,
}

impl HandFit {
    /// Takes the avatar's own hand. A hand whose joints lie on each other moves no finger.
    #[must_use]
    pub fn new(skeleton: &Skeleton, side: Side) -> Self {
        let rest = skeleton.rest_positions();
        let at = |joint: usize| rest.get(joint).map_or(DVec3::ZERO, |p| p.as_dvec3());
        let wrist = side.wrist().index();
        let first = side.first_finger_joint().index();
        let palm = [
            at(wrist),
            at(first),
            at(first + 3),
            at(first + 6),
            at(first + 9),
        ];
        let [hub, index, middle, little, ring] = palm;
        let along = ((index + middle + ring + little) * 0.25 - hub).normalize_or(DVec3::X);
        let across = (index - little)
            .reject_from_normalized(along)
            .normalize_or(DVec3::Z);
        // With the thumb's side ahead the palm is below: fingers curl towards it, on either hand.
        let curl = match side {
            Side::Left => -across,
            Side::Right => across,
        };
        let inward = curl.cross(along);
        let fingers = std::array::from_fn(|finger| {
            let joints = [0, 1, 2].map(|k| at(first + 3 * finger + k));
            if finger == THUMB {
                // The thumb closes across the palm.
                Finger::new(joints, little - joints[1], true)
            } else {
                Finger::new(joints, inward, false)
            }
        });
        let parent = side.wrist().parent().map_or(DVec3::ZERO, |p| at(p.index()));
        let forearm = (hub - parent).normalize_or(along);
        let bend = curl.reject_from_normalized(forearm).normalize_or(DVec3::Z);
        Self {
            palm,
            wrist_axes: [forearm, bend, forearm.cross(bend)],
            fingers,
            bias: None,
        }
    }

    /// For landmarks of a network whose bias is known; without, they are taken for the middles of the joints.
    #[must_use]
    pub fn with_bias(mut self, bias: FlexionBias) -> Self {
        self.bias = Some(bias);
        self
    }

    /// The pose that `hand` shows. Landmarks that show no hand (coincident, not finite) give a relaxed one of confidence 0.
    #[must_use]
    pub fn fit(&self, hand: &HandLandmarks) -> HandPose {
        let points = hand.metres.map(|p| p.as_dvec3());
        let palm = self.palm_of(&points);
        let [confidence, palm_confidence] = match palm {
            Some(_) => [
                confidence(hand, SIZE, SCORE) * end_on(&points),
                confidence(hand, PALM_SIZE, PALM_SCORE),
            ],
            None => [0.0; 2],
        };
        let fingers = self.bend(&points, palm, confidence);
        HandPose {
            camera_from_palm: palm,
            fingers,
            confidence,
            palm_confidence,
        }
    }

    /// A hand whose joints are measured in any right-handed axes, metres: the wrist joint's rotation in them, and the finger joints'. Nothing
    /// where they show no hand.
    pub(crate) fn fit_points(
        &self,
        points: &[DVec3; HAND_LANDMARKS],
    ) -> Option<(DQuat, [DQuat; FINGER_JOINTS])> {
        let palm = self.palm_of(points)?;
        Some((palm, self.bend(points, Some(palm), 1.0)))
    }

    /// The fingers of a hand that does nothing.
    pub(crate) fn relaxed(&self) -> [DQuat; FINGER_JOINTS] {
        self.bend(&[DVec3::ZERO; HAND_LANDMARKS], None, 0.0)
    }

    fn palm_of(&self, points: &[DVec3; HAND_LANDMARKS]) -> Option<DQuat> {
        let pairs: [Pair; 5] = std::array::from_fn(|k| {
            let landmark = if k == 0 { 0 } else { ROOTS[k - 1] };
            Pair {
                from: self.palm[k],
                to: points[landmark],
                weight: 1.0,
            }
        });
        Similarity::fit(&pairs).map(|similarity| similarity.to_from)
    }

    /// Fingers that are `confidence` (0..=1) those of `points`, and relaxed for the rest.
    fn bend(
        &self,
        points: &[DVec3; HAND_LANDMARKS],
        palm: Option<DQuat>,
        confidence: f64,
    ) -> [DQuat; FINGER_JOINTS] {
        let palm_from_camera = palm.map_or(DQuat::IDENTITY, |q| q.inverse());
        let mut fingers = [DQuat::IDENTITY; FINGER_JOINTS];
        for (number, joints) in fingers.chunks_exact_mut(3).enumerate() {
            let Some(finger) = self.fingers[number] else {
                continue;
            };
            let (limits, relaxed) = if number == THUMB {
                (&THUMB_LIMITS, RELAXED[1])
            } else {
                (&FINGER_LIMITS, RELAXED[0])
            };
            let relaxed = Angles {
                flexion: relaxed,
                ..Angles::default()
            };
            let angles = directions(points, ROOTS[number]).map_or(relaxed, |directions| {
                let mut seen = finger.angles(directions.map(|d| palm_from_camera * d));
                if let Some(bias) = self.bias.filter(|_| number != THUMB) {
                    seen.flexion[0] = bias.undo(seen.flexion[0]);
                }
                relaxed.blend(&seen.limited(limits), confidence)
            });
            joints.copy_from_slice(&finger.rotations(&angles));
        }
        fingers
    }

    /// Splits the palm's turn against the forearm: the twist about the forearm's length is shared by elbow and wrist, as the two
    /// bones of a forearm share it, and the rest bends the wrist; both within limits. `camera_from_forearm` is the elbow joint's
    /// rotation in the camera's axes, `camera_from_palm` is [`HandPose::camera_from_palm`].
    #[must_use]
    pub fn wrist(&self, camera_from_forearm: DQuat, camera_from_palm: DQuat) -> WristTurn {
        let [forearm, bend, sideways] = self.wrist_axes;
        let turn = camera_from_forearm.inverse() * camera_from_palm;
        if !turn.is_finite() || turn.length_squared() < 1e-12 {
            return WristTurn {
                elbow_share: DQuat::IDENTITY,
                wrist: DQuat::IDENTITY,
            };
        }
        let turn = turn.normalize();
        let along = DVec3::new(turn.x, turn.y, turn.z).dot(forearm);
        let angle = 2.0 * along.atan2(turn.w);
        let angle =
            (angle + std::f64::consts::PI).rem_euclid(std::f64::consts::TAU) - std::f64::consts::PI;
        let swing = DQuat::from_axis_angle(forearm, -angle) * turn;
        let swing = if swing.w < 0.0 { -swing } else { swing }.to_scaled_axis();
        let limited = |axis: DVec3, most: f64| axis * swing.dot(axis).clamp(-most, most);
        let swing = DQuat::from_scaled_axis(limited(bend, WRIST[0]) + limited(sideways, WRIST[1]));
        let half = 0.5 * angle.clamp(-FOREARM_TWIST, FOREARM_TWIST);
        let elbow_share = DQuat::from_axis_angle(forearm, half);
        WristTurn {
            elbow_share,
            wrist: elbow_share * swing,
        }
    }
}

/// Unit vectors along the three bones of the finger whose root is landmark `root`.
fn directions(points: &[DVec3; HAND_LANDMARKS], root: usize) -> Option<[DVec3; 3]> {
    let bone = |k: usize| {
        let (from, to) = (points.get(root + k)?, points.get(root + k + 1)?);
        (*to - *from).try_normalize()
    };
    Some([bone(0)?, bone(1)?, bone(2)?])
}

/// How far fingers are to be believed of a palm that points at the camera, where it hides them, 0..=1.
fn end_on(points: &[DVec3; HAND_LANDMARKS]) -> f64 {
    let along = points[ROOTS[1]] - points[0];
    let share = along.truncate().length() / along.length();
    ramp(share, END_ON)
}

/// How far `hand` is to be believed by its size in the picture and the network's probability, 0..=1.
fn confidence(hand: &HandLandmarks, size_px: [f64; 2], score: [f64; 2]) -> f64 {
    let (mut low, mut high) = (hand.pixels[0], hand.pixels[0]);
    for pixel in hand.pixels {
        if !pixel.is_finite() {
            return 0.0;
        }
        low = low.min(pixel);
        high = high.max(pixel);
    }
    let size = (high - low).as_dvec2().length();
    ramp(size, size_px) * ramp(f64::from(hand.confidence), score)
}

/// From 0 at the first of two bounds to 1 at the second.
fn ramp(value: f64, [none, all]: [f64; 2]) -> f64 {
    let share = (value - none) / (all - none);
    if share.is_finite() {
        share.clamp(0.0, 1.0)
    } else {
        0.0
    }
}

#[cfg(test)]
mod tests;
