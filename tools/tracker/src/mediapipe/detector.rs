//! MediaPipe's single-shot detectors: anchors, decoding, and merging of overlapping detections.

use super::SEEN;
use crate::TrackerError;
use crate::crop::{Border, Region};
use crate::networks::sigmoid;
use crate::networks::{Network, NetworkSet, Signature};
use crate::picture::PictureView;
use glam::Vec2;
use npu_runtime::Provider;

/// Detections that overlap more are of the same thing (intersection over union).
const SAME: f32 = 0.3;

/// Key points of the detector that has most.
const MOST_POINTS: usize = 6;

/// More raw detections than this are not merged: the best-scored ones are.
const MOST_RAW: usize = 256;

/// Which detector.
#[derive(Debug, Clone, Copy)]
struct Layout {
    signature: Signature,
    /// The grids' steps in pixels of the input; equal ones that follow each other share a grid.
    strides: &'static [usize],
    points: usize,
}

const PERSON: Layout = Layout {
    signature: Signature {
        name: "pose_detection",
        size: 224,
        outputs: &[(0, 2254 * 12), (1, 2254)],
        border: Border::Zero,
        black: -1.0,
    },
    strides: &[8, 16, 32, 32, 32],
    points: 4,
};

const FACE: Layout = Layout {
    signature: Signature {
        name: "face_detection_short_range",
        size: 128,
        outputs: &[(0, 896 * 16), (1, 896)],
        border: Border::Zero,
        black: -1.0,
    },
    strides: &[8, 16, 16, 16],
    points: 6,
};

/// Something that was detected.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Detection {
    /// Probability, 0..=1.
    pub score: f32,
    /// The box's corners, in the coordinates (0..1) of the region that was searched.
    corners: [Vec2; 2],
    points: [Vec2; MOST_POINTS],
    count: usize,
}

impl Detection {
    /// Its key points: of the detector, pixels of the picture.
    #[must_use]
    pub fn points(&self) -> &[Vec2] {
        self.points.get(..self.count).unwrap_or_default()
    }

    fn area(&self) -> f32 {
        let size = (self.corners[1] - self.corners[0]).max(Vec2::ZERO);
        size.x * size.y
    }

    fn overlap(&self, other: &Self) -> f32 {
        let low = self.corners[0].max(other.corners[0]);
        let high = self.corners[1].min(other.corners[1]);
        let common = (high - low).max(Vec2::ZERO);
        let common = common.x * common.y;
        let all = self.area() + other.area() - common;
        if all > 0.0 { common / all } else { 0.0 }
    }
}

/// A detector of people or faces.
#[derive(Debug)]
pub struct Detector {
    network: Network,
    anchors: Vec<Vec2>,
    points: usize,
}

impl Detector {
    /// The files that [`Self::person`] and [`Self::face`] need.
    pub const NAMES: [&str; 2] = [PERSON.signature.name, FACE.signature.name];

    /// The detector of people; its key points are the hips' middle, a point at the edge of a circle about it that encloses the
    /// person, upright above it, and the same two for the upper body.
    ///
    /// # Errors
    /// As [`Network::open`].
    pub fn person(set: &NetworkSet, provider: Provider) -> Result<Self, TrackerError> {
        Self::open(set, &PERSON, provider)
    }

    /// The detector of near faces; its key points are the right eye, the left eye, the nose's tip, the mouth, the right and the left
    /// ear.
    ///
    /// # Errors
    /// As [`Network::open`].
    pub fn face(set: &NetworkSet, provider: Provider) -> Result<Self, TrackerError> {
        Self::open(set, &FACE, provider)
    }

    fn open(set: &NetworkSet, layout: &Layout, provider: Provider) -> Result<Self, TrackerError> {
        Ok(Self {
            network: Network::open(set, &layout.signature, provider)?,
            anchors: anchors(layout.signature.size, layout.strides),
            points: layout.points,
        })
    }

    /// What is seen in `region` of `picture`, best-scored first, each thing once.
    ///
    /// # Errors
    /// [`TrackerError::Runtime`] if the network fails.
    pub fn run(
        &mut self,
        picture: PictureView<'_>,
        region: &Region,
    ) -> Result<Vec<Detection>, TrackerError> {
        self.network.run(picture, region)?;
        let (boxes, scores) = (self.network.output(0), self.network.output(1));
        let size = self.network.size();
        let raw = decode(boxes, scores, &self.anchors, size, self.points);
        let mut merged = merge(raw);
        let picture_from_region = region.picture_from_region();
        for detection in &mut merged {
            for point in &mut detection.points {
                *point = picture_from_region.transform_point2(*point);
            }
        }
        Ok(merged)
    }
}

/// The anchors' centres, 0..1 of the input: two for each layer at each place of a grid (`SsdAnchorsCalculator` with
/// `fixed_anchor_size` and an interpolated scale).
fn anchors(size: usize, strides: &[usize]) -> Vec<Vec2> {
    let mut anchors = Vec::new();
    for layers in strides.chunk_by(|a, b| a == b) {
        let Some(places) = layers.first().and_then(|stride| size.checked_div(*stride)) else {
            continue;
        };
        for y in 0..places {
            for x in 0..places {
                let centre = (Vec2::new(x as f32, y as f32) + 0.5) / places as f32;
                anchors.extend(std::iter::repeat_n(centre, 2 * layers.len()));
            }
        }
    }
    anchors
}

