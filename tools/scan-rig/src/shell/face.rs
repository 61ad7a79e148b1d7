//! The face as a thin shell: where units of mouth and eyes move it, the scan's Gaussians give way to finer ones on the body model, which take
//! their colours from the scan along lines through it.

use super::additions::{Additions, smoothstep};
use super::cells::Cell;
use super::head::{Head, SHELL, STRETCHED, corners};
use super::lines::Line;
use super::normals::normals;
use super::place::Screen;
use super::skin::{AROUND_EYE, Painter, REACH, SkinColours, likeness};
use crate::body::{BodyModel, BodyPart};
use crate::nearest::Nearest;
use crate::scan::Scan;
use glam::DVec3;

/// Where both show, the shell is this far under the surface, metres: the scan's own Gaussians are before it.
const UNDER: f64 = 0.0015;

/// Width of the shell's cells at the rims of lips and lids and away from them, metres, and the distances between which it changes.
const SPACING: [f64; 2] = [0.0011, 0.0024];
const RIM: [f64; 2] = [0.004, 0.020];

/// Width of the cells of what is behind lips and lids, metres.
const INSIDE_SPACING: f64 = 0.0026;

/// How deep under the face the scan's own Gaussians may lie, metres.
const MIST: f64 = 0.013;

/// What is farther from the head's middle is in a cheek's pocket, which no open mouth shows, metres.
const CHEEK: f64 = 0.034;

/// The mouth is within this of the teeth's middle, and this deep under the skin, metres.
const CAVITY: f64 = 0.08;
const IN_CAVITY: f64 = 0.016;

/// Lips are thin, and thinner in a smile: what is behind them is moved into the mouth by this, metres.
const BEHIND_LIPS: f64 = 0.003;

/// From the rims, the shell closes before what is inside, metres.
const LIPS: f64 = 0.016;

/// Lashes: shares of the most that closing the eyes moves, between which an edge is the upper lid's; distances from it, metres at scale 1,
/// between which they end; how dark they are.
const LASHES: (f64, f64) = (0.55, 0.8);
const LASH_WIDTH: (f64, f64) = (0.0006, 0.0022);
const LASH_DARK: f64 = 0.5;

/// What closing the eyes stretches by less than this share of a fold is painted as the scan shows it with open eyes.
const WHOLE: f64 = 0.8;

/// What is in a socket stays this far behind the skin around the eye, metres; what is before it by no more than the second, pokes out.
const BEHIND_SKIN: f64 = 0.0012;
const POKES_OUT: f64 = 0.008;

/// The colour deep in the mouth.
const THROAT: DVec3 = DVec3::new(0.10, 0.030, 0.030);

/// Opacity of the shell's Gaussians.
const OPACITY: f32 = 0.97;

/// The face's shell, and what it found out about the face.
#[derive(Debug)]
pub(crate) struct Face {
    pub(crate) additions: Additions,
    /// For each of them whether it shows in the neutral face, and has to look there as it was scanned.
    pub(crate) as_scanned: Vec<bool>,
    /// `[N_g]` which of the scan's Gaussians give way.
    pub(crate) drop: Vec<bool>,
    /// The usual colour of the cheeks.
    pub(crate) cheek: DVec3,
}

/// `[N_g]` which of the scan's Gaussians are in the mouth: an open mouth would show them before its back. `normals` are the skin's.
fn in_mouth(
    model: &BodyModel,
    head: &Head,
    (vertices, normals): (&[DVec3], &[DVec3]),
    scan: &Scan,
) -> Vec<bool> {
    let mut teeth = (DVec3::ZERO, 0.0);
    for (face, _) in (model.faces.iter().zip(&model.parts)).filter(|(_, p)| **p == BodyPart::Teeth)
    {
        teeth.0 += face.iter().map(|v| vertices[*v as usize]).sum::<DVec3>();
        teeth.1 += 3.0;
    }
    let middle = teeth.0 / f64::max(teeth.1, 1.0);
    let skin: Vec<usize> = (0..model.body_vertices)
        .filter(|v| model.outer[*v] && vertices[*v].distance(middle) < 2.0 * CAVITY * head.scale)
        .collect();
    let places: Vec<[f32; 3]> = (skin.iter())
        .map(|v| vertices[*v].as_vec3().to_array())
        .collect();
    let tree = Nearest::new(&places);
    let depth = |at: DVec3| {
        let nearest = skin[tree.one(&at.as_vec3().to_array())?.at];
        Some((vertices[nearest] - at).dot(normals[nearest]))
    };
    (scan.positions.iter())
        .map(|at| {
            let at = at.as_dvec3();
            at.distance(middle) < CAVITY * head.scale
                && depth(at).is_some_and(|depth| depth > IN_CAVITY * head.scale)
        })
        .collect()
}

