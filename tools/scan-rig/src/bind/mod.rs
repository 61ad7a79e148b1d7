//! Gaussians on triangles: cleaned, split, bound in the pose of the scan; weights, and accessories.
//!
//! A Gaussian is bound where the scan stands: whatever triangle it is on, posed as the scan it is where it was. The order of the work:
//! skinning weights -> things that are no body -> what is left out -> long Gaussians split -> a triangle for each -> what leaves the body
//! in other poses left out.

pub mod accessories;
pub(crate) mod carried;
mod clean;
mod ground;
mod growth;
mod rest;
mod samples;
mod settle;
mod split;
mod triangles;
mod weights;

pub use rest::Rest;

use crate::RigError;
use crate::body::posing::kept;
use crate::body::{BodyModel, BodyPart, Registered, SkinRow};
use crate::figures::Percentiles;
use crate::scan::Scan;
use crate::surface::Survey;
use accessories::{Accessory, Wearer};
use carried::Carried;
use clean::Unfit;
use glam::{DVec3, Vec3};
use ground::{Ground, Placed, Skin};
use rayon::prelude::*;
use serde::Serialize;
use spmm3::JOINTS;

/// How much a scan may grow where long Gaussians are split, as a multiple of the Gaussians that were given.
const GROWTH: usize = 4;
/// Gaussians lower than this are no accessory but ground, metres.
const GROUND: f32 = 0.08;
/// Parts of a long Gaussian whose middle is by the body are left out where they are farther from it, metres: its ends are of the surroundings
/// and would fly beside the person.
const ASTRAY: f32 = 0.055;
/// Side of the triangle that carries an accessory, metres.
const CARRIER: f64 = 0.05;

/// A mesh that carries Gaussians.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Mesh {
    /// Vertices in the scan's pose, metres: the body model's, then those of carriers.
    pub vertices: Vec<DVec3>,
    /// Counter-clockwise triangles: the body model's, then those of carriers.
    pub faces: Vec<[u32; 3]>,
    /// Skinning weights of the vertices, at most four joints each, whose sum is 1.
    pub weights: Vec<SkinRow>,
}

/// Gaussians bound to a mesh, all in the scan's pose.
#[derive(Debug, Clone, Default)]
pub struct Bound {
    /// The Gaussians.
    pub scan: Scan,
    /// The face of the mesh that carries each.
    pub triangles: Vec<u32>,
    /// The mesh.
    pub mesh: Mesh,
    /// What each Gaussian belongs to: 0 is the body, 1 the first of the report's accessories, and so on.
    pub accessory: Vec<u8>,
    /// What was done.
    pub report: BindReport,
}

/// What binding did to a scan.
#[derive(Debug, Clone, PartialEq, Default, Serialize)]
pub struct BindReport {
    /// Gaussians of the scan.
    pub given: usize,
    /// Left out: they show nowhere.
    pub hidden: usize,
    /// Left out: no part of the person.
    pub apart: usize,
    /// Left out: behind the surface.
    pub behind: usize,
    /// Left out: off the surface, and little of them shows.
    pub off: usize,
    /// Left out: long, and little of them shows.
    pub coarse: usize,
    /// More Gaussians by splitting long ones.
    pub split: usize,
    /// Gaussians that were moved to another part of the body by their neighbours.
    pub outvoted: usize,
    /// Left out: they leave the body when it moves.
    pub leaving: usize,
    /// Gaussians in the end.
    pub kept: usize,
    /// Distances of the body's Gaussians from their triangles.
    pub offsets: Percentiles,
    /// The largest standard deviation, metres.
    pub longest_axis: f32,
    /// What is worn or carried.
    pub accessories: Vec<Accessory>,
}

/// Choices in binding.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct BindOptions {
    /// Look for things that are no body. Without, all Gaussians are the body's.
    pub accessories: bool,
}

impl Default for BindOptions {
    fn default() -> Self {
        Self { accessories: true }
    }
}

impl Bound {
    /// The mesh's vertices in single precision, as packages have them.
    #[must_use]
    pub fn vertices(&self) -> Vec<Vec3> {
        single(&self.mesh.vertices)
    }

    /// The Gaussians in their triangles' frames.
    #[must_use]
    pub(crate) fn carried(&self) -> Carried {
        Carried::new(
            &self.scan,
            &self.triangles,
            &self.mesh.faces,
            &self.vertices(),
        )
    }

