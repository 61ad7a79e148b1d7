//! Eight people: bodies, clothes and stances.

use crate::RigError;
use crate::body::posing::{chain, posed_from_rest, skinned, t_pose};
use crate::body::state::is_above;
use crate::body::{BodyModel, Registered, SkinRow};
use crate::normals::vertex_normals;
use crate::prepare::Similarity;
use glam::{DMat3, DQuat, DVec3, Vec3};
use reconstruct::makehuman::{Macros, Quad};
use reconstruct::{BareBody, Part, Texture};
use spmm3::{JOINTS, Joint};
use std::path::Path;

/// Where a synthetic person's joints are in a pose.
#[derive(Debug, Clone, PartialEq)]
pub struct Stance {
    /// World rotations relative to the rest pose.
    pub rotations: [DMat3; JOINTS],
    /// Positions, metres.
    pub joints: [DVec3; JOINTS],
}

/// How many people there are.
pub const PEOPLE: usize = 8;

/// Thickness of the clothes: at least, and how much more at most, metres.
const CLOTH: (f64, f64) = (0.004, 0.021);

/// A person who does not exist.
#[derive(Debug, Clone)]
pub struct SyntheticPerson {
    number: usize,
    /// Clothed, in the body's rest pose, metres.
    rest: Vec<DVec3>,
    joints: [DVec3; JOINTS],
    weights: Vec<SkinRow>,
    faces: Vec<[u32; 3]>,
    /// The quads that can be seen: their numbers on the body, and themselves.
    pub(super) quad_numbers: Vec<u32>,
    pub(super) quads: Vec<Quad>,
    pub(super) parts: Vec<Part>,
    /// How much of each vertex is under clothes, 0..=1.
    pub(super) clothed: Vec<f64>,
    pub(super) skin_texture: Texture,
    pub(super) eye_texture: Texture,
    /// Colours of shirt and trousers, where the skin's texture has no clothes painted on.
    pub(super) clothes: Option<[Vec3; 2]>,
    stance: [DMat3; JOINTS],
    yaw: f64,
}

/// A body's shape: MakeHuman's macros, of which age and ancestry are no shapes of the registered model.
fn macros(number: usize) -> Macros {
    let pick = |values: [f32; PEOPLE]| values[number % PEOPLE];
    let strange = pick([0.4, 0.3, 0.0, 0.5, 0.2, 0.5, 0.3, 0.0]);
    let african = pick([0.0, 0.5, 0.0, 0.0, 1.0, 0.0, 0.5, 0.0]);
    Macros {
        gender: pick([1.0, 0.0, 1.0, 0.1, 0.9, 0.0, 1.0, 0.2]),
        age: 0.5 + 0.5 * pick([0.3, 0.0, 0.5, 0.2, 0.1, 0.4, 0.0, 0.3]),
        muscle: pick([0.7, 0.4, 0.3, 0.5, 0.8, 0.3, 0.5, 0.6]),
        weight: pick([0.7, 0.4, 0.3, 0.75, 0.5, 0.6, 0.35, 0.5]),
        height: pick([0.7, 0.35, 0.6, 0.4, 0.55, 0.45, 0.75, 0.5]),
        proportions: pick([0.5, 0.7, 0.4, 0.5, 0.6, 0.5, 0.5, 0.8]),
        races: [strange * african, strange * (1.0 - african), 1.0 - strange],
    }
}

