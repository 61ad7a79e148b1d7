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

/// eps of the virtual mass, metres: keeps it finite at a controller. The paper does not state its value.
const EPSILON: f32 = 1e-3;

/// Where the controllers sit and which of them move each Gaussian.
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

    /// Assigns every Gaussian its strongest controllers.
    ///
    /// `graph` is the template's surface (with bridges between layers, or a Gaussian on an island without controllers
    /// falls back to the straight distance). Distances are measured to the corners of the Gaussian's triangle and on to its anchor.
    ///
    /// # Errors
    /// If there are fewer than three controllers, more than 16 bits can count, or a controller's vertex is out of range.
    pub fn tie(
        template: &Template,
        graph: &EdgeGraph,
        gaussians: &BoundGaussians,
        vertices: Vec<u32>,
    ) -> Result<Self, PersonError> {
        let most = usize::from(u16::MAX);
        if !(NEIGHBOURS..=most).contains(&vertices.len()) {
            return Err(PersonError::Count {
                what: "controllers",
                got: vertices.len(),
                expected: vertices.len().clamp(NEIGHBOURS, most),
            });
        }
        let points = template.vertices();
        PersonError::check_indices(
            "controller vertex",
            vertices.iter().map(|v| *v as usize),
            points.len(),
        )?;
        let seats: Vec<Seat> = vertices
            .par_iter()
            .map(|vertex| Seat::new(template, graph, *vertex))
            .collect();
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
                    let corner = template.skin()[*corner as usize];
                    for (joint, weight) in corner.joints.iter().zip(corner.weights) {
                        skin[usize::from(*joint)] += share * weight;
                    }
                }
                let last = [a, b, c].map(|corner| corner.distance(anchor));
                strongest(&seats, &skin, anchor, |seat| {
                    let through = |k: usize| seat.walked[corners[k] as usize] + last[k];
                    through(0).min(through(1)).min(through(2))
                })
            })
            .unzip();
        Self::new(template, vertices, neighbours, masses)
    }

    /// Template vertices the controllers sit at.
    #[must_use]
    pub fn vertices(&self) -> &[u32] {
        &self.vertices
    }

    /// `[N_g]` the three controllers that hold each Gaussian.
    #[must_use]
    pub fn neighbours(&self) -> &[[u16; NEIGHBOURS]] {
        &self.neighbours
    }

    /// `[N_g]` their normalised virtual masses.
    #[must_use]
    pub fn masses(&self) -> &[[f32; NEIGHBOURS]] {
        &self.masses
    }
}

/// A controller's place and what is known from there.
struct Seat {
    position: Vec3,
    skin: [f32; crate::JOINTS],
    /// Distance along the surface to every vertex, metres; infinite where no path leads.
    walked: Vec<f32>,
}

impl Seat {
    fn new(template: &Template, graph: &EdgeGraph, vertex: u32) -> Self {
        let mut walked = vec![f32::INFINITY; template.vertices().len()];
        for (reached, distance) in graph.reachable(vertex, f32::MAX) {
            walked[reached as usize] = distance;
        }
        Self {
            position: template.vertices()[vertex as usize],
            skin: template.skin()[vertex as usize].dense(),
            walked,
        }
    }
}

/// The three seats that pull hardest at a Gaussian with weights `skin` at `anchor`, and their shares.
fn strongest(
    seats: &[Seat],
    skin: &[f32; crate::JOINTS],
    anchor: Vec3,
    geodesic: impl Fn(&Seat) -> f32,
) -> ([u16; NEIGHBOURS], [f32; NEIGHBOURS]) {
    let mut distances: Vec<f32> = seats.iter().map(geodesic).collect();
    if distances.iter().filter(|d| d.is_finite()).count() < NEIGHBOURS {
        // An island no controller sits on (an eyelash, a button): straight distance is all there is.
        for (distance, seat) in distances.iter_mut().zip(seats) {
            if distance.is_infinite() {
                *distance = seat.position.distance(anchor);
            }
        }
    }
    let pull = |similarity: &dyn Fn(&Seat) -> f32| {
        let mut kept = [(0u16, -1.0f32); NEIGHBOURS];
        for ((controller, seat), distance) in (0u16..).zip(seats).zip(&distances) {
            let nearness = 1.0 / (distance + EPSILON);
            // Similarity is at most 1, so that most seats are settled by their distance alone.
            if nearness <= kept[NEIGHBOURS - 1].1 {
                continue;
            }
            let force = similarity(seat) * nearness;
            let at = kept.partition_point(|(_, other)| *other >= force);
            if at < NEIGHBOURS {
                kept[at..].rotate_right(1);
                kept[at] = (controller, force);
            }
        }
        kept
    };
    let mut kept = pull(&|seat| cosine(skin, &seat.skin));
    if kept[0].1 <= 0.0 {
        // No controller shares a joint with this Gaussian: the nearest ones hold it.
        kept = pull(&|_| 1.0);
    }
    let total: f32 = kept.iter().map(|(_, force)| force).sum();
    (
        kept.map(|(controller, _)| controller),
        kept.map(|(_, force)| force / total),
    )
}

/// S_skin: cosine of the angle between two dense weight vectors.
fn cosine(a: &[f32], b: &[f32]) -> f32 {
    let dot = |x: &[f32], y: &[f32]| x.iter().zip(y).map(|(p, q)| p * q).sum::<f32>();
    let lengths = (dot(a, a) * dot(b, b)).sqrt();
    if lengths > 0.0 {
        (dot(a, b) / lengths).clamp(0.0, 1.0)
    } else {
        0.0
    }
}
