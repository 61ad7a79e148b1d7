//! Clothes and hair: a displacement of each vertex in T-pose, along the normal where outlines say how far, smooth between.
//!
//! Face and hands stay the body model's, so that the expression basis and the fingers fit them; ears and toes go with what is around them.

use crate::body::{Body, Canonical};
use crate::guard::{room, turn_outwards};
use crate::posing::influences;
use crate::register::{Registration, Scene};
use glam::{DMat3, DVec3};
use rayon::prelude::*;
use scan_rig::body::BodyPart;
use scan_rig::body::laplacian::{Laplacian, Pulled};

/// Each round's stiffness, how near pulls must be (metres), and whether poses are corrected before it.
const ROUNDS: [(f64, f64, bool); 8] = [
    (8.0, 0.060, false),
    (4.0, 0.050, true),
    (2.0, 0.040, true),
    (1.0, 0.035, true),
    (0.5, 0.030, true),
    (0.25, 0.025, true),
    (0.25, 0.020, true),
    (0.25, 0.020, true),
];

/// How much stiffer the head is.
const HEAD: f64 = 3.0;

/// The length of an edge where the mesh is neither fine nor coarse, metres.
const USUAL_EDGE: f64 = 0.018;

/// Weight of staying where face and hands are.
const PINNED: f64 = 6.0;

/// The same of ears and toes, which follow hair and shoes around them.
const LIGHTLY: f64 = 0.5;

/// More pulls than this on one vertex say little that is new.
const ENOUGH: f64 = 6.0;

/// A pull along the surface says nothing of its height: least cosine with the normal.
const ALONG: f64 = 0.35;

/// How far below the registered body the surface may be: it is a person's, and not quite the model's, metres.
const BELOW: f64 = 0.03;

/// How far vertices may slide along the surface, metres.
const SLIDE: f64 = 0.015;

/// Rounds of smoothing of the looseness.
const SMOOTHING: usize = 12;

/// A dressed body.
#[derive(Debug)]
pub(crate) struct Dressed {
    /// In T-pose, the pelvis joint at the origin.
    pub(crate) canonical: Canonical,
    /// `[N_v]` how far from the bare body, metres.
    pub(crate) thickness: Vec<f64>,
    /// `[N_v]` how far the outlines of single frames are from the surface, root mean square, metres: where cloth swings.
    pub(crate) looseness: Vec<f64>,
    /// Vertices that had to be held back so that no face is inside out.
    pub(crate) held_back: usize,
}

impl Dressed {
    /// The registered body without clothes.
    pub(crate) fn bare(body: &Body, found: &Registration) -> Self {
        let canonical = Canonical::bare(body, &found.shape);
        let none = vec![0.0; canonical.vertices.len()];
        Self {
            canonical,
            thickness: none.clone(),
            looseness: none,
            held_back: 0,
        }
    }
}

/// What the views ask of the vertices along their normals.
struct Asked {
    weight: Vec<f64>,
    /// Sum of weights times wanted heights.
    height: Vec<f64>,
    /// Sum of weights times squared distances from the present surface.
    squared: Vec<f64>,
}

/// Dresses the registered body; the chosen frames' own corrections go on.
pub(crate) fn dress(scene: &Scene<'_>, found: &mut Registration) -> Dressed {
    let body = scene.body;
    let count = body.model.body_vertices;
    let bare = Canonical::bare(body, &found.shape);
    let normals = bare.normals(body);
    let room = room(body, &bare);
    let pinned: Vec<f64> = (0..count).map(|v| pinned(body, v)).collect();
    let growth: Vec<f64> = (0..count).map(|v| growth(body, v)).collect();
    let stiffness = (0..count)
        .map(|v| (1.0 + HEAD * body.model.head_share(v)) * fineness(body, &bare, v).powi(2))
        .collect();
    let laplacian = Laplacian::new(&body.model.neighbours, stiffness);
    let mut displacement: Vec<DVec3> = (0..count)
        .map(|v| normals[v] * (found.shape.cloth * body.clothed[v]).min(room[v]))
        .collect();
    let mut held_back = 0;
    for (stiff, reach, correct) in ROUNDS {
        let canonical = displaced(&bare, &displacement);
        if correct {
            scene.correct_poses(&canonical, found, reach);
        }
        let asked = asked(scene, found, &canonical, &normals, &displacement, reach);
        let pulled: Vec<Pulled> = (0..count)
            .map(|v| {
                let share = growth[v] / (1.0 + asked.weight[v] / ENOUGH);
                Pulled {
                    normal: normals[v],
                    along: asked.weight[v] * share,
                    every_way: pinned[v],
                    towards: normals[v] * (asked.height[v] * share),
                }
            })
            .collect();
        let steps = laplacian.solve(stiff, &pulled, &mut displacement);
        for (v, offset) in displacement.iter_mut().enumerate() {
            let height = offset.dot(normals[v]);
            let slide = (*offset - normals[v] * height).clamp_length_max(SLIDE);
            *offset = normals[v] * height.clamp(-BELOW, room[v]) + slide;
        }
        held_back = turn_outwards(body, &bare, &mut displacement);
        log::debug!("clothes: stiffness {stiff}: {steps} steps, {held_back} vertices held back");
    }
    let canonical = displaced(&bare, &displacement);
    let (_, reach, _) = ROUNDS[0];
    let last = asked(scene, found, &canonical, &normals, &displacement, reach);
    let mut thickness: Vec<f64> = (displacement.iter().zip(&normals))
        .map(|(offset, normal)| offset.dot(*normal))
        .collect();
    thickness.resize(bare.vertices.len(), 0.0);
    Dressed {
        canonical,
        thickness,
        looseness: looseness(body, &last),
        held_back,
    }
}

