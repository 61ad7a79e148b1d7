//! Eyeballs that turn: placed behind the registered lids, painted with what the scan shows between them.

use super::additions::{Additions, brightness, median, smoothstep};
use super::cells::Cell;
use super::head::Head;
use super::lines::{Line, Lines};
use super::place::{Placement, Screen};
use crate::body::{BodyModel, BodyPart, Registered};
use crate::scan::Scan;
use glam::{DVec3, Vec3};
use spmm3::Joint;

/// Angular radii on the eyeball, radians.
const PUPIL: f64 = 0.19;
const IRIS: f64 = 0.46;

/// Skin within this of an eye's centre places it, metres in the rest pose.
const AROUND: f64 = 0.024;

/// Lids stay this far before the eyeball, metres, and it moves back for that by no more than the second.
const CLEARANCE: f64 = 0.0004;
const MOST_BACK: f64 = 0.006;

/// How small the eyeball may become to stay behind the lids, in steps, and what a metre of that costs over a metre of moving back.
const SMALLER: [f64; 4] = [1.0, 0.95, 0.90, 0.85];
const COST: f64 = 0.3;

/// How far the lids are closed where they have to clear the eyeball: they move along straight lines, which cut it off.
const CLOSING: [f64; 5] = [0.0, 0.3, 0.5, 0.75, 1.0];

/// Width of cells on the iris and beside it, metres.
const SPACING: [f64; 2] = [0.0006, 0.0013];

/// The person's gaze is no farther from straight ahead than this, radians.
const MOST_ASIDE: f64 = 0.3;

/// What the white of the eye is where the scan shows none, relative to the skin's brightness.
const WHITE: DVec3 = DVec3::new(1.30, 1.24, 1.20);

/// How much of the scan's own picture of the eye is kept.
const SCANNED: f64 = 0.6;

/// An eyeball in the scan's pose.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Eye {
    /// Its centre, around which it turns, metres.
    pub centre: DVec3,
    /// Its radius, metres.
    pub radius: f64,
    /// Unit direction in which it looks.
    pub gaze: DVec3,
}

/// Puts both eyeballs (left, right) behind the lids and covers them. `vertices` are the model's in the scan's pose; those of the
/// eyeballs are moved. `skin` is the colour of the face's skin.
#[expect(
    clippy::too_many_arguments,
    reason = "the registered body is three of them"
)]
pub(crate) fn cover(
    model: &BodyModel,
    registered: &Registered,
    shaped: (&[DVec3], &[DVec3]),
    head: &Head,
    vertices: &mut [DVec3],
    scan: &Scan,
    skin: DVec3,
    additions: &mut Additions,
) -> [Option<Eye>; 2] {
    let joints = [Joint::LeftEye, Joint::RightEye];
    let eyes = joints.map(|joint| place(model, registered, shaped, head, vertices, joint));
    let reach = 0.06 * head.scale;
    let lines = Lines::new(scan, |at| {
        let position = scan.positions[at].as_dvec3();
        eyes.iter()
            .flatten()
            .any(|eye| eye.centre.distance(position) < reach)
    });
    let mut cells: [Vec<Cell>; 2] = Default::default();
    for quad in 0..model.faces.len() / 2 {
        let first = model.faces[2 * quad][0] as usize;
        if model.parts[2 * quad] != BodyPart::Eyes {
            continue;
        }
        for (side, joint) in joints.iter().enumerate() {
            if model.weights[first][joint.index()] <= 0.5 {
                continue;
            }
            if let Some(eye) = &eyes[side] {
                let patch = head.patch(model, vertices, quad);
                let middle = patch.corners.iter().sum::<DVec3>() / 4.0 - eye.centre;
                let ahead = middle.angle_between(head.forward());
                if ahead < 1.75 {
                    let spacing = if ahead < 0.65 { SPACING[0] } else { SPACING[1] };
                    patch.cells(spacing * head.scale, &mut cells[side]);
                }
            }
        }
    }
    let spots: [Vec<Spot>; 2] = std::array::from_fn(|side| {
        eyes[side].map_or_else(Vec::new, |eye| {
            spots_of(model, head, vertices, &lines, &eye, &cells[side])
        })
    });
    let gaze = gaze(head, &spots);
    let paint = Paint::new(&spots, gaze, skin);
    eyes.map(|eye| eye.map(|eye| Eye { gaze, ..eye }))
        .into_iter()
        .enumerate()
        .for_each(|(side, _)| {
            for (cell, spot) in cells[side].iter().zip(&spots[side]) {
                additions.push(cell, 0.0, paint.colour(spot, gaze, head), 0.98);
            }
        });
    eyes.map(|eye| eye.map(|eye| Eye { gaze, ..eye }))
}

