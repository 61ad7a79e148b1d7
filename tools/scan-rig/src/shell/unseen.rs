//! Triangles that no view showed get Gaussians of their size, in colours that continue from around them, with their grain.

use super::additions::Additions;
use super::cells::{Cell, Patch};
use super::harmonic::Edges;
use super::head::corners;
use super::lines::{Line, Lines, Seen};
use super::normals::normals;
use super::shown::shown;
use crate::RigError;
use crate::bind::Bound;
use crate::body::{BodyModel, BodyPart, Registered};
use glam::{DVec2, DVec3, Vec3};
use serde::Serialize;

/// A triangle that is covered less than this, 0..=1, has a hole; one that is covered more than the second has a colour to continue.
const COVERED: (f32, f32) = (0.5, 0.85);

/// Of a head only what is covered less than this has a hole: its mist of long Gaussians is thin, but shows more than a filling does.
const HEAD_COVERED: f32 = 0.05;

/// How far before and behind a triangle Gaussians cover it, metres.
const LINE: (f32, f32) = (0.05, 0.04);

/// Width of the cells, metres: of hands, of all else.
const SPACING: [f64; 2] = [0.004, 0.007];

/// How far under the mesh the filling lies, metres: what is seen of the scan is before it.
const UNDER: f64 = 0.004;

/// Other poses stretch triangles: cells are this much larger than in the T-pose.
const STRETCH: f64 = 1.25;

/// Rounds that smooth the colours that are continued: what is left over is grain.
const SMOOTHING: usize = 6;

/// How much of the grain is taken over.
const GRAIN: f64 = 0.6;

/// How much of the body is covered with Gaussians in the T-pose, each triangle seen along its normal.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize)]
pub struct CoverageReport {
    /// The share of the body's skin (by area, in the T-pose) that had holes.
    pub open_before: f64,
    /// The share of it that has holes now.
    pub open_after: f64,
    /// Gaussians that were added.
    pub added: usize,
}

/// The mesh in T-pose and what covers each of its faces.
struct Covered {
    vertices: Vec<DVec3>,
    outer: Vec<bool>,
    /// `[N_f]` whether the scan shows it.
    shown: Vec<bool>,
    /// `[N_f]` the coverage under which a face has a hole.
    least: Vec<f32>,
    /// `[N_f]` mean coverage and colour.
    seen: Vec<(f32, DVec3)>,
    /// `[N_f]` square metres.
    areas: Vec<f64>,
    /// `[N_g]` the scan's Gaussians in T-pose.
    positions: Vec<Vec3>,
}

/// Says how much is covered, and covers what is not if `fill` says which vertices were closed in as the scan stood (colours are not
/// continued from there), but for faces of hands that stay as they were scanned (`is_stiff`): the model's fingers may be elsewhere.
pub(crate) fn complete(
    bound: &mut Bound,
    model: &BodyModel,
    registered: &Registered,
    fill: Option<&[bool]>,
    is_stiff: impl Fn(usize) -> bool,
) -> Result<CoverageReport, RigError> {
    let covered = Covered::new(bound, model, registered, shown(bound, model), |_| true)?;
    let (open, all) = covered.open();
    let mut report = CoverageReport {
        open_before: open / all.max(1e-12),
        open_after: open / all.max(1e-12),
        added: 0,
    };
    if let Some(closed_in) = fill {
        let additions = filling(bound, model, &covered, closed_in, is_stiff);
        report.added = additions.len();
        super::join(bound, additions);
        let shown = covered.shown.clone();
        let after = Covered::new(bound, model, registered, shown, |face| {
            covered.has_hole(face)
        })?;
        report.open_after = after.open().0 / all.max(1e-12);
    }
    Ok(report)
}

