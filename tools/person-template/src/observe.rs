//! What is looked at: frames whose poses differ, cameras that stand around the person, and the outline of the person in each of their pictures.

use crate::body::Canonical;
use crate::distance::SignedDistance;
use crate::error::TemplateError;
use crate::posing::{Correction, Posed};
use capture::{Camera, Capture, FramePose, Photograph};
use glam::{DVec2, DVec3};
use rayon::prelude::*;
use spmm3::{ExpressionBasis, Expressions, Joint, fit_expression};

/// A pixel belongs to the person from this value of the mask on.
const PERSON: u8 = 128;

/// Around the person so much is looked at, as a share of the person's size in the picture.
const MARGIN: f64 = 0.35;

/// A person of fewer pixels is no person.
const SMALLEST: usize = 64;

/// How far from the origin a pelvis may be, metres.
const FURTHEST: f32 = 1e4;

/// Fewer pictures of the person do not say how it is shaped.
const FEWEST_VIEWS: usize = 4;

/// A picture that the person is in.
#[derive(Debug)]
pub(crate) struct View {
    /// Which of the chosen frames.
    pub(crate) slot: usize,
    /// Which of the capture's cameras.
    pub(crate) index: usize,
    /// The camera of the part that is looked at, at the size at which it is looked at.
    pub(crate) camera: Camera,
    /// From the person's outline.
    pub(crate) outline: SignedDistance,
}

/// The poses of all frames, checked, their expression in the basis of the body model, whose named expressions are `presets`; and whether no map of the
/// capture's basis is known, so that faces are at rest.
pub(crate) fn poses(
    capture: &Capture,
    presets: &Expressions,
) -> Result<(Vec<FramePose>, bool), TemplateError> {
    let mut poses = capture.poses().ok_or(TemplateError::NoPoses)?.to_vec();
    if poses.len() != capture.frames() || poses.is_empty() {
        return Err(TemplateError::NoPoses);
    }
    let mut at_rest = false;
    for (frame, pose) in poses.iter_mut().enumerate() {
        let refused = |reason: &str| TemplateError::Pose {
            frame,
            reason: reason.to_owned(),
        };
        if !pose.parameters.is_finite() || !pose.pelvis.is_finite() {
            return Err(refused("has a number that is not finite"));
        }
        if pose.pelvis.abs().max_element() > FURTHEST {
            return Err(refused(
                "puts the pelvis kilometres away: metres are needed",
            ));
        }
        if let Some(from) = capture.expression_basis() {
            let own = ExpressionBasis::MAKEHUMAN_1;
            at_rest |= !fit_expression(&mut pose.parameters, from, &own, presets);
        }
    }
    Ok((poses, at_rest))
}

/// At most `count` of the frames in `among`, their poses as different as can be (farthest-point sampling of joints around the pelvis, the turn of the
/// whole person included), ascending.
pub(crate) fn diverse_frames(
    average: &Canonical,
    poses: &[FramePose],
    among: &[usize],
    count: usize,
) -> Vec<usize> {
    let features: Vec<Vec<DVec3>> = (among.par_iter())
        .map(|frame| {
            let posed = Posed::new(&average.joints, &poses[*frame], &Correction::default());
            let body = posed.joints.iter().take(Joint::Jaw.index());
            body.map(|joint| *joint - posed.joints[0]).collect()
        })
        .collect();
    let apart = |a: usize, b: usize| -> f64 {
        let pairs = features[a].iter().zip(&features[b]);
        pairs.map(|(a, b)| a.distance_squared(*b)).sum()
    };
    let mut chosen: Vec<usize> = farthest(among.len(), count, apart);
    chosen.sort_unstable();
    chosen.into_iter().map(|at| among[at]).collect()
}

