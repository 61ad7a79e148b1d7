//! The registered head: its axes, how far expressions move and stretch each place, and where lips and lids are.

use super::additions::smoothstep;
use super::cells::Patch;
use super::normals::normals;
use super::place::Screen;
use crate::body::BodyModel;
use crate::body::Registered;
use glam::{DMat3, DVec2, DVec3};
use rayon::prelude::*;
use spmm3::Joint;

/// The widest that the jaw opens, radians, and the angle at which units of the mouth are tried.
const JAW: (f64, f64) = (0.28, 0.14);

/// Where units move the face farther than the first, it gets a shell; beyond the second, the scan's Gaussians give way to it. Metres at scale 1.
pub(crate) const SHELL: (f64, f64) = (0.0012, 0.003);

/// Where expressions stretch the face more than the first it gets a shell; beyond the second, the scan's Gaussians give way to it.
pub(crate) const STRETCHED: (f64, f64) = (1.3, 1.6);

/// What gives way was long: the shell continues this far under what stays, metres at scale 1.
const UNDERLAY: f64 = 0.036;

/// Quads are sized for no more than this much stretch.
const MOST_STRETCH: f64 = 8.0;

/// From the middle between the eyes, metres at scale 1: what is farther is not the face.
const FACE_RADIUS: f64 = 0.15;

/// Skin within this of an eyeball's centre gets a shell, metres at scale 1.
const AROUND_EYE: f64 = 0.022;

/// How far a vertex is lifted off the skin before it is tested for what is before it, metres.
const LIFT: f64 = 0.0003;

/// The head of a registered body, in the scan's pose.
#[derive(Debug)]
pub(crate) struct Head {
    /// Its axes as columns: to the person's left, up, forward.
    pub(crate) axes: DMat3,
    /// Uniform scale of the body model.
    pub(crate) scale: f64,
    /// The middle between the eyes, metres.
    pub(crate) centre: DVec3,
    /// The eyes' joints, left and right, metres.
    pub(crate) eyes: [DVec3; 2],
    /// `[N_v]` how far units of mouth and eyes move each vertex, metres.
    pub(crate) motion: Vec<f64>,
    /// `[N_v]` how much a vertex is of a lid that closes, 0..=1.
    pub(crate) lid: Vec<f64>,
    /// `[N_v]` how closing both eyes moves a vertex, metres.
    pub(crate) closing: Vec<DVec3>,
    /// `[N_v]` how far that is, as a share of the farthest.
    pub(crate) closes: Vec<f64>,
    /// `[N_v]` how much the units of the mouth move a vertex, metres.
    pub(crate) mouth: Vec<f64>,
    /// `[N_f / 2]` how far each quad's edges are stretched in the widest expression.
    pub(crate) stretch: Vec<DVec2>,
    /// `[N_v]` whether a vertex is skin that shows with open or closed lids: what a lid folds away is not the model's outside.
    pub(crate) shows: Vec<bool>,
    /// `[N_v]` whether a vertex is under where Gaussians that give way to the shell may have reached.
    pub(crate) underlay: Vec<bool>,
    /// `[N_v]` distance to the rim of the mouth's and the eyes' openings, metres; [`FAR`] away from the face.
    pub(crate) rim: Vec<f64>,
}

/// How far from the rims is what lies away from the face, metres: finite, since cells weigh it by shares that may be 0.
pub(super) const FAR: f64 = 1.0;