impl Covered {
    fn new(
        bound: &Bound,
        model: &BodyModel,
        registered: &Registered,
        shown: Vec<bool>,
        take: impl Fn(usize) -> bool,
    ) -> Result<Self, RigError> {
        let rest = bound.rest(model, registered)?;
        let vertices = rest.vertices;
        let single: Vec<Vec3> = vertices.iter().map(|v| v.as_vec3()).collect();
        let posed =
            bound
                .carried()
                .posed(&bound.scan, &bound.triangles, &bound.mesh.faces, &single);
        let faces = &bound.mesh.faces;
        let outer: Vec<bool> = (0..model.faces.len())
            .map(|face| {
                let skin = !matches!(
                    model.parts[face],
                    BodyPart::InnerMouth
                        | BodyPart::EyeSocket
                        | BodyPart::Eyes
                        | BodyPart::Teeth
                        | BodyPart::Tongue
                );
                skin && take(face) && faces[face].iter().all(|v| model.outer[*v as usize])
            })
            .collect();
        let turned: Vec<(DVec3, f64)> = (faces.iter())
            .map(|face| {
                let [a, b, c] = face.map(|v| vertices[v as usize]);
                let cross = (b - a).cross(c - a);
                (cross.normalize_or_zero(), 0.5 * cross.length())
            })
            .collect();
        let smooth = normals(&vertices, faces, |_| true);
        const SAMPLES: [[f64; 3]; 4] = [
            [1.0 / 3.0, 1.0 / 3.0, 1.0 / 3.0],
            [0.70, 0.15, 0.15],
            [0.15, 0.70, 0.15],
            [0.15, 0.15, 0.70],
        ];
        let mut lines = Vec::new();
        let mut face_of = Vec::new();
        for face in (0..outer.len()).filter(|face| outer[*face]) {
            for shares in SAMPLES {
                let weigh = |values: &[DVec3]| -> DVec3 {
                    (faces[face].iter().zip(shares))
                        .map(|(v, share)| values[*v as usize] * share)
                        .sum()
                };
                lines.push(Line {
                    point: weigh(&vertices),
                    towards_viewer: weigh(&smooth).normalize_or(turned[face].0),
                    before: LINE.0,
                    behind: LINE.1,
                });
                face_of.push(face);
            }
        }
        let index = Lines::new(&posed, |at| bound.accessory[at] == 0);
        let found: Vec<Seen> = index.look(&lines, |line, gaussian| {
            let carrier = bound.triangles[gaussian] as usize;
            turned[carrier].0.dot(turned[face_of[line]].0) > 0.0
        });
        let mut seen = vec![(0.0_f32, DVec3::ZERO); outer.len()];
        for (samples, faces) in found
            .chunks(SAMPLES.len())
            .zip(face_of.chunks(SAMPLES.len()))
        {
            let coverage: f32 = samples.iter().map(|s| s.coverage).sum();
            let colour: DVec3 = samples
                .iter()
                .map(|s| s.colour.as_dvec3() * f64::from(s.coverage))
                .sum();
            seen[faces[0]] = (
                coverage / samples.len() as f32,
                colour / f64::from(coverage.max(1e-6)),
            );
        }
        Ok(Self {
            areas: turned
                .iter()
                .take(outer.len())
                .map(|(_, area)| *area)
                .collect(),
            vertices,
            outer,
            shown,
            least: (model.parts.iter())
                .map(|part| {
                    if matches!(part, BodyPart::Face | BodyPart::Head) {
                        HEAD_COVERED
                    } else {
                        COVERED.0
                    }
                })
                .collect(),
            seen,
            positions: posed.positions,
        })
    }

    fn has_hole(&self, face: usize) -> bool {
        self.outer[face] && !self.shown[face] && self.seen[face].0 < self.least[face]
    }

    /// The area with holes, and all of it, square metres.
    fn open(&self) -> (f64, f64) {
        let (mut open, mut all) = (0.0, 0.0);
        for face in (0..self.outer.len()).filter(|face| self.outer[*face]) {
            all += self.areas[face];
            if self.has_hole(face) {
                open += self.areas[face];
            }
        }
        (open, all)
    }
}

