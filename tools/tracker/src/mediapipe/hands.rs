//! The hands: searched where the body has its wrists, then followed from landmarks to landmarks.

use super::regions::{Rect, Towards, Tracking, rotation};
use super::{SEEN, exceeds};
use crate::TrackerError;
use crate::crop::{Border, Region};
use crate::models::{HandEstimate, HandHint, HandModel, Side};
use crate::networks::{Network, NetworkSet, Signature};
use crate::picture::PictureView;
use glam::{Vec2, Vec3};
use motion_fit::landmarks::{HAND_LANDMARKS, HandLandmarks};
use npu_runtime::Provider;

const RECROP: Signature = Signature {
    name: "hand_recrop",
    size: 256,
    outputs: &[(0, 4)],
    border: Border::Replicate,
    black: 0.0,
};

/// A hand that is less probably of the side that was looked for is the other one: two hands close together draw both regions to one,
/// and MediaPipe's graph, which does not ask, then gives it twice.
const THIS_SIDE: f32 = 0.2;

/// The side of the input in which the landmarks are given, pixels.
const SIDE: f32 = 224.0;

/// Wrists that are less visible are not looked at.
const WRIST_SEEN: f32 = 0.1;

/// A hand that was followed belongs to another arm, or to none, if its wrist is farther from the body's, in sides of its region.
const WRIST_APART: f32 = 0.4;

/// How far the followed region may be from the searched one (`hand_tracking.pbtxt`).
const TRACKING: Tracking = Tracking {
    rotation: 40.0 * std::f32::consts::PI / 180.0,
    translation: 0.2,
    scale: 0.4,
    margin: -0.1,
};

/// The landmarks of the palm, by which a region is laid about a hand.
const PALM: [usize; 12] = [0, 1, 2, 3, 5, 6, 9, 10, 13, 14, 17, 18];

/// The network that gives hands' landmarks.
const LANDMARKS: Signature = Signature {
    name: "hand_landmark_full",
    size: 224,
    outputs: &[
        (0, HAND_LANDMARKS * 3),
        (1, 1),
        (2, 1),
        (3, HAND_LANDMARKS * 3),
    ],
    border: Border::Replicate,
    black: 0.0,
};

/// MediaPipe's hands for both sides of a person.
#[derive(Debug)]
pub struct Hands {
    recrop: Network,
    landmarks: Network,
    search_every: u32,
    sides: [Option<Last>; 2],
}

/// What is kept of a hand in the last picture.
#[derive(Debug)]
struct Last {
    pixels: [Vec2; HAND_LANDMARKS],
    /// Where to look next.
    region: Region,
    /// Pictures since it was searched.
    followed: u32,
}

impl Hands {
    /// The files that it needs, without their ending.
    pub const NAMES: [&'static str; 2] = [RECROP.name, LANDMARKS.name];

    /// Loads its networks, each to be run by `provider`. A hand that is followed is searched again where the body has it in
    /// every `search_every`-th picture: 1 is what MediaPipe does, and costs a run of the searching network for every hand and picture.
    ///
    /// # Errors
    /// As [`Network::open`].
    pub fn open(
        set: &NetworkSet,
        search_every: u32,
        provider: Provider,
    ) -> Result<Self, TrackerError> {
        Ok(Self {
            recrop: Network::open(set, &RECROP, provider)?,
            landmarks: Network::open(set, &LANDMARKS, provider)?,
            search_every: search_every.max(1),
            sides: [None, None],
        })
    }

    /// The region that the searching network sees about the hand of a body (`hand_landmarks_from_pose_to_recrop_roi.pbtxt`,
    /// `hand_recrop_by_roi_cpu.pbtxt`).
    fn search(
        &mut self,
        picture: PictureView<'_>,
        hint: &HandHint,
    ) -> Result<Option<Region>, TrackerError> {
        let knuckle = (hint.index * 2.0 + hint.little) / 3.0;
        let rect = Rect {
            radians: rotation(hint.wrist, knuckle, Towards::Top),
            ..Rect::aligned(knuckle, hint.wrist, Towards::Top)
        };
        let Some(region) = rect.square(-0.1, 2.7) else {
            return Ok(None);
        };
        self.recrop.run(picture, &region)?;
        let [x0, y0, x1, y1] = *self.recrop.output(0) else {
            return Ok(None);
        };
        let size = self.recrop.size() as f32;
        let [centre, edge] = [Vec2::new(x0, y0), Vec2::new(x1, y1)]
            .map(|p| region.picture_from_region().transform_point2(p / size));
        Ok(Rect::aligned(centre, edge, Towards::Bottom).square(-0.1, 1.0))
    }

    fn look(
        &mut self,
        picture: PictureView<'_>,
        region: &Region,
        side: Side,
        followed: u32,
    ) -> Result<Option<HandEstimate>, TrackerError> {
        self.landmarks.run(picture, region)?;
        let network = &self.landmarks;
        let seen = read([0, 1, 2, 3].map(|i| network.output(i)), region, side);
        self.sides[side.index()] = seen.as_ref().and_then(|seen| {
            Some(Last {
                pixels: seen.pixels,
                region: region_after(&seen.pixels)?,
                followed,
            })
        });
        Ok(seen.map(HandEstimate::Landmarks))
    }
}

impl HandModel for Hands {
    fn follow(
        &mut self,
        picture: PictureView<'_>,
        side: Side,
    ) -> Result<Option<HandEstimate>, TrackerError> {
        let (region, followed) = match &self.sides[side.index()] {
            Some(last) if last.followed + 1 < self.search_every => (last.region, last.followed + 1),
            _ => return Ok(None),
        };
        self.look(picture, &region, side, followed)
    }

