//! The order of the work.

use super::body_points::{BodyPoints, Look, body_points};
use super::cut::{Cut, cut};
use super::face_points::{Head, face_landmarks_of};
use super::figures::{Figures, Steps, median};
use super::landmarks::{ANKLES, EARS, ELBOWS, EYES, HEELS, HIPS, KNEES, SHOULDERS, TOES, WRISTS};
use super::networks::Networks;
use super::refused;
use super::sample::thinned;
use super::similarity::Similarity;
use super::stance::{
    body_axis, centre_of_mass, exchanged, extent, facing, is_exchanged, stand, turn_to,
};
use super::upright::{UpScore, look_for_up};
use super::views::Subject;
use crate::RigError;
use crate::points::KeyPoint;
use crate::scan::Scan;
use crate::sight::Sight;
use glam::{DQuat, DVec3, Vec3};
use motion_fit::landmarks::{BODY_LANDMARKS, FACE_LANDMARKS};
use splat_scene::{Scene, UpAxis};

/// What is known of a scan before it is looked at.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Options {
    /// How tall the person is, metres; without it, [`USUAL_HEIGHT`]: a scan has no unit.
    pub height: Option<f64>,
    /// The axis of the file that points up, roughly; without it, the one that shows a standing person.
    pub up: Option<UpAxis>,
    /// Opposite corners of a box that the person is in, in the file's own units and axes.
    pub within: Option<[[f32; 3]; 2]>,
}

/// A scan that stands in the person's space, and what networks saw of it.
#[derive(Debug, Clone)]
pub struct Prepared {
    /// The person's Gaussians, surroundings cut away.
    pub scan: Scan,
    /// BlazePose's landmarks.
    pub body: [KeyPoint; BODY_LANDMARKS],
    /// The face mesh's landmarks, where a face was seen.
    pub face: Option<Box<[KeyPoint; FACE_LANDMARKS]>>,
    /// From the scene's axes and units (for the file's axes see [`Scene::point_of_file`]) to the person's space.
    pub person_from_scene: Similarity,
    /// The person's height, metres: as it was given, or the usual one.
    pub height: f64,
    /// What was measured, and what may be wrong.
    pub figures: Figures,
}

/// The height of a person of whom none was given, metres.
pub const USUAL_HEIGHT: f64 = 1.75;

/// Gaussians that are drawn at most, for networks that see 256 pixels.
const MOST_DRAWN: usize = 500_000;
/// Views of the body.
const VIEWS: u32 = 12;
/// Views of the body while up is looked for, and their share of the usual size.
const FIRST_VIEWS: (u32, f64) = (8, 0.6);
/// A ray that passes farther than about this from a landmark does not count, metres.
const REACH: f64 = 0.03;
/// What lies behind the scan in pictures.
const BEHIND: [f32; 3] = [0.75; 3];
/// Views with less are not a standing person, of 4.
const LEAST_SCORE: f64 = 1.2;
/// Up is looked for again while it turns by more than this, radians.
const SETTLED: f64 = 0.06;
/// ... and so many times.
const PASSES: usize = 3;
/// Views of a scan agree on a person's joints to this, metres: median over joints.
const MOST_RESIDUAL: f64 = 0.05;
/// With more, the user is told, metres.
const DOUBTFUL_RESIDUAL: f64 = 0.03;

