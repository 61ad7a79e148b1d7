//! `BlazePose`'s landmarks of a body by name: their numbers in [`super::BodyLandmarks::points`]. Of every pair the person's left one comes
//! first.

use super::BODY_LANDMARKS;

/// The nose's tip.
pub const NOSE: usize = 0;
/// Middles of the eyes.
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

/// The first landmark of hips and legs: those before are of head, arms and hands.
pub const LOWER: usize = HIPS[0];

/// The same landmark of the other side.
#[must_use]
pub const fn mirrored(landmark: usize) -> usize {
    match landmark {
        0 => 0,
        1..=3 => landmark + 3,
        4..=6 => landmark - 3,
        odd if odd % 2 == 1 => odd + 1,
        even => even - 1,
    }
}

const _: () = assert!(
    BODY_LANDMARKS == 33 && mirrored(TOES[0]) == TOES[1],
    "the numbers above are of BlazePose's 33 landmarks"
);

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_landmark_is_its_mirror_images_mirror_image() {
        for landmark in 0..BODY_LANDMARKS {
            let other = mirrored(landmark);
            assert!(other < BODY_LANDMARKS, "{landmark}");
            assert_eq!(mirrored(other), landmark);
        }
        for [left, right] in [
            EYES, EARS, SHOULDERS, ELBOWS, WRISTS, INDICES, HIPS, KNEES, ANKLES, HEELS, TOES,
        ] {
            assert_eq!(mirrored(left), right);
        }
    }
}
