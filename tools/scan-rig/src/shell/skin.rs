//! The colours of the face's skin: looked up in the scan along lines, continued where it shows none.

use super::additions::{brightness, median, smoothstep};
use super::harmonic::Edges;
use super::head::Head;
use super::lines::{Line, Lines};
use crate::body::BodyModel;
use crate::scan::Scan;
use glam::{DVec3, Vec3};

/// How far before and behind the shell the scan's Gaussians colour it, metres.
const LINE: (f32, f32) = (0.020, 0.014);

/// What is more than this before the shell hides it, metres.
const HIDDEN: f64 = 0.012;

/// What stays as it was scanned and is more than this before the skin, hair as a rule, is drawn before the shell again: it does not colour
/// it, metres.
const APART: f32 = 0.003;

/// Lids are in the shade of the brow, but no darker than this, of the cheeks' brightness.
const LID_SHADE: f64 = 0.65;
/// What is nearer to an eye's opening may be lashes, metres.
const OPENING: f64 = 0.005;

/// How much lighter a closed lid would be where it faces upwards.
const LID_FORM: f64 = 0.35;

/// How much of the cheeks' hue lids have.
const LID_HUE: f64 = 0.4;

/// Within this of an eye's joint, at its opening, only what looks like skin colours the lids, metres.
pub(super) const AROUND_EYE: f64 = 0.034;

/// Colours are looked for this far from the middle of the eyes, metres: beyond all that the shell covers.
pub(super) const REACH: f64 = 0.2;

/// Colours at the model's vertices, `[N_v]`, black away from the face.
#[derive(Debug)]
pub(super) struct SkinColours {
    /// Of all skin, brows and shade as the scan has them.
    pub(super) all: Vec<DVec3>,
    /// Around the eyes, continued from what is skin: what closed lids look like.
    pub(super) lids: Vec<DVec3>,
    /// The usual colour of the cheeks.
    pub(super) cheek: DVec3,
}

/// How much a colour is of skin like that of the cheeks, 0..=1: brows, shade and the white of an eye are less red, or darker.
pub(super) fn likeness(colour: DVec3, cheek: DVec3) -> f64 {
    let redness = |c: DVec3| (c.x - c.z) / brightness(c).max(0.02);
    let red = redness(colour) / redness(cheek).max(0.1);
    let bright = brightness(colour) / brightness(cheek).max(0.02);
    smoothstep(0.55, 0.8, red) * smoothstep(0.62, 0.82, bright)
}

/// What colours the shell.
#[derive(Debug)]
pub(super) struct Painter<'a> {
    pub(super) head: &'a Head,
    scan: &'a Scan,
    /// `[N_g]` which of the scan's Gaussians give way to the shell.
    gives_way: &'a [bool],
    lines: Lines<'a>,
}

impl<'a> Painter<'a> {
    pub(super) fn new(head: &'a Head, scan: &'a Scan, gives_way: &'a [bool]) -> Self {
        let reach = REACH * head.scale;
        let lines = Lines::new(scan, |at| {
            scan.positions[at].as_dvec3().distance(head.centre) < reach
        });
        Self {
            head,
            scan,
            gives_way,
            lines,
        }
    }

    /// How a viewer before the face looks at a place: between its normal and straight ahead.
    pub(super) fn line(&self, point: DVec3, normal: DVec3) -> Line {
        let ahead = self.head.forward();
        let towards = if normal.dot(ahead) > -0.3 {
            normal + 0.7 * ahead
        } else {
            normal
        };
        Line {
            point,
            towards_viewer: towards.normalize_or(ahead),
            before: LINE.0,
            behind: LINE.1,
        }
    }