/// Finds the person in a scene.
///
/// # Errors
/// [`RigError::Unsuited`] if the scene shows no person, several, a part of one, or too few Gaussians; others if drawing or a network
/// fails.
pub fn prepare(
    scene: &Scene,
    options: &Options,
    sight: &mut Sight,
    networks: &mut Networks,
) -> Result<Prepared, RigError> {
    let mut steps = Steps::start();
    let mut figures = Figures::default();
    if scene.is_empty() {
        return Err(refused::empty());
    }
    let all = Scan::from_scene(scene);
    let within = options
        .within
        .map(|corners| corners.map(|corner| scene.point_of_file(Vec3::from(corner))));
    let parts = cut(&all, within);
    let most = parts.iter().map(|part| count(&part.keep)).max();
    match most {
        None if within.is_some() => return Err(refused::outside(scene)),
        None => return Err(refused::empty()),
        Some(most) if most < refused::FEWEST => return Err(refused::too_few(most)),
        Some(_) => {}
    }
    steps.ended("cut");

    let found = the_person(
        scene,
        options.up,
        &all,
        &parts,
        sight,
        networks,
        &mut figures,
    )?;
    drop(all);
    if found.scan.len() > refused::MOST {
        return Err(refused::too_many(found.scan.len()));
    }
    figures.gaussians = found.scan.len();
    steps.ended("up");

    let height = options.height.unwrap_or(USUAL_HEIGHT);
    let placed = stood(&found, height, sight, networks)?;
    figures.tilt_degrees = placed.tilt.to_degrees();
    steps.ended("stance");

    let mut person_from_scene = found.normal_from_scene.then(&placed.person_from_normal);
    let mut scan = person_from_scene.scan(&found.scan);
    sight.set(&thinned(&scan, MOST_DRAWN));
    let (seen, looks, crowded) =
        look_around(&scan, DVec3::Y, DVec3::Z, (VIEWS, 1.0), sight, networks)?;
    if crowded > VIEWS as usize / 3 {
        return Err(refused::touching(crowded));
    }
    figures.views = looks;
    figures.exchanged = seen.exchanged;
    let mut body = seen.points;
    let correction = onto_the_floor(&scan, &mut body, placed.floor, height)?;
    for point in &mut body {
        point.position = correction.point(point.position);
        point.residual *= correction.scale;
    }
    person_from_scene = person_from_scene.then(&correction);
    scan = person_from_scene.scan(&found.scan);
    complete(&scan, &body)?;
    figures.body_residual = median(joints(&body).map(|joint| joint.residual));
    if figures.body_residual > MOST_RESIDUAL || looks < VIEWS as usize / 2 {
        return Err(refused::unsure(1e3 * figures.body_residual));
    }
    steps.ended("body");

    sight.set(&scan);
    let eyes = (body[EYES[0]].position + body[EYES[1]].position) / 2.0;
    let ears = (body[EARS[0]].position + body[EARS[1]].position) / 2.0;
    let front = ((eyes - ears) * DVec3::new(1.0, 0.3, 1.0)).normalize_or(DVec3::Z);
    let head = Head {
        eyes,
        front,
        up: DVec3::Y,
    };
    let face = face_landmarks_of(|view| sight.picture(view, [0.6; 3]), networks, &head)?;
    figures.face_residual = face
        .as_ref()
        .map(|face| median(face.iter().map(|point| point.residual)));
    steps.ended("face");

    if figures.body_residual > DOUBTFUL_RESIDUAL {
        figures.doubts.push(format!(
            "the views agree on the joints to {:.0} mm only (a person who stands freely: 20): is this a person, with arms and legs apart?",
            1e3 * figures.body_residual
        ));
    }
    if face.is_none() {
        figures.doubts.push(
            "no face was seen: is this a person whose face is not covered? The avatar's face will not move as one".to_owned(),
        );
    }
    figures.seconds = steps.seconds;
    Ok(Prepared {
        scan,
        body,
        face,
        person_from_scene,
        height,
        figures,
    })
}

fn count(keep: &[bool]) -> usize {
    keep.iter().filter(|keep| **keep).count()
}

/// The one cluster that a person stands in.
struct Found {
    /// Its Gaussians, in the scene's units.
    scan: Scan,
    /// The same, as large as a person and about the origin.
    normal: Scan,
    normal_from_scene: Similarity,
    /// The axis that is up.
    up: DVec3,
    /// The floor in the space of `normal`, if there is one.
    floor: Option<Floor>,
}

/// A floor that a person stands on.
#[derive(Debug, Clone, Copy)]
struct Floor {
    /// Of unit length, upwards.
    normal: DVec3,
    /// `normal . point` of its points.
    level: f64,
}

