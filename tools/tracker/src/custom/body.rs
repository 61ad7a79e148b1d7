//! A user's network for bodies.

use super::decode::{Decoded, Look};
use super::network::Shared;
use crate::TrackerError;
use crate::models::{BodyEstimate, BodyHints, BodyModel, BodyRotations, JointRotation};
use crate::picture::PictureView;
use glam::{Vec2, Vec3};
use motion_fit::landmarks::BodyLandmarks;
use motion_fit::landmarks::blazepose::{HIPS, SHOULDERS};

/// Landmarks that the finder holds for less likely are left out of the region.
const SEEN: f32 = 0.5;

pub(super) struct CustomBody {
    finder: Box<dyn BodyModel>,
    network: Shared,
}

impl CustomBody {
    pub(super) fn new(finder: Box<dyn BodyModel>, network: Shared) -> Self {
        Self { finder, network }
    }
}

impl BodyModel for CustomBody {
    fn run(
        &mut self,
        picture: PictureView<'_>,
        seconds: f64,
    ) -> Result<Option<BodyEstimate>, TrackerError> {
        let found = self.finder.run(picture, seconds)?;
        let Some(found) = found.as_ref().and_then(BodyEstimate::landmarks) else {
            return Ok(None);
        };
        let seen = found.points.iter().filter(|p| p.confidence >= SEEN);
        let Some(region) = (self.network).region(seen.map(|p| p.pixel), lean(found)) else {
            return Ok(None);
        };
        let look = Look {
            region: &region,
            mirrored: false,
        };
        let Some(seen) = self.network.look(picture, look)? else {
            return Ok(None);
        };
        let landmarks = merged(found, &seen);
        if !seen.turns() {
            return Ok(Some(BodyEstimate::Landmarks(landmarks)));
        }
        let mut joints = [JointRotation::UNKNOWN; 22];
        for (to, from) in joints.iter_mut().zip(&seen.joints) {
            *to = *from;
        }
        Ok(Some(BodyEstimate::Rotations(Box::new(BodyRotations {
            joints,
            sight: self.network.sight(&region),
            landmarks: Some(landmarks),
            hints: BodyHints::default(),
        }))))
    }

    fn people(&self) -> Option<usize> {
        self.finder.people()
    }
}

/// How far the trunk is turned from upright, radians, clockwise as one looks at the picture.
fn lean(body: &BodyLandmarks) -> f32 {
    let sum = |[a, b]: [usize; 2]| body.points[a].pixel + body.points[b].pixel;
    let up = sum(SHOULDERS) - sum(HIPS);
    up.x.atan2(-up.y)
}

/// The network's landmarks where it has any, else those that were found.
fn merged(found: &BodyLandmarks, seen: &Decoded) -> BodyLandmarks {
    let mut body = found.clone();
    let hips = HIPS.map(|at| seen.marks.get(at).and_then(|mark| mark.metres));
    // Metres are counted from the hips' middle.
    let middle = match hips {
        [Some(left), Some(right)] => (left + right) * 0.5,
        _ => Vec3::ZERO,
    };
    for (to, mark) in body.points.iter_mut().zip(&seen.marks) {
        let pixel: Vec2 = mark.pixel.unwrap_or(to.pixel);
        to.pixel = pixel;
        to.metres = mark.metres.map_or(to.metres, |metres| metres - middle);
        to.confidence = mark.confidence.unwrap_or(to.confidence);
    }
    body
}