/// At most `count` of the cameras in `among`, their directions from `person` as different as can be, ascending.
pub(crate) fn spread_cameras(
    cameras: &[Camera],
    among: &[usize],
    person: DVec3,
    count: usize,
) -> Vec<usize> {
    let directions: Vec<DVec3> = (among.iter())
        .map(|at| (cameras[*at].position() - person).normalize_or_zero())
        .collect();
    let apart = |a: usize, b: usize| directions[a].distance_squared(directions[b]);
    let mut chosen = farthest(among.len(), count, apart);
    chosen.sort_unstable();
    chosen.into_iter().map(|at| among[at]).collect()
}

/// Farthest-point sampling from the first on; of equals the first.
fn farthest(of: usize, count: usize, apart: impl Fn(usize, usize) -> f64) -> Vec<usize> {
    let mut distance = vec![f64::INFINITY; of];
    let mut chosen = Vec::new();
    while chosen.len() < count.min(of) {
        let next = (0..of).fold(0, |most, at| {
            if distance[at] > distance[most] {
                at
            } else {
                most
            }
        });
        chosen.push(next);
        for (at, distance) in distance.iter_mut().enumerate() {
            *distance = distance.min(apart(at, next));
        }
        distance[next] = f64::NEG_INFINITY;
    }
    chosen
}

/// As [`seen`], as many as it takes to say how the person is shaped.
///
/// # Errors
/// If no picture has the person in it, or too few have, or one cannot be read.
pub(crate) fn views(
    capture: &Capture,
    frames: &[usize],
    cameras: &[usize],
    side: u32,
) -> Result<Vec<View>, TemplateError> {
    let views = seen(capture, frames, cameras, side)?;
    if views.is_empty() {
        return Err(TemplateError::NoMasks {
            pictures: frames.len() * cameras.len(),
        });
    }
    if views.len() < FEWEST_VIEWS {
        return Err(TemplateError::TooFewViews {
            views: views.len(),
            frames: frames.len(),
            least: FEWEST_VIEWS,
        });
    }
    Ok(views)
}

/// The views of the chosen frames by the chosen cameras that have the person in them, frame by frame; masks are looked at with at most `side` pixels a
/// side.
pub(crate) fn seen(
    capture: &Capture,
    frames: &[usize],
    cameras: &[usize],
    side: u32,
) -> Result<Vec<View>, TemplateError> {
    let pairs: Vec<(usize, usize, usize)> = (frames.iter().enumerate())
        .flat_map(|(slot, frame)| cameras.iter().map(move |camera| (slot, *frame, *camera)))
        .collect();
    let views: Vec<Option<View>> = (pairs.par_iter())
        .map(|(slot, frame, camera)| {
            let photograph = capture.photograph(*camera, *frame)?;
            let pinhole = capture.cameras()[*camera].undistorted();
            Ok(
                outlined(&photograph, &pinhole, side).map(|(seen_by, outline)| View {
                    slot: *slot,
                    index: *camera,
                    camera: seen_by,
                    outline,
                }),
            )
        })
        .collect::<Result<_, TemplateError>>()?;
    Ok(views.into_iter().flatten().collect())
}

/// The corner and the size of the part of a picture around the person, pixels; nothing without a mask with a person in it.
pub(crate) fn around_person(photograph: &Photograph) -> Option<([u32; 2], [u32; 2])> {
    let mask = photograph.mask.as_ref()?;
    let width = photograph.size[0] as usize;
    let (mut low, mut high, mut count) = ([usize::MAX; 2], [0; 2], 0);
    for (at, value) in mask.iter().enumerate() {
        if *value >= PERSON {
            let place = [at % width, at / width];
            for axis in 0..2 {
                low[axis] = low[axis].min(place[axis]);
                high[axis] = high[axis].max(place[axis] + 1);
            }
            count += 1;
        }
    }
    if count < SMALLEST {
        return None;
    }
    let largest = (0..2).map(|axis| high[axis] - low[axis]).max().unwrap_or(0);
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "a part of a picture's side"
    )]
    let margin = (MARGIN * largest as f64) as usize + 4;
    let whole = |value: usize| u32::try_from(value).unwrap_or(u32::MAX);
    let corner = low.map(|low| whole(low.saturating_sub(margin)));
    let size = [0, 1].map(|axis| {
        let end = whole(high[axis] + margin).min(photograph.size[axis]);
        end - corner[axis]
    });
    Some((corner, size))
}

