//! A face's landmarks in space, from close-ups of the head.

use super::networks::Networks;
use super::triangulate::{Ray, triangulate};
use crate::RigError;
use crate::pinhole::Pinhole;
use crate::points::KeyPoint;
use crate::sight::Rgb;
use glam::{DVec3, Vec3Swizzles};
use motion_fit::landmarks::{FACE_LANDMARKS, FaceLandmarks};

/// Where a head is, and where it looks.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Head {
    /// The middle of the eyes, metres.
    pub eyes: DVec3,
    /// The unit direction in which the face looks.
    pub front: DVec3,
    /// The unit direction of the head's up.
    pub up: DVec3,
}

/// Turns of the close-ups to the side, degrees, and how far they are raised, in their distance.
const VIEWS: [(f64, f64); 6] = [
    (-35.0, 0.0),
    (-20.0, 0.1),
    (0.0, 0.0),
    (0.0, 0.2),
    (20.0, 0.1),
    (35.0, 0.0),
];
/// Distance of the close-ups, metres.
const DISTANCE: f64 = 0.9;
/// Focal length, pixels, and side of the pictures, pixels.
const FOCAL: f64 = 1300.0;
const SIDE: u32 = 512;
/// A ray that passes farther than about this from a landmark does not count, metres.
const REACH: f64 = 0.003;
/// In fewer views the face is hidden.
const FEWEST: usize = 3;

/// Six close-ups of a head.
#[must_use]
pub fn close_ups(head: &Head) -> [Pinhole; 6] {
    let up = head.up.normalize_or(DVec3::Y);
    let front = head
        .front
        .reject_from_normalized(up)
        .normalize_or(up.any_orthonormal_vector());
    let side = up.cross(front);
    let middle = head.eyes - up * 0.03 - front * 0.05;
    VIEWS.map(|(degrees, raised)| {
        let angle = degrees.to_radians();
        let out = front * angle.cos() + side * angle.sin() + up * raised;
        Pinhole::look_at(middle + out * DISTANCE, middle, up, FOCAL, SIDE, SIDE)
    })
}

/// The face's landmarks in space, from pictures that `draw` makes of a head: of a scan's, or of any other whose landmarks are wanted in
/// the same way. Nothing if the network sees a face in fewer than three of the views. The pictures are made twice: the second time as the
/// head turned out to look.
///
/// # Errors
/// Those of `draw`, and [`RigError::Tracker`] if a network fails.
pub fn face_landmarks_of(
    mut draw: impl FnMut(&Pinhole) -> Result<Rgb, RigError>,
    networks: &mut Networks,
    head: &Head,
) -> Result<Option<Box<[KeyPoint; FACE_LANDMARKS]>>, RigError> {
    let Some(first) = look(&mut draw, networks, head)? else {
        return Ok(None);
    };
    let Some(turned) = head_of(&first) else {
        return Ok(None);
    };
    Ok(look(&mut draw, networks, &turned)?.or(Some(first)))
}

/// Where a head looks whose face's landmarks are known; nothing if they are no face.
#[must_use]
pub fn head_of(face: &[KeyPoint; FACE_LANDMARKS]) -> Option<Head> {
    // Outer and inner corners of the eyes (right, left), forehead and chin.
    let at = |index: usize| face[index].position;
    let right = (at(33) + at(133)) / 2.0;
    let left = (at(263) + at(362)) / 2.0;
    let up = (at(10) - at(152)).try_normalize()?;
    let side = (left - right).reject_from_normalized(up).try_normalize()?;
    Some(Head {
        eyes: (left + right) / 2.0,
        front: side.cross(up),
        up,
    })
}

fn look(
    draw: &mut impl FnMut(&Pinhole) -> Result<Rgb, RigError>,
    networks: &mut Networks,
    head: &Head,
) -> Result<Option<Box<[KeyPoint; FACE_LANDMARKS]>>, RigError> {
    let mut looks: Vec<(Pinhole, FaceLandmarks)> = Vec::new();
    for view in close_ups(head) {
        if let Some(seen) = networks.face(&draw(&view)?)? {
            looks.push((view, seen));
        }
    }
    if looks.len() < FEWEST {
        return Ok(None);
    }
    let mut points = Box::new([KeyPoint::default(); FACE_LANDMARKS]);
    for (landmark, point) in points.iter_mut().enumerate() {
        let rays: Vec<Ray> = looks
            .iter()
            .map(|(view, seen)| {
                let pixel = seen.points[landmark].xy().as_dvec2();
                Ray::new(view, pixel, f64::from(seen.confidence))
            })
            .collect();
        let Some(found) = triangulate(&rays, REACH) else {
            return Ok(None);
        };
        *point = found;
    }
    Ok(Some(points))
}