/// Puts one eyeball behind its lids.
fn place(
    model: &BodyModel,
    registered: &Registered,
    (shaped, joints): (&[DVec3], &[DVec3]),
    head: &Head,
    vertices: &mut [DVec3],
    joint: Joint,
) -> Option<Eye> {
    let own: Vec<usize> = (model.body_vertices..model.rest.len())
        .filter(|v| model.weights[*v][joint.index()] > 0.5)
        .collect();
    let at_rest = *joints.get(joint.index())?;
    let placement = Placement::around(model, registered, shaped, at_rest, AROUND, |v| {
        head.lid[v] > 0.05
    })?;
    let mut centre = placement.point(at_rest);
    for v in &own {
        vertices[*v] = placement.point(shaped[*v]);
    }
    let mut distances: Vec<f64> = own.iter().map(|v| vertices[*v].distance(centre)).collect();
    distances.sort_unstable_by(f64::total_cmp);
    let radius = *distances.get(distances.len() / 2)?;
    // What of the lids is inside of the ball, along the line of sight.
    let forward = head.forward();
    let clearance = CLEARANCE * head.scale;
    let before = skin_before(model, head, vertices, centre, radius);
    let mut lids: Vec<DVec3> = Vec::with_capacity(CLOSING.len() * before.len());
    for share in CLOSING {
        lids.extend(
            before
                .iter()
                .map(|v| vertices[*v] + share * head.closing[*v]),
        );
    }
    let back = |centre: DVec3, radius: f64| {
        (lids.iter().map(|lid| *lid - centre))
            .filter(|away| away.dot(forward) > 0.2 * radius)
            .map(|away| {
                let beside = away - forward * away.dot(forward);
                let ball = ((radius + clearance).powi(2) - beside.length_squared())
                    .max(0.0)
                    .sqrt();
                ball - away.dot(forward)
            })
            .fold(0.0, f64::max)
            .min(MOST_BACK * head.scale)
    };
    // Smaller about its front, which stays.
    let smaller = |share: f64| (centre + forward * (radius * (1.0 - share)), radius * share);
    let tried = SMALLER.map(|share| {
        let (centre, own) = smaller(share);
        let back = back(centre, own);
        (back + COST * (radius - own), share, back)
    });
    let (_, share, back) = (tried.into_iter()).min_by(|a, b| a.0.total_cmp(&b.0))?;
    let (front, radius) = smaller(share);
    for v in &own {
        vertices[*v] = front + share * (vertices[*v] - centre) - forward * back;
    }
    centre = front - forward * back;
    centre.is_finite().then_some(Eye {
        centre,
        radius,
        gaze: forward,
    })
}

/// The vertices of the skin before an eyeball that shows with open or closed lids.
fn skin_before(
    model: &BodyModel,
    head: &Head,
    vertices: &[DVec3],
    centre: DVec3,
    radius: f64,
) -> Vec<usize> {
    (0..model.body_vertices)
        .filter(|v| head.shows[*v] && vertices[*v].distance(centre) < 1.4 * radius)
        .collect()
}

/// What the scan shows at a cell of an eyeball.
#[derive(Debug, Clone, Copy)]
struct Spot {
    /// Unit direction from the eyeball's centre.
    direction: DVec3,
    colour: DVec3,
    /// Whether the cell is between the lids and the scan shows something there.
    shows: bool,
}

fn spots_of(
    model: &BodyModel,
    head: &Head,
    vertices: &[DVec3],
    lines: &Lines<'_>,
    eye: &Eye,
    cells: &[Cell],
) -> Vec<Spot> {
    let screen = Screen::new(model, vertices, eye.centre, 2.0 * eye.radius);
    let forward = head.forward();
    let rays: Vec<Line> = cells
        .iter()
        .map(|cell| Line {
            point: cell.point,
            towards_viewer: forward,
            before: 0.012,
            behind: 0.014,
        })
        .collect();
    (lines.look(&rays, |_, _| true).into_iter().zip(cells))
        .map(|(seen, cell)| {
            let covered =
                (screen.nearest(cell.point, forward)).is_some_and(|height| height > -0.001);
            Spot {
                direction: (cell.point - eye.centre).normalize_or(forward),
                colour: seen.colour.as_dvec3(),
                shows: !covered && seen.coverage > 0.7 && cell.normal.dot(forward) > 0.2,
            }
        })
        .collect()
}