/// Covers the face. `vertices` are the body model's in the scan's pose, `triangles` carry the scan's Gaussians.
pub(crate) fn cover(
    model: &BodyModel,
    head: &Head,
    vertices: &[DVec3],
    scan: &Scan,
    triangles: &[u32],
) -> Face {
    let reach = REACH * head.scale;
    let own = |face: usize| {
        model.faces[face]
            .iter()
            .all(|v| (*v as usize) < model.body_vertices)
    };
    let normals = normals(vertices, &model.faces, |face| {
        own(face) && is_skin(model, face)
    });
    let drop: Vec<bool> = (triangles
        .iter()
        .zip(in_mouth(model, head, (vertices, &normals), scan)))
    .map(|(face, in_mouth)| {
        let face = *face as usize;
        face < model.faces.len() && (in_mouth || head.is_core(model, face / 2))
    })
    .collect();
    let painter = Painter::new(head, scan, &drop);
    let skin = painter.skin(model, vertices, &normals);
    let outside: Vec<usize> = (0..model.body_vertices)
        .filter(|v| model.outer[*v] && vertices[*v].distance(head.centre) < reach)
        .collect();
    // What is inside is opaque: where the scan's own Gaussians lie over it, which are mist, it would show through them.
    let is_behind_scan = |quad: usize| {
        let middle = corners(model, quad)
            .iter()
            .map(|v| vertices[*v as usize])
            .sum::<DVec3>()
            / 4.0;
        let away = |v: &usize| vertices[*v].distance_squared(middle);
        let nearest = outside.iter().min_by(|a, b| away(a).total_cmp(&away(b)));
        nearest.is_some_and(|v| {
            let covered =
                head.motion[*v] > SHELL.1 * head.scale && head.rim[*v] < LIPS * head.scale;
            let beside = (middle - head.centre).dot(head.axes.x_axis).abs();
            let pocket =
                model.parts[2 * quad] == BodyPart::InnerMouth && beside > CHEEK * head.scale;
            !covered && (pocket || away(v).sqrt() < MIST * head.scale)
        })
    };
    let screen = Screen::of(
        (model.faces.iter())
            .filter(|face| face.iter().all(|v| model.outer[*v as usize]))
            .map(|face| face.map(|v| vertices[v as usize]))
            .filter(|[corner, ..]| {
                let eye = |eye: &DVec3| eye.distance(*corner) < AROUND_EYE * head.scale;
                head.eyes.iter().any(eye)
            }),
    );
    let pokes_out = |point: DVec3| {
        (screen.nearest(point, head.forward())).is_some_and(|height| {
            (-POKES_OUT * head.scale..BEHIND_SKIN * head.scale).contains(&height)
        })
    };
    let mut additions = Additions::default();
    let mut as_scanned = Vec::new();
    let mut cells = Vec::new();
    for quad in 0..model.faces.len() / 2 {
        if own(2 * quad) {
            cells.clear();
            let shows = corners(model, quad).iter().all(|v| head.shows[*v as usize]);
            match model.parts[2 * quad] {
                BodyPart::InnerMouth | BodyPart::EyeSocket if !shows && !is_behind_scan(quad) => {
                    inside(
                        model,
                        head,
                        vertices,
                        quad,
                        &skin,
                        &pokes_out,
                        &mut cells,
                        &mut additions,
                    );
                }
                BodyPart::InnerMouth | BodyPart::EyeSocket if !shows => {}
                _ => painter.shell(
                    model,
                    vertices,
                    &normals,
                    quad,
                    &skin,
                    &mut cells,
                    &mut additions,
                    &mut as_scanned,
                ),
            }
            as_scanned.resize(additions.len(), false);
        }
    }
    Face {
        additions,
        as_scanned,
        drop,
        cheek: skin.cheek,
    }
}

fn is_skin(model: &BodyModel, face: usize) -> bool {
    matches!(model.parts[face], BodyPart::Face | BodyPart::Head)
}

/// Values at a triangle's corners, weighed by a cell's shares.
fn at_cell<T>(model: &BodyModel, cell: &Cell, values: &[T]) -> T
where
    T: Copy + std::ops::Mul<f64, Output = T> + std::iter::Sum,
{
    let face = model.faces[cell.triangle as usize];
    face.iter()
        .zip(cell.shares)
        .map(|(v, share)| values[*v as usize] * share)
        .sum()
}

