//! Hands: fingers that move where the scan shows an open hand, hands that stay as they are, or the body model's in the person's colours.

use super::additions::{Additions, brightness, median};
use super::cells::{Cell, Patch};
use super::head::corners;
use super::lines::{Line, Lines};
use super::normals::normals;
use super::textures::Textures;
use crate::bind::Bound;
use crate::body::{BodyModel, BodyPart, Registered, SkinRow, posing};
use glam::{DVec2, DVec3, Vec3};
use serde::Serialize;
use spmm3::{JOINTS, Joint};

/// What to do with a hand.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Hands {
    /// Its fingers move if it was open and empty; else it stays as it was scanned.
    #[default]
    AsSeen,
    /// It stays as it was scanned, and moves with the wrist.
    Keep,
    /// The body model's hand in the scan's colours, whose fingers move.
    Replace,
}

/// What became of a hand.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Hand {
    /// It moves with the wrist.
    #[default]
    Rigid,
    /// Its fingers move, as they were scanned.
    Moving,
    /// It is the body model's.
    Replaced,
}

/// What was found out about a hand.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize)]
pub struct HandReport {
    /// What became of it.
    pub became: Hand,
    /// How straight its fingers are: 1 for a flat hand, about 0.5 for a fist.
    pub straight: f64,
    /// How sure its finger joints are, 0..=1.
    pub confidence: f64,
    /// The share of the registered fingers' skin that is where the scan has Gaussians, 0..=1.
    pub fingers: f64,
    /// Whether it holds something.
    pub holds: bool,
    /// The scan's Gaussians on it.
    pub gaussians: usize,
}

/// Fingers this straight, of joints this sure, on this many Gaussians move.
const STRAIGHT: f64 = 0.85;
const SURE: f64 = 0.5;
const ENOUGH: usize = 300;

/// And if this much of the registered fingers is covered by the scan, each triangle by what is within the line's ends of it, metres.
const SEEN: f64 = 0.8;
const LINE: (f32, f32) = (0.005, 0.005);

/// The skin of a hand of which nothing was seen, of a person whose face was not seen either.
const UNSEEN_SKIN: DVec3 = DVec3::new(0.60, 0.45, 0.37);

/// Share of hand and fingers in a vertex's weights from which it is replaced, and over which the replacement blends in.
const HAND: (f64, f64) = (0.6, 0.95);

/// Width of cells, metres.
const SPACING: f64 = 0.0022;

/// Poses stretch a finger's skin: cells are this much larger.
const STRETCH: f64 = 1.2;

/// How much of the skin texture's contrast is taken over.
const DETAIL: f64 = 0.8;

/// The joints of both hands: left, right.
const SIDES: [HandJoints; 2] = [
    HandJoints {
        wrist: Joint::LeftWrist,
        first: Joint::LeftIndex1 as usize,
    },
    HandJoints {
        wrist: Joint::RightWrist,
        first: Joint::RightIndex1 as usize,
    },
];

/// Whether a face of the model is on a hand that stays as it was scanned.
pub(crate) fn is_rigid(model: &BodyModel, hands: &[HandReport; 2], face: usize) -> bool {
    (SIDES.iter().zip(hands))
        .any(|(hand, report)| report.became == Hand::Rigid && hand.has_face(model, face))
}

