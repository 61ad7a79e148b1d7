//! `BlazePose`'s landmarks by name, and their mirror images.

use crate::points::KeyPoint;
use motion_fit::landmarks::BODY_LANDMARKS;
use spmm3::Joint;

/// What the landmarks are, in their order.
pub const NAMES: [&str; BODY_LANDMARKS] = [
    "nose",
    "left eye inner",
    "left eye",
    "left eye outer",
    "right eye inner",
    "right eye",
    "right eye outer",
    "left ear",
    "right ear",
    "mouth left",
    "mouth right",
    "left shoulder",
    "right shoulder",
    "left elbow",
    "right elbow",
    "left wrist",
    "right wrist",
    "left pinky",
    "right pinky",
    "left index",
    "right index",
    "left thumb",
    "right thumb",
    "left hip",
    "right hip",
    "left knee",
    "right knee",
    "left ankle",
    "right ankle",
    "left heel",
    "right heel",
    "left foot",
    "right foot",
];

/// The nose's tip.
pub const NOSE: usize = 0;
/// Middles of the eyes, the person's left one first, as in all pairs.
pub const EYES: [usize; 2] = [2, 5];
/// Ears.
pub const EARS: [usize; 2] = [7, 8];
/// Shoulders.
pub const SHOULDERS: [usize; 2] = [11, 12];
/// Elbows.
pub const ELBOWS: [usize; 2] = [13, 14];
/// Wrists.
pub const WRISTS: [usize; 2] = [15, 16];
/// Knuckles of the index fingers.
pub const INDICES: [usize; 2] = [19, 20];
/// Hips.
pub const HIPS: [usize; 2] = [23, 24];
/// Knees.
pub const KNEES: [usize; 2] = [25, 26];
/// Ankles.
pub const ANKLES: [usize; 2] = [27, 28];
/// Heels.
pub const HEELS: [usize; 2] = [29, 30];
/// Tips of the feet.
pub const TOES: [usize; 2] = [31, 32];

/// The joints of the limbs, and the landmark that lies near each.
pub const JOINTS: [(Joint, usize); 12] = [
    (Joint::LeftShoulder, SHOULDERS[0]),
    (Joint::RightShoulder, SHOULDERS[1]),
    (Joint::LeftElbow, ELBOWS[0]),
    (Joint::RightElbow, ELBOWS[1]),
    (Joint::LeftWrist, WRISTS[0]),
    (Joint::RightWrist, WRISTS[1]),
    (Joint::LeftHip, HIPS[0]),
    (Joint::RightHip, HIPS[1]),
    (Joint::LeftKnee, KNEES[0]),
    (Joint::RightKnee, KNEES[1]),
    (Joint::LeftAnkle, ANKLES[0]),
    (Joint::RightAnkle, ANKLES[1]),
];

/// The joints of the limbs and their landmarks.
pub(super) fn limbs(
    points: &[KeyPoint; BODY_LANDMARKS],
) -> impl Iterator<Item = (Joint, &KeyPoint)> {
    JOINTS.iter().map(|(joint, at)| (*joint, &points[*at]))
}

/// Landmarks whose sides networks mistake together: head, arms, legs.
pub const GROUPS: [&[usize]; 3] = [
    &[1, 2, 3, 4, 5, 6, 7, 8, 9, 10],
    &[11, 12, 13, 14, 15, 16, 17, 18, 19, 20, 21, 22],
    &[23, 24, 25, 26, 27, 28, 29, 30, 31, 32],
];

/// The same landmark of the other side.
#[must_use]
pub const fn mirrored(landmark: usize) -> usize {
    match landmark {
        0 => 0,
        1..=3 => landmark + 3,
        4..=6 => landmark - 3,
        // From here on, pairs.
        _ if landmark % 2 == 1 => landmark + 1,
        _ => landmark - 1,
    }
}

const _: () = assert!(BODY_LANDMARKS == 33, "the tables above are BlazePose's");

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_mirror_image_of_a_mirror_image_is_the_landmark_itself_and_of_its_group() {
        for landmark in 0..BODY_LANDMARKS {
            assert_eq!(mirrored(mirrored(landmark)), landmark, "{landmark}");
        }
        for group in GROUPS {
            assert!(
                group.iter().all(|at| group.contains(&mirrored(*at))),
                "{group:?}"
            );
        }
        for [left, right] in [EYES, EARS, SHOULDERS, WRISTS, HIPS, TOES] {
            assert_eq!(mirrored(left), right, "{left}");
        }
    }
}