/// The Gaussians that close the holes.
fn filling(
    bound: &Bound,
    model: &BodyModel,
    covered: &Covered,
    closed_in: &[bool],
    is_stiff: impl Fn(usize) -> bool,
) -> Additions {
    let faces = &model.faces;
    let count = covered.vertices.len();
    let mut sums = vec![(DVec3::ZERO, 0.0_f64); count];
    let mut open = vec![false; count];
    for face in (0..faces.len()).filter(|face| covered.outer[*face]) {
        let (coverage, colour) = covered.seen[face];
        for v in faces[face] {
            if coverage > COVERED.1 {
                let sum = &mut sums[v as usize];
                sum.0 += colour * covered.areas[face];
                sum.1 += covered.areas[face];
            } else if covered.has_hole(face) {
                open[v as usize] = true;
            }
        }
    }
    let known: Vec<bool> = (0..count)
        .map(|v| sums[v].1 > 0.0 && !open[v] && closed_in.get(v) != Some(&true))
        .collect();
    let colours: Vec<DVec3> = sums
        .iter()
        .map(|(sum, weight)| *sum / weight.max(1e-12))
        .collect();
    let outer = (0..faces.len())
        .filter(|face| covered.outer[*face])
        .map(|face| faces[face]);
    let edges = Edges::new(&covered.vertices, outer);
    let continued = edges.fill(&colours, &known);
    let smooth = edges.smoothed(&continued, SMOOTHING);
    let grain = Grain::new(bound, model, covered, &edges, &known, &smooth);
    let mut additions = Additions::default();
    let mut rng = fastrand::Rng::with_seed(0x5ca1_ab1e);
    let mut cells: Vec<Cell> = Vec::new();
    for quad in 0..faces.len() / 2 {
        let halves = [2 * quad, 2 * quad + 1];
        if is_stiff(halves[0]) || !halves.iter().any(|face| covered.has_hole(*face)) {
            continue;
        }
        cells.clear();
        let patch = Patch {
            corners: corners(model, quad).map(|v| covered.vertices[v as usize]),
            stretch: DVec2::splat(STRETCH),
            first_triangle: u32::try_from(2 * quad).unwrap_or(u32::MAX),
        };
        let fine = matches!(model.parts[2 * quad], BodyPart::Hand | BodyPart::Face);
        patch.cells(STRETCH * SPACING[usize::from(!fine)], &mut cells);
        for cell in &cells {
            let face = faces[cell.triangle as usize];
            let colour: DVec3 = (face.iter().zip(cell.shares))
                .map(|(v, share)| continued[*v as usize] * share)
                .sum();
            let nearest = face[usize::from(cell.shares[1] > cell.shares[0])];
            let colour = colour + GRAIN * grain.pick(nearest, &mut rng);
            let at = |vertices: &[DVec3]| face.map(|v| vertices[v as usize]);
            let carried = cell.carried(at(&covered.vertices), at(&bound.mesh.vertices));
            additions.push(&carried, -UNDER, colour, 0.95);
        }
    }
    additions
}

/// How the colours of Gaussians differ from the smooth colour of where they are.
struct Grain {
    /// For each vertex the known one that is nearest.
    source: Vec<Option<u32>>,
    /// Differences at each vertex, by where they begin.
    starts: Vec<u32>,
    differences: Vec<Vec3>,
}

impl Grain {
    fn new(
        bound: &Bound,
        model: &BodyModel,
        covered: &Covered,
        edges: &Edges,
        known: &[bool],
        smooth: &[DVec3],
    ) -> Self {
        let mut entries: Vec<(u32, Vec3)> = Vec::new();
        for (gaussian, face) in bound.triangles.iter().enumerate() {
            let face_at = *face as usize;
            let is_skin = face_at < model.faces.len()
                && covered.outer[face_at]
                && bound.accessory[gaussian] == 0;
            if !is_skin || bound.scan.opacities[gaussian] < 0.5 {
                continue;
            }
            let at = covered.positions[gaussian].as_dvec3();
            let nearest = (model.faces[face_at].into_iter())
                .min_by(|a, b| {
                    let away = |v: &u32| covered.vertices[*v as usize].distance_squared(at);
                    away(a).total_cmp(&away(b))
                })
                .unwrap_or_default();
            if known[nearest as usize] {
                let difference = bound.scan.colours[gaussian] - smooth[nearest as usize].as_vec3();
                entries.push((
                    nearest,
                    difference.clamp(Vec3::splat(-0.2), Vec3::splat(0.2)),
                ));
            }
        }
        entries.sort_by_key(|(vertex, _)| *vertex);
        let mut starts = vec![0_u32; edges.vertices() + 1];
        for (vertex, _) in &entries {
            starts[*vertex as usize + 1] += 1;
        }
        for k in 1..starts.len() {
            starts[k] += starts[k - 1];
        }
        Self {
            source: edges.reached(known),
            starts,
            differences: entries.into_iter().map(|(_, d)| d).collect(),
        }
    }

    /// A difference from near the vertex, at random.
    fn pick(&self, vertex: u32, rng: &mut fastrand::Rng) -> DVec3 {
        let roll = rng.usize(..);
        let Some(source) = self.source[vertex as usize] else {
            return DVec3::ZERO;
        };
        let source = source as usize;
        let own = &self.differences[self.starts[source] as usize..self.starts[source + 1] as usize];
        if own.is_empty() {
            return DVec3::ZERO;
        }
        own[roll % own.len()].as_dvec3()
    }
}
