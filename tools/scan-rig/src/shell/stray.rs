//! What hung in an opening between two parts of the body as the scan stood: between arm and flank no view looked well, and Gaussians there have
//! the colours of what was behind. Once the arm is lifted they show: what is off the body is left out, what is long is shortened, and what is
//! lighter than the body around takes its colour.

use super::additions::brightness;
use super::harmonic::Edges;
use crate::RigError;
use crate::apart::{CLOSED_IN, InTwoPoses, come_apart};
use crate::bind::Bound;
use crate::body::{BodyModel, Registered};
use crate::nearest::Nearest;
use crate::scan::Scan;
use glam::{DVec3, Vec3};
use rayon::prelude::*;
use std::collections::HashSet;

/// Bounds as those of [`CLOSED_IN`] for the edges of an opening: no view looked well there either, but skin may have been seen aslant, metres.
const EDGE: (f32, f32) = (0.09, 0.05);

/// Of a thing, Gaussians of more opacity than this are looked at, one in each cube of such a side, metres: no more than tells where its surface is.
const SOLID: f32 = 0.3;
const CUBE: f32 = 0.006;

/// How far from its triangle a Gaussian may be in an opening, metres: cloth is nearer. A Gaussian that its neighbours moved to
/// another part of the body is beside its triangle and not over it, so its height and how far it is outside of all skin are asked too, each with
/// a share of that.
const OFF: f32 = 0.012;
const OUTSIDE: f32 = 0.6;
const OVER: f32 = 0.4;

/// Mist is wide, skin is fine: a Gaussian whose second longest standard deviation is more than these is mist, at the edge of an opening and in it,
/// metres. Splat trainers leave few as wide on skin that was looked at.
const MIST_AT_EDGE: f32 = 0.008;
const MIST: f32 = 0.005;
/// Half of [`OFF`] is too far off for mist.
const MIST_OFF: f32 = 0.006;
/// Mist this far off its triangle goes from under the skin to outside of it, or back, as a limb turns, metres.
const DEEP: f32 = 0.022;

/// In an opening, what is farther off its triangle than this, metres, may be so much lighter than the body around, and at the edge what is outside
/// of the skin so much. What was behind the person is light: a wall, the sky.
const OFF_SKIN: f32 = 0.004;
const LIGHTER: f64 = 0.15;
const LIGHTER_AT_EDGE: f64 = 0.3;

/// Where a Gaussian ends, in standard deviations, how much farther off the body its end may be in T-pose, metres, elsewhere and in an opening, and
/// to what share it may be shortened. Spikes of 4 mm are seen where an arm is lifted before a wall; elsewhere cloth hides them. Shorter than a
/// fifth, a Gaussian leaves a hole.
const END: f32 = 2.0;
const STANDS_OFF: [f32; 2] = [0.018, 0.004];
const SHORTEST: f32 = 0.2;

/// Gaussians on vertices that are the head's by more than this stay as they are: the face has a shell of its own.
const HEADS_SHARE: f64 = 0.5;

/// What was found.
#[derive(Debug, Clone, PartialEq, Default)]
pub(crate) struct Stray {
    /// `[N_v]` whether a vertex of the body was closed in as the scan stood.
    pub(crate) closed_in: Vec<bool>,
    /// Gaussians left out.
    pub(crate) dropped: usize,
    /// Gaussians shortened.
    pub(crate) shortened: usize,
    /// Gaussians in the colour of the body around.
    pub(crate) repainted: usize,
}

/// Where a Gaussian of the body is. Lengths in metres.
#[derive(Debug, Clone, Copy)]
struct Seat {
    /// Its triangle is closed in as the scan stands.
    closed_in: bool,
    /// Its triangle is closed in by [`EDGE`].
    at_edge: bool,
    /// How far it is from its triangle.
    off: f32,
    /// Its height over its triangle in T-pose.
    height: f32,
    /// How far it is outside of the nearest skin as the scan stands, and in T-pose, negative inside.
    outside: [f32; 2],
    /// Its second longest standard deviation.
    width: f32,
}

impl Seat {
    /// Whether it hung in the opening: over its triangle or outside of all skin, or mist. What lies under the skin in both poses does not show.
    fn is_left_out(&self) -> bool {
        let [here, outside] = self.outside;
        let surfaces = self.off > DEEP && (here < 0.0) != (outside < 0.0);
        let is_outside = outside > OUTSIDE * OFF;
        let hangs = (self.closed_in && (is_outside || self.height > OVER * OFF))
            || (self.at_edge && is_outside && self.width > MIST_AT_EDGE);
        let is_mist = self.closed_in && self.width > MIST && (self.stands_off() || surfaces);
        (hangs && self.off > OFF) || is_mist
    }

