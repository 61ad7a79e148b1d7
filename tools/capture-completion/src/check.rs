//! What is wrong with a capture, in figures and words.

use crate::motion::{on_view, view_of};
use capture::{Camera, FramePose};
use glam::DVec2;
use motion_fit::body::landmark_places;
use motion_fit::landmarks::blazepose::{ANKLES, EYES, LOWER, mirrored};
use motion_fit::landmarks::{BODY_LANDMARKS, BodyLandmarks};
use spmm3::Skeleton;

/// Landmarks less sure than this are not compared.
const SURE: f32 = 0.5;
/// A camera is said to be wrong when its errors are this much the median of the others'.
const TWICE: f64 = 2.0;
/// ... and above this share of the person's height.
const NOTICEABLE_PERCENT: f64 = 1.0;
/// Frames forwards and backwards in which a camera's clock is searched.
const LAG: isize = 5;
/// How much better another frame must fit before a camera is said to lag.
const CLEARLY: f64 = 0.75;
/// Mask values at the picture's edge, and how many of them cut a person off.
const MASKED: u8 = 128;
const CUT: usize = 12;
/// A share of frames that is worth saying.
const WORTH: f64 = 0.05;

/// What one camera's pictures of a frame show.
#[derive(Debug, Clone, Default)]
pub struct Shown {
    /// The landmarks, pixels of the camera's pinhole.
    pub landmarks: Option<BodyLandmarks>,
    /// Whether there is a mask, and what is wrong with it.
    pub mask: Option<MaskFacts>,
}

/// What a mask is like.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct MaskFacts {
    /// Pixels of the person.
    pub pixels: usize,
    /// Pixels of the person at each edge of the picture: left, top, right, bottom.
    pub at_edges: [usize; 4],
}

impl MaskFacts {
    /// Counts a mask of [height, width].
    #[must_use]
    pub fn of(mask: &[u8], width: usize) -> Self {
        let is_in = |value: &&u8| **value >= MASKED;
        let mut facts = Self {
            pixels: mask.iter().filter(is_in).count(),
            at_edges: [0; 4],
        };
        let mut rows = mask.chunks_exact(width.max(1));
        let (first, last) = (
            mask.chunks_exact(width.max(1)).next(),
            mask.rchunks_exact(width.max(1)).next(),
        );
        facts.at_edges[1] = first.map_or(0, |row| row.iter().filter(is_in).count());
        facts.at_edges[3] = last.map_or(0, |row| row.iter().filter(is_in).count());
        rows.by_ref().for_each(|row| {
            facts.at_edges[0] += usize::from(row.first().is_some_and(|v| *v >= MASKED));
            facts.at_edges[2] += usize::from(row.last().is_some_and(|v| *v >= MASKED));
        });
        facts
    }
}

/// A camera's figures.
#[derive(Debug, Clone, PartialEq)]
pub struct CameraReport {
    /// Its name.
    pub name: String,
    /// Frames looked at.
    pub frames: usize,
    /// Of these, frames in which a person was seen.
    pub seen: usize,
    /// Median over frames of the root mean square distance between the pose's landmarks and the seen ones, pixels; none without a pose.
    pub error_px: Option<f64>,
    /// The same as a percentage of the person's height in the picture.
    pub error_percent: Option<f64>,
    /// Frames by which the camera is late (negative: early); 0 where no other frame fits clearly better.
    pub lag: isize,
    /// Frames with a mask that is empty although a person is seen.
    pub empty_masks: usize,
    /// Frames with a mask that is cut off at an edge of the picture.
    pub cut_masks: usize,
}

/// A capture's figures and what is wrong with it.
#[derive(Debug, Clone, PartialEq)]
pub struct Report {
    /// One for each camera.
    pub cameras: Vec<CameraReport>,
    /// One sentence each; none: nothing is wrong.
    pub findings: Vec<String>,
}

/// Compares `shown[camera][frame]` with the poses of the same frames on a skeleton as long as the person.
#[must_use]
pub fn report(
    cameras: &[Camera],
    shown: &[Vec<Shown>],
    poses: &[FramePose],
    skeleton: &Skeleton,
) -> Report {
    let places: Vec<Places> = (poses.iter())
        .map(|pose| landmark_places(skeleton, &pose.on(skeleton)))
        .collect();
    let cameras: Vec<CameraReport> = (cameras.iter().zip(shown))
        .map(|(camera, shown)| of_camera(camera, shown, &places))
        .collect();
    let findings = findings(&cameras);
    Report { cameras, findings }
}

