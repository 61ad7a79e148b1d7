//! Where a Gaussian is relative to the scan's surface and to the body's skin.

use super::clean::Place;
use crate::RigError;
use crate::body::BodyModel;
use crate::nearest::Nearest;
use crate::surface::Surface;
use glam::Vec3;

/// The scan's surface, to ask where a Gaussian is relative to it.
pub(super) struct Ground<'a> {
    surface: &'a Surface,
    tree: Nearest<3>,
}

/// A place and the surface's normal there.
#[derive(Debug, Clone, Copy)]
pub(super) struct Placed {
    pub(super) place: Place,
    pub(super) normal: Vec3,
}

impl<'a> Ground<'a> {
    pub(super) fn new(surface: &'a Surface) -> Result<Self, RigError> {
        if surface.points.is_empty() {
            return Err(RigError::unsuited(
                "the scan has no surface: nothing in it is opaque from outside; train it longer, or export it without transparency",
            ));
        }
        let points: Vec<_> = surface.points.iter().map(|p| p.to_array()).collect();
        Ok(Self {
            surface,
            tree: Nearest::new(&points),
        })
    }

    pub(super) fn place(&self, position: Vec3) -> Placed {
        let Some(found) = self.tree.one(&position.to_array()) else {
            let place = Place {
                distance: f32::INFINITY,
                height: 0.0,
            };
            return Placed {
                place,
                normal: Vec3::Y,
            };
        };
        let normal = self.surface.normals[found.at];
        let place = Place {
            distance: found.squared.sqrt(),
            height: (position - self.surface.points[found.at]).dot(normal),
        };
        Placed { place, normal }
    }
}

/// The body's skin, to ask whether something is off it.
pub(super) struct Skin<'a> {
    vertices: &'a [Vec3],
    normals: Vec<Vec3>,
    names: Vec<u32>,
    tree: Nearest<3>,
}

impl<'a> Skin<'a> {
    pub(super) fn new(model: &BodyModel, vertices: &'a [Vec3]) -> Self {
        let mut normals = vec![Vec3::ZERO; vertices.len()];
        for face in &model.faces {
            let [a, b, c] = face.map(|v| vertices[v as usize]);
            for vertex in face {
                normals[*vertex as usize] += (b - a).cross(c - a);
            }
        }
        let names: Vec<u32> = (0_u32..)
            .zip(&model.outer)
            .filter(|(_, outer)| **outer)
            .map(|(at, _)| at)
            .collect();
        let points: Vec<_> = names
            .iter()
            .map(|at| vertices[*at as usize].to_array())
            .collect();
        Self {
            vertices,
            normals,
            tree: Nearest::new(&points),
            names,
        }
    }

    /// How far outside of the skin a point is, to the nearest vertex, metres; 0 inside.
    pub(super) fn off(&self, point: Vec3) -> f32 {
        self.tree.one(&point.to_array()).map_or(0.0, |found| {
            let vertex = self.names[found.at] as usize;
            let outside = (point - self.vertices[vertex]).dot(self.normals[vertex]) > 0.0;
            if outside { found.squared.sqrt() } else { 0.0 }
        })
    }
}
