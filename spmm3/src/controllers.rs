//! Local attribute controllers and how strongly each holds a Gaussian (paper, section IV-B).
//!
//! A controller sits at a template vertex. A Gaussian takes its K = 3 strongest neighbours by *virtual mass*
//! f = S_skin / (d_geo + eps), normalised to 1. Distance along the surface and skinning similarity together keep a
//! sleeve's controllers from dragging the flank it brushes.

use crate::{BoundGaussians, EdgeGraph, PersonError, Template};
use glam::Vec3;
use rayon::prelude::*;

/// K: controllers that hold one Gaussian.
pub const NEIGHBOURS: usize = 3;

/// The paper's stability constant eps, metres.
const EPSILON: f32 = 1e-3;

/// Where the controllers sit and which of them hold each Gaussian.
#[derive(Debug, Clone, PartialEq)]
pub struct Controllers {
    vertices: Vec<u32>,
    neighbours: Vec<[u16; NEIGHBOURS]>,
    masses: Vec<[f32; NEIGHBOURS]>,
}

impl Controllers {
    /// Takes the template vertices the controllers sit at, and for each of N_g Gaussians its three controllers and
    /// their normalised virtual masses.
    ///
    /// # Errors
    /// If counts differ, an index is out of range, or a Gaussian's masses are negative or do not sum to 1.
    pub fn new(
        template: &Template,
        vertices: Vec<u32>,
        neighbours: Vec<[u16; NEIGHBOURS]>,
        masses: Vec<[f32; NEIGHBOURS]>,
    ) -> Result<Self, PersonError> {
        PersonError::check_count("virtual masses", masses.len(), neighbours.len())?;
        let bound = template.vertices().len();
        PersonError::check_indices(
            "controller vertex",
            vertices.iter().map(|v| *v as usize),
            bound,
        )?;
        let named = neighbours.iter().flatten().map(|c| usize::from(*c));
        PersonError::check_indices("controller of a Gaussian", named, vertices.len())?;
        PersonError::check_range(
            "virtual mass",
            bytemuck::cast_slice(&masses),
            0.0,
            1.0,
            "0..1",
        )?;
        for (at, mass) in masses.iter().enumerate() {
            let sum: f32 = mass.iter().sum();
            if (sum - 1.0).abs() > 2e-3 {
                return Err(PersonError::Value {
                    what: "sum of virtual masses",
                    at,
                    value: sum,
                    range: "1",
                });
            }
        }
        Ok(Self {
            vertices,
            neighbours,
            masses,
        })
    }

    /// Ties every Gaussian to its strongest controllers.
    ///
    /// `graph` is the template's surface (with bridges between layers, or a Gaussian on an island without controllers
    /// falls back to the straight distance). Distances run to the Gaussian's triangle's corners and on to its anchor.
    ///
    /// # Errors
    /// If there are fewer than three controllers or a controller's vertex is out of range.
    pub fn tie(
        template: &Template,
        graph: &EdgeGraph,
        gaussians: &BoundGaussians,
        vertices: Vec<u32>,
    ) -> Result<Self, PersonError> {
        if vertices.len() < NEIGHBOURS {
            return Err(PersonError::Count {
                what: "controllers",
                got: vertices.len(),
                expected: NEIGHBOURS,
            });
        }
        let points = template.vertices();
        PersonError::check_indices(
            "controller vertex",
            vertices.iter().map(|v| *v as usize),
            points.len(),
        )?;
        let near = nearby_controllers(graph, template, &vertices);
        let (neighbours, masses) = gaussians
            .corners()
            .par_iter()
            .zip(gaussians.barycentrics())
            .map(|(corners, [v, w])| {
                let shares = [1.0 - v - w, *v, *w];
                let [a, b, c] = corners.map(|i| points[i as usize]);
                let anchor = a * shares[0] + b * shares[1] + c * shares[2];
                let mut skin = [0.0f32; crate::JOINTS];
                for (corner, share) in corners.iter().zip(shares) {
                    for (sum, weight) in skin
                        .iter_mut()
                        .zip(template.skin()[*corner as usize].dense())
                    {
                        *sum += share * weight;
                    }
                }
                let mut candidates: Vec<(u16, f32)> = Vec::new();
                for corner in corners {
                    let last = points[*corner as usize].distance(anchor);
                    for (controller, distance) in &near[*corner as usize] {
                        let total = distance + last;
                        match candidates.iter_mut().find(|(known, _)| known == controller) {
                            Some((_, best)) => *best = best.min(total),
                            None => candidates.push((*controller, total)),
                        }
                    }
                }
                strongest(template, &vertices, &skin, anchor, &mut candidates)
            })
            .unzip();
        Self::new(template, vertices, neighbours, masses)
    }