/// The part of a picture around the person, at most `side` pixels a side: its camera and the person's outline.
fn outlined(
    photograph: &Photograph,
    pinhole: &Camera,
    side: u32,
) -> Option<(Camera, SignedDistance)> {
    let (corner, size) = around_person(photograph)?;
    let mask = photograph.mask.as_ref()?;
    let largest = size[0].max(size[1]);
    let smaller = |length: u32| {
        if largest <= side {
            length
        } else {
            (length * side).div_ceil(largest).max(2)
        }
    };
    let small = size.map(smaller);
    let camera = pinhole.cropped(corner, size).scaled(small);
    let step = DVec2::new(
        f64::from(size[0]) / f64::from(small[0]),
        f64::from(size[1]) / f64::from(small[1]),
    );
    // Sub-samples a side, so that no pixel of the mask is passed over.
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "at most the picture's side"
    )]
    let fine = step.max_element().ceil() as u32;
    let width = photograph.size[0] as usize;
    let value = |x: f64, y: f64| {
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "within the picture"
        )]
        let at = (y as usize + corner[1] as usize) * width + x as usize + corner[0] as usize;
        u32::from(mask.get(at).copied().unwrap_or(0))
    };
    let mut inside = Vec::with_capacity(small[0] as usize * small[1] as usize);
    for y in 0..small[1] {
        for x in 0..small[0] {
            let mut sum = 0;
            for down in 0..fine {
                for right in 0..fine {
                    let share = |k: u32| (f64::from(k) + 0.5) / f64::from(fine);
                    let place = DVec2::new(f64::from(x) + share(right), f64::from(y) + share(down));
                    let place = place * step;
                    sum += value(place.x, place.y);
                }
            }
            inside.push(sum >= u32::from(PERSON) * fine * fine);
        }
    }
    let outline = SignedDistance::new(&inside, small[0] as usize, small[1] as usize)?;
    Some((camera, outline))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_farthest_points_are_the_ends_and_then_the_middle() {
        let line = [0.0_f64, 1.0, 2.0, 5.0, 9.0, 10.0];
        let chosen = farthest(6, 3, |a, b| (line[a] - line[b]).abs());
        assert_eq!(chosen, [0, 5, 3], "of a line");
        assert_eq!(farthest(2, 9, |_, _| 0.0), [0, 1], "more than there are");
    }

    #[test]
    fn a_smaller_picture_keeps_the_outline_where_it_is() {
        let size = [300_u32, 200];
        let mask: Vec<u8> = (0..size[0] * size[1])
            .map(|at| {
                let (x, y) = (at % size[0], at / size[0]);
                if (90..210).contains(&x) && (60..140).contains(&y) {
                    255
                } else {
                    0
                }
            })
            .collect();
        let photograph = Photograph {
            size,
            rgb: vec![0; 3 * mask.len()],
            mask: Some(mask),
        };
        let camera = Camera {
            name: "a".to_owned(),
            size,
            focal: [250.0, 250.0],
            centre: [150.0, 100.0],
            distortion: [0.0; 5],
            camera_from_world: glam::DAffine3::IDENTITY,
        };
        let (small, outline) = outlined(&photograph, &camera, 100).expect("a person");
        assert!(small.size[0] <= 100, "{:?}", small.size);
        for (pixel, outside) in [([90.0, 100.0], -1.0), ([210.0, 100.0], 1.0)] {
            let slope = (pixel[0] - 150.0) / 250.0;
            let at = small
                .project(DVec3::new(slope, 0.0, 1.0))
                .expect("in front");
            let (value, gradient) = outline.at(at).expect("in the picture");
            assert!(value.abs() < 0.6, "{value} pixels off");
            assert!(gradient.x * outside > 0.4, "{gradient}");
        }
        let nobody = Photograph {
            mask: None,
            ..photograph
        };
        assert!(outlined(&nobody, &camera, 100).is_none(), "without a mask");
    }
}
