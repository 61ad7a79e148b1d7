//! What is read off one face: its similarity to the reference, and lengths in the head's own axes and unit.
//!
//! The unit is the distance between the outer corners of the eyes, the axes are those of the avatar's T-pose (x to the person's
//! left, y up, z forward), the origin is the middle between those corners.

use crate::align::{Pair, Similarity};
use crate::landmarks::FACE_LANDMARKS;
use glam::{DVec2, DVec3, Vec3};

/// Points that bone carries, and where they are: what MediaPipe's face mesh with attention gave for a render of the demo avatar that
/// looked straight into the camera, made symmetric. With it the rotations of renders of that avatar, up to 40 degrees of yaw and 20
/// of pitch, are found within 2.1 degrees on average, 4.6 at most (`cargo test -p motion-fit rendered_heads -- --nocapture`).
const RIGID: [(usize, [f64; 3]); 14] = [
    (33, [-0.500, 0.000, 0.000]),
    (133, [-0.194, -0.018, 0.056]),
    (362, [0.194, -0.018, 0.056]),
    (263, [0.500, 0.000, 0.000]),
    (168, [0.000, 0.005, 0.262]),
    (6, [0.000, -0.083, 0.296]),
    (197, [0.000, -0.171, 0.338]),
    (195, [0.000, -0.254, 0.384]),
    (5, [0.000, -0.345, 0.434]),
    (4, [0.000, -0.450, 0.446]),
    (127, [-0.762, -0.015, -0.564]),
    (356, [0.762, -0.015, -0.564]),
    (234, [-0.758, -0.173, -0.647]),
    (454, [0.758, -0.173, -0.647]),
];
/// Pixels between the outer corners of the eyes below which a face shows nothing.
const LEAST_PIXELS: f64 = 8.0;
/// How far an iris is before the line between its eye's corners, in widths of the eye.
const IRIS_DEPTH: f64 = 0.13;
/// Radius in widths of an eye on which an iris turns.
const EYE_RADIUS: f64 = 0.36;

/// Landmarks of one eye: its iris, the corners towards the person's right and left, three points of the upper lid, and those below
/// them of the lower.
struct Eye {
    iris: usize,
    corners: [usize; 2],
    upper: [usize; 3],
    lower: [usize; 3],
    brow: [usize; 5],
}

/// The person's left eye, then the right one.
const EYES: [Eye; 2] = [
    Eye {
        iris: 473,
        corners: [362, 263],
        upper: [386, 385, 387],
        lower: [374, 380, 373],
        brow: [334, 296, 336, 293, 300],
    },
    Eye {
        iris: 468,
        corners: [33, 133],
        upper: [159, 158, 160],
        lower: [145, 153, 144],
        brow: [105, 66, 107, 63, 70],
    },
];

/// Lengths of one face, not yet compared with its neutral ones.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Lengths {
    /// Between the inner edges of the lips.
    pub(super) gap: f64,
    /// Between the mouth's corners.
    pub(super) width: f64,
    /// The mouth's corners above the base of the nose (negative).
    pub(super) corners: f64,
    /// Of the red of both lips together.
    pub(super) lips: f64,
    /// Brows above the eyes: left, right.
    pub(super) brows: [f64; 2],
    /// Between the lids, in widths of the eye: left, right.
    pub(super) lids: [f64; 2],
    /// How far the irises are from the middle of the eyes on average, as sines: to the person's left, and up.
    pub(super) gaze: DVec2,
}

/// The rotation and size of a face: laid on it, the reference's points are where the landmarks of bone are.
pub(super) fn align(points: &[Vec3; FACE_LANDMARKS]) -> Option<Similarity> {
    let pairs = RIGID.map(|(landmark, at)| Pair {
        from: DVec3::from_array(at),
        to: points[landmark].as_dvec3(),
        weight: 1.0,
    });
    Similarity::fit(&pairs).filter(|found| found.scale >= LEAST_PIXELS)
}

/// Measures a face that lies as `similarity` says. Nothing if a length is not finite.
pub(super) fn measure(points: &[Vec3; FACE_LANDMARKS], similarity: &Similarity) -> Option<Lengths> {
    let at = |landmark: usize| similarity.invert(points[landmark].as_dvec3());
    let above = |upper: usize, lower: usize| at(upper).y - at(lower).y;
    let gap = (above(13, 14) + above(82, 87) + above(312, 317)) / 3.0;
    let corners = (at(61).y + at(291).y) * 0.5 - at(2).y;
    let mut gaze = DVec2::ZERO;
    let mut lids = [0.0; 2];
    let mut brows = [0.0; 2];
    // A landmark's depth is the network's weakest number, and irises have none: their place is where the line of sight meets
    // the plane that irises lie in.
    let sight = similarity.to_from.inverse() * DVec3::Z;
    for (side, eye) in EYES.iter().enumerate() {
        let [right, left] = eye.corners.map(at);
        let middle = (right + left) * 0.5;
        let width = right.distance(left).max(1e-3);
        let pairs = eye.upper.into_iter().zip(eye.lower);
        lids[side] = pairs.map(|(u, l)| above(u, l)).sum::<f64>() / (3.0 * width);
        brows[side] = eye.brow.map(|k| at(k).y).into_iter().sum::<f64>() / 5.0 - middle.y;
        let iris = at(eye.iris);
        let depth = middle.z + IRIS_DEPTH * width;
        let along = if sight.z.abs() > 0.3 {
            (depth - iris.z) / sight.z
        } else {
            0.0
        };
        let offset = (iris + sight * along - middle) / (width * EYE_RADIUS);
        gaze += offset.truncate() * 0.5;
    }
    let lengths = Lengths {
        gap,
        width: at(61).distance(at(291)),
        corners,
        lips: above(0, 13) + above(14, 17),
        brows,
        lids,
        gaze,
    };
    let all = [lengths.gap, lengths.width, lengths.corners, lengths.lips];
    let finite = all.into_iter().chain(brows).chain(lids).all(f64::is_finite);
    (finite && gaze.is_finite()).then_some(lengths)
}
