//! The body: a person is detected once, then followed from landmarks to landmarks.

use super::Detector;
use super::blaze_pose::{BlazePose, BodyBy};
use super::one_euro::OneEuro;
use super::regions::{Rect, Towards};
use crate::TrackerError;
use crate::crop::Region;
use crate::models::{BodyEstimate, BodyModel};
use crate::networks::NetworkSet;
use crate::picture::PictureView;
use glam::Vec2;
use motion_fit::landmarks::BodyLandmarks;
use npu_runtime::Provider;

/// BlazePose with the detector of people.
#[derive(Debug)]
pub struct Body {
    detector: Detector,
    landmarks: BlazePose,
    /// Where to look next, if the person was seen.
    region: Option<Region>,
    /// Of the two landmarks that say where to look next, x and y each.
    filters: [OneEuro; 4],
    people: Option<usize>,
}

impl Body {
    /// The files that it needs for landmarks `by`, without their ending.
    #[must_use]
    pub fn names(by: BodyBy) -> Vec<&'static str> {
        let mut names = vec![Detector::NAMES[0]];
        names.extend(by.networks());
        names
    }

    /// Loads the detector and the networks that see the landmarks `by`, each to be run by `provider`.
    ///
    /// # Errors
    /// As [`Network::open`](crate::networks::Network::open).
    pub fn open(set: &NetworkSet, by: BodyBy, provider: Provider) -> Result<Self, TrackerError> {
        Ok(Self {
            detector: Detector::person(set, provider)?,
            landmarks: BlazePose::open(set, by, provider)?,
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
        let Some(seen) = self.landmarks.run(picture, region)? else {
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
