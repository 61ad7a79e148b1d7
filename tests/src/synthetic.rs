//! A small puppet made in code: a whole avatar for tests, without downloads.
//!
//! Tubes around the bones of an SMPL-X-sized skeleton in T-pose, smooth skinning weights, Gaussians spread over the
//! surface, and small random networks whose effect is visible (centimetres) yet tame. The same size gives the same puppet.

use glam::{Mat3, Quat, Vec2, Vec3};
use spmm3::networks::{
    AttributeNetwork, DeformGraph, Dense, MeshNetwork, QuantisedBases, QuantisedDecoder,
};
use spmm3::{
    ATTRIBUTES, Avatar, BoundGaussians, Controllers, EXPRESSION, EdgeGraph, ExpressionPreset,
    Expressions, GaussianSet, INFLUENCES, JOINTS, Joint, MotionParams, PARAMS, SH_C0, Skeleton,
    SkinWeights, Template, attribute,
};

/// How large a puppet is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct PuppetSize {
    /// Multiplies rings and segments of every tube; vertices grow with its square (about 860 at 1, 20,700 at 5).
    pub detail: usize,
    /// N_g.
    pub gaussians: usize,
    /// Number of controllers.
    pub controllers: usize,
    /// Hidden units of one controller.
    pub controller_hidden: usize,
    /// B.
    pub bases: usize,
    /// Hidden units of F_mesh.
    pub mesh_hidden: usize,
    /// Offset fields of F_mesh.
    pub rank: usize,
}

impl PuppetSize {
    /// For tests: a few hundred vertices, 2,000 Gaussians, 16 controllers.
    pub const SMALL: Self = Self {
        detail: 1,
        gaussians: 2_000,
        controllers: 16,
        controller_hidden: 4,
        bases: 5,
        mesh_hidden: 24,
        rank: 8,
    };
    /// As large as the demo person: for benches and package sizes.
    pub const FULL: Self = Self {
        detail: 5,
        gaussians: 60_000,
        controllers: 500,
        controller_hidden: 8,
        bases: 15,
        mesh_hidden: 256,
        rank: 64,
    };
}

/// All parts of the puppet, consistent with each other.
#[derive(Debug, Clone)]
pub struct Puppet {
    /// 55 joints in T-pose.
    pub skeleton: Skeleton,
    /// Tubes and their weights.
    pub template: Template,
    /// The template's surface with the tubes joined, as the controllers were tied on.
    pub surface: EdgeGraph,
    /// Pairs of vertices that join the tubes in [`Self::surface`].
    pub bridges: Vec<(u32, u32)>,
    /// The Gaussians in the template's space, before binding.
    pub at_rest: GaussianSet,
    /// The Gaussians bound to the tubes, rounded as a package keeps them.
    pub gaussians: BoundGaussians,
    /// Controllers and virtual masses.
    pub controllers: Controllers,
    /// F_mesh.
    pub mesh: MeshNetwork,
    /// F_attr.
    pub attributes: AttributeNetwork,
    /// `smile`, `blink` and `a`.
    pub expressions: Expressions,
}

impl Puppet {
    /// Makes the puppet.
    ///
    /// # Panics
    /// If the parts do not fit each other: a bug here or in `spmm3`.
    #[must_use]
    pub fn new(size: PuppetSize) -> Self {
        let rest = rest_positions();
        let skeleton = Skeleton::new(rest).expect("the skeleton is finite");
        let mut surface = Surface::default();
        for limb in limbs(&rest) {
            surface.add(&limb, &rest, size.detail);
        }
        let Surface {
            vertices,
            faces,
            skin,
            bridges,
            colours,
        } = surface;
        let template = Template::new(vertices, faces, skin).expect("the tubes are a template");
        let mut random = Random::new(17);
        let (at_rest, triangles, barycentrics) =
            scatter(&template, &colours, size.gaussians, &mut random);
        let gaussians = BoundGaussians::bind(&template, &at_rest, triangles, barycentrics)
            .expect("the Gaussians hang on the template")
            .quantised();
        let surface = EdgeGraph::new(&template, &bridges);
        let seats = spread(template.vertices(), size.controllers);
        let controllers = Controllers::tie(&template, &surface, &gaussians, seats)
            .expect("the controllers sit on the template");
        Self {
            mesh: mesh_network(&template, size, &mut random),
            attributes: attribute_network(size, &mut random),
            skeleton,
            surface,
            bridges,
            at_rest,
            gaussians,
            controllers,
            expressions: expressions(),
            template,
        }
    }