/// What scores enough, in the region's coordinates, best first (`TensorsToDetectionsCalculator`).
fn decode(
    boxes: &[f32],
    scores: &[f32],
    anchors: &[Vec2],
    size: usize,
    count: usize,
) -> Vec<Detection> {
    let size = size as f32;
    let mut found: Vec<Detection> = boxes
        .chunks_exact(4 + 2 * count)
        .zip(scores)
        .zip(anchors)
        .filter_map(|((numbers, score), anchor)| {
            let score = sigmoid(*score);
            // No number is no score.
            if score.is_nan() || score < SEEN || !numbers.iter().all(|n| n.is_finite()) {
                return None;
            }
            let mut pairs = numbers
                .chunks_exact(2)
                .map(|pair| Vec2::new(pair[0], pair[1]) / size);
            let centre = pairs.next()? + *anchor;
            let half = pairs.next()? * 0.5;
            let mut points = [Vec2::ZERO; MOST_POINTS];
            for (point, pair) in points.iter_mut().zip(pairs) {
                *point = pair + *anchor;
            }
            Some(Detection {
                score,
                corners: [centre - half, centre + half],
                points,
                count: count.min(MOST_POINTS),
            })
        })
        .collect();
    found.sort_by(|a, b| b.score.total_cmp(&a.score));
    found.truncate(MOST_RAW);
    found
}

/// Overlapping detections as one, the mean weighted by scores (`NonMaxSuppressionCalculator`, `WEIGHTED`).
fn merge(mut raw: Vec<Detection>) -> Vec<Detection> {
    let mut merged = Vec::new();
    while let Some(best) = raw.first().copied() {
        // The best one is among them, also where its box has no area.
        let (same, rest): (Vec<_>, Vec<_>) = raw
            .iter()
            .enumerate()
            .partition(|(at, other)| *at == 0 || best.overlap(other) > SAME);
        let total: f32 = same.iter().map(|(_, d)| d.score).sum();
        let mean = |of: &dyn Fn(&Detection) -> Vec2| {
            same.iter().map(|(_, d)| of(d) * d.score).sum::<Vec2>() / total
        };
        merged.push(Detection {
            corners: std::array::from_fn(|i| mean(&|d| d.corners[i])),
            points: std::array::from_fn(|i| mean(&|d| d.points[i])),
            ..best
        });
        raw = rest.into_iter().map(|(_, d)| *d).collect();
    }
    merged
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn anchors_are_those_of_the_published_tables() {
        // Places of the grids and anchors at each: 28 x 28 x 2, 14 x 14 x 2, 7 x 7 x 6; 16 x 16 x 2, 8 x 8 x 6.
        let person = anchors(224, PERSON.strides);
        let face = anchors(128, FACE.strides);
        assert_eq!((person.len(), face.len()), (2254, 896), "numbers of boxes");
        for (table, at, x, y) in [
            (&person, 0, 0.017_857_144, 0.017_857_144),
            (&person, 1, 0.017_857_144, 0.017_857_144),
            (&person, 2, 0.053_571_43, 0.017_857_144),
            (&person, 1567, 0.982_142_9, 0.982_142_9),
            (&person, 1568, 0.035_714_287, 0.035_714_287),
            (&person, 1960, 0.071_428_57, 0.071_428_57),
            (&person, 1966, 0.214_285_72, 0.071_428_57),
            (&person, 2253, 0.928_571_4, 0.928_571_4),
            (&face, 0, 0.031_25, 0.031_25),
            (&face, 511, 0.968_75, 0.968_75),
            (&face, 512, 0.0625, 0.0625),
            (&face, 895, 0.9375, 0.9375),
        ] {
            assert!(
                table[at].distance(Vec2::new(x, y)) < 1e-6,
                "anchor {at}: {}",
                table[at]
            );
        }
    }

    /// A box of 40 pixels about the middle of 100, moved by `dx`, with one key point at its centre.
    fn boxes(dx: &[f32]) -> (Vec<f32>, Vec<Vec2>) {
        let numbers = dx
            .iter()
            .flat_map(|dx| [*dx, 0.0, 40.0, 40.0, *dx, 0.0])
            .collect();
        (numbers, vec![Vec2::splat(0.5); dx.len()])
    }

    #[test]
    fn overlapping_detections_become_their_weighted_mean_and_others_stay() {
        let (numbers, anchors) = boxes(&[0.0, 4.0, 45.0, 90.0]);
        // Probabilities 0.9, 0.6, 0.75, and one that is too low.
        let scores = [9.0_f32.ln(), 1.5_f32.ln(), 3.0_f32.ln(), -1.0];
        let merged = merge(decode(&numbers, &scores, &anchors, 100, 1));
        let x: Vec<f32> = merged.iter().map(|d| d.points()[0].x).collect();
        assert_eq!(x.len(), 2, "{x:?}");
        assert!((x[0] - (0.5 + 0.04 * 0.6 / 1.5)).abs() < 1e-5, "{x:?}");
        assert!((x[1] - 0.95).abs() < 1e-5, "{x:?}");
    }

    #[test]
    fn numbers_that_are_none_are_no_detection() {
        let (mut numbers, anchors) = boxes(&[0.0, 4.0, 45.0]);
        numbers[4] = f32::NAN;
        let scores = [9.0, f32::NAN, f32::INFINITY];
        assert_eq!(
            merge(decode(&numbers, &scores, &anchors, 100, 1)).len(),
            1,
            "the last"
        );
        assert!(decode(&[], &scores, &anchors, 100, 1).is_empty(), "nothing");
    }
}