/// How many times finer than usual the mesh is at a vertex: its Laplacian, which knows no lengths, gets as much stiffer, or ears and toes would be crumpled.
fn fineness(body: &Body, bare: &Canonical, vertex: usize) -> f64 {
    let around = body.model.neighbours.of(vertex);
    let lengths = (around.iter())
        .map(|n| bare.vertices[*n as usize].distance(bare.vertices[vertex]))
        .sum::<f64>();
    let mean = lengths / around.len().max(1) as f64;
    (USUAL_EDGE / mean.max(1e-6)).clamp(0.7, 6.0)
}

/// How much outlines say of a vertex, 0..=1: nothing of ears, hands and toes. An outline shows one finger or the next, the ear or the hair beside it, the
/// shoe around five toes: followed, it crumples them.
fn growth(body: &Body, vertex: usize) -> f64 {
    (1.0 - body.ear[vertex]) * (1.0 - body.hand[vertex]) * (1.0 - body.toes[vertex])
}

/// How strongly a vertex stays the body model's.
fn pinned(body: &Body, vertex: usize) -> f64 {
    match body.parts[vertex] {
        BodyPart::Skin | BodyPart::Head | BodyPart::Hand => {
            PINNED * body.hand[vertex] + LIGHTLY * (body.ear[vertex] + body.toes[vertex])
        }
        _ => PINNED,
    }
}

fn displaced(bare: &Canonical, displacement: &[DVec3]) -> Canonical {
    let mut canonical = bare.clone();
    for (vertex, offset) in canonical.vertices.iter_mut().zip(displacement) {
        *vertex += *offset;
    }
    canonical
}

fn asked(
    scene: &Scene<'_>,
    found: &Registration,
    canonical: &Canonical,
    normals: &[DVec3],
    displacement: &[DVec3],
    reach: f64,
) -> Asked {
    let frames: Vec<Vec<(usize, f64, f64)>> = (0..scene.poses.len())
        .into_par_iter()
        .map(|slot| {
            let (posed, pulls) = scene.pulls(slot, canonical, &found.correction(slot), reach);
            pulls
                .iter()
                .filter_map(|pull| {
                    let turn: DMat3 = influences(&scene.body.skin[pull.vertex])
                        .map(|(joint, weight)| posed.maps[joint].matrix3 * weight)
                        .fold(DMat3::ZERO, |sum, part| sum + part);
                    let along = (turn * normals[pull.vertex]).dot(pull.direction);
                    (along > ALONG).then(|| {
                        let weight = pull.weight * along * along;
                        (pull.vertex, weight, pull.distance / along)
                    })
                })
                .collect()
        })
        .collect();
    let count = displacement.len();
    let mut asked = Asked {
        weight: vec![0.0; count],
        height: vec![0.0; count],
        squared: vec![0.0; count],
    };
    for (vertex, weight, distance) in frames.into_iter().flatten() {
        let height = displacement[vertex].dot(normals[vertex]) + distance;
        asked.weight[vertex] += weight;
        asked.height[vertex] += weight * height;
        asked.squared[vertex] += weight * distance * distance;
    }
    asked
}

/// Root mean squares, spread over the mesh to where nothing was seen.
fn looseness(body: &Body, asked: &Asked) -> Vec<f64> {
    let (mut sums, mut weights) = (asked.squared.clone(), asked.weight.clone());
    for _ in 0..SMOOTHING {
        let spread = |values: &[f64]| -> Vec<f64> {
            (0..values.len())
                .map(|v| {
                    let around = body.model.neighbours.of(v);
                    let near: f64 = around.iter().map(|n| values[*n as usize]).sum();
                    0.5 * values[v] + 0.5 * near / around.len().max(1) as f64
                })
                .collect()
        };
        (sums, weights) = (spread(&sums), spread(&weights));
    }
    let mut looseness: Vec<f64> = (sums.iter().zip(&weights))
        .map(|(sum, weight)| (sum / weight.max(1e-6)).sqrt())
        .collect();
    looseness.resize(body.model.rest.len(), 0.0);
    looseness
}
