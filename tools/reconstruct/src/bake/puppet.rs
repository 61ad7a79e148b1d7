//! What the simulation needs of the demo person: fabrics, and how loosely each cloth hangs.

use crate::simulate::{Fabric, Puppet, Surface, arm_share};
use crate::{Part, Person};
use glam::Vec3;
use spmm3::Joint;

/// How far the jacket's hem and its sleeves may leave their skinned place, metres.
const HEM_LOOSENESS: f32 = 0.1;
const SLEEVE_LOOSENESS: f32 = 0.012;
/// The same for the legs of the jeans just above the shoes, and how high that reaches above the ankles.
const CUFF_LOOSENESS: f32 = 0.015;
const CUFF_HEIGHT: f32 = 0.1;

/// A shirt's vertex is covered by a jacket's this near, metres.
const COVER: f32 = 0.035;

/// Derives fabrics and looseness from the person's parts.
#[must_use]
pub fn puppet(person: &Person) -> Puppet {
    let template = person.template().clone();
    let parts = person.vertex_parts();
    let rest = template.vertices();
    let joints = person.skeleton().rest_positions();
    let height = |joint: Joint| joints[joint.index()].y;
    let of_arm: Vec<f32> = template
        .skin()
        .iter()
        .map(|s| arm_share(&s.dense()))
        .collect();
    let jacket_hem = (0..rest.len())
        .filter(|v| parts[*v] == Part::Jacket && of_arm[*v] < 0.1)
        .map(|v| rest[v].y)
        .fold(f32::INFINITY, f32::min);
    // Above the breast bone a jacket lies on the shoulders.
    let sewn = height(Joint::Spine3) + 0.02;
    let mut looseness: Vec<f32> = (0..rest.len())
        .map(|v| match parts[v] {
            Part::Jacket => {
                let drop = ((sewn - rest[v].y) / (sewn - jacket_hem).max(0.1)).clamp(0.0, 1.0);
                let trunk = HEM_LOOSENESS * drop * drop.sqrt();
                let sleeve = SLEEVE_LOOSENESS * sleeve_drop(rest[v], joints);
                trunk * (1.0 - of_arm[v]) + sleeve * of_arm[v]
            }
            Part::Jeans => {
                let ankle = height(Joint::LeftAnkle);
                CUFF_LOOSENESS * ((ankle + CUFF_HEIGHT - rest[v].y) / CUFF_HEIGHT).clamp(0.0, 1.0)
            }
            _ => 0.0,
        })
        .map(|loose| if loose > 5e-4 { loose } else { 0.0 })
        .collect();
    let riders = small_pieces(rest.len(), template.faces(), &parts);
    riders.iter().for_each(|v| looseness[*v as usize] = 0.0);
    let covered = covered(rest, &parts, template.faces());
    let fabric = parts
        .iter()
        .map(|part| match part {
            Part::Face => Fabric::Face,
            Part::Skin | Part::Head | Part::Hand => Fabric::Skin,
            part if part.is_cloth() => Fabric::Cloth,
            _ => Fabric::Rigid,
        })
        .collect();
    Puppet {
        skeleton: person.skeleton().clone(),
        expressions: person.expressions().to_vec(),
        template,
        fabric,
        looseness,
        riders,
        covered,
    }
}

/// Pairs (shirt vertex, jacket vertex over it).
fn covered(rest: &[Vec3], parts: &[Part], faces: &[[u32; 3]]) -> Vec<(u32, u32)> {
    let normals = Surface::new(rest.len(), faces).normals(rest);
    let of = |part: Part| {
        (0u32..)
            .zip(parts)
            .filter(move |(_, p)| **p == part)
            .map(|(v, _)| v)
    };
    let jacket: Vec<u32> = of(Part::Jacket).collect();
    of(Part::Shirt)
        .filter_map(|inner| {
            let at = rest[inner as usize];
            let outer = jacket.iter().copied().min_by(|a, b| {
                let away = |v: u32| rest[v as usize].distance_squared(at);
                away(*a).total_cmp(&away(*b))
            })?;
            let over = rest[outer as usize] - at;
            (over.length() < COVER && over.dot(normals[outer as usize]) > 0.0)
                .then_some((inner, outer))
        })
        .collect()
}

/// 0 at the shoulder, 1 from the middle of the upper arm on.
fn sleeve_drop(at: Vec3, joints: &[Vec3; spmm3::JOINTS]) -> f32 {
    let (shoulder, elbow) = (
        joints[Joint::LeftShoulder.index()].x,
        joints[Joint::LeftElbow.index()].x,
    );
    ((at.x.abs() - shoulder) / (0.5 * (elbow - shoulder)).max(0.01)).clamp(0.0, 1.0)
}

/// Jacket vertices outside its largest connected piece: the lapels.
fn small_pieces(vertices: usize, faces: &[[u32; 3]], parts: &[Part]) -> Vec<u32> {
    let pieces = crate::fit::pieces(vertices, faces);
    let mut sizes = vec![0usize; vertices];
    let of_jacket = |v: &usize| parts[*v] == Part::Jacket;
    (0..vertices)
        .filter(of_jacket)
        .for_each(|v| sizes[pieces[v] as usize] += 1);
    let largest = (0..vertices).max_by_key(|v| sizes[*v]);
    (0u32..)
        .zip(&pieces)
        .filter(|(v, piece)| of_jacket(&(*v as usize)) && Some(**piece as usize) != largest)
        .map(|(v, _)| v)
        .collect()
}
