//! Which part of a scan is the person.

use super::cut::Cut;
use super::figures::Figures;
use super::looking::{BEHIND, MOST_DRAWN, subject};
use super::networks::Networks;
use super::refused;
use super::sample::thinned;
use super::similarity::Similarity;
use super::upright::{UpScore, look_for_up};
use crate::RigError;
use crate::scan::Scan;
use crate::sight::Sight;
use glam::{DQuat, DVec3, Vec3};
use splat_scene::{Scene, UpAxis};

/// The height of a person of whom none was given, metres.
pub const USUAL_HEIGHT: f64 = 1.75;

/// Views with less are not a standing person, of 4.
const LEAST_SCORE: f64 = 1.2;

/// The one cluster that a person stands in.
pub(super) struct Found {
    /// Its Gaussians, in the scene's units.
    pub(super) scan: Scan,
    /// The same, as large as a person and about the origin.
    pub(super) normal: Scan,
    pub(super) normal_from_scene: Similarity,
    /// Opposite corners of its box, in the scene's units.
    pub(super) corners: (Vec3, Vec3),
    /// The axis that is up.
    pub(super) up: DVec3,
    /// What a floor says, in the space of `normal`.
    pub(super) known: Option<Known>,
}

/// What is known of up without the body.
#[derive(Debug, Clone, Copy)]
pub(super) struct Known {
    /// Of unit length.
    pub(super) up: DVec3,
    /// The floor's `up . point`, if there is a floor.
    pub(super) level: Option<f64>,
}

/// The one part of a scan in which a person stands. `up` is the axis that is up, if that is known.
///
/// # Errors
/// [`RigError::Unsuited`] if no part shows a person, or several do.
pub(super) fn the_person(
    scene: &Scene,
    up: Option<UpAxis>,
    all: &Scan,
    parts: &[Cut],
    sight: &mut Sight,
    networks: &mut Networks,
    figures: &mut Figures,
) -> Result<Found, RigError> {
    let mut people: Vec<(Vec3, Vec3)> = Vec::new();
    let mut found: Option<Found> = None;
    let mut best_score: f64 = 0.0;
    for part in parts
        .iter()
        .filter(|part| count(&part.keep) >= refused::FEWEST)
    {
        let scan = all.filtered(&part.keep);
        let size = f64::from((part.high - part.low).max_element());
        let scale = USUAL_HEIGHT / size;
        let middle = ((part.low + part.high) / 2.0).as_dvec3();
        let normal_from_scene = Similarity {
            scale,
            rotation: DQuat::IDENTITY,
            translation: -middle * scale,
        };
        let normal = normal_from_scene.scan(&scan);
        sight.set(&thinned(&normal, MOST_DRAWN));
        let candidates = candidates(scene, up, part);
        let subject = |up| subject(&normal, up);
        let scores = look_for_up(sight, networks, &candidates, subject, BEHIND)?;
        let by_score = |a: &&UpScore, b: &&UpScore| a.score.total_cmp(&b.score);
        let Some(best) = scores.iter().max_by(by_score).copied() else {
            continue;
        };
        best_score = best_score.max(best.score);
        if best.score < LEAST_SCORE {
            continue;
        }
        people.push((part.low, part.high));
        if found.is_none() {
            let known = part.planes.iter().find_map(|plane| {
                let up = plane.normal.as_dvec3().normalize();
                let level = f64::from(plane.level) * scale + up.dot(normal_from_scene.translation);
                (up.dot(best.up) > 0.8).then_some(Known {
                    up,
                    level: Some(level),
                })
            });
            figures.candidates = scores;
            figures.planes = part.planes.len();
            found = Some(Found {
                scan,
                normal,
                normal_from_scene,
                corners: (part.low, part.high),
                up: best.up,
                known,
            });
        }
    }
    match found {
        Some(_) if people.len() > 1 => Err(refused::several(scene, &people)),
        Some(found) => Ok(found),
        None => Err(refused::nobody(best_score)),
    }
}

/// Directions that may be up, in the scene's axes: those of planes that the person may stand on, what the scene itself says, then the other axes.
fn candidates(scene: &Scene, given: Option<UpAxis>, part: &Cut) -> Vec<DVec3> {
    let direction = |axis: UpAxis| {
        let unit = match axis {
            UpAxis::PlusX => Vec3::X,
            UpAxis::MinusX => Vec3::NEG_X,
            UpAxis::PlusY => Vec3::Y,
            UpAxis::MinusY => Vec3::NEG_Y,
            UpAxis::PlusZ => Vec3::Z,
            UpAxis::MinusZ => Vec3::NEG_Z,
        };
        scene.point_of_file(unit).as_dvec3()
    };
    if let Some(given) = given {
        return vec![direction(given)];
    }
    let planes = part.planes.iter().map(|plane| plane.normal.as_dvec3());
    let detected = scene.detect_up(None).axis;
    let axes = std::iter::once(detected).chain(UpAxis::ALL);
    let mut candidates: Vec<DVec3> = Vec::new();
    for up in planes.chain(axes.map(direction)) {
        if candidates.iter().all(|other| other.dot(up) < 0.97) {
            candidates.push(up);
        }
    }
    candidates
}

/// How many are kept.
pub(super) fn count(keep: &[bool]) -> usize {
    keep.iter().filter(|keep| **keep).count()
}