    /// Template vertices the controllers sit at.
    #[must_use]
    pub fn vertices(&self) -> &[u32] {
        &self.vertices
    }

    /// [N_g] the three controllers that hold each Gaussian.
    #[must_use]
    pub fn neighbours(&self) -> &[[u16; NEIGHBOURS]] {
        &self.neighbours
    }

    /// [N_g] their normalised virtual masses.
    #[must_use]
    pub fn masses(&self) -> &[[f32; NEIGHBOURS]] {
        &self.masses
    }
}

/// For every vertex the controllers nearest along the surface: (controller, metres), nearest first.
fn nearby_controllers(
    graph: &EdgeGraph,
    template: &Template,
    controllers: &[u32],
) -> Vec<Vec<(u16, f32)>> {
    const KEPT: usize = 8;
    let points = template.vertices();
    // Each controller floods as far as its KEPT-th nearest fellow, which covers every vertex between them.
    let floods: Vec<Vec<(u32, f32)>> = controllers
        .par_iter()
        .map(|source| {
            let mut straight: Vec<f32> = controllers
                .iter()
                .map(|c| points[*source as usize].distance(points[*c as usize]))
                .collect();
            straight.sort_unstable_by(f32::total_cmp);
            let reach = straight[KEPT.min(straight.len() - 1)] * 1.5;
            graph.reachable(*source, reach)
        })
        .collect();
    let mut near = vec![Vec::new(); points.len()];
    for (controller, flood) in floods.iter().enumerate() {
        let Ok(controller) = u16::try_from(controller) else {
            break;
        };
        for (vertex, distance) in flood {
            near[*vertex as usize].push((controller, *distance));
        }
    }
    for list in &mut near {
        list.sort_unstable_by(|a: &(u16, f32), b| a.1.total_cmp(&b.1).then(a.0.cmp(&b.0)));
        list.truncate(KEPT);
    }
    near
}

fn strongest(
    template: &Template,
    controllers: &[u32],
    skin: &[f32; crate::JOINTS],
    anchor: Vec3,
    candidates: &mut Vec<(u16, f32)>,
) -> ([u16; NEIGHBOURS], [f32; NEIGHBOURS]) {
    if candidates.len() < NEIGHBOURS {
        // An island no controller sits on (an eyelash, a button): straight distance is all there is.
        for (controller, vertex) in (0u16..).zip(controllers) {
            if candidates.iter().all(|(known, _)| *known != controller) {
                candidates.push((
                    controller,
                    template.vertices()[*vertex as usize].distance(anchor),
                ));
            }
        }
    }
    candidates.sort_unstable_by(|a, b| a.1.total_cmp(&b.1).then(a.0.cmp(&b.0)));
    candidates.truncate(16);
    let pull = |similarity: &dyn Fn(u16) -> f32| {
        let mut forces: Vec<(u16, f32)> = candidates
            .iter()
            .map(|(controller, distance)| {
                let force = similarity(*controller) / (distance + EPSILON);
                (*controller, force)
            })
            .collect();
        forces.sort_unstable_by(|a, b| b.1.total_cmp(&a.1).then(a.0.cmp(&b.0)));
        [forces[0], forces[1], forces[2]]
    };
    let mut kept = pull(&|controller| {
        let other = template.skin()[controllers[usize::from(controller)] as usize].dense();
        cosine(skin, &other)
    });
    if kept[0].1 <= 0.0 {
        // No controller nearby shares a joint with this Gaussian: the nearest ones hold it.
        kept = pull(&|_| 1.0);
    }
    let total: f32 = kept.iter().map(|(_, force)| force).sum();
    (
        kept.map(|(controller, _)| controller),
        kept.map(|(_, force)| force / total),
    )
}

fn cosine(a: &[f32], b: &[f32]) -> f32 {
    let dot = |x: &[f32], y: &[f32]| x.iter().zip(y).map(|(p, q)| p * q).sum::<f32>();
    let norms = (dot(a, a) * dot(b, b)).sqrt();
    if norms > 0.0 {
        (dot(a, b) / norms).clamp(0.0, 1.0)
    } else {
        0.0
    }
}
