//! A stance in which a body would not fall over: soles level, both on the floor, the centre of mass above them.

use super::person::SyntheticPerson;
use crate::body::posing::chain;
use glam::{DMat3, DQuat, DVec3};
use spmm3::{JOINTS, Joint};

/// How far in front of the ankles the weight of a quiet stance is, metres: Winter, *Human balance and posture control* (1995).
const BEFORE_ANKLES: f64 = 0.045;
/// Rounds in which knees and lean follow one another.
const ROUNDS: usize = 8;

/// Hip, knee and the joints of the foot.
const LEGS: [(Joint, Joint, [Joint; 2]); 2] = [
    (
        Joint::LeftHip,
        Joint::LeftKnee,
        [Joint::LeftAnkle, Joint::LeftFoot],
    ),
    (
        Joint::RightHip,
        Joint::RightKnee,
        [Joint::RightAnkle, Joint::RightFoot],
    ),
];

impl SyntheticPerson {
    /// The rotations of a stance, changed in the legs and leant until the body would stand.
    pub(super) fn balanced(&self, stance: &[DMat3; JOINTS]) -> [DMat3; JOINTS] {
        let turned = DMat3::from_rotation_y(self.yaw());
        let (left, front) = (turned * DVec3::X, turned * DVec3::Z);
        let mut rotations = *stance;
        let level = |rotations: &mut [DMat3; JOINTS]| {
            for (.., foot) in LEGS {
                for joint in foot {
                    rotations[joint.index()] = turned;
                }
            }
        };
        for _ in 0..ROUNDS {
            level(&mut rotations);
            self.bend_longer_leg(&mut rotations, left);
            let stance = self.standing(&rotations, DVec3::ZERO);
            let ankles = LEGS.map(|(.., [ankle, _])| stance.joints[ankle.index()]);
            let ankles = (ankles[0] + ankles[1]) / 2.0;
            let centre = centre_of_volume(&self.posed(&stance), self.faces()) - ankles;
            let wanted = (front * BEFORE_ANKLES).with_y(centre.y);
            let lean = DMat3::from_quat(DQuat::from_rotation_arc(
                centre.normalize(),
                wanted.normalize(),
            ));
            rotations
                .iter_mut()
                .for_each(|rotation| *rotation = lean * *rotation);
        }
        level(&mut rotations);
        self.bend_longer_leg(&mut rotations, left);
        rotations
    }

    /// Bends the knee of the leg that reaches lower until both reach as low.
    fn bend_longer_leg(&self, rotations: &mut [DMat3; JOINTS], left: DVec3) {
        let height = |rotations: &[DMat3; JOINTS], leg: usize| {
            chain(rotations, DVec3::ZERO, 1.0, self.rest_joints())[LEGS[leg].2[0].index()].y
        };
        let longer = usize::from(height(rotations, 1) < height(rotations, 0));
        let wanted = height(rotations, 1 - longer);
        let (hip, knee, _) = LEGS[longer];
        let bent = |radians: f64| {
            let mut bent = *rotations;
            bent[hip.index()] = DMat3::from_axis_angle(left, -radians) * bent[hip.index()];
            bent[knee.index()] = DMat3::from_axis_angle(left, radians) * bent[knee.index()];
            bent
        };
        let (mut low, mut high) = (0.0, 0.8);
        for _ in 0..30 {
            let middle = 0.5 * (low + high);
            if height(&bent(middle), longer) < wanted {
                low = middle;
            } else {
                high = middle;
            }
        }
        *rotations = bent(low);
    }
}

/// The centre of what a closed mesh encloses.
fn centre_of_volume(vertices: &[DVec3], faces: &[[u32; 3]]) -> DVec3 {
    let (mut volume, mut sum) = (0.0, DVec3::ZERO);
    for face in faces {
        let [a, b, c] = face.map(|vertex| vertices[vertex as usize]);
        let share = a.dot(b.cross(c));
        volume += share;
        sum += (a + b + c) * (share / 4.0);
    }
    sum / volume
}
