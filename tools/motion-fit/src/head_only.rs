//! A face without a body, close to a camera: the head's landmarks of a body, made from those of the face.

use crate::landmarks::{BODY_LANDMARKS, BodyLandmarks, BodyPoint, FaceLandmarks};

/// Distance between the pupils of a grown person (mean), metres.
const PUPILS: f32 = 0.063;
/// The face's irises, the right one first.
const IRISES: [usize; 2] = [468, 473];
/// Landmarks of the body's nose, eyes and ears, and of the face at the same places: the tip of the nose, the irises, and beside the ears.
const SAME: [(usize, usize); 5] = [(0, 1), (2, 473), (5, 468), (7, 454), (8, 234)];
/// A face less sure than this places no body.
const SURE: f32 = 0.5;

/// The head of a body whose face is `face`; all else is not seen. Metres are relative to the face's middle.
pub(crate) fn head_of(face: &FaceLandmarks) -> Option<BodyLandmarks> {
    let at = |landmark: usize| face.points.get(landmark).copied();
    let [right, left] = [at(IRISES[0])?, at(IRISES[1])?];
    let scale = PUPILS / right.distance(left);
    if face.confidence.is_nan() || face.confidence < SURE || !scale.is_finite() {
        return None;
    }
    let mut points = [BodyPoint::default(); BODY_LANDMARKS];
    for (body, landmark) in SAME {
        let place = at(landmark)?;
        let metres = (place - (right + left) / 2.0) * scale;
        if !metres.is_finite() {
            return None;
        }
        points[body] = BodyPoint {
            pixel: place.truncate(),
            metres,
            confidence: face.confidence.min(1.0),
        };
    }
    Some(BodyLandmarks { points })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::body::{BodyFit, FitConfig};
    use crate::landmarks::{Camera, FACE_LANDMARKS};
    use glam::{Vec2, Vec3};
    use spmm3::{JOINTS, Joint, Skeleton};

    /// A face 0.6 m before a camera of 600 pixels' focal length: a thousand pixels a metre.
    fn face(middle: Vec2) -> FaceLandmarks {
        let mut points = Box::new([middle.extend(0.0); FACE_LANDMARKS]);
        for (landmark, offset) in [
            (1, Vec3::new(0.0, 35.0, -35.0)),
            (468, Vec3::new(-31.5, 0.0, 0.0)),
            (473, Vec3::new(31.5, 0.0, 0.0)),
            (234, Vec3::new(-68.0, 15.0, 75.0)),
            (454, Vec3::new(68.0, 15.0, 75.0)),
        ] {
            points[landmark] += offset;
        }
        FaceLandmarks {
            points,
            confidence: 1.0,
        }
    }

    #[test]
    fn a_face_alone_places_a_person_whose_head_is_there() {
        let mut rest = [Vec3::ZERO; JOINTS];
        for (joint, place) in [
            (Joint::Pelvis, Vec3::new(0.0, 0.95, 0.0)),
            (Joint::LeftShoulder, Vec3::new(0.18, 1.42, 0.0)),
            (Joint::RightShoulder, Vec3::new(-0.18, 1.42, 0.0)),
            (Joint::Neck, Vec3::new(0.0, 1.49, 0.0)),
            (Joint::Head, Vec3::new(0.0, 1.58, 0.02)),
        ] {
            rest[joint.index()] = place;
        }
        let skeleton = Skeleton::new(rest).expect("finite");
        let camera = Camera {
            size: Vec2::new(640.0, 480.0),
            focal: 600.0,
            centre: Vec2::new(320.0, 240.0),
        };
        for middle in [Vec2::new(320.0, 240.0), Vec2::new(420.0, 200.0)] {
            let mut fit = BodyFit::new(&skeleton, FitConfig::new(camera));
            let body = head_of(&face(middle)).expect("a head");
            let pose = (0..30)
                .map(|k| fit.fit(f64::from(k) / 30.0, Some(&body)))
                .last()
                .expect("thirty pictures");
            assert!(pose.seen, "a person");
            let mut motion = spmm3::MotionParams::default();
            pose.write(&mut motion);
            let head = skeleton.pose(&motion).position(Joint::Head) + motion.root_translation;
            let sight = pose.camera.camera_from_world * (head - pose.camera.position);
            let pixel = sight.truncate() / sight.z * camera.focal + camera.centre;
            assert!(pixel.distance(middle) < 70.0, "at {pixel}, not {middle}");
            assert!((0.5..0.9).contains(&sight.z), "{} m away", sight.z);
        }
    }

    #[test]
    fn a_doubtful_or_senseless_face_places_nothing() {
        let mut doubtful = face(Vec2::ZERO);
        doubtful.confidence = 0.2;
        assert_eq!(head_of(&doubtful), None, "doubtful");
        let mut flat = face(Vec2::ZERO);
        flat.points.fill(Vec3::ONE);
        assert_eq!(head_of(&flat), None, "all in one point");
        flat.points.fill(Vec3::NAN);
        assert_eq!(head_of(&flat), None, "no numbers");
    }
}
