//! The face: detected where the body has its head, then followed from landmarks to landmarks.

use super::face_mesh::{self, LEFT_EYE, LIPS, MESH, RIGHT_EYE};
use super::regions::{Rect, Towards, Tracking, rotation};
use super::{Detector, SEEN, exceeds};
use crate::TrackerError;
use crate::crop::{Border, Region};
use crate::models::{FaceEstimate, FaceHint, FaceModel};
use crate::networks::sigmoid;
use crate::networks::{Network, NetworkSet, Signature};
use crate::picture::PictureView;
use glam::Vec3;
use motion_fit::landmarks::{FACE_LANDMARKS, FaceLandmarks};
use npu_runtime::Provider;

const LANDMARKS: Signature = Signature {
    name: "face_landmark_with_attention",
    size: 192,
    outputs: &[
        (0, MESH * 3),
        (1, LIPS.len() * 2),
        (2, RIGHT_EYE.len() * 2),
        (3, LEFT_EYE.len() * 2),
        (4, 10),
        (5, 10),
        (6, 1),
    ],
    border: Border::Replicate,
    black: 0.0,
};

/// The side of the input in which the landmarks are given, pixels.
const SIDE: f32 = 192.0;

/// How far the followed region may be from the detected one (`face_tracking.pbtxt`).
const TRACKING: Tracking = Tracking {
    rotation: 15.0 * std::f32::consts::PI / 180.0,
    translation: 0.1,
    scale: 0.3,
    margin: -0.2,
};

/// A face that was followed is another person's, or none, if its nose is farther from the body's, in sides of its region.
const NOSE_APART: f32 = 0.4;
/// The nose's tip: in the mesh, and among a body's landmarks.
const NOSE: (usize, usize) = (1, 0);
/// Corners of the eyes away from the nose, the person's right one first.
const EYES: (usize, usize) = (33, 263);

/// MediaPipe's face mesh with attention.
#[derive(Debug)]
pub struct Face {
    detector: Detector,
    landmarks: Network,
    search_every: u32,
    last: Option<Last>,
}

/// What is kept of the face in the last picture.
#[derive(Debug)]
struct Last {
    points: Box<[Vec3; FACE_LANDMARKS]>,
    /// Where to look next.
    region: Region,
    /// Pictures since it was detected.
    followed: u32,
}

impl Face {
    /// The files that it needs, without their ending.
    pub const NAMES: [&str; 2] = [Detector::NAMES[1], LANDMARKS.name];

    /// Loads its networks, each to be run by `provider`. A face that is followed is detected again in every
    /// `search_every`-th picture: 1 is what MediaPipe does.
    ///
    /// # Errors
    /// As [`Network::open`].
    pub fn open(
        set: &NetworkSet,
        search_every: u32,
        provider: Provider,
    ) -> Result<Self, TrackerError> {
        Ok(Self {
            detector: Detector::face(set, provider)?,
            landmarks: Network::open(set, &LANDMARKS, provider)?,
            search_every: search_every.max(1),
            last: None,
        })
    }

    /// The next picture is searched as a whole: it shows another scene, or another view of the same.
    pub fn forget(&mut self) {
        self.last = None;
    }

    /// The region about the face that scores best where a body has its head, or in the whole picture
    /// (`face_landmarks_from_pose_to_recrop_roi.pbtxt`, `face_detection_front_detections_to_roi.pbtxt`).
    fn search(
        &mut self,
        picture: PictureView<'_>,
        hint: Option<&FaceHint>,
    ) -> Result<Option<Region>, TrackerError> {
        let region = match hint {
            Some(FaceHint { points }) => {
                let radians = rotation(points[5], points[2], Towards::Right);
                Rect::about(*points, radians).square(0.0, 3.0)
            }
            None => Region::whole(picture),
        };
        let Some(region) = region else {
            return Ok(None);
        };
        let found = self.detector.run(picture, &region)?;
        Ok(found.first().and_then(|face| {
            let points = face.points();
            let [right_eye, left_eye, ..] = points else {
                return None;
            };
            let radians = rotation(*right_eye, *left_eye, Towards::Right);
            Rect::about(points.iter().copied(), radians).square(-0.1, 2.0)
        }))
    }

