//! What hung between two parts of the body as the scan stood: between arm and flank no view looked well, and Gaussians there have the
//! colours of what was behind. Once the arm is lifted they show: what is off the body is left out, what is long is shortened, and what is
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

/// Bounds as those of [`CLOSED_IN`], by other skin or a thing, for mist beside what is closed in, metres.
const BETWEEN_FAR: (f32, f32) = (0.09, 0.05);

/// A Gaussian whose second longest standard deviation is more is mist where it stands off the skin, metres: beside what is closed in, and
/// between two parts, where as much as [`OFF_AS_MIST`] off its triangle is too far for mist.
const MIST: f32 = 0.008;
const MIST_BETWEEN: f32 = 0.005;
const OFF_AS_MIST: f32 = 0.006;

/// Mist farther off its triangle than this, between two parts, is under the skin in one pose and out of it in another, metres.
const DEEP: f32 = 0.022;

/// Of a thing, one in so many Gaussians of more opacity than this is looked at.
const THINNED: usize = 3;
const SOLID: f32 = 0.3;

/// Between two parts, what is farther off its triangle than the first is left out, and what is farther off than the second is no skin's
/// colour, metres.
const OFF: f32 = 0.012;
const BESIDE: f32 = 0.004;

/// How much lighter than the body around such a Gaussian may be, and one that is outside of the skin beside what is closed in.
const LIGHTER: f64 = 0.15;
const MUCH_LIGHTER: f64 = 0.3;

/// Where a Gaussian ends, in standard deviations, how much farther off the body its end may be in T-pose, metres, elsewhere and between two
/// parts, and how much it may be shortened.
const END: f32 = 2.0;
const STANDS_OFF: [f32; 2] = [0.018, 0.004];
const SHORTEST: f32 = 0.2;

/// Gaussians on vertices that are the head's by more than this stay as they are: the face has a shell of its own.
const HEADS_SHARE: f64 = 0.5;

/// What was found.
#[derive(Debug, Clone, PartialEq, Default)]
pub(crate) struct Stray {
    /// `[N_v]` whether a vertex of the body was closed in as the scan stood.
    pub(crate) opens: Vec<bool>,
    /// Gaussians left out.
    pub(crate) dropped: usize,
    /// Gaussians shortened.
    pub(crate) shortened: usize,
    /// Gaussians in the colour of the body around.
    pub(crate) repainted: usize,
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
    let of_things: Vec<usize> = (0..bound.scan.len())
        .filter(|at| bound.accessory[*at] != 0 && bound.scan.opacities[*at] > SOLID)
        .step_by(THINNED)
        .collect();
    let of =
        |scan: &Scan| -> Vec<Vec3> { of_things.iter().map(|at| scan.positions[*at]).collect() };
    let opens = opening(model, [&here, &there], [&of(&bound.scan), &of(&posed)]);
    let is_body = |at: usize| {
        let face = bound.triangles[at] as usize;
        bound.accessory[at] == 0
            && (model.faces.get(face))
                .is_some_and(|corners| model.head_share(corners[0] as usize) < HEADS_SHARE)
    };
    let is_on = |opens: &[bool], at: usize| {
        (model.faces.get(bound.triangles[at] as usize))
            .is_some_and(|corners| corners.iter().any(|v| opens[*v as usize]))
    };
    let body: Vec<bool> = (0..bound.scan.len()).map(is_body).collect();
    let on = |opens: &[bool]| -> Vec<bool> {
        (body.iter().enumerate())
            .map(|(at, body)| *body && is_on(opens, at))
            .collect()
    };
    let (between, beside) = (on(&opens.near), on(&opens.far));
    let (ends_here, ends_there) = (ends(model, &bound.scan, &here), ends(model, &posed, &there));
    let colours = around(bound, model, &between, &rest.vertices[..model.rest.len()]);
    let outside = outside(model, &posed.positions, &there);
    let mut stray = Stray::default();
    let mut keep = vec![true; bound.scan.len()];
    for at in (0..bound.scan.len()).filter(|at| body[*at]) {
        let off = carried.offsets[at].length();
        // What lies as deep under the skin does not show. A Gaussian that its neighbours moved to another part of the body is beside its
        // triangle, not over it, and outside of the skin all the same.
        let corners = model.faces[bound.triangles[at] as usize].map(|v| there[v as usize]);
        let normal = (corners[1] - corners[0]).cross(corners[2] - corners[0]);
        let height = (posed.positions[at] - corners[0]).dot(normal.normalize_or_zero());
        let is_outside = outside[at] > 0.6 * OFF;
        let scales = bound.scan.scales[at];
        let width = scales.element_sum() - scales.max_element() - scales.min_element();
        let is_stray = (between[at] && (is_outside || height > 0.4 * OFF))
            || (beside[at] && is_outside && width > MIST);
        let stands_off = off > OFF_AS_MIST && outside[at] > 0.6 * OFF_AS_MIST;
        let is_mist = between[at] && width > MIST_BETWEEN && (stands_off || off > DEEP);
        if (off > OFF && is_stray) || is_mist {
            keep[at] = false;
            stray.dropped += 1;
            continue;
        }
        let grown = ends_there[at] - ends_here[at];
        let most = STANDS_OFF[usize::from(between[at])];
        if grown > most {
            let scales = &mut bound.scan.scales[at];
            let longest = scales.max_element();
            let share = (most / grown).clamp(SHORTEST, 1.0);
            *scales = scales.min(Vec3::splat(longest * share));
            stray.shortened += 1;
        }
        let lighter = if between[at] && off > BESIDE {
            Some(LIGHTER)
        } else if beside[at] && stands_off {
            Some(MUCH_LIGHTER)
        } else {
            None
        };
        if let Some(lighter) = lighter {
            let face = model.faces[bound.triangles[at] as usize];
            let usual = face.iter().map(|v| colours[*v as usize]).sum::<DVec3>() / 3.0;
            if brightness(bound.scan.colours[at].as_dvec3()) > brightness(usual) + lighter {
                bound.scan.colours[at] = usual.as_vec3();
                stray.repainted += 1;
            }
        }
    }
    bound.retain(&keep);
    stray.opens = opens.near;
    Ok(stray)
}