    /// The small puppet.
    #[must_use]
    pub fn small() -> Self {
        Self::new(PuppetSize::SMALL)
    }

    /// The parts of the deform graph.
    #[must_use]
    pub fn graph(&self) -> DeformGraph<'_> {
        DeformGraph {
            template: &self.template,
            controllers: &self.controllers,
            mesh: &self.mesh,
            attributes: &self.attributes,
        }
    }

    /// The puppet as an avatar, ready to be saved.
    ///
    /// # Panics
    /// If the networks do not fit: a bug here.
    #[must_use]
    pub fn avatar(&self) -> Avatar {
        Avatar {
            name: "puppet".into(),
            provenance: "made in code by the tests".into(),
            licence: "CC0-1.0".into(),
            skeleton: self.skeleton.clone(),
            template: self.template.clone(),
            gaussians: self.gaussians.clone(),
            controllers: self.controllers.clone(),
            expressions: self.expressions.clone(),
            deform_graph: self.graph().to_onnx().expect("the networks fit"),
            report: serde_json::json!({ "vertices": self.template.vertices().len(), "error_mm": 0.1 + 0.2 }),
        }
    }
}

/// A seeded source of numbers (splitmix64), the same on every machine.
#[derive(Debug, Clone)]
pub struct Random(u64);

impl Random {
    /// Starts the sequence of `seed`.
    #[must_use]
    pub fn new(seed: u64) -> Self {
        Self(seed)
    }