    /// The mesh in T-pose.
    ///
    /// # Errors
    /// If a joint is nowhere.
    pub fn rest(&self, model: &BodyModel, registered: &Registered) -> Result<Rest, RigError> {
        Rest::new(&self.mesh, model, registered)
    }

    /// Keeps the Gaussians for which `keep` is true; it is as long as the scan.
    pub fn retain(&mut self, keep: &[bool]) {
        self.scan = self.scan.filtered(keep);
        let mut kept = keep.iter();
        self.triangles
            .retain(|_| kept.next().copied().unwrap_or(false));
        let mut kept = keep.iter();
        self.accessory
            .retain(|_| kept.next().copied().unwrap_or(false));
    }
}

/// Binds a scan to the body that was registered to it.
///
/// # Errors
/// If nothing of the scan is left, or the body model does not fit its registration.
pub fn bind(
    scan: &Scan,
    survey: &Survey,
    model: &BodyModel,
    registered: &Registered,
    options: &BindOptions,
) -> Result<Bound, RigError> {
    let body = single(&registered.vertices);
    if body.len() != model.rest.len() || scan.len() != survey.peak.len() {
        return Err(RigError::unsuited(
            "the body model, its registration and the scan are of different runs: run all steps again on one scan",
        ));
    }
    let outer = |face: usize| is_outer(model, face);
    let mut rows = model.weights.clone();
    // Hands stay as they were scanned, until completing them decides otherwise.
    weights::stiffen_fingers(&mut rows);
    weights::smooth(&mut rows, |vertex| model.neighbours.of(vertex));
    let rows: Vec<SkinRow> = rows.iter().map(|row| kept(row).dense()).collect();

    let ground = Ground::new(&survey.surface)?;
    let places: Vec<Placed> = scan
        .positions
        .par_iter()
        .map(|p| ground.place(*p))
        .collect();
    let mut mesh = Mesh {
        vertices: registered.vertices.clone(),
        faces: model.faces.clone(),
        weights: rows,
    };
    let skin = Skin::new(model, &body);
    let mut label = vec![0_u8; scan.len()];
    let mut things = Vec::new();
    let mut shapes = Vec::new();
    if options.accessories {
        let wearer = Wearer {
            vertices: &body,
            weights: &model.weights,
        };
        (things, shapes) = find_things(scan, survey, &places, &skin, wearer, &mut label);
    }

    let mut report = BindReport {
        given: scan.len(),
        ..BindReport::default()
    };
    let keep: Vec<bool> = (0..scan.len())
        .map(|at| {
            let unfit = clean::unfit(scan, &survey.peak, at, places[at].place, label[at] != 0);
            match unfit {
                None => return true,
                Some(Unfit::Hidden) => report.hidden += 1,
                Some(Unfit::Apart) => report.apart += 1,
                Some(Unfit::Behind) => report.behind += 1,
                Some(Unfit::Off) => report.off += 1,
                Some(Unfit::Coarse) => report.coarse += 1,
            }
            false
        })
        .collect();
    let cleaned = scan.filtered(&keep);
    let kept_at: Vec<usize> = (0..scan.len()).filter(|at| keep[*at]).collect();
    let label: Vec<u8> = kept_at.iter().map(|at| label[*at]).collect();
    let (split, parents) = split::without_long(&cleaned, split::LONGEST, scan.len() * GROWTH);
    report.split = split.len() - cleaned.len();
    let mut parts = vec![0_u32; cleaned.len()];
    parents.iter().for_each(|at| parts[*at as usize] += 1);
    let stays: Vec<bool> = (parents.par_iter().zip(&split.positions))
        .map(|(parent, position)| {
            let parent = *parent as usize;
            if let Some(shape) = usize::from(label[parent])
                .checked_sub(1)
                .and_then(|at| shapes.get(at))
            {
                return shape.contains(*position);
            }
            parts[parent] == 1
                || skin.off(*position) <= ASTRAY
                || skin.off(cleaned.positions[parent]) > ASTRAY
        })
        .collect();
    report.apart += stays.iter().filter(|stays| !**stays).count();
    let split = split.filtered(&stays);
    let mut stay = stays.into_iter();
    let parents: Vec<u32> = (parents.into_iter())
        .filter(|_| stay.next().unwrap_or(false))
        .collect();
    let label: Vec<u8> = parents.iter().map(|at| label[*at as usize]).collect();

    let normals: Vec<Vec3> = split
        .positions
        .par_iter()
        .map(|p| ground.place(*p).normal)
        .collect();
    let faces = triangles::Faces::new(&body, &model.faces, &mesh.weights, outer);
    let own: Vec<usize> = (0..split.len()).filter(|at| label[*at] == 0).collect();
    let of = |values: &[Vec3]| -> Vec<Vec3> { own.iter().map(|at| values[*at]).collect() };
    let (chosen, outvoted) = faces
        .choose(&of(&split.positions), &of(&normals))
        .filter(|_| !own.is_empty())
        .ok_or_else(|| RigError::unsuited("nothing of the scan is near the body: it is no scan of a person, or too few views of the person went into it"))?;
    report.outvoted = outvoted;
    let mut triangles = vec![0_u32; split.len()];
    for (at, triangle) in own.iter().zip(chosen) {
        triangles[*at] = triangle;
    }
    for (thing, number) in things.iter().zip(1_u8..) {
        let face = add_carrier(&mut mesh, thing);
        for (triangle, label) in triangles.iter_mut().zip(&label) {
            if *label == number {
                *triangle = face;
            }
        }
    }

    let mut bound = Bound {
        scan: split,
        triangles,
        mesh,
        accessory: label,
        report,
    };
    let peak: Vec<f32> = parents
        .iter()
        .map(|at| survey.peak[kept_at[*at as usize]])
        .collect();
    settle::settle(&mut bound, peak, model, registered, &faces, &ground)?;
    let offsets = bound.carried().offsets;
    let of_body = offsets
        .iter()
        .zip(&bound.accessory)
        .filter(|(_, a)| **a == 0);
    bound.report.offsets = Percentiles::of(of_body.map(|(offset, _)| offset.length()).collect());
    bound.report.longest_axis = crate::figures::longest_axis(&bound.scan);
    bound.report.kept = bound.scan.len();
    for (thing, number) in things.iter_mut().zip(1_u8..) {
        thing.gaussians = bound.accessory.iter().filter(|a| **a == number).count();
    }
    bound.report.accessories = things;
    Ok(bound)
}

