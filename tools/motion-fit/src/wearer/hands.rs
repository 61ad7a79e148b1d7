//! One hand: where it is measured, or was a moment ago, and how its fingers are bent.

use super::body::BodyHand;
use super::space::Space;
use super::{HandJoints, WearerHand};
use crate::hands::{FINGER_JOINTS, HandFit, Side};
use crate::landmarks::HAND_LANDMARKS;
use glam::{DMat3, DQuat, DVec3};

/// Which of `OpenXR`'s joints are a hand's landmarks: wrist, thumb, index, middle, ring, little finger. Palms and the fingers' metacarpals
/// are none.
const LANDMARKS: [usize; HAND_LANDMARKS] = [
    1, 2, 3, 4, 5, 7, 8, 9, 10, 12, 13, 14, 15, 17, 18, 19, 20, 22, 23, 24, 25,
];
/// The wrist among `OpenXR`'s joints.
const WRIST: usize = 1;
/// From a wrist to the palm's middle, where a grip is, metres.
const PALM: f64 = 0.075;
/// A hand that is lost stays for so long, seconds ...
const HOLDS: f64 = 0.5;
/// ... and then each of these makes the place where it was e times less sure, seconds.
const FORGETS: f64 = 0.2;
/// A place less sure than this says nothing: the arm hangs, metres.
const FORGOTTEN: f64 = 3.0;
/// How sure a measured wrist is, metres.
const MEASURED: f64 = 0.001;
/// How soon a hand that was found again is where it is, and fingers come to rest or back, seconds.
const FINDS: f64 = 0.06;
const RELAXES: f64 = 0.25;

/// A hand in motion space.
#[derive(Debug, Clone, Copy)]
pub(super) struct Measured {
    pub(super) wrist: DVec3,
    /// `motion_from_wrist` of the avatar's wrist joint.
    turn: DQuat,
    /// Nothing of a hand whose joints are not all known.
    fingers: Option<[DQuat; FINGER_JOINTS]>,
}

/// Where the solver is to bring a wrist.
#[derive(Debug, Clone, Copy)]
pub(super) struct Goal {
    pub(super) wrist: DVec3,
    pub(super) turn: DQuat,
    /// Standard deviation, metres.
    pub(super) spread: f64,
}

/// The avatar's axes of a hand in T-pose as `OpenXR`'s: fingers along -z, the back of the hand along y.
fn joint_from_avatar(side: Side) -> DQuat {
    let axes = match side {
        Side::Left => DMat3::from_cols(DVec3::NEG_Z, DVec3::Y, DVec3::X),
        Side::Right => DMat3::from_cols(DVec3::Z, DVec3::Y, DVec3::NEG_X),
    };
    DQuat::from_mat3(&axes)
}

/// The same for a grip: fingers along -y, the thumb along -z; x goes out of the left palm's back's other side, and into the right palm.
fn grip_from_avatar(side: Side) -> DQuat {
    let axes = match side {
        Side::Left => DMat3::from_cols(DVec3::NEG_Y, DVec3::NEG_X, DVec3::NEG_Z),
        Side::Right => DMat3::from_cols(DVec3::Y, DVec3::X, DVec3::NEG_Z),
    };
    DQuat::from_mat3(&axes)
}

/// Follows one hand.
#[derive(Debug, Clone)]
pub(super) struct Hand {
    side: Side,
    fit: HandFit,
    /// Where it was last relative to the hips: wrist and turn.
    last: Option<(DVec3, DQuat)>,
    unseen: f64,
    /// What is left of the way back to a hand that was found again.
    offset: DVec3,
    relaxed: [DQuat; FINGER_JOINTS],
    fingers: [DQuat; FINGER_JOINTS],
}

impl Hand {
    pub(super) fn new(fit: HandFit, side: Side) -> Self {
        let relaxed = fit.relaxed();
        Self {
            side,
            fit,
            last: None,
            unseen: f64::INFINITY,
            offset: DVec3::ZERO,
            relaxed,
            fingers: relaxed,
        }
    }