    /// The next 64 random bits.
    pub fn bits(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    /// A whole number below `bound`, which must not be 0.
    pub fn below(&mut self, bound: usize) -> usize {
        usize::try_from(self.bits() >> 1).unwrap_or(0) % bound
    }

    /// A number in 0..1.
    pub fn unit(&mut self) -> f32 {
        (self.bits() >> 40) as f32 / (1u64 << 24) as f32
    }

    /// A number in -1..1.
    pub fn signed(&mut self) -> f32 {
        2.0 * self.unit() - 1.0
    }

    /// A roughly normal number with standard deviation 1.
    pub fn normal(&mut self) -> f32 {
        (0..12).map(|_| self.unit()).sum::<f32>() - 6.0
    }

    /// A vector in the cube -1..1.
    pub fn vector(&mut self) -> Vec3 {
        Vec3::new(self.signed(), self.signed(), self.signed())
    }

    /// Motion with every joint bent by up to `reach` radians about each axis, and every expression in play.
    pub fn motion(&mut self, reach: f32) -> MotionParams {
        let mut motion = MotionParams::default();
        for joint in Joint::ALL {
            motion.set_axis_angle(joint, self.vector() * reach);
        }
        for coefficient in motion.expression_mut() {
            *coefficient = self.signed();
        }
        motion.root_translation = self.vector();
        motion
    }
}

/// T-pose positions of a man of 1.75 m, metres, standing on y = 0.
fn rest_positions() -> [Vec3; JOINTS] {
    let left: [(Joint, [f32; 3]); 26] = [
        (Joint::LeftHip, [0.090, 0.890, 0.000]),
        (Joint::LeftKnee, [0.105, 0.490, 0.005]),
        (Joint::LeftAnkle, [0.105, 0.085, -0.030]),
        (Joint::LeftFoot, [0.115, 0.025, 0.095]),
        (Joint::LeftCollar, [0.050, 1.390, -0.020]),
        (Joint::LeftShoulder, [0.175, 1.420, -0.020]),
        (Joint::LeftElbow, [0.440, 1.420, -0.030]),
        (Joint::LeftWrist, [0.690, 1.420, -0.030]),
        (Joint::LeftEye, [0.032, 1.615, 0.085]),
        (Joint::LeftIndex1, [0.790, 1.420, -0.002]),
        (Joint::LeftIndex2, [0.824, 1.418, 0.002]),
        (Joint::LeftIndex3, [0.848, 1.415, 0.003]),
        (Joint::LeftMiddle1, [0.796, 1.422, -0.027]),
        (Joint::LeftMiddle2, [0.830, 1.420, -0.028]),
        (Joint::LeftMiddle3, [0.856, 1.416, -0.029]),
        (Joint::LeftPinky1, [0.773, 1.413, -0.072]),
        (Joint::LeftPinky2, [0.793, 1.410, -0.077]),
        (Joint::LeftPinky3, [0.810, 1.407, -0.081]),
        (Joint::LeftRing1, [0.787, 1.418, -0.050]),
        (Joint::LeftRing2, [0.818, 1.416, -0.053]),
        (Joint::LeftRing3, [0.843, 1.413, -0.055]),
        (Joint::LeftThumb1, [0.722, 1.408, 0.002]),
        (Joint::LeftThumb2, [0.748, 1.400, 0.027]),
        (Joint::LeftThumb3, [0.772, 1.396, 0.043]),
        (Joint::Neck, [0.0, 1.450, -0.020]),
        (Joint::Head, [0.0, 1.545, 0.010]),
    ];
    let middle: [(Joint, [f32; 3]); 5] = [
        (Joint::Pelvis, [0.0, 0.950, 0.000]),
        (Joint::Spine1, [0.0, 1.060, -0.010]),
        (Joint::Spine2, [0.0, 1.180, -0.015]),
        (Joint::Spine3, [0.0, 1.250, -0.005]),
        (Joint::Jaw, [0.0, 1.550, 0.030]),
    ];
    let mut rest = [Vec3::ZERO; JOINTS];
    for (joint, position) in left.into_iter().chain(middle) {
        let position = Vec3::from_array(position);
        rest[joint.index()] = position;
        if let Some(twin) = joint.name().strip_prefix("left_") {
            let name = format!("right_{twin}");
            if let Some(right) = Joint::ALL.into_iter().find(|j| j.name() == name) {
                rest[right.index()] = position * Vec3::new(-1.0, 1.0, 1.0);
            }
        }
    }
    let eyes = rest[Joint::LeftEye.index()] * Vec3::new(-1.0, 1.0, 1.0);
    rest[Joint::RightEye.index()] = eyes;
    rest
}

/// A tube along a bent line.
struct Limb {
    /// Points of the line and the tube's two radii there: across and the other way, metres.
    line: Vec<(Vec3, Vec2)>,
    rings: usize,
    segments: usize,
    /// Joints that may move it.
    joints: Vec<Joint>,
    colour: Vec3,
}

const SKIN: Vec3 = Vec3::new(0.80, 0.60, 0.50);
const JACKET: Vec3 = Vec3::new(0.16, 0.27, 0.42);
const JEANS: Vec3 = Vec3::new(0.20, 0.22, 0.30);
const WHITE: Vec3 = Vec3::new(0.92, 0.92, 0.92);

/// All tubes; the first is the torso, which the others are joined to.
fn limbs(rest: &[Vec3; JOINTS]) -> Vec<Limb> {
    use Joint::*;
    let at = |joint: Joint| rest[joint.index()];
    let point = |joint: Joint, across: f32, other: f32| (at(joint), Vec2::new(across, other));
    let mut limbs = vec![
        Limb {
            line: vec![
                (Vec3::new(0.0, 0.86, 0.0), Vec2::new(0.15, 0.10)),
                point(Pelvis, 0.17, 0.12),
                point(Spine1, 0.145, 0.11),
                point(Spine3, 0.165, 0.12),
                (Vec3::new(0.0, 1.40, -0.02), Vec2::new(0.14, 0.09)),
                (Vec3::new(0.0, 1.455, -0.02), Vec2::new(0.06, 0.06)),
            ],
            rings: 11,
            segments: 12,
            joints: vec![
                Pelvis,
                Spine1,
                Spine2,
                Spine3,
                LeftCollar,
                RightCollar,
                Neck,
            ],
            colour: JACKET,
        },
        Limb {
            line: vec![
                (at(Neck) - Vec3::Y * 0.02, Vec2::new(0.055, 0.055)),
                (at(Head) + Vec3::Y * 0.005, Vec2::new(0.06, 0.07)),
                (Vec3::new(0.0, 1.62, 0.015), Vec2::new(0.076, 0.095)),
                (Vec3::new(0.0, 1.70, 0.005), Vec2::new(0.068, 0.085)),
                (Vec3::new(0.0, 1.745, 0.0), Vec2::new(0.035, 0.04)),
            ],
            rings: 8,
            segments: 12,
            joints: vec![Neck, Head, Jaw],
            colour: SKIN,
        },
    ];
    let sides = [
        (
            [LeftCollar, LeftShoulder, LeftElbow, LeftWrist],
            [LeftHip, LeftKnee, LeftAnkle, LeftFoot],
            LeftEye,
            LeftIndex1.index(),
            1.0,
        ),
        (
            [RightCollar, RightShoulder, RightElbow, RightWrist],
            [RightHip, RightKnee, RightAnkle, RightFoot],
            RightEye,
            RightIndex1.index(),
            -1.0,
        ),
    ];
    for (arm, leg, eye, fingers, side) in sides {
        let out = Vec3::X * side;
        limbs.push(Limb {
            line: vec![
                (at(arm[1]) - out * 0.06, Vec2::new(0.065, 0.07)),
                point(arm[1], 0.06, 0.06),
                point(arm[2], 0.045, 0.045),
                (at(arm[3]) - out * 0.02, Vec2::new(0.032, 0.03)),
                (at(arm[3]) + out * 0.05, Vec2::new(0.018, 0.045)),
                (at(arm[3]) + out * 0.105, Vec2::new(0.014, 0.042)),
            ],
            rings: 12,
            segments: 8,
            joints: arm.to_vec(),
            colour: JACKET,
        });
        limbs.push(Limb {
            line: vec![
                (at(leg[0]) + Vec3::Y * 0.03, Vec2::new(0.085, 0.09)),
                point(leg[0], 0.085, 0.09),
                point(leg[1], 0.058, 0.06),
                point(leg[2], 0.042, 0.045),
                (
                    at(leg[2]) + Vec3::new(0.0, -0.045, 0.02),
                    Vec2::new(0.045, 0.045),
                ),
                (at(leg[3]) + Vec3::Z * 0.03, Vec2::new(0.045, 0.025)),
            ],
            rings: 11,
            segments: 8,
            joints: [&[Pelvis], &leg[..]].concat(),
            colour: JEANS,
        });
        limbs.push(Limb {
            line: vec![
                (at(eye) - Vec3::Z * 0.012, Vec2::splat(0.008)),
                (at(eye), Vec2::splat(0.013)),
                (at(eye) + Vec3::Z * 0.012, Vec2::splat(0.008)),
            ],
            rings: 3,
            segments: 5,
            joints: vec![eye],
            colour: WHITE,
        });
        for finger in 0..5 {
            let chain: [Joint; 3] =
                std::array::from_fn(|phalanx| Joint::ALL[fingers + 3 * finger + phalanx]);
            let [a, b, c] = chain.map(at);
            limbs.push(Limb {
                line: vec![
                    (a - (b - a) * 0.3, Vec2::splat(0.009)),
                    (b, Vec2::splat(0.0085)),
                    (c, Vec2::splat(0.008)),
                    (c + (c - b) * 0.8, Vec2::splat(0.006)),
                ],
                rings: 5,
                segments: 4,
                joints: [&[arm[3]], &chain[..]].concat(),
                colour: SKIN,
            });
        }
    }
    limbs
}

#[derive(Default)]
struct Surface {
    vertices: Vec<Vec3>,
    faces: Vec<[u32; 3]>,
    skin: Vec<SkinWeights>,
    bridges: Vec<(u32, u32)>,
    /// Per face.
    colours: Vec<Vec3>,
}

impl Surface {
    fn add(&mut self, limb: &Limb, rest: &[Vec3; JOINTS], detail: usize) {
        let (rings, segments) = (limb.rings * detail, limb.segments * detail);
        let first = index(self.vertices.len());
        let before = self.vertices.len();
        let (mut points, normals) = sample(&limb.line, rings);
        self.vertices.push(points[0].0);
        for ((centre, radii), along) in points.iter().zip(&normals) {
            // Vertical tubes are wide along x, arms along z.
            let aside = if along.x.abs() > 0.7 {
                Vec3::Y
            } else {
                Vec3::X
            };
            let u = aside.reject_from(*along).normalize();
            let v = along.cross(u);
            for segment in 0..segments {
                let angle = segment as f32 / segments as f32 * std::f32::consts::TAU;
                let (sin, cos) = angle.sin_cos();
                self.vertices
                    .push(*centre + u * cos * radii.x + v * sin * radii.y);
            }
        }
        let (end, _) = points.pop().unwrap_or_default();
        self.vertices.push(end);
        let last = index(self.vertices.len() - 1);
        let at =
            |ring: usize, segment: usize| first + 1 + index(ring * segments + segment % segments);
        for s in 0..segments {
            self.faces.push([first, at(0, s + 1), at(0, s)]);
            for r in 0..rings - 1 {
                let (a, b) = (at(r, s), at(r, s + 1));
                let (c, d) = (at(r + 1, s + 1), at(r + 1, s));
                self.faces.push([a, b, c]);
                self.faces.push([a, c, d]);
            }
            self.faces
                .push([last, at(rings - 1, s), at(rings - 1, s + 1)]);
        }
        self.colours.resize(self.faces.len(), limb.colour);
        for vertex in before..self.vertices.len() {
            self.skin
                .push(smooth_weights(self.vertices[vertex], &limb.joints, rest));
        }
        // Both ends of a tube are joined to what is nearest of everything before it.
        for end in [first, last] {
            let here = self.vertices[end as usize];
            let near = (0..before).min_by(|a, b| {
                let distance = |v: usize| self.vertices[v].distance_squared(here);
                distance(*a).total_cmp(&distance(*b))
            });
            if let Some(near) = near.filter(|v| self.vertices[*v].distance(here) < 0.15) {
                self.bridges.push((end, index(near)));
            }
        }
    }
}

/// `rings` points along a line with radii, and the direction at each.
fn sample(line: &[(Vec3, Vec2)], rings: usize) -> (Vec<(Vec3, Vec2)>, Vec<Vec3>) {
    let mut reached = vec![0.0f32];
    for pair in line.windows(2) {
        reached.push(reached[reached.len() - 1] + pair[0].0.distance(pair[1].0));
    }
    let length = reached[reached.len() - 1];
    let points: Vec<(Vec3, Vec2)> = (0..rings)
        .map(|ring| {
            let along = ring as f32 / (rings - 1) as f32 * length;
            let piece = reached
                .partition_point(|r| *r <= along)
                .clamp(1, line.len() - 1);
            let share = (along - reached[piece - 1]) / (reached[piece] - reached[piece - 1]);
            let ((p, r), (q, s)) = (line[piece - 1], line[piece]);
            (p.lerp(q, share), r.lerp(s, share))
        })
        .collect();
    let directions = (0..rings)
        .map(|ring| {
            let (before, after) = (ring.saturating_sub(1), (ring + 1).min(rings - 1));
            (points[after].0 - points[before].0).normalize()
        })
        .collect();
    (points, directions)
}

/// Weights that fall off smoothly with the distance to each joint's bone.
fn smooth_weights(vertex: Vec3, joints: &[Joint], rest: &[Vec3; JOINTS]) -> SkinWeights {
    const SOFTNESS: f32 = 0.025;
    let bone_end = |joint: Joint| {
        let children: Vec<Vec3> = Joint::ALL
            .into_iter()
            .filter(|child| child.parent() == Some(joint))
            .map(|child| rest[child.index()])
            .collect();
        match (joint, &children[..]) {
            (Joint::Head, _) => rest[joint.index()] + Vec3::Y * 0.2,
            (Joint::Jaw, _) => rest[joint.index()] + Vec3::new(0.0, -0.03, 0.07),
            (Joint::LeftWrist | Joint::RightWrist, all) => {
                all.iter().sum::<Vec3>() / all.len() as f32
            }
            (Joint::Pelvis | Joint::Spine3, _) => rest[joint.index()] + Vec3::Y * 0.08,
            (_, [only]) => *only,
            _ => rest[joint.index()],
        }
    };
    let mut near: Vec<(f32, Joint)> = joints
        .iter()
        .map(|joint| {
            let start = rest[joint.index()];
            let bone = bone_end(*joint) - start;
            let along = (vertex - start).dot(bone) / bone.length_squared().max(1e-9);
            (
                vertex.distance(start + bone * along.clamp(0.0, 1.0)),
                *joint,
            )
        })
        .collect();
    near.sort_by(|a, b| a.0.total_cmp(&b.0));
    near.truncate(INFLUENCES);
    let closest = near[0].0;
    let mut skin = SkinWeights::default();
    for (slot, (distance, joint)) in near.iter().enumerate() {
        skin.joints[slot] = *joint as u8;
        skin.weights[slot] = (-((distance - closest) / SOFTNESS).powi(2) / 2.0).exp();
    }
    let sum: f32 = skin.weights.iter().sum();
    skin.weights = skin.weights.map(|weight| weight / sum);
    skin
}

/// Gaussians over the surface, as many to a face as its area deserves, in the faces' order.
fn scatter(
    template: &Template,
    colours: &[Vec3],
    count: usize,
    random: &mut Random,
) -> (GaussianSet, Vec<u32>, Vec<[f32; 2]>) {
    let corners = |face: &[u32; 3]| face.map(|v| template.vertices()[v as usize]);
    let area = |[a, b, c]: [Vec3; 3]| (b - a).cross(c - a).length() / 2.0;
    let total: f32 = template.faces().iter().map(|f| area(corners(f))).sum();
    let radius = (total / count as f32).sqrt() * 0.6;
    let mut out = GaussianSet::zeroed(0);
    let (mut triangles, mut barycentrics) = (Vec::new(), Vec::new());
    let mut reached = 0.0f64;
    for (triangle, face) in template.faces().iter().enumerate() {
        let [a, b, c] = corners(face);
        reached += f64::from(area([a, b, c])) / f64::from(total) * count as f64;
        let normal = (b - a).cross(c - a).normalize_or(Vec3::Y);
        let x = (b - a).normalize_or(Vec3::X);
        let flat = Quat::from_mat3(&Mat3::from_cols(x, normal.cross(x), normal));
        let last = triangle + 1 == template.faces().len();
        while out.len() < count && ((out.len() as f64) < reached || last) {
            let (mut v, mut w) = (random.unit(), random.unit());
            if v + w > 1.0 {
                (v, w) = (1.0 - v, 1.0 - w);
            }
            let turn = Quat::from_rotation_z(random.signed() * 3.0);
            let tilt = Quat::from_scaled_axis(random.vector() * 0.1);
            let spread = Vec3::new(random.signed(), random.signed(), random.signed()) * 0.25;
            out.positions
                .push(a + (b - a) * v + (c - a) * w + normal * random.signed() * 0.002);
            out.rotations.push(flat * turn * tilt);
            out.log_scales
                .push(spread + Vec3::new(radius.ln(), radius.ln(), (radius * 0.3).ln()));
            out.opacity_logits.push(3.0 + random.signed());
            let shade = colours[triangle] + random.vector() * 0.06;
            out.colours.push((shade - 0.5) / SH_C0);
            triangles.push(index(triangle));
            barycentrics.push([v, w]);
        }
    }
    (out, triangles, barycentrics)
}

/// Farthest-point sampling: `count` vertices spread over the body.
fn spread(vertices: &[Vec3], count: usize) -> Vec<u32> {
    let mut distance = vec![f32::INFINITY; vertices.len()];
    let mut chosen = vec![0usize];
    while chosen.len() < count {
        let from = vertices[chosen[chosen.len() - 1]];
        for (known, vertex) in distance.iter_mut().zip(vertices) {
            *known = known.min(vertex.distance(from));
        }
        let farthest = (0..vertices.len()).max_by(|a, b| distance[*a].total_cmp(&distance[*b]));
        chosen.push(farthest.unwrap_or_default());
    }
    chosen.into_iter().map(index).collect()
}

fn dense(inputs: usize, outputs: usize, gain: f32, random: &mut Random) -> Dense {
    let spread = gain / (inputs as f32).sqrt();
    let weights: Vec<f32> = (0..inputs * outputs)
        .map(|_| random.normal() * spread)
        .collect();
    let bias = (0..outputs).map(|_| random.signed() * 0.1).collect();
    Dense::new(inputs, outputs, &weights, bias).expect("a layer's counts fit")
}

/// Waves of about a centimetre that run over the body.
fn mesh_network(template: &Template, size: PuppetSize, random: &mut Random) -> MeshNetwork {
    let vertices = template.vertices();
    let mut fields = Vec::with_capacity(size.rank * 3 * vertices.len());
    let amplitude = 0.003 / (size.rank as f32).sqrt();
    for _ in 0..size.rank {
        for _axis in 0..3 {
            let (wave, phase) = (random.vector() * 12.0, random.signed() * 3.0);
            fields.extend(
                vertices
                    .iter()
                    .map(|v| (wave.dot(*v) + phase).sin() * amplitude),
            );
        }
    }
    let mean = (0..3 * vertices.len())
        .map(|_| random.signed() * 1e-4)
        .collect();
    MeshNetwork {
        first: dense(PARAMS, size.mesh_hidden, 6.0, random),
        second: dense(size.mesh_hidden, size.mesh_hidden, 2.0, random),
        code: dense(size.mesh_hidden, size.rank, 2.0, random),
        decoder: QuantisedDecoder::quantise(size.rank, &fields, mean).expect("the decoder fits"),
    }
}

fn attribute_network(size: PuppetSize, random: &mut Random) -> AttributeNetwork {
    let hidden = size.controllers * size.controller_hidden;
    let second: Vec<half::f16> = (0..hidden * size.bases)
        .map(|_| half::f16::from_f32(random.normal() / (size.controller_hidden as f32).sqrt()))
        .collect();
    let second_bias = (0..size.controllers * size.bases)
        .map(|_| random.signed() * 0.1)
        .collect();
    let mut bases = Vec::with_capacity(ATTRIBUTES * size.bases * size.gaussians);
    for plane in 0..ATTRIBUTES {
        // Metres, quaternion parts, log-metres, logits and colour coefficients: each visible, none wild.
        let reach = match plane {
            p if attribute::OFFSET.contains(&p) => 0.000_6,
            attribute::OPACITY => 0.05,
            _ => 0.015,
        };
        bases.extend((0..size.bases * size.gaussians).map(|_| random.normal() * reach));
    }
    AttributeNetwork {
        first: dense(PARAMS, hidden, 6.0, random),
        second,
        second_bias,
        bases: QuantisedBases::quantise(size.bases, size.gaussians, &bases).expect("the bases fit"),
    }
}

fn expressions() -> Expressions {
    let preset = |slot: usize, jaw: f32| {
        let mut coefficients = [0.0; EXPRESSION];
        coefficients[slot] = 1.5;
        ExpressionPreset { coefficients, jaw }
    };
    [
        ("smile", preset(0, 0.0)),
        ("blink", preset(1, 0.0)),
        ("a", preset(2, 0.3)),
    ]
    .map(|(name, preset)| (name.to_owned(), preset))
    .into()
}

/// Indices of a puppet fit 32 bits.
fn index(at: usize) -> u32 {
    u32::try_from(at).expect("a puppet is small")
}