type Places = [Option<glam::Vec3>; BODY_LANDMARKS];

fn of_camera(camera: &Camera, shown: &[Shown], places: &[Places]) -> CameraReport {
    let median_at = |lag: isize| {
        let errors = (shown.iter().enumerate()).filter_map(|(frame, shown)| {
            let at = frame.checked_add_signed(-lag)?;
            let seen = shown.landmarks.as_ref()?;
            error_px(camera, seen, places.get(at)?)
        });
        median(errors.collect())
    };
    let now = median_at(0);
    let best = (-LAG..=LAG)
        .filter_map(|lag| Some((lag, median_at(lag)?)))
        .min_by(|a, b| a.1.total_cmp(&b.1));
    let lag = match (best, now) {
        (Some((lag, best)), Some(now)) if best < CLEARLY * now => lag,
        _ => 0,
    };
    let heights = shown
        .iter()
        .filter_map(|shown| height_px(shown.landmarks.as_ref()?));
    let height = median(heights.collect());
    let masked = |wrong: &dyn Fn(&Shown, &MaskFacts) -> bool| {
        let masks = shown
            .iter()
            .filter_map(|shown| Some((shown, shown.mask.as_ref()?)));
        masks.filter(|(shown, mask)| wrong(shown, mask)).count()
    };
    CameraReport {
        name: camera.name.clone(),
        frames: shown.len(),
        seen: shown
            .iter()
            .filter(|shown| shown.landmarks.is_some())
            .count(),
        error_px: now,
        error_percent: now.zip(height).map(|(now, height)| 100.0 * now / height),
        lag,
        empty_masks: masked(&|shown, mask| shown.landmarks.is_some() && mask.pixels == 0),
        cut_masks: masked(&|_, mask| mask.at_edges.iter().any(|count| *count > CUT)),
    }
}

/// Root mean square distance of the sure landmarks from where the pose has them, pixels. Networks take left for right, in the upper or the lower half of a
/// body: each half counts as it fits better, as the fit over all cameras has it.
fn error_px(camera: &Camera, seen: &BodyLandmarks, places: &Places) -> Option<f64> {
    let half = |range: std::ops::Range<usize>, crossed: bool| -> Option<(f64, f64)> {
        let (mut sum, mut count) = (0.0, 0.0);
        for landmark in range {
            let from = if crossed {
                mirrored(landmark)
            } else {
                landmark
            };
            let point = &seen.points[from];
            if let (true, Some(place)) = (point.confidence > SURE, places[landmark]) {
                let at = camera.project(place.as_dvec3())?;
                sum += at.distance_squared(point.pixel.as_dvec2());
                count += 1.0;
            }
        }
        Some((sum, count))
    };
    let better = |range: std::ops::Range<usize>| {
        let mean = |(sum, count): &(f64, f64)| sum / f64::max(*count, 1.0);
        let (straight, crossed) = (half(range.clone(), false)?, half(range, true)?);
        Some(if crossed.1 > 0.0 && mean(&crossed) < mean(&straight) {
            crossed
        } else {
            straight
        })
    };
    let (upper, lower) = (better(0..LOWER)?, better(LOWER..BODY_LANDMARKS)?);
    let count = upper.1 + lower.1;
    (count > 0.0).then(|| f64::sqrt((upper.0 + lower.0) / count))
}

/// The person's height in the picture, pixels: from eyes to ankles is 0.88 of it.
fn height_px(seen: &BodyLandmarks) -> Option<f64> {
    let middle = |pair: [usize; 2]| -> DVec2 {
        (seen.points[pair[0]].pixel + seen.points[pair[1]].pixel).as_dvec2() / 2.0
    };
    let height = middle(EYES).distance(middle(ANKLES)) / 0.88;
    (height > 1.0).then_some(height)
}

fn median(mut values: Vec<f64>) -> Option<f64> {
    values.retain(|value| value.is_finite());
    values.sort_by(f64::total_cmp);
    values.get(values.len() / 2).copied()
}

