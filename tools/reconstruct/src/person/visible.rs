//! Which parts of the person's surface can be seen: covered cloth costs Gaussians and shines through gaps.

use super::range_of_motion::arms_down_and_up;
use super::{Part, Person};
use crate::depth_map::DepthMap;
use crate::shading::{sphere_directions, vertex_normals};
use rayon::prelude::*;

/// Directions looked from.
const DIRECTIONS: u16 = 26;

/// Texels along a depth map's side, fine enough to tell a lapel from the cloth 2 mm below it.
const MAP: usize = 1024;

/// How far below what is seen a vertex still counts, metres.
const BIAS: f32 = 0.002;

/// Views more oblique than this are not used (cosine).
const MIN_FACING: f32 = 0.45;

/// Whether a part may be left out where it is covered: skin and cloth, not what moves into view with the face.
fn may_be_covered(part: Part) -> bool {
    part.is_cloth() || matches!(part, Part::Skin | Part::Shoes)
}

/// `[N_f]` whether a triangle can be seen, with hanging, spread or raised arms, or borders on one that can.
pub(super) fn visible_faces(person: &Person) -> Vec<bool> {
    let faces = person.template().faces();
    let casters: Vec<[u32; 3]> = faces
        .iter()
        .zip(person.parts())
        .filter(|(_, part)| !matches!(part, Part::Hair | Part::Brows | Part::Lashes))
        .map(|(face, _)| *face)
        .collect();
    let mut visible = vec![false; person.template().vertices().len()];
    for vertices in arms_down_and_up(person) {
        let normals = vertex_normals(&vertices, faces);
        let seen: Vec<Vec<bool>> = sphere_directions(DIRECTIONS)
            .collect::<Vec<_>>()
            .into_par_iter()
            .map(|towards| {
                let map = DepthMap::new(towards, MAP, &vertices, &casters);
                vertices
                    .iter()
                    .zip(&normals)
                    .map(|(vertex, normal)| {
                        normal.dot(towards).abs() > MIN_FACING
                            && map.visibility(*vertex + towards * BIAS, 1e-4) > 0.3
                    })
                    .collect()
            })
            .collect();
        for seen in seen {
            for (visible, seen) in visible.iter_mut().zip(seen) {
                *visible |= seen;
            }
        }
    }
    // One ring more: cloth shifts, and triangles are wider than the shift.
    let near = |visible: &[bool], face: &[u32; 3]| face.iter().any(|v| visible[*v as usize]);
    let mut grown = visible.clone();
    for face in faces.iter().filter(|face| near(&visible, face)) {
        face.iter().for_each(|v| grown[*v as usize] = true);
    }
    faces
        .iter()
        .zip(person.parts())
        .map(|(face, part)| !may_be_covered(*part) || near(&grown, face))
        .collect()
}