    /// Whether it stands off the skin in T-pose, as mist must not.
    fn stands_off(&self) -> bool {
        self.off > MIST_OFF && self.outside[1] > OUTSIDE * MIST_OFF
    }

    /// How much lighter than the body around it may be.
    fn lightest(&self) -> Option<f64> {
        if self.closed_in && self.off > OFF_SKIN {
            Some(LIGHTER)
        } else {
            (self.at_edge && self.stands_off()).then_some(LIGHTER_AT_EDGE)
        }
    }
}

/// Tidies up what was bound.
pub(crate) fn tidy(
    bound: &mut Bound,
    model: &BodyModel,
    registered: &Registered,
) -> Result<Stray, RigError> {
    let rest = bound.rest(model, registered)?;
    let here = bound.vertices();
    let there: Vec<Vec3> = rest.vertices.iter().map(|v| v.as_vec3()).collect();
    let carried = bound.carried();
    let posed = carried.posed(&bound.scan, &bound.triangles, &bound.mesh.faces, &there);
    let opening = {
        #[expect(clippy::cast_possible_truncation, reason = "about 1")]
        let scale = registered.scale as f32;
        Opening::new(bound, model, scale, &posed, [&here, &there])
    };
    let outside = [(&bound.scan, &here), (&posed, &there)]
        .map(|(scan, skin)| outside(model, &scan.positions, skin));
    let seats: Vec<Option<Seat>> = (0..bound.scan.len())
        .map(|at| {
            let face = model.faces.get(bound.triangles[at] as usize)?;
            let [a, b, c] = face.map(|v| v as usize);
            if bound.accessory[at] != 0 || model.head_share(a) >= HEADS_SHARE {
                return None;
            }
            let normal = (there[b] - there[a]).cross(there[c] - there[a]);
            let scales = bound.scan.scales[at];
            Some(Seat {
                closed_in: [a, b, c].iter().any(|v| opening.closed_in[*v]),
                at_edge: [a, b, c].iter().any(|v| opening.edge[*v]),
                off: carried.offsets[at].length(),
                height: (posed.positions[at] - there[a]).dot(normal.normalize_or_zero()),
                outside: [outside[0][at], outside[1][at]],
                width: scales.element_sum() - scales.max_element() - scales.min_element(),
            })
        })
        .collect();
    let is_closed_in: Vec<bool> = (seats.iter())
        .map(|seat| seat.is_some_and(|seat| seat.closed_in))
        .collect();
    let usual = usual_colours(
        bound,
        model,
        &is_closed_in,
        &rest.vertices[..model.rest.len()],
    );
    let (ends_here, ends_there) = (ends(model, &bound.scan, &here), ends(model, &posed, &there));
    let mut stray = Stray {
        closed_in: opening.closed_in,
        ..Stray::default()
    };
    let mut keep = vec![true; bound.scan.len()];
    for (at, seat) in seats.iter().enumerate() {
        let Some(seat) = seat else { continue };
        if seat.is_left_out() {
            keep[at] = false;
            stray.dropped += 1;
            continue;
        }
        let grown = ends_there[at] - ends_here[at];
        let most = STANDS_OFF[usize::from(seat.closed_in)];
        if grown > most {
            let scales = &mut bound.scan.scales[at];
            let longest = scales.max_element();
            let share = (most / grown).clamp(SHORTEST, 1.0);
            *scales = scales.min(Vec3::splat(longest * share));
            stray.shortened += 1;
        }
        if let Some(lighter) = seat.lightest() {
            let face = model.faces[bound.triangles[at] as usize];
            let usual = face.iter().map(|v| usual[*v as usize]).sum::<DVec3>() / 3.0;
            if brightness(bound.scan.colours[at].as_dvec3()) > brightness(usual) + lighter {
                bound.scan.colours[at] = usual.as_vec3();
                stray.repainted += 1;
            }
        }
    }
    bound.retain(&keep);
    Ok(stray)
}

/// `[N_v]` which vertices of the skin are near other skin, or a thing, as the scan stands, that is far in T-pose.
struct Opening {
    /// By [`CLOSED_IN`].
    closed_in: Vec<bool>,
    /// By [`EDGE`].
    edge: Vec<bool>,
}