impl Head {
    /// `vertices`: the body model's, in the scan's pose.
    pub(crate) fn new(model: &BodyModel, registered: &Registered, vertices: &[DVec3]) -> Self {
        let axes = registered.rotations[Joint::Head.index()];
        let scale = registered.scale;
        let joint = |joint: Joint| registered.joints[joint.index()];
        let eyes = [Joint::LeftEye, Joint::RightEye].map(joint);
        let centre = 0.5 * (eyes[0] + eyes[1]);
        let count = model.rest.len();
        let (mut motion, mut lid, mut mouth) =
            (vec![0.0; count], vec![0.0; count], vec![0.0; count]);
        let near: Vec<bool> = (vertices.iter())
            .map(|v| v.distance(centre) < FACE_RADIUS * scale)
            .collect();
        for unit in &model.units {
            let closes = unit.name.starts_with("eye-") && unit.name.ends_with("-closure");
            let of_mouth = unit.name.starts_with("mouth");
            let of_eye = unit.name.starts_with("eye-");
            if !of_mouth && !of_eye {
                continue;
            }
            for (v, offset) in unit.offsets.iter().enumerate().take(model.body_vertices) {
                let length = offset.length() * scale;
                if near[v] && length > 0.0 {
                    motion[v] = f64::max(motion[v], length);
                    if of_mouth {
                        mouth[v] = f64::max(mouth[v], length);
                    }
                    if closes {
                        lid[v] = f64::max(lid[v], smoothstep(0.0012, 0.004, length));
                    }
                }
            }
        }
        // The skin around the eyes is before eyeballs and sockets: it has to be as opaque as they are.
        for eye in eyes {
            for v in (0..model.body_vertices).filter(|v| model.outer[*v]) {
                if vertices[v].distance(eye) < AROUND_EYE * scale {
                    motion[v] = motion[v].max(1.2 * SHELL.1 * scale);
                }
            }
        }
        let closing = closing(model, registered);
        let most = (closing.iter().take(model.body_vertices))
            .fold(1e-6, |most, offset| f64::max(most, offset.length()));
        let closes = closing
            .iter()
            .map(|offset| offset.length() / most)
            .collect();
        let stretch = stretch(model, registered, vertices, &near, &closing);
        let shows = shows(model, registered, vertices, &lid, centre);
        let rim = rim(model, vertices, &motion, &shows);
        let mut head = Self {
            axes,
            scale,
            centre,
            eyes,
            motion,
            lid,
            closing,
            closes,
            mouth,
            stretch,
            shows,
            underlay: Vec::new(),
            rim,
        };
        head.underlay = head.underlay(model, vertices);
        head
    }

    /// Whether units of mouth and eyes move all of a quad of the face, or stretch it, more than this.
    #[must_use]
    pub(crate) fn is_moved(
        &self,
        model: &BodyModel,
        quad: usize,
        motion: f64,
        stretched: f64,
    ) -> bool {
        let ring = corners(model, quad);
        let moves =
            |least: f64| (ring.iter()).all(|v| self.motion[*v as usize] > least * self.scale);
        moves(motion) || (moves(0.2 * motion) && self.stretch[quad].max_element() > stretched)
    }

    /// Whether the scan's Gaussians on a quad give way to the shell.
    #[must_use]
    pub(crate) fn is_core(&self, model: &BodyModel, quad: usize) -> bool {
        let own = |v: &u32| (*v as usize) < model.body_vertices;
        corners(model, quad).iter().all(own) && self.is_moved(model, quad, SHELL.1, STRETCHED.1)
    }

    fn underlay(&self, model: &BodyModel, vertices: &[DVec3]) -> Vec<bool> {
        let mut in_core = vec![false; vertices.len()];
        for quad in (0..model.faces.len() / 2).filter(|quad| self.is_core(model, *quad)) {
            for v in corners(model, quad) {
                in_core[v as usize] = model.outer[v as usize];
            }
        }
        let pairs = vertices.iter().zip(&in_core);
        let core: Vec<DVec3> = pairs.filter(|(_, core)| **core).map(|(v, _)| *v).collect();
        let reach = (UNDERLAY * self.scale).powi(2);
        let (far, out) = (1.3 * FACE_RADIUS * self.scale, &model.outer);
        (vertices.par_iter().enumerate())
            .map(|(v, at)| {
                v < model.body_vertices
                    && out[v]
                    && model.head_share(v) > 0.3
                    && at.distance(self.centre) < far
                    && core.iter().any(|core| core.distance_squared(*at) < reach)
            })
            .collect()
    }