impl SyntheticPerson {
    /// Builds person `number` (there are [`PEOPLE`], then they come again) of MakeHuman's `body`, whose files are in the folder
    /// `makehuman`.
    ///
    /// # Errors
    /// If a file is missing or damaged; the error names it.
    pub fn new(body: &mut BareBody, makehuman: &Path, number: usize) -> Result<Self, RigError> {
        let mut rng = fastrand::Rng::with_seed(1 + number as u64);
        let mesh = body.mesh(&macros(number))?;
        let bare = body.vertices(&mesh);
        let joints = body.joints(&mesh)?.map(|j| j.as_dvec3());
        let outer = body.outer(&bare);
        let mut rest: Vec<DVec3> = bare.iter().map(|v| v.as_dvec3()).collect();
        let weights = body.skin().to_vec();
        // What cannot be seen is in no scan.
        let (mut quad_numbers, mut quads, mut parts) = (Vec::new(), Vec::new(), Vec::new());
        for ((number, quad), part) in (0..).zip(body.quads()).zip(body.parts()) {
            let outside = quad.corners.iter().filter(|c| outer[**c as usize]).count();
            if outside >= 2 && !matches!(part, Part::Teeth | Part::Tongue) {
                quad_numbers.push(number);
                quads.push(*quad);
                parts.push(*part);
            }
        }
        let faces: Vec<[u32; 3]> = body
            .quads()
            .iter()
            .flat_map(|quad| {
                let [a, b, c, d] = quad.corners;
                [[a, b, c], [a, c, d]]
            })
            .collect();
        let clothed: Vec<f64> = weights.iter().map(clothed).collect();
        let thickness = uneven(&rest, &mut rng);
        let normals = vertex_normals(&rest, &faces, DVec3::Y);
        for (((vertex, normal), share), thickness) in
            (rest.iter_mut().zip(&normals)).zip(&clothed).zip(thickness)
        {
            *vertex += *normal * *share * (CLOTH.0 + CLOTH.1 * thickness);
        }
        let (stance, yaw) = stance(&mut rng);
        let package = reconstruct::makehuman::Package::new(makehuman);
        let skins = "skins/young_caucasian_male/textures/young_caucasian_male_special_suit.png";
        let eyes = "proxies/eyes/HighPolyEyes/textures/blue_eye.png";
        let mut person = Self {
            number,
            rest,
            joints,
            weights,
            faces,
            quad_numbers,
            quads,
            parts,
            clothed,
            skin_texture: Texture::read(&package.data(skins))?,
            eye_texture: Texture::read(&package.data(eyes))?,
            clothes: (number % 2 == 1).then(|| {
                let mut colour = || Vec3::new(rng.f32(), rng.f32(), rng.f32()) * 0.6 + 0.2;
                [colour(), colour() * 0.6]
            }),
            stance,
            yaw,
        };
        person.stance = person.balanced(&stance);
        Ok(person)
    }

    /// The triangles of the whole mesh, those of the registered model.
    #[must_use]
    pub fn faces(&self) -> &[[u32; 3]] {
        &self.faces
    }

    /// The mesh' true weights, `[N_v]`.
    #[must_use]
    pub fn weights(&self) -> &[SkinRow] {
        &self.weights
    }

    /// Distinguishes this person's random numbers from others'.
    pub(super) fn seed(&self) -> u64 {
        1000 + self.number as u64
    }

    /// Turned to the left of +z, radians.
    #[must_use]
    pub fn yaw(&self) -> f64 {
        self.yaw
    }

    /// The joints in the body's rest pose, metres.
    #[must_use]
    pub fn rest_joints(&self) -> &[DVec3; JOINTS] {
        &self.joints
    }

    /// How the person stands when it is scanned, without falling over: soles level at y = 0, the pelvis above the origin.
    #[must_use]
    pub fn stance(&self) -> Stance {
        let standing = self.standing(&self.stance, DVec3::ZERO);
        let soles = lowest(&self.posed(&standing));
        self.standing(&self.stance, DVec3::NEG_Y * soles)
    }

    /// The pose whose world rotations, relative to the T-pose, are `rotations`, where an avatar of this person would take it: the T-pose stands
    /// with its soles at y = 0 and its hips above the origin, and the pelvis stays where it is there.
    #[must_use]
    pub fn as_avatar(&self, rotations: &[DMat3; JOINTS]) -> Stance {
        let straight = t_pose(&self.joints);
        let standing = self.standing(&straight, DVec3::ZERO);
        let soles = lowest(&self.posed(&standing));
        let [left, right] =
            [Joint::LeftHip, Joint::RightHip].map(|hip| standing.joints[hip.index()]);
        let middle = 0.5 * (left + right);
        let turned = std::array::from_fn(|j| rotations[j] * straight[j]);
        self.standing(&turned, -DVec3::new(middle.x, soles, middle.z))
    }

    /// The pose whose world rotations relative to the body's rest pose are `rotations`, the pelvis at `pelvis`, metres.
    #[must_use]
    pub fn standing(&self, rotations: &[DMat3; JOINTS], pelvis: DVec3) -> Stance {
        Stance {
            rotations: *rotations,
            joints: chain(rotations, pelvis, 1.0, &self.joints),
        }
    }

    /// The clothed surface in a pose, metres, `[N_v]`.
    #[must_use]
    pub fn posed(&self, pose: &Stance) -> Vec<DVec3> {
        let maps = posed_from_rest(&pose.rotations, &pose.joints, 1.0, &self.joints);
        skinned(&self.weights, &maps, &self.rest)
    }