impl Opening {
    /// `scale`: the body's; `posed`: the scan in T-pose; `here` and `there`: the mesh as the scan stands, and in T-pose.
    fn new(
        bound: &Bound,
        model: &BodyModel,
        scale: f32,
        posed: &Scan,
        [here, there]: [&[Vec3]; 2],
    ) -> Self {
        let outer: Vec<usize> = (0..model.body_vertices)
            .filter(|v| model.outer[*v])
            .collect();
        // A thing that is held closes in what is beside it as well, and mist is on both sides of a thin limb: from any side.
        let skin: Vec<InTwoPoses> = (outer.iter())
            .map(|v| InTwoPoses {
                outwards: Vec3::ZERO,
                scanned: here[*v],
                straight: there[*v],
            })
            .collect();
        let mut taken = HashSet::new();
        let things: Vec<InTwoPoses> = (0..bound.scan.len())
            .filter(|at| bound.accessory[*at] != 0 && bound.scan.opacities[*at] > SOLID)
            .filter(|at| taken.insert((bound.scan.positions[*at] / CUBE).floor().as_ivec3()))
            .map(|at| InTwoPoses {
                outwards: Vec3::ZERO,
                scanned: bound.scan.positions[at],
                straight: posed.positions[at],
            })
            .collect();
        let bounds = [CLOSED_IN, EDGE].map(|(within, farther)| (within * scale, farther * scale));
        let from_skin = come_apart(&skin, &skin, bounds);
        let from_things = come_apart(&skin, &things, bounds);
        let mut opening = Self {
            closed_in: vec![false; model.rest.len()],
            edge: vec![false; model.rest.len()],
        };
        for ((v, skin), thing) in outer.iter().zip(from_skin).zip(from_things) {
            opening.closed_in[*v] = skin[0] || thing[0];
            opening.edge[*v] = skin[1] || thing[1];
        }
        opening
    }
}

/// How far points are outside of the nearest skin, metres; negative inside.
fn outside(model: &BodyModel, points: &[Vec3], vertices: &[Vec3]) -> Vec<f32> {
    let mut middles: Vec<[f32; 3]> = Vec::new();
    let mut normals: Vec<Vec3> = Vec::new();
    for face in &model.faces {
        if face.iter().all(|v| model.outer[*v as usize]) {
            let [a, b, c] = face.map(|v| vertices[v as usize]);
            middles.push(((a + b + c) / 3.0).to_array());
            normals.push((b - a).cross(c - a).normalize_or_zero());
        }
    }
    let tree = Nearest::new(&middles);
    (points.par_iter())
        .map(|point| {
            tree.one(&point.to_array()).map_or(0.0, |found| {
                (*point - Vec3::from(middles[found.at])).dot(normals[found.at])
            })
        })
        .collect()
}

/// How far the worse end of each Gaussian is from the skin, metres.
fn ends(model: &BodyModel, scan: &Scan, vertices: &[Vec3]) -> Vec<f32> {
    let mut points: Vec<[f32; 3]> = Vec::new();
    for face in &model.faces {
        if face.iter().all(|v| model.outer[*v as usize]) {
            let corners = face.map(|v| vertices[v as usize]);
            points.extend(corners.map(|v| v.to_array()));
            points.push((corners.iter().sum::<Vec3>() / 3.0).to_array());
        }
    }
    let tree = Nearest::new(&points);
    let distance = |point: Vec3| {
        let found = tree.one(&point.to_array());
        found.map_or(0.0, |found| found.squared.sqrt())
    };
    (0..scan.len())
        .into_par_iter()
        .map(|at| {
            let end = scan.longest(at) * END;
            let centre = scan.positions[at];
            distance(centre + end).max(distance(centre - end))
        })
        .collect()
}

/// `[N_v]` the body's colour at its vertices, continued from where it was not `[N]` closed in.
fn usual_colours(
    bound: &Bound,
    model: &BodyModel,
    closed_in: &[bool],
    vertices: &[DVec3],
) -> Vec<DVec3> {
    let mut sums = vec![(DVec3::ZERO, 0.0_f64); model.rest.len()];
    for at in (0..bound.scan.len()).filter(|at| !closed_in[*at] && bound.accessory[*at] == 0) {
        let weight = f64::from(bound.scan.opacities[at]);
        let corners = model.faces.get(bound.triangles[at] as usize);
        for v in corners.into_iter().flatten() {
            let sum = &mut sums[*v as usize];
            sum.0 += bound.scan.colours[at].as_dvec3() * weight;
            sum.1 += weight;
        }
    }
    let known: Vec<bool> = sums.iter().map(|(_, weight)| *weight > 0.5).collect();
    let colours: Vec<DVec3> = (sums.iter())
        .map(|(sum, weight)| *sum / weight.max(1e-9))
        .collect();
    let skin =
        (model.faces.iter().copied()).filter(|face| face.iter().all(|v| model.outer[*v as usize]));
    Edges::new(vertices, skin).fill(&colours, &known)
}
