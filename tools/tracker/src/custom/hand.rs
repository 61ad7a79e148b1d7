//! A user's network for hands.

use super::decode::{Decoded, Look};
use super::description::Trained;
use super::network::Shared;
use crate::TrackerError;
use crate::models::{HandEstimate, HandHint, HandModel, HandRotations, JointRotation, Side};
use crate::picture::PictureView;
use glam::Vec3;
use motion_fit::landmarks::HandLandmarks;

/// MediaPipe's wrist and the middle finger's root.
const WRIST: usize = 0;
const MIDDLE: usize = 9;

pub(super) struct CustomHand {
    finder: Box<dyn HandModel>,
    network: Shared,
}

impl CustomHand {
    pub(super) fn new(finder: Box<dyn HandModel>, network: Shared) -> Self {
        Self { finder, network }
    }
}

impl HandModel for CustomHand {
    /// Follows the finder's hand only: where that is must first agree with the body.
    fn follow(
        &mut self,
        picture: PictureView<'_>,
        side: Side,
    ) -> Result<Option<HandEstimate>, TrackerError> {
        self.finder.follow(picture, side)
    }

    fn find(
        &mut self,
        picture: PictureView<'_>,
        side: Side,
        hint: &HandHint,
        followed: Option<HandEstimate>,
    ) -> Result<Option<HandEstimate>, TrackerError> {
        let found = self.finder.find(picture, side, hint, followed)?;
        let Some(found) = found.as_ref().and_then(HandEstimate::landmarks) else {
            return Ok(None);
        };
        let up = found.pixels[MIDDLE] - found.pixels[WRIST];
        let radians = up.x.atan2(-up.y);
        let Some(region) = self.network.region(found.pixels, radians) else {
            return Ok(None);
        };
        let trained = self.network.plan.description.side;
        let look = Look {
            region: &region,
            mirrored: matches!(
                (trained, side),
                (Trained::Left, Side::Right) | (Trained::Right, Side::Left)
            ),
        };
        let Some(seen) = self.network.look(picture, look)? else {
            return Ok(None);
        };
        let landmarks = merged(found, &seen);
        if !seen.turns() {
            // Metres are those of one network or of the other.
            let own = seen.marks.iter().all(|mark| mark.metres.is_some());
            return Ok(Some(if own {
                HandEstimate::Joints(landmarks)
            } else {
                HandEstimate::Landmarks(landmarks)
            }));
        }
        let mut joints = [JointRotation::UNKNOWN; 16];
        for (to, from) in joints.iter_mut().zip(&seen.joints) {
            *to = *from;
        }
        Ok(Some(HandEstimate::Rotations(Box::new(HandRotations {
            joints,
            sight: self.network.sight(&region),
            landmarks: Some(landmarks),
        }))))
    }

    fn forget(&mut self, side: Side) {
        self.finder.forget(side);
    }
}

/// The network's landmarks where it has any, else those that were found.
fn merged(found: &HandLandmarks, seen: &Decoded) -> HandLandmarks {
    let mut hand = found.clone();
    let metres: Vec<Vec3> = seen.marks.iter().filter_map(|mark| mark.metres).collect();
    // Metres are counted from the hand's own middle.
    let middle = metres.iter().sum::<Vec3>() / metres.len().max(1) as f32;
    let points = hand.pixels.iter_mut().zip(&mut hand.metres);
    for ((pixel, metres), mark) in points.zip(&seen.marks) {
        *pixel = mark.pixel.unwrap_or(*pixel);
        *metres = mark.metres.map_or(*metres, |metres| metres - middle);
    }
    if !seen.turns() {
        hand.confidence = seen.confidence.min(hand.confidence);
    }
    hand
}
