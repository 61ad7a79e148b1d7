//! BlazePose's networks on one region of a picture: what their numbers mean.

use super::seen::Seen;
use super::{SEEN, exceeds};
use crate::TrackerError;
use crate::crop::{Border, Region};
use crate::networks::sigmoid;
use crate::networks::{Network, NetworkSet, Signature};
use crate::picture::PictureView;
use glam::{Vec2, Vec3};
use motion_fit::landmarks::{BODY_LANDMARKS, BodyLandmarks, BodyPoint};
use npu_runtime::Provider;
use std::str::FromStr;

/// Landmarks that a network gives: a body's, two that say where to look next, and four of no use here.
const ALL: usize = 39;
/// Numbers of a landmark: x, y, z in the input's pixels, visibility and presence as logits.
const NUMBERS: usize = 5;
/// The side of the input in which landmarks are given, pixels.
const SIDE: f32 = 256.0;
/// Places along a side of the heat maps.
const HEAT: usize = 64;
/// Places to each side of a landmark that refine it.
const REACH: usize = 3;

/// The network of that name; all have the same inputs and outputs.
const fn signature(name: &'static str) -> Signature {
    Signature {
        name,
        size: 256,
        outputs: &[
            (0, ALL * NUMBERS),
            (1, 1),
            (3, HEAT * HEAT * ALL),
            (4, ALL * 3),
        ],
        border: Border::Replicate,
        black: 0.0,
    }
}

/// Which of BlazePose's networks see a body's landmarks.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum BodyBy {
    /// The one of 6 MB, for live cameras.
    Full,
    /// The one of 28 MB, which takes four times as long.
    Heavy,
    /// Both, and the mean of what they see; of arms or legs the heavy one alone where the full one has left and right the other way round.
    Both,
}

impl BodyBy {
    /// All choices.
    pub const ALL: [Self; 3] = [Self::Full, Self::Heavy, Self::Both];

    /// The name by which it is asked for, as [`FromStr`] reads it.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Full => "full",
            Self::Heavy => "heavy",
            Self::Both => "both",
        }
    }

    /// The networks' files without their ending; of two the one first whose sides are believed.
    pub(super) fn networks(self) -> &'static [&'static str] {
        match self {
            Self::Full => &["pose_landmark_full"],
            Self::Heavy => &["pose_landmark_heavy"],
            Self::Both => &["pose_landmark_heavy", "pose_landmark_full"],
        }
    }
}

impl FromStr for BodyBy {
    type Err = UnknownBody;

    fn from_str(text: &str) -> Result<Self, Self::Err> {
        (Self::ALL.into_iter())
            .find(|by| by.name() == text)
            .ok_or_else(|| UnknownBody(text.to_owned()))
    }
}

/// A text that names no choice of the body's networks.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("there is no body network {0:?}; known: {known}", known = BodyBy::ALL.map(BodyBy::name).join(", "))]
pub struct UnknownBody(pub String);

/// The networks that look at a body, one after the other.
#[derive(Debug)]
pub(super) struct BlazePose {
    networks: Vec<Network>,
}

impl BlazePose {
    /// Loads the networks, each to be run by `provider`.
    ///
    /// # Errors
    /// As [`Network::open`].
    pub(super) fn open(
        set: &NetworkSet,
        by: BodyBy,
        provider: Provider,
    ) -> Result<Self, TrackerError> {
        let open = |name: &&'static str| Network::open(set, &signature(name), provider);
        let networks = by.networks().iter().map(open).collect::<Result<_, _>>()?;
        Ok(Self { networks })
    }

    /// The body in `region`; nothing if no network sees one there.
    ///
    /// # Errors
    /// [`TrackerError::Runtime`] if a network fails.
    pub(super) fn run(
        &mut self,
        picture: PictureView<'_>,
        region: &Region,
    ) -> Result<Option<Seen>, TrackerError> {
        let mut all: Option<Seen> = None;
        for network in &mut self.networks {
            network.run(picture, region)?;
            if !exceeds(network.number(1), SEEN) {
                continue;
            }
            let [numbers, heat, metres] = [0, 2, 3].map(|i| network.output(i));
            all = Seen::joined(all, read(numbers, heat, metres, region));
        }
        Ok(all)
    }
}