    fn find(
        &mut self,
        picture: PictureView<'_>,
        side: Side,
        hint: &HandHint,
        followed: Option<HandEstimate>,
    ) -> Result<Option<HandEstimate>, TrackerError> {
        if !exceeds(hint.confidence, WRIST_SEEN) {
            self.forget(side);
            return Ok(None);
        }
        if followed.is_some() {
            let agrees = self.sides[side.index()].as_ref().is_some_and(|last| {
                last.pixels[0].distance(hint.wrist) <= WRIST_APART * last.region.side()
            });
            if agrees {
                return Ok(followed);
            }
            self.forget(side);
        }
        let Some(searched) = self.search(picture, hint)? else {
            self.forget(side);
            return Ok(None);
        };
        if let Some(last) = &self.sides[side.index()]
            && TRACKING.holds(&last.region, &searched, last.pixels)
        {
            let region = last.region;
            let seen = self.look(picture, &region, side, 0)?;
            if seen.is_some() {
                return Ok(seen);
            }
        }
        self.look(picture, &searched, side, 0)
    }

    fn forget(&mut self, side: Side) {
        self.sides[side.index()] = None;
    }
}

/// Where to look for a hand that was seen (`hand_landmarks_to_roi.pbtxt`).
fn region_after(pixels: &[Vec2; HAND_LANDMARKS]) -> Option<Region> {
    let knuckles = ((pixels[5] + pixels[13]) * 0.5 + pixels[9]) * 0.5;
    let radians = rotation(pixels[0], knuckles, Towards::Top);
    Rect::turned_about(PALM.map(|i| pixels[i]), radians).square(-0.1, 2.0)
}

/// What the landmarks' network saw: landmarks, presence, the probability of a right hand, metres. Nothing if there is no hand, or
/// one of the other `side`, or a number is not finite.
fn read(outputs: [&[f32]; 4], region: &Region, side: Side) -> Option<HandLandmarks> {
    let [landmarks, presence, right, metres] = outputs;
    let (confidence, right) = (*presence.first()?, *right.first()?);
    let this_side = match side {
        Side::Left => 1.0 - right,
        Side::Right => right,
    };
    if !(exceeds(confidence, SEEN) && exceeds(this_side, THIS_SIDE)) {
        return None;
    }
    let picture_from_region = region.picture_from_region();
    let turn = Vec2::from_angle(region.radians());
    let mut hand = HandLandmarks {
        pixels: [Vec2::ZERO; HAND_LANDMARKS],
        metres: [Vec3::ZERO; HAND_LANDMARKS],
        confidence: confidence.min(1.0),
    };
    for (pixel, at) in hand.pixels.iter_mut().zip(landmarks.chunks_exact(3)) {
        *pixel = picture_from_region.transform_point2(Vec2::new(at[0], at[1]) / SIDE);
    }
    for (metres, at) in hand.metres.iter_mut().zip(metres.chunks_exact(3)) {
        *metres = turn.rotate(Vec2::new(at[0], at[1])).extend(at[2]);
    }
    let sane =
        hand.pixels.iter().all(|p| p.is_finite()) && hand.metres.iter().all(|p| p.is_finite());
    sane.then_some(hand)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn region() -> Region {
        Region::new(Vec2::new(100.0, 100.0), 50.0, 0.5).unwrap()
    }

    #[test]
    fn a_hand_of_the_other_side_is_not_this_one() {
        let (at, metres) = ([112.0; 63], [0.0; 63]);
        for (right, sides) in [
            (0.95, [false, true]),
            (0.05, [true, false]),
            (0.5, [true, true]),
        ] {
            let seen = Side::BOTH
                .map(|side| read([&at, &[0.9], &[right], &metres], &region(), side).is_some());
            assert_eq!(seen, sides, "{right}");
        }
    }

    #[test]
    fn numbers_that_are_none_are_no_hand_and_do_not_panic() {
        let good = [vec![112.0; 63], vec![0.9], vec![0.5], vec![0.0; 63]];
        for bad in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY] {
            for which in 0..4 {
                let mut outputs = good.clone();
                outputs[which][0] = bad;
                let [a, b, c, d] = &outputs;
                if let Some(hand) = read([a, b, c, d], &region(), Side::Right) {
                    let fine = hand.pixels.iter().all(|p| p.is_finite()) && hand.confidence <= 1.0;
                    assert!(fine, "{bad} in output {which}");
                }
            }
        }
        assert!(
            read([&[], &[], &[], &[]], &region(), Side::Left).is_none(),
            "nothing"
        );
        let point = [Vec2::ONE; HAND_LANDMARKS];
        assert!(
            region_after(&point).is_none(),
            "no region about a single point"
        );
    }

    #[test]
    fn the_region_about_a_hand_has_the_fingers_up_and_twice_the_palms_length() {
        // A hand that points right: wrist at (10, 50), knuckles at x = 60, tips beyond.
        let mut pixels = [Vec2::new(60.0, 50.0); HAND_LANDMARKS];
        pixels[0] = Vec2::new(10.0, 50.0);
        pixels[5].y = 40.0;
        pixels[13].y = 60.0;
        let region = region_after(&pixels).unwrap();
        assert!(
            (region.radians() - std::f32::consts::FRAC_PI_2).abs() < 1e-5,
            "{region:?}"
        );
        assert!((region.side() - 100.0).abs() < 1e-3, "{region:?}");
        // A tenth of the palm's length towards the fingers.
        assert!(
            region.centre().distance(Vec2::new(40.0, 50.0)) < 1e-3,
            "{region:?}"
        );
    }
}