fn the_person(
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
            let floor = part.planes.iter().find_map(|plane| {
                let normal = plane.normal.as_dvec3();
                (normal.dot(best.up) > 0.8).then(|| Floor {
                    normal,
                    level: f64::from(plane.level) * scale
                        + normal.dot(normal_from_scene.translation),
                })
            });
            figures.up = scores;
            figures.planes = part.planes.len();
            found = Some(Found {
                scan,
                normal,
                normal_from_scene,
                up: best.up,
                floor,
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

/// The upright cylinder about a scan.
fn subject(scan: &Scan, up: DVec3) -> Subject {
    let step = scan.len().div_ceil(20_000).max(1);
    let points: Vec<DVec3> = (scan.positions.iter().zip(&scan.opacities))
        .filter(|(_, opacity)| **opacity > 0.1)
        .map(|(point, _)| point.as_dvec3())
        .step_by(step)
        .collect();
    let ends = |values: &mut Vec<f64>| {
        values.sort_by(f64::total_cmp);
        let cut = values.len() / 500;
        let get = |at: usize| values.get(at).copied().unwrap_or_default();
        (get(cut), get(values.len().saturating_sub(1 + cut)))
    };
    let first = up.any_orthonormal_vector();
    let second = up.cross(first);
    let [(a, b), (c, d), (low, high)] = [first, second, up]
        .map(|axis| ends(&mut points.iter().map(|point| point.dot(axis)).collect()));
    let middle = first * ((a + b) / 2.0) + second * ((c + d) / 2.0) + up * ((low + high) / 2.0);
    let mut away = points
        .iter()
        .map(|point| (*point - middle).reject_from(up).length())
        .collect();
    Subject {
        middle,
        up,
        height: (high - low).max(0.1),
        radius: ends(&mut away).1.max(0.1),
    }
}

/// The body's landmarks from views all around, in how many of them it was seen, and in how many there are several people. `sight` shows
/// the scan.
fn look_around(
    scan: &Scan,
    up: DVec3,
    front: DVec3,
    (views, share): (u32, f64),
    sight: &mut Sight,
    networks: &mut Networks,
) -> Result<(BodyPoints, usize, usize), RigError> {
    let (mut looks, mut crowded) = (Vec::new(), 0);
    for view in subject(scan, up).around(views, front, share) {
        let picture = sight.picture(&view, BEHIND)?;
        if let Some(seen) = networks.body(&picture)? {
            looks.push(Look { view, seen });
        }
        crowded += usize::from(networks.people() > 1);
    }
    Ok((body_points(&looks, REACH), looks.len(), crowded))
}

/// Where the scan's person stands.
struct Placed {
    person_from_normal: Similarity,
    /// The floor, in the person's space.
    floor: Option<Floor>,
    /// From the best axis to up, radians.
    tilt: f64,
}

/// Turns up until the views agree with it.
fn stood(
    found: &Found,
    height: f64,
    sight: &mut Sight,
    networks: &mut Networks,
) -> Result<Placed, RigError> {
    sight.set(&thinned(&found.normal, MOST_DRAWN));
    let mut up = found.floor.map_or(found.up, |floor| floor.normal);
    let mut front = up.any_orthonormal_vector();
    for pass in 0..PASSES {
        let (seen, ..) = look_around(&found.normal, up, front, FIRST_VIEWS, sight, networks)?;
        let mut points = seen.points;
        let turned = onto_the_floor(&found.normal, &mut points, found.floor, height)?;
        let new_up = turned.rotation.inverse() * DVec3::Y;
        front = turned.rotation.inverse() * DVec3::Z;
        let moved = new_up.angle_between(up);
        up = new_up;
        log::debug!("up turned by {:.1} degrees", moved.to_degrees());
        if moved < SETTLED || pass + 1 == PASSES {
            return Ok(Placed {
                person_from_normal: turned,
                floor: found.floor.map(|_| Floor {
                    normal: DVec3::Y,
                    level: 0.0,
                }),
                tilt: up.angle_between(found.up),
            });
        }
    }
    Err(refused::unsure(0.0))
}

/// The movement after which the person stands on y = 0 above the origin, faces +z, and is so many metres tall. Exchanges left and right of
/// `points` if all views took one for the other. `floor` is what the person stands on, if that is known.
fn onto_the_floor(
    scan: &Scan,
    points: &mut [KeyPoint; BODY_LANDMARKS],
    floor: Option<Floor>,
    height: f64,
) -> Result<Similarity, RigError> {
    let missing = || refused::incomplete("head or feet");
    if joints(points).any(|joint| joint.support <= 0.0) {
        return Err(refused::unsure(f64::INFINITY));
    }
    let axis = body_axis(points).ok_or_else(missing)?;
    let reach = USUAL_HEIGHT;
    let up = floor.map_or_else(
        || {
            let feet = feet_of(scan, points, 0.14 * reach);
            stand(&feet, centre_of_mass(points), axis, reach)
        },
        |floor| floor.normal,
    );
    let mut front = facing(points, up).ok_or_else(missing)?;
    if is_exchanged(points, front) {
        *points = exchanged(points);
        front = -front;
    }
    let (lowest, top) = extent(scan, points, up, reach).ok_or_else(missing)?;
    // Where a floor was taken off, the soles were cut by its thickness. A platform is higher than the floor.
    let bottom = floor.map_or(lowest, |floor| {
        if (lowest - floor.level).abs() < 0.03 * reach {
            floor.level
        } else {
            lowest
        }
    });
    if bottom >= top {
        return Err(missing());
    }
    let scale = height / (top - bottom);
    let rotation = turn_to(up, front);
    let middle = [SHOULDERS, HIPS]
        .concat()
        .iter()
        .map(|at| points[*at].position)
        .sum::<DVec3>()
        / 4.0;
    let middle = rotation * middle;
    Ok(Similarity {
        scale,
        rotation,
        translation: -DVec3::new(middle.x, bottom, middle.z) * scale,
    })
}

/// Points of the scan near the feet.
fn feet_of(scan: &Scan, points: &[KeyPoint; BODY_LANDMARKS], radius: f64) -> Vec<DVec3> {
    let feet: Vec<DVec3> = [ANKLES, HEELS, TOES]
        .concat()
        .iter()
        .map(|at| points[*at].position)
        .collect();
    let all = scan.positions.iter().zip(&scan.opacities);
    let opaque = all
        .filter(|(_, opacity)| **opacity > 0.3)
        .map(|(point, _)| point.as_dvec3());
    opaque
        .filter(|point| feet.iter().any(|foot| (*point - *foot).length() < radius))
        .collect()
}

fn joints(points: &[KeyPoint; BODY_LANDMARKS]) -> impl Iterator<Item = &KeyPoint> {
    let all = [SHOULDERS, ELBOWS, WRISTS, HIPS, KNEES, ANKLES];
    all.into_iter().flatten().map(|at| &points[at])
}

/// Refuses a person without head or legs. Networks guess where they would be, and there nothing is.
fn complete(scan: &Scan, points: &[KeyPoint; BODY_LANDMARKS]) -> Result<(), RigError> {
    /// Radius about a landmark, metres, and Gaussians that must be in it.
    const NEAR: (f64, usize) = (0.12, 30);
    let has = |at: DVec3| {
        let near =
            (scan.positions.iter()).filter(|point| (point.as_dvec3() - at).length() < NEAR.0);
        near.take(NEAR.1).count() == NEAR.1
    };
    for (pair, what) in [
        (ANKLES, "feet"),
        (KNEES, "legs"),
        (EARS, "a head"),
        (HIPS, "hips"),
    ] {
        let middle = |at: usize| points[at].position;
        if !pair.into_iter().all(|at| has(middle(at))) {
            return Err(refused::incomplete(what));
        }
    }
    Ok(())
}