/// Whether Gaussians may be on a face: skin that can be seen from outside.
fn is_outer(model: &BodyModel, face: usize) -> bool {
    let skin = matches!(
        model.parts[face],
        BodyPart::Skin | BodyPart::Face | BodyPart::Head | BodyPart::Hand
    );
    skin && model.faces[face].iter().all(|v| model.outer[*v as usize])
}

/// Finds what is no body and labels its Gaussians.
fn find_things(
    scan: &Scan,
    survey: &Survey,
    places: &[Placed],
    skin: &Skin<'_>,
    wearer: Wearer<'_>,
    label: &mut [u8],
) -> (Vec<Accessory>, Vec<accessories::Shape>) {
    let off: Vec<Vec3> = (0..scan.len())
        .into_par_iter()
        .filter(|at| {
            let unfit = clean::unfit(scan, &survey.peak, *at, places[*at].place, true);
            let position = scan.positions[*at];
            unfit.is_none() && position.y > GROUND && skin.off(position) > accessories::OFF_BODY
        })
        .map(|at| scan.positions[at])
        .collect();
    let mut things = Vec::new();
    let mut shapes = Vec::new();
    for cluster in accessories::clusters(&off) {
        let (shape, thing) = accessories::attach(&cluster, wearer);
        things.push(thing);
        let number = u8::try_from(things.len()).unwrap_or(u8::MAX);
        label
            .par_iter_mut()
            .zip(&scan.positions)
            .for_each(|(label, position)| {
                if *label == 0 && shape.contains(*position) {
                    *label = number;
                }
            });
        shapes.push(shape);
    }
    (things, shapes)
}

/// Adds the triangle that carries a thing, and moves with its joint alone; which face it is.
fn add_carrier(mesh: &mut Mesh, thing: &Accessory) -> u32 {
    let mut row = [0.0; JOINTS];
    row[thing.joint.index()] = 1.0;
    let centre = Vec3::from(thing.centre).as_dvec3();
    let corners = [DVec3::ZERO, DVec3::X * CARRIER, DVec3::Y * CARRIER];
    #[expect(clippy::cast_possible_truncation, reason = "a body model's, and a few")]
    let (first, face) = (mesh.vertices.len() as u32, mesh.faces.len() as u32);
    for corner in corners {
        mesh.vertices.push(centre + corner);
        mesh.weights.push(row);
    }
    mesh.faces.push([first, first + 1, first + 2]);
    face
}

fn single(vertices: &[DVec3]) -> Vec<Vec3> {
    vertices.iter().map(|v| v.as_vec3()).collect()
}
