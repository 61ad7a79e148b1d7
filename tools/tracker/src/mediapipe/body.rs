//! The body: a person is detected once, then followed from landmarks to landmarks.

use super::one_euro::OneEuro;
use super::regions::{Rect, Towards};
use super::{Detector, SEEN, exceeds};
use crate::TrackerError;
use crate::crop::{Border, Region};
use crate::models::{BodyEstimate, BodyModel};
use crate::networks::sigmoid;
use crate::networks::{Network, NetworkSet, Signature};
use crate::picture::PictureView;
use glam::{Vec2, Vec3};
use motion_fit::landmarks::{BODY_LANDMARKS, BodyLandmarks, BodyPoint};
use npu_runtime::Provider;

/// Landmarks that the network gives: a body's, two that say where to look next, and four of no use here.
const ALL: usize = 39;
/// Numbers of a landmark: x, y, z in the input's pixels, visibility and presence as logits.
const NUMBERS: usize = 5;
/// The side of the input in which landmarks are given, pixels.
const SIDE: f32 = 256.0;
/// Places along a side of the heat maps.
const HEAT: usize = 64;
/// Places to each side of a landmark that refine it.
const REACH: usize = 3;

const LANDMARKS: Signature = Signature {
    name: "pose_landmark_full",
    size: 256,
    outputs: &[
        (0, ALL * NUMBERS),
        (1, 1),
        (3, HEAT * HEAT * ALL),
        (4, ALL * 3),
    ],
    border: Border::Replicate,
    black: 0.0,
};

/// BlazePose with the detector of people.
#[derive(Debug)]
pub struct Body {
    detector: Detector,
    landmarks: Network,
    /// Where to look next, if the person was seen.
    region: Option<Region>,
    /// Of the two landmarks that say where to look next, x and y each.
    filters: [OneEuro; 4],
    people: Option<usize>,
}

impl Body {
    /// The files that it needs, without their ending.
    pub const NAMES: [&str; 2] = [Detector::NAMES[0], LANDMARKS.name];

    /// Loads its networks, each to be run by `provider`.
    ///
    /// # Errors
    /// As [`Network::open`].
    pub fn open(set: &NetworkSet, provider: Provider) -> Result<Self, TrackerError> {
        Ok(Self {
            detector: Detector::person(set, provider)?,
            landmarks: Network::open(set, &LANDMARKS, provider)?,
            region: None,
            filters: std::array::from_fn(|_| OneEuro::new(0.01, 10.0)),
            people: None,
        })
    }

    /// The next picture is searched as a whole: it shows another scene, or another view of the same.
    pub fn forget(&mut self) {
        self.region = None;
    }

    /// The nearest person: of all that are detected, the one that appears largest.
    fn detect(&mut self, picture: PictureView<'_>) -> Result<Option<Region>, TrackerError> {
        let Some(whole) = Region::whole(picture) else {
            return Ok(None);
        };
        let found = self.detector.run(picture, &whole)?;
        self.people = Some(found.len());
        if found.len() > 1 {
            log::debug!("{} people are seen; the largest is tracked", found.len());
        }
        Ok(found
            .iter()
            .filter_map(|person| region_of(person.points()))
            .max_by(|a, b| a.side().total_cmp(&b.side())))
    }

    fn look(
        &mut self,
        picture: PictureView<'_>,
        region: &Region,
        seconds: f64,
    ) -> Result<Option<BodyLandmarks>, TrackerError> {
        self.landmarks.run(picture, region)?;
        if !exceeds(self.landmarks.number(1), SEEN) {
            return Ok(None);
        }
        let network = &self.landmarks;
        let [numbers, heat, metres] = [0, 2, 3].map(|i| network.output(i));
        let Some(seen) = Seen::read(numbers, heat, metres, region) else {
            return Ok(None);
        };
        let [centre, edge] = seen.next;
        let size = f64::from(2.0 * centre.distance(edge));
        let [a, b, c, d] = &mut self.filters;
        let smooth = |filter: &mut OneEuro, value: f32| {
            #[allow(
                clippy::cast_possible_truncation,
                reason = "a coordinate in single precision, as it came"
            )]
            let value = filter.apply(seconds, f64::from(value), size) as f32;
            value
        };
        let centre = Vec2::new(smooth(a, centre.x), smooth(b, centre.y));
        let edge = Vec2::new(smooth(c, edge.x), smooth(d, edge.y));
        self.region = region_of(&[centre, edge]);
        Ok(Some(seen.body))
    }
}

/// The region about a person from the hips' middle and a point on the circle about it.
fn region_of(points: &[Vec2]) -> Option<Region> {
    let [centre, edge, ..] = points else {
        return None;
    };
    Rect::aligned(*centre, *edge, Towards::Top).square(0.0, 1.25)
}

impl BodyModel for Body {
    fn run(
        &mut self,
        picture: PictureView<'_>,
        seconds: f64,
    ) -> Result<Option<BodyEstimate>, TrackerError> {
        if let Some(region) = self.region.take() {
            let seen = self.look(picture, &region, seconds)?;
            if seen.is_some() {
                return Ok(seen.map(BodyEstimate::Landmarks));
            }
        }
        for filter in &mut self.filters {
            filter.reset();
        }
        let Some(region) = self.detect(picture)? else {
            return Ok(None);
        };
        let seen = self.look(picture, &region, seconds)?;
        Ok(seen.map(BodyEstimate::Landmarks))
    }

    fn people(&self) -> Option<usize> {
        self.people
    }
}

/// What one run of the landmarks' network says.
struct Seen {
    body: BodyLandmarks,
    /// The two landmarks that say where to look next, pixels of the picture.
    next: [Vec2; 2],
}

impl Seen {
    /// Nothing if a number that matters is not finite.
    fn read(numbers: &[f32], heat: &[f32], metres: &[f32], region: &Region) -> Option<Self> {
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
        sane.then_some(Self { body, next })
    }
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
            let seen = Seen::read(&numbers, &heat, &metres, &region()).unwrap();
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
                if let Some(seen) = Seen::read(&numbers, &heat, &metres, &region()) {
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
            Seen::read(&[f32::NAN; ALL * NUMBERS], &[], &[0.0; ALL * 3], &region()).is_none(),
            "none"
        );
    }
}