    /// What a sample says of it: its joints before a controller's grip, and that before the tracked body.
    pub(super) fn measure(
        &self,
        hand: &WearerHand,
        body: Option<&BodyHand>,
        space: &Space,
    ) -> Option<Measured> {
        let bare = hand
            .joints
            .as_ref()
            .and_then(|joints| self.bare(joints, space));
        let held = || {
            let grip = space.pose(&finite(hand.floor_from_grip.as_ref())?);
            let turn = grip.rotation * grip_from_avatar(self.side);
            let fingers_along = match self.side {
                Side::Left => DVec3::X,
                Side::Right => DVec3::NEG_X,
            };
            Some(Measured {
                wrist: grip.position - turn * fingers_along * (PALM / space.scale()),
                turn,
                fingers: None,
            })
        };
        bare.or_else(held).or_else(|| self.of_body(body?))
    }

    fn of_body(&self, hand: &BodyHand) -> Option<Measured> {
        let points = || -> Option<[DVec3; HAND_LANDMARKS]> {
            let mut points = [DVec3::ZERO; HAND_LANDMARKS];
            for (point, joint) in points.iter_mut().zip(LANDMARKS) {
                *point = (*hand.points.get(joint)?)?;
            }
            Some(points)
        };
        let fitted = points().and_then(|points| self.fit.fit_points(&points));
        Some(Measured {
            wrist: hand.wrist,
            turn: fitted.map(|(palm, _)| palm).or(hand.turn)?,
            fingers: fitted.map(|(_, fingers)| fingers),
        })
    }

    fn bare(&self, joints: &HandJoints, space: &Space) -> Option<Measured> {
        let wrist = space.pose(&finite(joints.get(WRIST)?.as_ref())?);
        let mut points = [DVec3::ZERO; HAND_LANDMARKS];
        let mut all = true;
        for (point, joint) in points.iter_mut().zip(LANDMARKS) {
            match finite(joints.get(joint).and_then(Option::as_ref)) {
                Some(joint) => *point = space.point(joint.translation.as_dvec3()),
                None => all = false,
            }
        }
        let fitted = all.then(|| self.fit.fit_points(&points)).flatten();
        Some(Measured {
            wrist: wrist.position,
            turn: fitted.map_or_else(
                || wrist.rotation * joint_from_avatar(self.side),
                |(palm, _)| palm,
            ),
            fingers: fitted.map(|(_, fingers)| fingers),
        })
    }

    /// Where the wrist is to be `seconds` later, with hips at `hips` that face along `yaw`. `wrist` is where the avatar's was.
    pub(super) fn step(
        &mut self,
        measured: Option<&Measured>,
        hips: (DVec3, f64),
        wrist: Option<DVec3>,
        seconds: f64,
    ) -> Option<Goal> {
        let motion_from_hips = DQuat::from_rotation_y(hips.1);
        let fingers = measured.and_then(|m| m.fingers).unwrap_or(self.relaxed);
        let settled = measured.is_some() && self.unseen == 0.0;
        let soon = if measured.is_some() { FINDS } else { RELAXES };
        let holds = measured.is_none() && self.unseen < HOLDS;
        let share = match (settled, holds) {
            (true, _) => 1.0 - (-seconds / (FINDS / 4.0)).exp(),
            (_, true) => 0.0,
            _ => 1.0 - (-seconds / soon).exp(),
        };
        for (shown, to) in self.fingers.iter_mut().zip(fingers) {
            *shown = shown.slerp(to, share);
        }
        if let Some(measured) = measured {
            if let Some(wrist) = wrist.filter(|_| self.unseen > 0.0) {
                self.offset = wrist - measured.wrist;
            }
            self.offset *= (-seconds / FINDS).exp();
            if self.offset.length() < 1e-4 {
                self.offset = DVec3::ZERO;
            }
            self.unseen = 0.0;
            let back = motion_from_hips.inverse();
            self.last = Some((back * (measured.wrist - hips.0), back * measured.turn));
            return Some(Goal {
                wrist: measured.wrist + self.offset,
                turn: measured.turn,
                spread: MEASURED,
            });
        }
        self.unseen += seconds;
        let (place, turn) = self.last?;
        let spread = MEASURED * ((self.unseen - HOLDS).max(0.0) / FORGETS).exp();
        if spread > FORGOTTEN {
            self.last = None;
        }
        Some(Goal {
            wrist: hips.0 + motion_from_hips * place,
            turn: motion_from_hips * turn,
            spread,
        })
    }

    /// The finger joints, in SMPL-X's order.
    pub(super) fn fingers(&self) -> &[DQuat; FINGER_JOINTS] {
        &self.fingers
    }
}

fn finite(pose: Option<&glam::Affine3A>) -> Option<glam::Affine3A> {
    pose.copied().filter(|pose| pose.is_finite())
}