/// Decides on both hands and does it: left, right. `cheek` is the colour of the face's skin, where it is known.
#[expect(clippy::too_many_arguments, reason = "the body is three of them")]
pub(crate) fn complete(
    bound: &mut Bound,
    model: &BodyModel,
    registered: &Registered,
    textures: &Textures,
    wanted: [Hands; 2],
    cheek: Option<DVec3>,
    additions: &mut Additions,
    drop: &mut [bool],
) -> [HandReport; 2] {
    let mut reports = [HandReport::default(); 2];
    for (side, hand) in SIDES.into_iter().enumerate() {
        let on_it: Vec<usize> = (0..bound.triangles.len())
            .filter(|at| {
                bound.accessory[*at] == 0 && hand.has_face(model, bound.triangles[*at] as usize)
            })
            .collect();
        let report = &mut reports[side];
        report.straight = hand.straight(registered);
        report.confidence = hand
            .fingers()
            .map(|j| registered.confidence[j])
            .sum::<f64>()
            / 15.0;
        report.holds = (bound.report.accessories.iter()).any(|thing| {
            thing.joint == hand.wrist || hand.fingers().any(|j| j == thing.joint.index())
        });
        report.gaussians = on_it.len();
        report.fingers = hand.fingers_seen(bound, model, &on_it);
        let open = report.straight > STRAIGHT
            && report.confidence > SURE
            && report.fingers > SEEN
            && !report.holds
            && on_it.len() > ENOUGH;
        report.became = match wanted[side] {
            Hands::Keep => Hand::Rigid,
            Hands::Replace => Hand::Replaced,
            Hands::AsSeen if open => Hand::Moving,
            Hands::AsSeen => Hand::Rigid,
        };
        if report.became != Hand::Rigid {
            hand.free_fingers(bound, model);
        }
        if report.became == Hand::Replaced {
            let colours: Vec<Vec3> = (on_it.iter())
                .filter(|at| bound.scan.opacities[**at] > 0.4)
                .map(|at| bound.scan.colours[*at])
                .collect();
            for at in &on_it {
                drop[*at] = true;
            }
            let skin = match colours.as_slice() {
                // A hand in a pocket shows nothing.
                [] => cheek.unwrap_or(UNSEEN_SKIN),
                colours => median(colours),
            };
            hand.replace(bound, model, registered, textures, skin, additions);
        }
    }
    reports
}

/// The joints of a hand.
#[derive(Debug, Clone, Copy)]
struct HandJoints {
    wrist: Joint,
    /// Number of the first of its 15 finger joints.
    first: usize,
}

impl HandJoints {
    fn fingers(self) -> std::ops::Range<usize> {
        self.first..(self.first + 15).min(JOINTS)
    }

    fn share(self, row: &SkinRow) -> f64 {
        f64::from(row[self.wrist.index()]) + self.finger_share(row)
    }

    fn finger_share(self, row: &SkinRow) -> f64 {
        self.fingers().map(|j| f64::from(row[j])).sum()
    }

    fn has_face(self, model: &BodyModel, face: usize) -> bool {
        (model.faces.get(face)).is_some_and(|corners| {
            corners
                .iter()
                .all(|v| self.share(&model.weights[*v as usize]) > HAND.0)
        })
    }

    /// Distance from the wrist to the last joint over the bones' length, the mean of index, middle and ring finger: 1 for straight ones.
    fn straight(self, registered: &Registered) -> f64 {
        let at = |joint: usize| registered.joints[joint];
        // The order of SMPL-X: index, middle, pinky, ring, thumb.
        let fingers = [0, 1, 3].map(|finger| self.first + 3 * finger);
        let sum: f64 = fingers
            .iter()
            .map(|first| {
                let [wrist, a, b, c] = [self.wrist.index(), *first, first + 1, first + 2].map(at);
                let bones = wrist.distance(a) + a.distance(b) + b.distance(c);
                wrist.distance(c) / bones.max(1e-6)
            })
            .sum();
        sum / fingers.len() as f64
    }

    /// How much of the registered fingers the scan's Gaussians cover. Of a fist that was registered as an open hand, little.
    fn fingers_seen(self, bound: &Bound, model: &BodyModel, on_it: &[usize]) -> f64 {
        let fingers = (model.faces.iter()).filter(|face| {
            let is_finger = |v: &u32| {
                model.outer[*v as usize] && self.finger_share(&model.weights[*v as usize]) > 0.7
            };
            face.iter().all(is_finger)
        });
        let lines: Vec<Line> = fingers
            .filter_map(|face| {
                let [a, b, c] = face.map(|v| bound.mesh.vertices[v as usize]);
                let towards_viewer = (b - a).cross(c - a).try_normalize()?;
                Some(Line {
                    point: (a + b + c) / 3.0,
                    towards_viewer,
                    before: LINE.0,
                    behind: LINE.1,
                })
            })
            .collect();
        let mut own = vec![false; bound.scan.len()];
        for at in on_it {
            own[*at] = true;
        }
        let seen = Lines::new(&bound.scan, |at| own[at]).look(&lines, |_, _| true);
        let covered = seen.iter().filter(|seen| seen.coverage > 0.5).count();
        covered as f64 / lines.len().max(1) as f64
    }

