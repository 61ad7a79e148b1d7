//! Where the rim of a posed mesh should be in a picture: its vertices between faces that look to the camera and faces that look away, against the outline
//! of the mask.

use crate::body::Body;
use crate::observe::View;
use crate::raster::{Drawn, draw};
use glam::{DVec2, DVec3};

/// How far beside a rim vertex nothing may be drawn, pixels: the rims of limbs in front of the body are not the mask's outline.
const BESIDE: f64 = 2.0;

/// Least cosine between the rim's normal in the picture and the way out of the mask.
const FACING: f64 = 0.4;

/// A vertex that stands for so much of the rim has weight 1, metres.
const USUAL_SPACING: f64 = 0.012;

/// What the outline of a mask asks of a vertex.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Pull {
    pub(crate) vertex: usize,
    /// Unit, in the world.
    pub(crate) direction: DVec3,
    /// How far the vertex should move along it, metres.
    pub(crate) distance: f64,
    pub(crate) weight: f64,
}

/// A posed mesh.
#[derive(Debug, Clone, Copy)]
pub(crate) struct PosedMesh<'a> {
    /// `[N_v]` in the world, metres.
    pub(crate) vertices: &'a [DVec3],
    /// `[N_v]` unit.
    pub(crate) normals: &'a [DVec3],
}

/// The pulls of one view, and how well the drawn mesh covers the mask. `reach`: what is so far off has a quarter of the weight, metres; what is three
/// times as far has none.
pub(crate) fn pulls(body: &Body, mesh: PosedMesh<'_>, view: &View, reach: f64) -> Vec<Pull> {
    let camera = &view.camera;
    let drawn = draw(camera, mesh.vertices, &body.outer_faces);
    let eye = camera.position();
    let (mut sides, mut spacing) = (
        vec![0_u8; mesh.vertices.len()],
        vec![0.0_f64; mesh.vertices.len()],
    );
    for face in &body.outer_faces {
        let [a, b, c] = face.map(|v| mesh.vertices[v as usize]);
        let normal = (b - a).cross(c - a);
        let side = if normal.dot(eye - a) > 0.0 { 1 } else { 2 };
        let length = normal.length().sqrt();
        for v in face {
            sides[*v as usize] |= side;
            spacing[*v as usize] = spacing[*v as usize].max(length);
        }
    }
    let rotation = camera.camera_from_world.matrix3;
    let focal = DVec2::from(camera.focal);
    let pull = |vertex: usize| {
        let place = mesh.vertices[vertex];
        let sight = camera.camera_from_world.transform_point3(place);
        if sight.z < 0.1 {
            return None;
        }
        let slopes = sight.truncate() / sight.z;
        let pixel = slopes * focal + DVec2::from(camera.centre);
        // How the pixel moves with the place in camera axes, along a direction of the picture.
        let gradient = |along: DVec2| {
            let scaled = along * focal / sight.z;
            scaled.extend(-scaled.dot(slopes))
        };
        let normal = rotation * mesh.normals[vertex];
        let across = DVec2::new(
            gradient(DVec2::X).dot(normal),
            gradient(DVec2::Y).dot(normal),
        );
        let across = across.try_normalize()?;
        if drawn.covers(pixel + BESIDE * across) || !near(&drawn, pixel - across, sight.z) {
            return None;
        }
        let (value, outwards) = view.outline.at(pixel)?;
        let outwards = outwards.try_normalize()?;
        if outwards.dot(across) < FACING {
            return None;
        }
        let pixels = gradient(outwards);
        let length = pixels.length();
        let distance = -value / length;
        let fall = 1.0 + (distance / reach).powi(2);
        let weight = body.model.hand_factor(vertex)
            * (spacing[vertex] / USUAL_SPACING).clamp(0.1, 2.0)
            / (fall * fall);
        (distance.abs() < 3.0 * reach && length > 0.0).then(|| Pull {
            vertex,
            direction: rotation.transpose() * (pixels / length),
            distance,
            weight,
        })
    };
    (0..body.model.body_vertices)
        .filter(|v| sides[*v] == 3 && body.free[*v])
        .filter_map(pull)
        .collect()
}

/// Whether what is drawn at a point is about as deep as `depth`, metres.
fn near(drawn: &Drawn, point: DVec2, depth: f64) -> bool {
    drawn.pixel(point).is_some_and(|pixel| {
        let nearness = f64::from(drawn.nearness[pixel]);
        nearness > 0.0 && (1.0 / nearness - depth).abs() < 0.15
    })
}

/// Pixels that both the mesh and the mask cover, and those that one of them does.
pub(crate) fn overlap(body: &Body, vertices: &[DVec3], view: &View) -> (usize, usize) {
    let drawn = draw(&view.camera, vertices, &body.outer_faces);
    let (mut both, mut either) = (0, 0);
    for pixel in 0..view.outline.pixels() {
        let mesh = drawn.nearness.get(pixel).is_some_and(|n| *n > 0.0);
        let mask = view.outline.inside(pixel);
        both += usize::from(mesh && mask);
        either += usize::from(mesh || mask);
    }
    (both, either)
}
