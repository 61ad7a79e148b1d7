//! Which landmarks of the face's mesh the network's closer looks at lips, eyes and irises replace
//! (`tensors_to_face_landmarks_with_attention.pbtxt`).

use glam::Vec3;
use motion_fit::landmarks::FACE_LANDMARKS;

/// Landmarks of the mesh, before the irises.
pub(super) const MESH: usize = 468;
/// Landmarks of an iris.
const IRIS: usize = 5;
/// Of an eye's list, how many are its edge: their mean depth is the iris's.
const EDGE: usize = 16;

/// The lips.
pub(super) const LIPS: [usize; 80] = [
    61, 146, 91, 181, 84, 17, 314, 405, 321, 375, 291, 185, 40, 39, 37, 0, 267, 269, 270, 409, 78,
    95, 88, 178, 87, 14, 317, 402, 318, 324, 308, 191, 80, 81, 82, 13, 312, 311, 310, 415, 76, 77,
    90, 180, 85, 16, 315, 404, 320, 307, 306, 184, 74, 73, 72, 11, 302, 303, 304, 408, 62, 96, 89,
    179, 86, 15, 316, 403, 319, 325, 292, 183, 42, 41, 38, 12, 268, 271, 272, 407,
];

/// The person's right eye, its edge first.
pub(super) const RIGHT_EYE: [usize; 71] = [
    33, 7, 163, 144, 145, 153, 154, 155, 133, 246, 161, 160, 159, 158, 157, 173, 130, 25, 110, 24,
    23, 22, 26, 112, 243, 247, 30, 29, 27, 28, 56, 190, 226, 31, 228, 229, 230, 231, 232, 233, 244,
    113, 225, 224, 223, 222, 221, 189, 35, 124, 46, 53, 52, 65, 143, 111, 117, 118, 119, 120, 121,
    128, 245, 156, 70, 63, 105, 66, 107, 55, 193,
];

/// The person's left eye, its edge first.
pub(super) const LEFT_EYE: [usize; 71] = [
    263, 249, 390, 373, 374, 380, 381, 382, 362, 466, 388, 387, 386, 385, 384, 398, 359, 255, 339,
    254, 253, 252, 256, 341, 463, 467, 260, 259, 257, 258, 286, 414, 446, 261, 448, 449, 450, 451,
    452, 453, 464, 342, 445, 444, 443, 442, 441, 413, 265, 353, 276, 283, 282, 295, 372, 340, 346,
    347, 348, 349, 350, 357, 465, 383, 300, 293, 334, 296, 336, 285, 417,
];

/// Puts the network's outputs together, all in the input's pixels: the `mesh` (x, y, z), then what is seen of lips, right and left eye
/// closer (x, y), then the right and the left iris (x, y), which get the mean depth of their eye's edge.
pub(super) fn combine(
    mesh: &[f32],
    closer: [&[f32]; 3],
    irises: [&[f32]; 2],
    points: &mut [Vec3; FACE_LANDMARKS],
) {
    for (point, numbers) in points.iter_mut().zip(mesh.chunks_exact(3)) {
        *point = Vec3::new(numbers[0], numbers[1], numbers[2]);
    }
    for (places, numbers) in [&LIPS[..], &RIGHT_EYE, &LEFT_EYE].into_iter().zip(closer) {
        for (place, numbers) in places.iter().zip(numbers.chunks_exact(2)) {
            points[*place].x = numbers[0];
            points[*place].y = numbers[1];
        }
    }
    for (side, (eye, numbers)) in [&RIGHT_EYE, &LEFT_EYE].into_iter().zip(irises).enumerate() {
        let depth = eye[..EDGE].iter().map(|i| points[*i].z).sum::<f32>() / EDGE as f32;
        let iris = points.iter_mut().skip(MESH + side * IRIS).take(IRIS);
        for (point, numbers) in iris.zip(numbers.chunks_exact(2)) {
            *point = Vec3::new(numbers[0], numbers[1], depth);
        }
    }
}