/// Where both eyes look: towards the middle of what is dark between the lids.
fn gaze(head: &Head, spots: &[Vec<Spot>; 2]) -> DVec3 {
    let forward = head.forward();
    let mut aside = DVec3::ZERO;
    for spots in spots {
        let shown: Vec<(f64, DVec3)> = (spots.iter())
            .filter(|spot| spot.shows)
            .map(|spot| (brightness(spot.colour), spot.direction))
            .collect();
        let mut sorted: Vec<f64> = shown.iter().map(|(b, _)| *b).collect();
        sorted.sort_unstable_by(f64::total_cmp);
        let at = |share: usize| {
            sorted
                .get(sorted.len() * share / 100)
                .copied()
                .unwrap_or_default()
        };
        let (dark, bright) = (at(10), at(85));
        if shown.len() < 40 || bright - dark < 0.12 {
            return forward;
        }
        let weighed = shown
            .iter()
            .map(|(b, d)| ((dark + 0.4 * (bright - dark) - b).max(0.0), *d));
        let (weight, sum) = weighed.fold((0.0, DVec3::ZERO), |(w, s), (weight, d)| {
            (w + weight, s + weight * d)
        });
        if weight > 0.0 {
            aside += 0.5 * (sum / weight).reject_from(forward);
        }
    }
    // Lids hide the iris above and below: what is left of it says less about the height.
    let up = head.axes.y_axis;
    aside -= 0.6 * up * aside.dot(up);
    let aside = aside.clamp_length_max(MOST_ASIDE);
    (forward * (1.0 - aside.length_squared()).max(0.0).sqrt() + aside).normalize_or(forward)
}

/// Colours of an eye.
#[derive(Debug, Clone, Copy)]
struct Paint {
    white: DVec3,
    iris: DVec3,
    /// How much more red than blue the skin is.
    redness: f64,
}

impl Paint {
    fn new(spots: &[Vec<Spot>; 2], gaze: DVec3, skin: DVec3) -> Self {
        let between = |low: f64, high: f64| -> Vec<Vec3> {
            (spots.iter().flatten())
                .filter(|spot| {
                    spot.shows && (low..high).contains(&spot.direction.angle_between(gaze))
                })
                .map(|spot| spot.colour.as_vec3())
                .collect()
        };
        let bright = brightness(skin).clamp(0.1, 0.75);
        let usual = (WHITE * bright).min(DVec3::splat(0.93));
        let mut beside = between(IRIS + 0.08, 1.2);
        beside.retain(|c| f64::from(c.x - c.z) < 0.6 * (skin.x - skin.z).max(0.05));
        beside
            .sort_unstable_by(|a, b| brightness(b.as_dvec3()).total_cmp(&brightness(a.as_dvec3())));
        beside.truncate(beside.len() / 2);
        let white = if beside.len() < 12 {
            usual
        } else {
            usual.lerp(median(&beside), 0.6)
        };
        let within = between(PUPIL + 0.04, IRIS - 0.04);
        let iris = if within.len() < 12 {
            DVec3::new(0.30, 0.22, 0.15) * (bright / 0.5)
        } else {
            median(&within)
        };
        let redness = (skin.x - skin.z).max(0.05);
        Self {
            white,
            iris,
            redness,
        }
    }

    fn colour(&self, spot: &Spot, gaze: DVec3, head: &Head) -> DVec3 {
        let angle = spot.direction.angle_between(gaze);
        let limbus = 1.0 - 0.45 * smoothstep(IRIS - 0.12, IRIS - 0.02, angle);
        let iris = self.iris * limbus;
        let pupil = DVec3::splat(0.03).lerp(self.iris * 0.3, 0.2);
        let ball = self.white * (1.0 - 0.25 * smoothstep(0.6, 1.3, angle));
        let painted = (pupil.lerp(iris, smoothstep(PUPIL - 0.03, PUPIL + 0.03, angle)))
            .lerp(ball, smoothstep(IRIS - 0.03, IRIS + 0.04, angle));
        // The upper lid's shade.
        let shade = 1.0 - 0.25 * smoothstep(0.15, 0.6, spot.direction.dot(head.axes.y_axis));
        if spot.shows {
            // Where the registration is off by a millimetre, the line meets a lid: skin is redder than the white of an eye.
            let red = (spot.colour.x - spot.colour.z) / self.redness;
            let is_lid = smoothstep(0.5, 0.9, red) * smoothstep(IRIS - 0.05, IRIS + 0.1, angle);
            (painted * shade).lerp(spot.colour, SCANNED * (1.0 - is_lid))
        } else {
            painted * shade
        }
    }
}