fn findings(cameras: &[CameraReport]) -> Vec<String> {
    let mut findings = Vec::new();
    let share = |part: usize, of: usize| part as f64 / (of.max(1)) as f64;
    for (k, camera) in cameras.iter().enumerate() {
        let name = &camera.name;
        let unseen = camera.frames - camera.seen;
        if camera.seen == 0 {
            findings.push(format!(
                "camera `{name}` sees no person in any frame: is it pointed at them, upright?"
            ));
            continue;
        }
        if share(unseen, camera.frames) > WORTH {
            findings.push(format!(
                "camera `{name}` sees no person in {unseen} of {} frames",
                camera.frames
            ));
        }
        let others = cameras.iter().enumerate().filter(|(other, _)| *other != k);
        let others = median(
            others
                .filter_map(|(_, other)| other.error_percent)
                .collect(),
        );
        if camera.lag != 0 {
            let (frames, word) = (
                camera.lag.unsigned_abs(),
                if camera.lag > 0 { "late" } else { "early" },
            );
            findings.push(format!(
                "camera `{name}` is {frames} frame{} {word}: its pictures fit the pose of other cameras' earlier or later frames",
                if frames == 1 { "" } else { "s" }
            ));
        } else if let (Some(own), Some(others)) = (camera.error_percent, others)
            && own > TWICE * others
            && own > NOTICEABLE_PERCENT
        {
            findings.push(format!(
                "camera `{name}` is off by {own:.1} % of the person's height, {:.1} times the others: is its calibration of this recording?",
                own / others
            ));
        }
        if camera.empty_masks > 0 {
            findings.push(format!(
                "camera `{name}` has {} empty masks of frames in which a person is seen",
                camera.empty_masks
            ));
        }
        if share(camera.cut_masks, camera.frames) > WORTH {
            findings.push(format!(
                "camera `{name}` cuts the person off at the picture's edge in {} of {} frames: what is beyond cannot be learnt from it",
                camera.cut_masks, camera.frames
            ));
        }
    }
    findings
}

/// A skeleton as long as the person whom the cameras saw; `skeleton` itself where fewer than two cameras did.
#[must_use]
pub fn measured(skeleton: &Skeleton, cameras: &[Camera], shown: &[Vec<Shown>]) -> Skeleton {
    if cameras.len() < 2 {
        return skeleton.clone();
    }
    let views: Vec<_> = cameras.iter().map(view_of).collect();
    let frames = shown.iter().map(Vec::len).min().unwrap_or(0);
    let seen: Vec<Vec<Option<BodyLandmarks>>> = (0..frames)
        .map(|frame| {
            (cameras.iter().zip(shown))
                .map(|(camera, shown)| Some(on_view(camera, shown[frame].landmarks.as_ref()?)))
                .collect()
        })
        .collect();
    motion_fit::body::several::measure(skeleton, &views, &seen)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn camera(name: &str, error_percent: f64) -> CameraReport {
        CameraReport {
            name: name.to_owned(),
            frames: 60,
            seen: 60,
            error_px: Some(error_percent * 5.0),
            error_percent: Some(error_percent),
            lag: 0,
            empty_masks: 0,
            cut_masks: 0,
        }
    }

    #[test]
    fn a_capture_without_fault_has_no_findings() {
        let cameras = [camera("a", 1.2), camera("b", 1.0), camera("c", 1.4)];
        assert_eq!(findings(&cameras), Vec::<String>::new(), "nothing is wrong");
    }

    #[test]
    fn each_fault_is_said_once_with_its_camera() {
        let mut cameras = [
            camera("a", 1.2),
            camera("b", 4.0),
            camera("c", 1.4),
            camera("d", 1.1),
            camera("e", 1.0),
        ];
        cameras[2].lag = 2;
        cameras[3].seen = 30;
        cameras[4].cut_masks = 20;
        let found = findings(&cameras);
        assert_eq!(found.len(), 4, "{found:?}");
        let said = |name: &str, words: &str| {
            found
                .iter()
                .any(|line| line.contains(&format!("`{name}`")) && line.contains(words))
        };
        assert!(
            said("b", "calibration")
                && said("c", "2 frames late")
                && said("d", "no person in 30")
                && said("e", "cuts"),
            "{found:?}"
        );
    }

    #[test]
    fn a_masks_edges_are_counted() {
        let mut mask = vec![0; 6 * 4];
        for at in [0, 6, 12, 23] {
            mask[at] = 255;
        }
        let facts = MaskFacts::of(&mask, 6);
        assert_eq!(
            facts,
            MaskFacts {
                pixels: 4,
                at_edges: [3, 1, 1, 1]
            },
            "left, top, right, bottom"
        );
    }
}
