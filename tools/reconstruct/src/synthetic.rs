//! A small person of tubes for the tests: torso and arms, and a jacket that hangs open over the torso.

use crate::simulate::{Fabric, Puppet};
use glam::Vec3;
use spmm3::{JOINTS, Joint, Skeleton, SkinWeights, Template};

/// Standing man of 1.7 m in T-pose, coarsely.
fn skeleton() -> Skeleton {
    let mut rest = [Vec3::ZERO; JOINTS];
    for joint in Joint::ALL {
        let name = joint.name();
        let side = if name.starts_with("left") {
            1.0
        } else if name.starts_with("right") {
            -1.0
        } else {
            0.0
        };
        let (x, y) = match name
            .trim_start_matches("left_")
            .trim_start_matches("right_")
        {
            "pelvis" => (0.0, 0.95),
            "hip" => (0.1, 0.9),
            "knee" => (0.1, 0.5),
            "ankle" => (0.1, 0.1),
            "foot" => (0.1, 0.03),
            "spine1" => (0.0, 1.05),
            "spine2" => (0.0, 1.15),
            "spine3" => (0.0, 1.25),
            "neck" => (0.0, 1.45),
            "head" | "jaw" => (0.0, 1.55),
            "eye_smplhf" => (0.03, 1.6),
            "collar" => (0.05, 1.4),
            "shoulder" => (0.18, 1.4),
            "elbow" => (0.45, 1.4),
            "wrist" => (0.7, 1.4),
            _ => (0.8, 1.4),
        };
        rest[joint.index()] = Vec3::new(side * x, y, 0.0);
    }
    Skeleton::new(rest).expect("the joints are finite")
}

struct Mesh {
    vertices: Vec<Vec3>,
    faces: Vec<[u32; 3]>,
    skin: Vec<SkinWeights>,
    fabric: Vec<Fabric>,
    looseness: Vec<f32>,
}

fn two(a: Joint, b: Joint, share: f32) -> SkinWeights {
    let share = share.clamp(0.0, 1.0);
    SkinWeights {
        joints: [a as u8, b as u8, 0, 0],
        weights: [1.0 - share, share, 0.0, 0.0],
    }
}

fn along(chain: &[(Joint, f32)], at: f32, blend: f32) -> SkinWeights {
    for pair in chain.windows(2) {
        if at < pair[1].1 + blend {
            return two(
                pair[0].0,
                pair[1].0,
                (at - pair[1].1 + blend) / (2.0 * blend),
            );
        }
    }
    let last = chain[chain.len() - 1].0;
    two(last, last, 0.0)
}

impl Mesh {
    /// A tube of `rings` x `around` points; `open` leaves a slit in it.
    fn tube(
        &mut self,
        (rings, around): (u32, u32),
        open: bool,
        point: impl Fn(f32, f32) -> Vec3,
        skin: impl Fn(Vec3) -> SkinWeights,
        fabric: Fabric,
        looseness: impl Fn(Vec3) -> f32,
    ) {
        let base = u32::try_from(self.vertices.len()).expect("a small mesh");
        for r in 0..rings {
            for a in 0..around {
                let turn = if open {
                    0.03 + 0.94 * a as f32 / (around - 1) as f32
                } else {
                    a as f32 / around as f32
                };
                let at = point(r as f32 / (rings - 1) as f32, turn * std::f32::consts::TAU);
                self.vertices.push(at);
                self.skin.push(skin(at));
                self.fabric.push(fabric);
                self.looseness.push(looseness(at));
            }
        }
        for r in 0..rings - 1 {
            for a in 0..(if open { around - 1 } else { around }) {
                let b = (a + 1) % around;
                let [p, q, s, t] = [
                    r * around + a,
                    r * around + b,
                    (r + 1) * around + b,
                    (r + 1) * around + a,
                ]
                .map(|k| base + k);
                self.faces.extend([[p, q, s], [p, s, t]]);
            }
        }
    }
}

/// The tube person: about 1,500 vertices.
pub(crate) fn puppet() -> Puppet {
    use Joint::*;
    let mut mesh = Mesh {
        vertices: vec![],
        faces: vec![],
        skin: vec![],
        fabric: vec![],
        looseness: vec![],
    };
    let trunk = [
        (Pelvis, 0.0),
        (Spine1, 1.05),
        (Spine2, 1.15),
        (Spine3, 1.25),
    ];
    let torso = |radius: f32, low: f32| {
        move |s: f32, angle: f32| {
            Vec3::new(
                1.2 * radius * angle.sin(),
                low + s * (1.42 - low),
                radius * angle.cos(),
            )
        }
    };
    mesh.tube(
        (20, 24),
        false,
        torso(0.12, 0.9),
        |p| along(&trunk, p.y, 0.05),
        Fabric::Skin,
        |_| 0.0,
    );
    let loose = |p: Vec3| {
        if p.y > 1.3 {
            0.0
        } else {
            0.12 * (1.3 - p.y) / 0.5
        }
    };
    mesh.tube(
        (24, 28),
        true,
        torso(0.15, 0.75),
        |p| along(&trunk, p.y, 0.05),
        Fabric::Cloth,
        loose,
    );
    for sign in [1.0, -1.0] {
        let chain = if sign > 0.0 {
            [(LeftShoulder, 0.15), (LeftElbow, 0.45), (LeftWrist, 0.7)]
        } else {
            [(RightShoulder, 0.15), (RightElbow, 0.45), (RightWrist, 0.7)]
        };
        let arm = |s: f32, angle: f32| {
            Vec3::new(
                sign * (0.2 + 0.5 * s),
                1.4 + 0.045 * angle.cos(),
                sign * 0.045 * angle.sin(),
            )
        };
        mesh.tube(
            (18, 12),
            false,
            arm,
            |p| along(&chain, p.x.abs(), 0.06),
            Fabric::Cloth,
            |_| 0.0,
        );
    }
    let face =
        |s: f32, angle: f32| Vec3::new(0.08 * angle.sin(), 1.45 + 0.2 * s, 0.09 * angle.cos());
    mesh.tube(
        (10, 16),
        false,
        face,
        |_| two(Head, Head, 0.0),
        Fabric::Face,
        |_| 0.0,
    );
    let smile = mesh
        .vertices
        .iter()
        .zip(&mesh.fabric)
        .map(|(p, f)| {
            if *f == Fabric::Face {
                Vec3::new(p.x, 0.1 * p.z, 0.0) * 0.1
            } else {
                Vec3::ZERO
            }
        })
        .collect();
    Puppet {
        template: Template::new(mesh.vertices, mesh.faces, mesh.skin)
            .expect("tubes make a template"),
        skeleton: skeleton(),
        fabric: mesh.fabric,
        looseness: mesh.looseness,
        riders: vec![],
        covered: vec![],
        expressions: vec![smile],
    }
}
