//! Teeth and tongue: put behind the registered lips, in the colours of their textures, darker the deeper.

use super::additions::{Additions, brightness};
use super::head::Head;
use super::place::{Placement, Screen};
use super::textures::Textures;
use crate::body::{BodyModel, BodyPart, Registered};
use glam::DVec3;

/// Skin within this of the teeth's middle places them, metres in the rest pose.
const AROUND: f64 = 0.055;

/// Teeth stay this far behind the lips, metres, and move back for that by no more than the second.
const BEHIND: f64 = 0.0025;
const MOST_BACK: f64 = 0.015;

/// Width of the cells, metres.
const SPACING: f64 = 0.0015;

/// How far behind the front teeth the mouth is dark, metres.
const DARK: f64 = 0.028;

/// What is deeper than this behind the front teeth never shows, metres.
const DEEPEST: f64 = 0.04;

/// The teeth's texture is grey; teeth are in the shade of the lips, and a little yellow.
const TINT: DVec3 = DVec3::new(0.95, 0.89, 0.80);

/// The brightness of skin under which the textures look as painted.
const USUAL_SKIN: f64 = 0.60;

/// Puts teeth and tongue behind the lips and covers them; how far they had to move back, metres. `vertices` are the model's in the scan's
/// pose; those of teeth and tongue are moved.
#[expect(
    clippy::too_many_arguments,
    reason = "the registered body is three of them"
)]
pub(crate) fn cover(
    model: &BodyModel,
    registered: &Registered,
    shaped: &[DVec3],
    head: &Head,
    vertices: &mut [DVec3],
    textures: &Textures,
    skin: DVec3,
    additions: &mut Additions,
) -> f64 {
    let is_inside = |part: BodyPart| matches!(part, BodyPart::Teeth | BodyPart::Tongue);
    let mut own = vec![false; model.rest.len()];
    let mut teeth = vec![false; model.rest.len()];
    for (face, part) in model.faces.iter().zip(&model.parts) {
        for v in face {
            own[*v as usize] |= is_inside(*part);
            teeth[*v as usize] |= *part == BodyPart::Teeth;
        }
    }
    let members =
        |flags: &[bool]| -> Vec<usize> { (0..flags.len()).filter(|v| flags[*v]).collect() };
    let (own, teeth) = (members(&own), members(&teeth));
    if teeth.is_empty() {
        return 0.0;
    }
    let middle = teeth.iter().map(|v| shaped[*v]).sum::<DVec3>() / teeth.len() as f64;
    let forward = head.forward();
    if let Some(placement) = Placement::around(model, registered, shaped, middle, AROUND, |v| {
        head.mouth[v] > 0.001
    }) {
        for v in &own {
            vertices[*v] = placement.point(shaped[*v]);
        }
    }
    let placed = teeth.iter().map(|v| vertices[*v]).sum::<DVec3>() / teeth.len() as f64;
    let lips = Screen::new(model, vertices, placed, 0.05 * head.scale);
    let reach = MOST_BACK * head.scale;
    let back = (own.iter())
        .filter_map(|v| lips.nearest(vertices[*v], forward))
        .filter(|height| height.abs() < reach)
        .map(|height| BEHIND * head.scale - height)
        .fold(0.0, f64::max)
        .min(reach);
    for v in &own {
        vertices[*v] -= forward * back;
    }
    let front = teeth
        .iter()
        .map(|v| vertices[*v].dot(forward))
        .fold(f64::NEG_INFINITY, f64::max);
    let light = (brightness(skin) / USUAL_SKIN).clamp(0.5, 1.1);
    let mut cells = Vec::new();
    for quad in 0..model.faces.len() / 2 {
        let part = model.parts[2 * quad];
        if !is_inside(part) {
            continue;
        }
        cells.clear();
        head.patch(model, vertices, quad)
            .cells(SPACING * head.scale, &mut cells);
        for cell in &cells {
            let towards = if part == BodyPart::Teeth {
                forward
            } else {
                (forward + head.axes.y_axis).normalize_or(forward)
            };
            let depth = (front - cell.point.dot(forward)) / head.scale;
            if cell.normal.dot(towards) < 0.0 || depth > DEEPEST {
                continue;
            }
            let uv = (model.uvs[cell.triangle as usize].iter().zip(cell.shares))
                .map(|(uv, share)| uv.as_dvec2() * share)
                .sum::<glam::DVec2>();
            let texel = textures.colour(part, uv.as_vec2());
            let tint = if part == BodyPart::Teeth {
                TINT
            } else {
                DVec3::splat(0.75)
            };
            let dark = 1.0 - 0.75 * (depth / DARK).clamp(0.0, 1.0);
            additions.push(cell, 0.0, texel * tint * (light * dark), 0.98);
        }
    }
    back
}