/// `[N_v]` which vertices of the skin are closed in by what moves away from them.
struct Opening {
    /// By [`CLOSED_IN`].
    near: Vec<bool>,
    /// By [`BETWEEN_FAR`].
    far: Vec<bool>,
}

/// Which vertices of the skin are near other skin, or a thing, in the scan's pose that is far in T-pose. Both are in the two poses: first the
/// scan's.
fn opening(
    model: &BodyModel,
    [here, there]: [&[Vec3]; 2],
    [things_here, things_there]: [&[Vec3]; 2],
) -> Opening {
    let outer: Vec<usize> = (0..model.body_vertices)
        .filter(|v| model.outer[*v])
        .collect();
    let of = |vertices: &[Vec3]| -> Vec<Vec3> { outer.iter().map(|v| vertices[*v]).collect() };
    let (here, there) = (of(here), of(there));
    let skin = InTwoPoses {
        scanned: &here,
        straight: &there,
    };
    let things = InTwoPoses {
        scanned: things_here,
        straight: things_there,
    };
    let bounds = [CLOSED_IN, BETWEEN_FAR];
    let (from_skin, from_things) = (
        come_apart(skin, skin, bounds),
        come_apart(skin, things, bounds),
    );
    let mut opening = Opening {
        near: vec![false; model.rest.len()],
        far: vec![false; model.rest.len()],
    };
    for ((v, skin), thing) in outer.iter().zip(from_skin).zip(from_things) {
        opening.near[*v] = skin[0] || thing[0];
        opening.far[*v] = skin[1] || thing[1];
    }
    opening
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

/// The colour of the body at its vertices, continued from where it was not closed in.
fn around(bound: &Bound, model: &BodyModel, between: &[bool], vertices: &[DVec3]) -> Vec<DVec3> {
    let mut sums = vec![(DVec3::ZERO, 0.0_f64); model.rest.len()];
    for at in (0..bound.scan.len()).filter(|at| !between[*at] && bound.accessory[*at] == 0) {
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
