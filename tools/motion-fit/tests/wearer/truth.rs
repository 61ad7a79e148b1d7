//! A person who is truly in the headset, and what it sees of them.

use crate::common::{M3, V3, add, forward, mul, mul_v, rodrigues, scale, sub};
use glam::{Affine3A, Mat3A, Vec3A};
use motion_fit::wearer::{HAND_JOINTS, WearerHand, WearerSample};
use spmm3::{Joint, MotionParams, Skeleton};

pub(crate) const HEAD: usize = 15;
pub(crate) const WRISTS: [usize; 2] = [20, 21];
/// A half turn about y.
pub(crate) const TURNED: M3 = [[-1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, -1.0]];
/// Of an `OpenXR` joint whose hand is in T-pose, as the specification describes it: columns are x, y, z; fingers along -z, the back along y.
const HAND_AXES: [M3; 2] = [
    [[0.0, 0.0, -1.0], [0.0, 1.0, 0.0], [1.0, 0.0, 0.0]],
    [[0.0, 0.0, 1.0], [0.0, 1.0, 0.0], [-1.0, 0.0, 0.0]],
];

pub(crate) fn affine(rotation: &M3, at: V3) -> Affine3A {
    let column = |c: usize| Vec3A::from_array([0, 1, 2].map(|r| rotation[r][c] as f32));
    Affine3A {
        matrix3: Mat3A::from_cols(column(0), column(1), column(2)),
        translation: Vec3A::from_array(at.map(|v| v as f32)),
    }
}

pub(crate) fn rest(skeleton: &Skeleton, joint: usize) -> V3 {
    skeleton.rest_positions()[joint].to_array().map(f64::from)
}

fn eyes(skeleton: &Skeleton) -> V3 {
    let [left, right] = [Joint::LeftEye, Joint::RightEye].map(|j| rest(skeleton, j.index()));
    scale(add(left, right), 0.5)
}

/// A person who is truly in the headset: floor space is motion space turned by half.
pub(crate) struct Truth<'a> {
    pub(crate) skeleton: &'a Skeleton,
    /// The wearer's size over the avatar's.
    pub(crate) size: f64,
}

impl Truth<'_> {
    pub(crate) fn floor(&self, motion: V3) -> V3 {
        scale(mul_v(&TURNED, motion), self.size)
    }

    pub(crate) fn eyes(&self, motion: &MotionParams) -> V3 {
        let (rotations, positions) = forward(self.skeleton, motion);
        let from_head = sub(eyes(self.skeleton), rest(self.skeleton, HEAD));
        add(positions[HEAD], mul_v(&rotations[HEAD], from_head))
    }

    pub(crate) fn sample(&self, seconds: f64, motion: &MotionParams) -> WearerSample {
        let (rotations, _) = forward(self.skeleton, motion);
        let view = mul(&mul(&TURNED, &rotations[HEAD]), &TURNED);
        WearerSample {
            seconds,
            floor_from_view: Some(affine(&view, self.floor(self.eyes(motion)))),
            hands: [0, 1].map(|side| WearerHand {
                joints: Some(self.hand(side, motion)),
                floor_from_grip: None,
            }),
            ..WearerSample::default()
        }
    }

    /// The hand's joints: each finger bent as `motion` says.
    pub(crate) fn hand(
        &self,
        side: usize,
        motion: &MotionParams,
    ) -> [Option<Affine3A>; HAND_JOINTS] {
        let (rotations, positions) = forward(self.skeleton, motion);
        let wrist = WRISTS[side];
        let mut joints = [None; HAND_JOINTS];
        let mut set = |joint: usize, turn: &M3, at: V3| {
            let axes = mul(&mul(&TURNED, turn), &HAND_AXES[side]);
            joints[joint] = Some(affine(&axes, self.floor(at)));
        };
        set(1, &rotations[wrist], positions[wrist]);
        // Index, middle, little, ring, thumb, in SMPL-X's order; where each one's first joint is in OpenXR's.
        let first = 25 + 15 * side;
        for (finger, to) in [7, 12, 22, 17, 2].into_iter().enumerate() {
            let (mut turn, mut at, mut parent) = (rotations[wrist], positions[wrist], wrist);
            for bone in 0..3 {
                let joint = first + 3 * finger + bone;
                let along = sub(rest(self.skeleton, joint), rest(self.skeleton, parent));
                at = add(at, mul_v(&turn, along));
                let bend = motion.axis_angle(Joint::ALL[joint]).to_array();
                turn = mul(&turn, &rodrigues(bend.map(f64::from)));
                set(to + bone, &turn, at);
                if bone == 2 {
                    // The tip continues the last bone.
                    set(to + 3, &turn, add(at, mul_v(&turn, along)));
                }
                parent = joint;
            }
        }
        joints
    }
}