    fn look(
        &mut self,
        picture: PictureView<'_>,
        region: &Region,
        followed: u32,
    ) -> Result<Option<FaceEstimate>, TrackerError> {
        self.landmarks.run(picture, region)?;
        let network = &self.landmarks;
        let seen = read(std::array::from_fn(|i| network.output(i)), region);
        self.last = seen.as_ref().and_then(|seen| {
            Some(Last {
                points: seen.points.clone(),
                region: region_after(&seen.points)?,
                followed,
            })
        });
        Ok(seen.map(FaceEstimate::Landmarks))
    }
}

impl FaceModel for Face {
    fn follow(&mut self, picture: PictureView<'_>) -> Result<Option<FaceEstimate>, TrackerError> {
        let (region, followed) = match &self.last {
            Some(last) if last.followed + 1 < self.search_every => (last.region, last.followed + 1),
            _ => return Ok(None),
        };
        self.look(picture, &region, followed)
    }

    fn find(
        &mut self,
        picture: PictureView<'_>,
        hint: Option<&FaceHint>,
        followed: Option<FaceEstimate>,
    ) -> Result<Option<FaceEstimate>, TrackerError> {
        if followed.is_some() {
            let agrees = match (&self.last, hint) {
                (Some(last), Some(hint)) => {
                    let apart = last.points[NOSE.0].truncate().distance(hint.points[NOSE.1]);
                    apart <= NOSE_APART * last.region.side()
                }
                (Some(_), None) => true,
                (None, _) => false,
            };
            if agrees {
                return Ok(followed);
            }
            self.last = None;
        }
        let searched = self.search(picture, hint)?;
        let region = match (&self.last, searched) {
            (Some(last), Some(searched)) => {
                let points = last.points.iter().map(|p| p.truncate());
                if TRACKING.holds(&last.region, &searched, points) {
                    last.region
                } else {
                    searched
                }
            }
            (None, Some(searched)) => searched,
            (_, None) => {
                self.last = None;
                return Ok(None);
            }
        };
        self.look(picture, &region, 0)
    }
}

/// Where to look for a face that was seen (`face_landmarks_to_roi.pbtxt`).
fn region_after(points: &[Vec3; FACE_LANDMARKS]) -> Option<Region> {
    let radians = rotation(
        points[EYES.0].truncate(),
        points[EYES.1].truncate(),
        Towards::Right,
    );
    Rect::about(points.iter().map(|p| p.truncate()), radians).square(0.0, 1.5)
}

/// What the landmarks' network saw: its outputs in order. Nothing if there is no face, or a number is not finite.
fn read(outputs: [&[f32]; 7], region: &Region) -> Option<FaceLandmarks> {
    let [
        mesh,
        lips,
        right_eye,
        left_eye,
        right_iris,
        left_iris,
        presence,
    ] = outputs;
    let confidence = sigmoid(*presence.first()?);
    if !exceeds(confidence, SEEN) {
        return None;
    }
    let mut points = Box::new([Vec3::ZERO; FACE_LANDMARKS]);
    face_mesh::combine(
        mesh,
        [lips, right_eye, left_eye],
        [right_iris, left_iris],
        &mut points,
    );
    let picture_from_region = region.picture_from_region();
    for point in points.iter_mut() {
        let pixel = picture_from_region.transform_point2(point.truncate() / SIDE);
        *point = pixel.extend(point.z / SIDE * region.side());
    }
    let sane = points.iter().all(|p| p.is_finite());
    sane.then_some(FaceLandmarks { points, confidence })
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::Vec2;

    #[test]
    fn numbers_that_are_none_are_no_face_and_do_not_panic() {
        let region = Region::new(Vec2::new(100.0, 100.0), 50.0, 0.5).unwrap();
        let good = [MESH * 3, 160, 142, 142, 10, 10, 1].map(|length| vec![1.0_f32; length]);
        let seen =
            |outputs: &[Vec<f32>; 7]| read(std::array::from_fn(|i| &outputs[i][..]), &region);
        assert!(seen(&good).is_some(), "all is well");
        for bad in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY] {
            for which in 0..7 {
                let mut outputs = good.clone();
                outputs[which][0] = bad;
                if let Some(face) = seen(&outputs) {
                    assert!(
                        face.points.iter().all(|p| p.is_finite()),
                        "{bad} in output {which}"
                    );
                }
            }
        }
        assert!(read([&[]; 7], &region).is_none(), "nothing");
    }
}
