//! The order of the work.

use super::cut::cut;
use super::face_points::{Head, face_landmarks_of};
use super::figures::Figures;
use super::found::{USUAL_HEIGHT, count, the_person};
use super::hints::{Hints, residual, with};
use super::landmarks::{ANKLES, EARS, EYES, HIPS, KNEES};
use super::looking::{MOST_DRAWN, look_around};
use super::networks::Networks;
use super::placing::{onto_the_floor, stood};
use super::refused;
use super::sample::thinned;
use super::similarity::Similarity;
use super::stance::share_beside;
use crate::RigError;
use crate::median::median;
use crate::points::KeyPoint;
use crate::scan::Scan;
use crate::sight::Sight;
use crate::stopwatch::Stopwatch;
use glam::{DQuat, DVec3, Vec3};
use motion_fit::landmarks::{BODY_LANDMARKS, FACE_LANDMARKS};
use splat_scene::{Scene, UpAxis};
use spmm3::Joint;

/// What is known of a scan before it is looked at.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Options {
    /// How tall the person is, metres; without it, [`USUAL_HEIGHT`]: a scan has no unit.
    pub height: Option<f64>,
    /// The axis of the file that points up, roughly; without it, the one that shows a standing person.
    pub up: Option<UpAxis>,
    /// Opposite corners of a box that the person is in, in the file's own units and axes.
    pub within: Option<[[f32; 3]; 2]>,
    /// Joints whose places the user knows, in the file's own units and axes.
    pub joints: Vec<(Joint, Vec3)>,
}

/// A scan that stands in the person's space, and what networks saw of it.
#[derive(Debug, Clone)]
pub struct Prepared {
    /// The person's Gaussians, surroundings cut away.
    pub scan: Scan,
    /// BlazePose's landmarks, as the network has them wherever the user placed joints.
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

impl Prepared {
    /// Turns the person about the vertical through the origin.
    pub fn turn(&mut self, turn: DQuat) {
        let turn = Similarity {
            rotation: turn,
            ..Similarity::IDENTITY
        };
        self.scan = turn.scan(&self.scan);
        let face = self.face.iter_mut().flat_map(|face| face.iter_mut());
        for point in self.body.iter_mut().chain(face) {
            point.position = turn.point(point.position);
        }
        self.person_from_scene = self.person_from_scene.then(&turn);
    }
}

/// Views of the body.
const VIEWS: u32 = 12;
/// What is farther from all bones is not the person, metres.
const ABOUT_BONES: f64 = 0.22;
/// With this share of the surface beside the bones, there is more than one person; with that, the user is told.
const MOST_BESIDE: f64 = 0.12;
const MUCH_BESIDE: f64 = 0.05;
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
    let mut steps = Stopwatch::start();
    let mut figures = Figures::default();
    if scene.is_empty() {
        return Err(refused::empty());
    }
    let height = options.height.unwrap_or(USUAL_HEIGHT);
    if !(0.3..=3.0).contains(&height) {
        return Err(RigError::unsuited(format!(
            "a person is not {height} metres tall: give a height from 0.3 to 3 metres"
        )));
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
    let hints = Hints::new(scene, &options.joints);
    hints.check(
        scene,
        &found.normal,
        &found.normal_from_scene,
        found.corners,
    )?;
    steps.ended("up");

    let stood = stood(&found, height, &hints, sight, networks)?;
    figures.tilt_degrees = stood.tilt.to_degrees();
    steps.ended("stance");

    let mut person_from_scene = found.normal_from_scene.then(&stood.person_from_normal);
    let mut scan = person_from_scene.scan(&found.scan);
    sight.set(&thinned(&scan, MOST_DRAWN));
    let (seen, looks, crowded) =
        look_around(&scan, DVec3::Y, DVec3::Z, (VIEWS, 1.0), sight, networks)?;
    figures.crowded = crowded;
    if crowded > VIEWS as usize / 3 {
        return Err(refused::several_seen(crowded));
    }
    figures.views = looks;
    figures.exchanged = seen.exchanged;
    let mut body = seen.points;
    let hinted = hints.landmarks(&person_from_scene);
    let correction = onto_the_floor(&scan, &mut body, &hinted, stood.known, height, height)?;
    for point in &mut body {
        point.position = correction.point(point.position);
        point.residual *= correction.scale;
    }
    person_from_scene = person_from_scene.then(&correction);
    scan = person_from_scene.scan(&found.scan);
    let marked = with(&body, &hints.landmarks(&person_from_scene));
    complete(&scan, &marked)?;
    if looks < VIEWS as usize / 2 {
        return Err(refused::seldom_seen(looks));
    }
    figures.body_residual = residual(&body, &hinted);
    if figures.body_residual > MOST_RESIDUAL {
        return Err(refused::unsure(&marked));
    }
    figures.beside = share_beside(&scan, &marked, ABOUT_BONES * height / USUAL_HEIGHT);
    if figures.beside > MOST_BESIDE {
        return Err(refused::crowded(figures.beside));
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
        .and_then(|face| median(face.iter().map(|point| point.residual)));
    steps.ended("face");

    if figures.body_residual > DOUBTFUL_RESIDUAL {
        figures.doubts.push(format!(
            "the views agree on the joints to {:.0} mm only (a person who stands freely: 20): is this a person, with arms and legs apart?",
            1e3 * figures.body_residual
        ));
    }
    if figures.beside > MUCH_BESIDE {
        figures.doubts.push(format!(
            "{:.0} % of what the scan shows is not the person: cut furniture and other people away, or leave them out with --box",
            100.0 * figures.beside
        ));
    }
    if face.is_none() {
        figures.doubts.push(
            "no face was seen: is this a person whose face is not covered? The avatar's face will not move as one".to_owned(),
        );
    }
    figures.steps = steps.done;
    Ok(Prepared {
        scan,
        body,
        face,
        person_from_scene,
        height,
        figures,
    })
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