    /// Colours and how far they can be trusted, 0..=1.
    pub(super) fn look(&self, lines: &[Line], normals: &[DVec3]) -> Vec<(DVec3, f64)> {
        let counts = |line: usize, gaussian: usize| {
            let Line {
                point,
                towards_viewer,
                ..
            } = &lines[line];
            let away = self.scan.positions[gaussian] - point.as_vec3();
            self.gives_way[gaussian] || away.dot(towards_viewer.as_vec3()) < APART
        };
        (self.lines.look(lines, counts).into_iter())
            .zip(lines.iter().zip(normals))
            .map(|(seen, (line, normal))| {
                let facing = smoothstep(0.3, 0.6, line.towards_viewer.dot(*normal));
                let covered = smoothstep(0.5, 0.85, f64::from(seen.coverage));
                let near = 1.0 - smoothstep(0.6 * HIDDEN, HIDDEN, f64::from(seen.height));
                (seen.colour.as_dvec3(), facing * covered * near)
            })
            .collect()
    }

    /// The skin's colour at the vertices of the head, filled in where it was not seen.
    pub(super) fn skin(
        &self,
        model: &BodyModel,
        vertices: &[DVec3],
        normals: &[DVec3],
    ) -> SkinColours {
        let head = self.head;
        let reach = REACH * head.scale;
        let near: Vec<usize> = (0..model.body_vertices)
            .filter(|v| vertices[*v].distance(head.centre) < reach)
            .collect();
        let lines: Vec<Line> = near
            .iter()
            .map(|v| self.line(vertices[*v], normals[*v]))
            .collect();
        let own: Vec<DVec3> = near.iter().map(|v| normals[*v]).collect();
        let mut colours = vec![DVec3::ZERO; vertices.len()];
        let mut known = vec![false; vertices.len()];
        for (v, (colour, trust)) in near.iter().zip(self.look(&lines, &own)) {
            let at_lid = head.lid[*v] > 0.2 && head.rim[*v] < OPENING * head.scale;
            if model.outer[*v] && trust > 0.6 && !at_lid {
                colours[*v] = colour;
                known[*v] = true;
            }
        }
        let faces = (model.faces.iter().copied()).filter(|face| {
            face.iter().all(|v| {
                (*v as usize) < model.body_vertices
                    && vertices[*v as usize].distance(head.centre) < reach
            })
        });
        let edges = Edges::new(vertices, faces);
        let cheeks: Vec<Vec3> = (near.iter())
            .filter(|v| {
                known[**v] && head.mouth[**v] > 0.0015 && head.rim[**v] > 0.006 * head.scale
            })
            .map(|v| colours[*v].as_vec3())
            .collect();
        let cheek = match cheeks.as_slice() {
            // A visor or a beard may hide them.
            [] => median(
                &(near.iter().filter(|v| known[**v]))
                    .map(|v| colours[*v].as_vec3())
                    .collect::<Vec<_>>(),
            ),
            cheeks => median(cheeks),
        };
        // What no colour reaches keeps this one.
        for v in (0..colours.len()).filter(|v| !known[*v]) {
            colours[v] = cheek;
        }
        let all = edges.fill(&colours, &known);
        // Beside an eye's opening the scan shows lashes, and the eye itself beside its place: lids continue the skin around, in its own shade.
        for v in &near {
            let aside =
                (head.eyes.iter()).any(|eye| eye.distance(vertices[*v]) < AROUND_EYE * head.scale);
            let at_opening = head.rim[*v] < OPENING * head.scale;
            known[*v] &= !aside || !at_opening || likeness(colours[*v], cheek) > 0.5;
        }
        let mut lids = edges.fill(&colours, &known);
        let shut: Vec<DVec3> = (vertices.iter().zip(&head.closing))
            .map(|(v, closing)| *v + *closing)
            .collect();
        let closed = super::normals::normals(&shut, &model.faces, |face| {
            model.faces[face]
                .iter()
                .all(|v| (*v as usize) < model.body_vertices)
        });
        for v in &near {
            let bright = brightness(lids[*v]);
            let shade = bright.max(LID_SHADE * brightness(cheek)) / bright.max(0.02);
            let usual = cheek * (bright / brightness(cheek).max(0.02));
            // Closed, a lid is round: more light falls on its upper part.
            let form = 1.0 + LID_FORM * head.lid[*v] * closed[*v].dot(head.axes.y_axis);
            lids[*v] = lids[*v].lerp(usual, LID_HUE) * shade * form;
        }
        SkinColours { all, lids, cheek }
    }
}
