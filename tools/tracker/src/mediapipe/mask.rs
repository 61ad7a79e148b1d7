//! Which pixels are the person: the segmentation that BlazePose's landmark network gives beside the landmarks. A call does not need it, and it doubles the
//! network's time, so it is a network of its own here.

use super::SEEN;
use super::exceeds;
use super::regions::{Rect, Towards};
use crate::TrackerError;
use crate::crop::{Border, Region};
use crate::networks::{Network, NetworkSet, Signature, sigmoid};
use crate::picture::PictureView;
use glam::Vec2;
use motion_fit::landmarks::BodyLandmarks;
use motion_fit::landmarks::blazepose::{HIPS, SHOULDERS};
use npu_runtime::Provider;

/// Pixels along a side of the network's input and of its mask.
const SIDE: usize = 256;
/// Landmarks less sure than this do not say how far the person reaches.
const SURE: f32 = 0.3;
/// From the furthest landmark to the furthest part of the person: the top of the head, fingers.
const BEYOND: f32 = 1.12;
/// MediaPipe's own margin of the region.
const MARGIN: f32 = 1.25;

const SEGMENTATION: Signature = Signature {
    name: "pose_landmark_full",
    size: SIDE,
    outputs: &[(1, 1), (2, SIDE * SIDE)],
    border: Border::Replicate,
    black: 0.0,
};

/// The network that tells a person from what is around.
#[derive(Debug)]
pub struct PersonMask {
    network: Network,
}

/// A person's mask in a picture.
#[derive(Debug, Clone, PartialEq)]
pub struct Mask {
    /// [height, width]: the probability that a pixel is the person, 0..=1; 0 outside the region that was looked at.
    pub probabilities: Vec<f32>,
    /// The side of one value of the network in the picture, pixels: finer structure is not known.
    pub grain: f32,
    /// Left, top, right and bottom (exclusive) of what was looked at, within the picture.
    pub bounds: [usize; 4],
}

impl PersonMask {
    /// The files that it needs, without their ending.
    pub const NAMES: [&str; 1] = [SEGMENTATION.name];

    /// Loads the network, to be run by `provider`.
    ///
    /// # Errors
    /// As [`Network::open`].
    pub fn open(set: &NetworkSet, provider: Provider) -> Result<Self, TrackerError> {
        Ok(Self {
            network: Network::open(set, &SEGMENTATION, provider)?,
        })
    }

    /// The mask of the person whose landmarks were seen in the picture; nothing where the network sees no person there.
    ///
    /// # Errors
    /// [`TrackerError::Runtime`] if the network fails.
    pub fn run(
        &mut self,
        picture: PictureView<'_>,
        body: &BodyLandmarks,
    ) -> Result<Option<Mask>, TrackerError> {
        let Some(region) = region_of(body) else {
            return Ok(None);
        };
        self.network.run(picture, &region)?;
        if !exceeds(self.network.number(0), SEEN) {
            return Ok(None);
        }
        let logits = self.network.output(1);
        if logits.len() != SIDE * SIDE {
            return Ok(None);
        }
        Ok(Some(spread(
            logits,
            &region,
            [picture.width(), picture.height()],
        )))
    }
}

/// The square about the hips that holds the person, upright as they are.
fn region_of(body: &BodyLandmarks) -> Option<Region> {
    let middle = |pair: [usize; 2]| (body.points[pair[0]].pixel + body.points[pair[1]].pixel) / 2.0;
    let centre = middle(HIPS);
    let up = (middle(SHOULDERS) - centre).try_normalize()?;
    let sure = body.points.iter().filter(|point| point.confidence > SURE);
    let reach = sure
        .map(|point| point.pixel.distance(centre))
        .fold(0.0, f32::max);
    Rect::aligned(centre, centre + up * reach * BEYOND, Towards::Top).square(0.0, MARGIN)
}

/// The network's mask of `region` on the picture's pixels, bilinearly.
#[expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "clamped to the picture or the mask before"
)]
fn spread(logits: &[f32], region: &Region, [width, height]: [usize; 2]) -> Mask {
    let from_picture = region.region_from_picture();
    let to_picture = region.picture_from_region();
    let corners = [Vec2::ZERO, Vec2::X, Vec2::Y, Vec2::ONE].map(|c| to_picture.transform_point2(c));
    let size = Vec2::new(width as f32, height as f32);
    let low = corners.into_iter().fold(size, Vec2::min).max(Vec2::ZERO);
    let high = corners.into_iter().fold(Vec2::ZERO, Vec2::max).min(size);
    let (left, top) = (low.x as usize, low.y as usize);
    let (right, bottom) = (high.x.ceil() as usize, high.y.ceil() as usize);
    let shares: Vec<f32> = logits
        .iter()
        .map(|logit| {
            if logit.is_finite() {
                sigmoid(*logit)
            } else {
                0.0
            }
        })
        .collect();
    let mut probabilities = vec![0.0; width * height];
    let last = SIDE as f32 - 1.0;
    for y in top..bottom.min(height) {
        for x in left..right.min(width) {
            let at = from_picture.transform_point2(Vec2::new(x as f32 + 0.5, y as f32 + 0.5));
            if at.min_element() < 0.0 || at.max_element() > 1.0 {
                continue;
            }
            let at = (at * SIDE as f32 - 0.5).clamp(Vec2::ZERO, Vec2::splat(last));
            let (column, row) = ((at.x as usize).min(SIDE - 2), (at.y as usize).min(SIDE - 2));
            let part = at - Vec2::new(column as f32, row as f32);
            let value = |dx: usize, dy: usize| shares[(row + dy) * SIDE + column + dx];
            let above = value(0, 0) + (value(1, 0) - value(0, 0)) * part.x;
            let below = value(0, 1) + (value(1, 1) - value(0, 1)) * part.x;
            probabilities[y * width + x] = above + (below - above) * part.y;
        }
    }
    Mask {
        probabilities,
        grain: region.side() / SIDE as f32,
        bounds: [left, top, right.min(width), bottom.min(height)],
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_mask_lies_where_its_region_is_in_the_picture() {
        let mut logits = vec![-30.0; SIDE * SIDE];
        // The right half of the region.
        for row in logits.chunks_exact_mut(SIDE) {
            row[SIDE / 2..].fill(30.0);
        }
        // A quarter turn clockwise: the region's right is down in the picture.
        let region = Region::new(Vec2::new(60.0, 50.0), 64.0, std::f32::consts::FRAC_PI_2)
            .expect("a region");
        let mask = spread(&logits, &region, [100, 70]);
        let at = |x: usize, y: usize| mask.probabilities[y * 100 + x];
        assert!(at(60, 60) > 0.99, "below the middle");
        assert!(at(60, 40) < 0.01, "above it");
        assert_eq!(at(10, 60), 0.0, "outside");
        assert_eq!(mask.bounds, [28, 18, 92, 70], "within the picture");
        assert_eq!(mask.grain, 0.25, "a quarter of a pixel");
    }
}