impl Painter<'_> {
    /// The shell on one quad, if units move it.
    #[expect(clippy::too_many_arguments, reason = "the mesh is three of them")]
    fn shell(
        &self,
        model: &BodyModel,
        vertices: &[DVec3],
        normals: &[DVec3],
        quad: usize,
        skin: &SkinColours,
        cells: &mut Vec<Cell>,
        additions: &mut Additions,
        as_scanned: &mut Vec<bool>,
    ) {
        let head = self.head;
        let ring = corners(model, quad).map(|v| v as usize);
        let least = |values: &[f64]| {
            ring.iter()
                .map(|v| values[*v])
                .fold(f64::INFINITY, f64::min)
        };
        let under_scan = is_skin(model, 2 * quad) && ring.iter().all(|v| head.underlay[*v]);
        if !under_scan && !head.is_moved(model, quad, SHELL.0, STRETCHED.0) {
            return;
        }
        let apart = smoothstep(RIM[0], RIM[1], least(&head.rim) / head.scale);
        let spacing = (SPACING[0] + apart * (SPACING[1] - SPACING[0])) * head.scale;
        head.patch(model, vertices, quad).cells(spacing, cells);
        let smooth: Vec<DVec3> = (cells.iter())
            .map(|cell| at_cell(model, cell, normals).normalize_or(cell.normal))
            .collect();
        let lines: Vec<Line> = (cells.iter().zip(&smooth))
            .map(|(cell, n)| self.line(cell.point, *n))
            .collect();
        for (cell, (seen, trust)) in cells.iter().zip(self.look(&lines, &smooth)) {
            let lid = at_cell(model, cell, &head.lid);
            let filled = at_cell(model, cell, &skin.all)
                .lerp(at_cell(model, cell, &skin.lids), smoothstep(0.02, 0.2, lid));
            let outer: f64 = (model.faces[cell.triangle as usize].iter().zip(cell.shares))
                .map(|(v, share)| {
                    if self.head.shows[*v as usize] {
                        share
                    } else {
                        0.0
                    }
                })
                .sum();
            let rim = at_cell(model, cell, &head.rim) / head.scale;
            // A lid near its rim shows the eye where the registration is off by a millimetre.
            let folded = smoothstep(1.4, 1.9, head.stretch[quad].max_element());
            let closes = at_cell(model, cell, &head.closes);
            // The scan's lashes are beside the open eye, and would stay there when it closes.
            let near_eye =
                (head.eyes.iter()).any(|eye| eye.distance(cell.point) < 0.022 * head.scale);
            let beside_eye = if near_eye {
                1.0 - smoothstep(0.003, 0.006, rim)
            } else {
                0.0
            };
            let eye_shows =
                smoothstep(0.1, 0.4, lid) * folded.max(1.0 - smoothstep(0.002, 0.0045, rim));
            let eye_shows = eye_shows.max(
                smoothstep(0.1, 0.3, lid).max(beside_eye) * (1.0 - likeness(seen, skin.cheek)),
            );
            let trust = trust * smoothstep(0.6, 0.95, outer) * (1.0 - eye_shows);
            let mut colour = filled.lerp(seen, trust);
            // Lashes: a dark line along the free edge of the upper lid, which moves most.
            let lash = smoothstep(LASHES.0, LASHES.1, closes)
                * (1.0 - smoothstep(LASH_WIDTH.0, LASH_WIDTH.1, rim));
            colour *= 1.0 - LASH_DARK * lash;
            let motion = smoothstep(
                SHELL.0,
                SHELL.1,
                at_cell(model, cell, &head.motion) / head.scale,
            );
            let stretched = smoothstep(STRETCHED.0, STRETCHED.1, head.stretch[quad].max_element());
            let under = UNDER * (1.0 - motion.max(stretched));
            additions.push(cell, -under, colour, OPACITY);
            as_scanned.resize(
                additions.len(),
                // Pictures show lashes, and the eye itself beside its place, near its opening; and shade where lids close: neither is skin.
                outer > 0.95
                    && beside_eye < 0.5
                    && (folded < WHOLE || lid < 0.15 && eye_shows < 0.1),
            );
        }
    }
}

/// What is behind lips and lids: dark, and darker the deeper.
#[expect(clippy::too_many_arguments, reason = "the mesh is three of them")]
fn inside(
    model: &BodyModel,
    head: &Head,
    vertices: &[DVec3],
    quad: usize,
    skin: &SkinColours,
    pokes_out: &impl Fn(DVec3) -> bool,
    cells: &mut Vec<Cell>,
    additions: &mut Additions,
) {
    head.patch(model, vertices, quad)
        .cells(INSIDE_SPACING * head.scale, cells);
    let mouth = model.parts[2 * quad] == BodyPart::InnerMouth;
    for cell in cells.iter() {
        if !mouth && pokes_out(cell.point) {
            continue;
        }
        let filled = at_cell(model, cell, &skin.all);
        let deep = at_cell(model, cell, &head.rim).min(0.1) / head.scale;
        let colour = if mouth {
            let lip = filled * DVec3::new(0.72, 0.55, 0.55);
            lip.lerp(THROAT, smoothstep(0.001, 0.010, deep))
                * (1.0 - 0.6 * smoothstep(0.010, 0.045, deep))
        } else {
            // Lids have an edge, which is skin.
            let edge = at_cell(model, cell, &skin.lids) * 0.85;
            edge.lerp(filled * 0.3, smoothstep(0.002, 0.006, deep))
        };
        let lift = if mouth {
            BEHIND_LIPS * head.scale * smoothstep(0.003, 0.009, deep)
        } else {
            0.0
        };
        additions.push(cell, lift, colour, OPACITY);
    }
}