    /// What a perfect registration to this person's scan would find: the body model with the person's own body, clothes included, and its
    /// pose. `person_from_stance`: from where the person stood to where the scan was placed, in metres.
    #[must_use]
    pub fn registered(
        &self,
        model: &BodyModel,
        person_from_stance: &Similarity,
    ) -> (BodyModel, Registered) {
        let own = BodyModel {
            rest: self.rest.clone(),
            joints: self.joints,
            shapes: Vec::new(),
            ..model.clone()
        };
        let stance = self.stance();
        let turn = DMat3::from_quat(person_from_stance.rotation);
        let registered = Registered {
            shape: Vec::new(),
            rotations: stance.rotations.map(|rotation| turn * rotation),
            scale: person_from_stance.scale,
            joints: stance.joints.map(|joint| person_from_stance.point(joint)),
            vertices: (self.posed(&stance).iter())
                .map(|vertex| person_from_stance.point(*vertex))
                .collect(),
            confidence: [1.0; JOINTS],
        };
        (own, registered)
    }

    /// Unit normals at the vertices of a pose, outwards.
    #[must_use]
    pub(super) fn normals(&self, vertices: &[DVec3]) -> Vec<DVec3> {
        vertex_normals(vertices, &self.faces, DVec3::Y)
    }
}

fn lowest(vertices: &[DVec3]) -> f64 {
    vertices.iter().map(|v| v.y).fold(f64::INFINITY, f64::min)
}

/// How much of a vertex is under clothes: not head, neck and hands.
fn clothed(dense: &SkinRow) -> f64 {
    let bare = [
        Joint::Head,
        Joint::Jaw,
        Joint::Neck,
        Joint::LeftEye,
        Joint::RightEye,
        Joint::LeftWrist,
        Joint::RightWrist,
    ];
    let bare: f32 = bare.iter().map(|j| dense[j.index()]).sum();
    let fingers: f32 = dense.iter().skip(Joint::LeftIndex1.index()).sum();
    f64::from((1.0 - bare - fingers).clamp(0.0, 1.0))
}

/// A smooth random field over the vertices, 0..=1.
fn uneven(vertices: &[DVec3], rng: &mut fastrand::Rng) -> Vec<f64> {
    let mut field = vec![0.0; vertices.len()];
    for _ in 0..30 {
        let wave = DVec3::new(normal(rng), normal(rng), normal(rng)) * 12.0;
        let phase = rng.f64() * std::f64::consts::TAU;
        for (value, vertex) in field.iter_mut().zip(vertices) {
            *value += (vertex.dot(wave) + phase).cos();
        }
    }
    let low = field.iter().copied().fold(f64::INFINITY, f64::min);
    let high = field.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    field
        .iter_mut()
        .for_each(|v| *v = (*v - low) / (high - low).max(1e-9));
    field
}

/// Roughly normal, deviation 1, within 3.5.
pub(super) fn normal(rng: &mut fastrand::Rng) -> f64 {
    (0..12).map(|_| rng.f64()).sum::<f64>().clamp(2.5, 9.5) - 6.0
}

/// World rotations of a natural stance for a scan, arms away from the body, which may not be balanced, and how far it is turned to the left.
fn stance(rng: &mut fastrand::Rng) -> ([DMat3; JOINTS], f64) {
    let mut rotations = [DMat3::IDENTITY; JOINTS];
    let mut turn = |joint: Joint, axis_angle: DVec3| {
        let by = DMat3::from_quat(DQuat::from_scaled_axis(axis_angle));
        for below in Joint::ALL.into_iter().filter(|j| is_above(joint, *j)) {
            rotations[below.index()] = by * rotations[below.index()];
        }
    };
    let mut within = |low: f64, high: f64| (low + (high - low) * rng.f64()).to_radians();
    for (sign, [shoulder, elbow, hip, knee, ankle]) in [
        (
            1.0,
            [
                Joint::LeftShoulder,
                Joint::LeftElbow,
                Joint::LeftHip,
                Joint::LeftKnee,
                Joint::LeftAnkle,
            ],
        ),
        (
            -1.0,
            [
                Joint::RightShoulder,
                Joint::RightElbow,
                Joint::RightHip,
                Joint::RightKnee,
                Joint::RightAnkle,
            ],
        ),
    ] {
        turn(shoulder, DVec3::NEG_Z * sign * within(4.0, 22.0));
        turn(shoulder, DVec3::X * within(-10.0, 15.0));
        turn(elbow, DVec3::X * within(0.0, 25.0));
        turn(
            hip,
            DVec3::new(within(-8.0, 8.0), 0.0, sign * within(2.0, 8.0)),
        );
        turn(knee, DVec3::X * within(0.0, 10.0));
        turn(ankle, DVec3::X * within(-6.0, 6.0));
    }
    let spine = DVec3::new(within(-4.0, 8.0), within(-10.0, 10.0), within(-4.0, 4.0));
    turn(Joint::Spine2, spine);
    turn(
        Joint::Head,
        DVec3::new(within(-10.0, 10.0), within(-15.0, 15.0), 0.0),
    );
    let yaw = within(-180.0, 180.0);
    turn(Joint::Pelvis, DVec3::Y * yaw);
    (rotations, yaw)
}
