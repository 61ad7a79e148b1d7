//! The puppet's skeleton, and tubes around its bones with smooth skinning weights.

use super::index;
use glam::{Vec2, Vec3};
use spmm3::{INFLUENCES, JOINTS, Joint, SkinWeights};

/// T-pose positions of a man of 1.75 m, metres, standing on y = 0.
pub(super) fn rest_positions() -> [Vec3; JOINTS] {
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
pub(super) struct Limb {
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
pub(super) fn limbs(rest: &[Vec3; JOINTS]) -> Vec<Limb> {
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
pub(super) struct Surface {
    pub(super) vertices: Vec<Vec3>,
    pub(super) faces: Vec<[u32; 3]>,
    pub(super) skin: Vec<SkinWeights>,
    pub(super) bridges: Vec<(u32, u32)>,
    /// Per face.
    pub(super) colours: Vec<Vec3>,
}

impl Surface {
    pub(super) fn add(&mut self, limb: &Limb, rest: &[Vec3; JOINTS], detail: usize) {
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