/// What a network saw in `region`; nothing if a number that matters is not finite.
fn read(numbers: &[f32], heat: &[f32], metres: &[f32], region: &Region) -> Option<Seen> {
    let picture_from_region = region.picture_from_region();
    let turn = Vec2::from_angle(region.radians());
    let mut body = BodyLandmarks {
        points: [BodyPoint::default(); BODY_LANDMARKS],
    };
    let mut next = [Vec2::ZERO; 2];
    let landmarks = numbers.chunks_exact(NUMBERS).zip(metres.chunks_exact(3));
    for (index, (numbers, metres)) in landmarks.enumerate() {
        let at = refined(Vec2::new(numbers[0], numbers[1]) / SIDE, heat, index);
        let pixel = picture_from_region.transform_point2(at);
        if let Some(point) = body.points.get_mut(index) {
            let across = turn.rotate(Vec2::new(metres[0], metres[1]));
            *point = BodyPoint {
                pixel,
                metres: Vec3::new(across.x, across.y, metres[2]),
                confidence: sigmoid(numbers[3]),
            };
        } else if let Some(next) = next.get_mut(index - BODY_LANDMARKS) {
            *next = pixel;
        }
    }
    let sane =
        |p: &BodyPoint| p.pixel.is_finite() && p.metres.is_finite() && p.confidence.is_finite();
    let sane = body.points.iter().all(sane) && next.iter().all(|p| p.is_finite());
    sane.then_some(Seen { body, next })
}

/// `at` (0..1) moved to the mean of landmark `index`'s heat map about it, where that is sure of itself
/// (`RefineLandmarksFromHeatmapCalculator`).
#[allow(
    clippy::cast_possible_truncation,
    reason = "64 places a side; casts saturate, and what is beyond the map is refused before"
)]
fn refined(at: Vec2, heat: &[f32], index: usize) -> Vec2 {
    let place = at * HEAT as f32;
    if !(place.min_element() > -1.0 && place.max_element() < HEAT as f32) {
        return at;
    }
    let (column, row) = (place.x as usize, place.y as usize);
    let range = |centre: usize| centre.saturating_sub(REACH)..(centre + REACH + 1).min(HEAT);
    let (mut sum, mut best, mut mean) = (0.0_f32, 0.0_f32, Vec2::ZERO);
    for row in range(row) {
        for column in range(column) {
            let Some(logit) = heat.get((row * HEAT + column) * ALL + index) else {
                return at;
            };
            let weight = sigmoid(*logit);
            sum += weight;
            best = best.max(weight);
            mean += Vec2::new(column as f32, row as f32) * weight;
        }
    }
    if best >= SEEN && sum.is_finite() {
        mean / (sum * HEAT as f32)
    } else {
        at
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn region() -> Region {
        Region::new(Vec2::new(320.0, 240.0), 512.0, 0.0).unwrap()
    }

    /// Every landmark at the input's middle, with a heat map whose only warm place is `warm` (column, row).
    fn outputs(warm: (usize, usize), logit: f32) -> [Vec<f32>; 3] {
        let mut heat = vec![-20.0; HEAT * HEAT * ALL];
        for index in 0..ALL {
            heat[(warm.1 * HEAT + warm.0) * ALL + index] = logit;
        }
        [
            [128.0, 128.0, 0.0, 3.0, 3.0].repeat(ALL),
            heat,
            vec![0.5; ALL * 3],
        ]
    }

    #[test]
    fn a_landmark_moves_to_its_warm_place_only_where_the_heat_map_is_sure() {
        for (logit, expected) in [(5.0, 34.0 / 64.0), (-1.0, 0.5)] {
            let [numbers, heat, metres] = outputs((34, 32), logit);
            let seen = read(&numbers, &heat, &metres, &region()).unwrap();
            let x = seen.body.points[0].pixel.x;
            let expected = 320.0 + (expected - 0.5) * 512.0;
            assert!((x - expected).abs() < 0.01, "{x} against {expected}");
        }
    }

    #[test]
    fn numbers_that_are_none_are_no_body_and_do_not_panic() {
        for bad in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY, 1e30] {
            for which in 0..3 {
                let mut all = outputs((34, 32), 5.0);
                let middle = if which == 1 {
                    (32 * HEAT + 32) * ALL
                } else {
                    0
                };
                all[which][middle] = bad;
                let [numbers, heat, metres] = all;
                if let Some(seen) = read(&numbers, &heat, &metres, &region()) {
                    let fine = seen
                        .body
                        .points
                        .iter()
                        .all(|p| p.pixel.is_finite() && p.metres.is_finite());
                    assert!(fine, "{bad} in output {which}");
                }
            }
        }
        assert!(
            read(&[f32::NAN; ALL * NUMBERS], &[], &[0.0; ALL * 3], &region()).is_none(),
            "none"
        );
    }

    #[test]
    fn every_choice_of_networks_is_known_by_its_name() {
        for by in BodyBy::ALL {
            assert_eq!(by.name().parse(), Ok(by), "by its own name");
        }
        let error = "light".parse::<BodyBy>().expect_err("no such network");
        assert!(error.to_string().contains("full, heavy, both"), "{error}");
    }
}