    /// Where the person looks when looking ahead.
    #[must_use]
    pub(crate) fn forward(&self) -> DVec3 {
        self.axes.z_axis
    }

    /// A quad of the model as a patch.
    #[must_use]
    pub(crate) fn patch(&self, model: &BodyModel, vertices: &[DVec3], quad: usize) -> Patch {
        let [a, b, c, d] = corners(model, quad).map(|v| vertices[v as usize]);
        Patch {
            corners: [a, b, c, d],
            stretch: self.stretch[quad],
            first_triangle: u32::try_from(2 * quad).unwrap_or(u32::MAX),
        }
    }
}

/// The corners of a quad from its halves 012 and 023.
#[must_use]
pub(crate) fn corners(model: &BodyModel, quad: usize) -> [u32; 4] {
    let ([a, b, c], [_, _, d]) = (model.faces[2 * quad], model.faces[2 * quad + 1]);
    [a, b, c, d]
}

/// The vertices of the body model with one expression, in the scan's pose, metres: units by strength, and the jaw's angle in radians.
#[must_use]
pub(crate) fn expressed(
    model: &BodyModel,
    registered: &Registered,
    vertices: &[DVec3],
    units: &[(&str, f64)],
    jaw: f64,
) -> Vec<DVec3> {
    let axes = registered.rotations[Joint::Head.index()];
    let mut moved = vertices.to_vec();
    for (name, strength) in units {
        for unit in model.units.iter().filter(|unit| unit.name == *name) {
            for (vertex, offset) in moved.iter_mut().zip(&unit.offsets) {
                *vertex += axes * *offset * (registered.scale * strength);
            }
        }
    }
    if jaw != 0.0 {
        let pivot = registered.joints[Joint::Jaw.index()];
        let turn = DMat3::from_axis_angle(axes.x_axis, jaw);
        for (vertex, row) in moved.iter_mut().zip(&model.weights) {
            let weight = f64::from(row[Joint::Jaw.index()]);
            if weight > 0.0 {
                *vertex += weight * (pivot + turn * (*vertex - pivot) - *vertex);
            }
        }
    }
    moved
}

/// How the named expression that closes the eyes moves each vertex of the skin, in the scan's pose, metres.
fn closing(model: &BodyModel, registered: &Registered) -> Vec<DVec3> {
    let mut moved = vec![DVec3::ZERO; model.rest.len()];
    let (fields, presets) = model.expressions();
    let turn = registered.rotations[Joint::Head.index()] * registered.scale;
    if let Some(blink) = presets.get("blink") {
        for (field, coefficient) in fields.iter().zip(blink.coefficients) {
            for (moved, offset) in moved.iter_mut().zip(field) {
                *moved += turn * offset.as_dvec3() * f64::from(coefficient);
            }
        }
    }
    moved
}