    /// Gives fingers back the weights that binding gave to the wrist.
    fn free_fingers(self, bound: &mut Bound, model: &BodyModel) {
        for (v, own) in model.weights.iter().enumerate() {
            let fingers = self.finger_share(own);
            if fingers <= 0.0 {
                continue;
            }
            let mut row = bound.mesh.weights[v];
            let all: f64 = f64::from(row[self.wrist.index()]) + self.finger_share(&row);
            let whole = self.share(own).max(1e-9);
            row[self.wrist.index()] = share(all * f64::from(own[self.wrist.index()]) / whole);
            for j in self.fingers() {
                row[j] = share(all * f64::from(own[j]) / whole);
            }
            bound.mesh.weights[v] = posing::kept(&row).dense();
        }
    }

    /// Puts the model's hand in the place of the scan's. Its fingers are bent as they were registered, so that it is straight in T-pose.
    fn replace(
        self,
        bound: &mut Bound,
        model: &BodyModel,
        registered: &Registered,
        textures: &Textures,
        skin: DVec3,
        additions: &mut Additions,
    ) {
        let (shaped, joints) = model.shaped(&registered.shape);
        let maps = posing::posed_from_rest(
            &registered.rotations,
            &registered.joints,
            registered.scale,
            &joints,
        );
        for (v, row) in model.weights.iter().enumerate() {
            let hand = self.share(row);
            if hand > HAND.0 {
                let own =
                    posing::blended(&bound.mesh.weights[v], &maps).transform_point3(shaped[v]);
                let blend = super::additions::smoothstep(HAND.0, HAND.1, hand);
                let vertex = &mut bound.mesh.vertices[v];
                *vertex = vertex.lerp(own, blend);
            }
        }
        let is_hand =
            |face: usize| self.has_face(model, face) && model.parts[face] == BodyPart::Hand;
        let texel = |cell: &Cell| {
            let uv: DVec2 = (model.uvs[cell.triangle as usize].iter().zip(cell.shares))
                .map(|(uv, share)| uv.as_dvec2() * share)
                .sum();
            textures.colour(BodyPart::Hand, uv.as_vec2())
        };
        let normals = normals(&shaped, &model.faces, |_| true);
        let mut cells = Vec::new();
        for quad in 0..model.faces.len() / 2 {
            if is_hand(2 * quad) || is_hand(2 * quad + 1) {
                let patch = Patch {
                    corners: corners(model, quad).map(|v| shaped[v as usize] * registered.scale),
                    stretch: DVec2::splat(STRETCH),
                    first_triangle: u32::try_from(2 * quad).unwrap_or(u32::MAX),
                };
                patch.cells(STRETCH * SPACING, &mut cells);
            }
        }
        let texels: Vec<DVec3> = cells.iter().map(texel).collect();
        let usual = texels.iter().sum::<DVec3>() / texels.len().max(1) as f64;
        for (cell, texel) in cells.iter().zip(texels) {
            let face = model.faces[cell.triangle as usize];
            let normal: DVec3 = (face.iter().zip(cell.shares))
                .map(|(v, share)| normals[*v as usize] * share)
                .sum();
            // The back of the hand is up in the rest pose: a little light from above.
            let light = 0.94 + 0.08 * normal.normalize_or_zero().y;
            let detail =
                (texel / usual.max(DVec3::splat(0.05))).clamp(DVec3::splat(0.5), DVec3::splat(1.4));
            // Gloves have no nails and knuckles.
            let is_skin = skin.x > skin.z + 0.04 && brightness(skin) > 0.1;
            let detail = if is_skin {
                DVec3::ONE.lerp(detail, DETAIL)
            } else {
                DVec3::ONE
            };
            let at = |vertices: &[DVec3], scale: f64| face.map(|v| vertices[v as usize] * scale);
            let carried =
                cell.carried(at(&shaped, registered.scale), at(&bound.mesh.vertices, 1.0));
            additions.push(&carried, 0.0, skin * detail * light, 0.97);
        }
    }
}

#[expect(clippy::cast_possible_truncation, reason = "a share of 1")]
fn share(value: f64) -> f32 {
    value as f32
}