/// How far each quad's edges are stretched at most, over how long they are.
fn stretch(
    model: &BodyModel,
    registered: &Registered,
    vertices: &[DVec3],
    near: &[bool],
    closing: &[DVec3],
) -> Vec<DVec2> {
    let quads = model.faces.len() / 2;
    let in_face: Vec<usize> = (0..quads)
        .filter(|quad| {
            corners(model, *quad)
                .iter()
                .all(|v| near.get(*v as usize) == Some(&true))
        })
        .collect();
    let lengths = |points: &[DVec3], quad: usize| {
        Patch::edges(corners(model, quad).map(|v| points[v as usize]))
    };
    let mut poses: Vec<(Option<&str>, f64)> = vec![(None, JAW.0)];
    for unit in &model.units {
        poses.push((Some(&unit.name), 0.0));
        if unit.name.starts_with("mouth") {
            poses.push((Some(&unit.name), JAW.1));
        }
    }
    let rest: Vec<DVec2> = in_face
        .iter()
        .map(|quad| lengths(vertices, *quad).max(DVec2::splat(1e-5)))
        .collect();
    let longest = poses
        .par_iter()
        .map(|(unit, jaw)| {
            let unit: Vec<(&str, f64)> = unit.iter().map(|name| (*name, 1.0)).collect();
            let posed = expressed(model, registered, vertices, &unit, *jaw);
            (in_face.iter().zip(&rest))
                .map(|(quad, rest)| lengths(&posed, *quad) / *rest)
                .collect::<Vec<DVec2>>()
        })
        .reduce(
            || vec![DVec2::ONE; in_face.len()],
            |a, b| a.iter().zip(&b).map(|(a, b)| a.max(*b)).collect(),
        );
    let shut: Vec<DVec3> = vertices.iter().zip(closing).map(|(v, c)| *v + *c).collect();
    let longest: Vec<DVec2> = (in_face.iter().zip(&rest).zip(longest))
        .map(|((quad, rest), longest)| longest.max(lengths(&shut, *quad) / *rest))
        .collect();
    let mut stretch = vec![DVec2::ONE; quads];
    for (quad, longest) in in_face.iter().zip(longest) {
        stretch[*quad] = longest.clamp(DVec2::ONE, DVec2::splat(MOST_STRETCH));
    }
    stretch
}

/// The model's outside, and what closed lids add to it.
fn shows(
    model: &BodyModel,
    registered: &Registered,
    vertices: &[DVec3],
    lid: &[f64],
    centre: DVec3,
) -> Vec<bool> {
    let shut = [("eye-left-closure", 1.0), ("eye-right-closure", 1.0)];
    let closed = expressed(model, registered, vertices, &shut, 0.0);
    let own = |face: usize| {
        model.faces[face]
            .iter()
            .all(|v| (*v as usize) < model.body_vertices)
    };
    let normals = normals(&closed, &model.faces, own);
    let screen = Screen::of(
        (0..model.faces.len())
            .filter(|face| own(*face))
            .map(|face| model.faces[face].map(|v| closed[v as usize]))
            .filter(|corners| corners[0].distance(centre) < 0.07 * registered.scale),
    );
    let forward = registered.rotations[Joint::Head.index()].z_axis;
    (0..vertices.len())
        .map(|v| {
            let hidden = || {
                screen
                    .first(closed[v] + (LIFT * registered.scale) * normals[v], forward)
                    .is_some()
            };
            let is_own = v < model.body_vertices;
            model.outer[v]
                || (is_own && lid[v] > 0.05 && normals[v].dot(forward) > 0.15 && !hidden())
        })
        .collect()
}

/// How far each vertex of the moving face is from the rims, where what is seen meets what is not.
fn rim(model: &BodyModel, vertices: &[DVec3], motion: &[f64], shows: &[bool]) -> Vec<f64> {
    let is_outer = |v: &u32| shows[*v as usize];
    let own = |face: &&[u32; 3]| face.iter().all(|v| (*v as usize) < model.body_vertices);
    let mut at_rim = vec![false; vertices.len()];
    for face in model.faces.iter().filter(own) {
        if !face.iter().all(is_outer) {
            for v in face.iter().filter(|v| is_outer(v)) {
                at_rim[*v as usize] = motion[*v as usize] > 0.0;
            }
        }
    }
    let pairs = vertices.iter().zip(&at_rim);
    let rims: Vec<DVec3> = pairs.filter(|(_, rim)| **rim).map(|(v, _)| *v).collect();
    (vertices.par_iter().zip(motion))
        .map(|(vertex, motion)| {
            if *motion <= 0.0 {
                return FAR;
            }
            (rims.iter())
                .map(|rim| rim.distance_squared(*vertex))
                .fold(FAR * FAR, f64::min)
                .sqrt()
        })
        .collect()
}
