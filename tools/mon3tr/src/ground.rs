//! The height of a scene's ground below a point: where a person who is put there sets the feet.

use glam::{Vec2, Vec3};
use splat_scene::Scene;

/// Fainter Gaussians are haze, not ground.
const OPAQUE: f32 = 0.5;

/// What lies so far around the point counts, metres.
const AROUND: f32 = 0.6;

/// Height of a layer that is looked at as one, metres.
const LAYER: f32 = 0.1;

/// The lowest layer is the ground if it holds so much of what the fullest one holds: strays below it do not.
const ENOUGH: f32 = 0.25;

/// Fewer Gaussians around a point tell nothing of it.
const FEW: usize = 20;

/// Height in metres (y) of the ground around a point of a scene that lies in the world: the middle of the lowest layer of
/// 10 cm that is well filled. Where there is next to nothing, that of the whole scene; nothing for an empty scene.
pub(crate) fn height(scene: &Scene, at: Vec3) -> Option<f32> {
    let solid: Vec<Vec3> = scene
        .positions()
        .iter()
        .zip(scene.opacities())
        .filter(|(_, opacity)| **opacity >= OPAQUE)
        .map(|(position, _)| Vec3::from_array(*position))
        .collect();
    let near: Vec<f32> = solid
        .iter()
        .filter(|p| Vec2::new(p.x, p.z).distance(Vec2::new(at.x, at.z)) <= AROUND)
        .map(|p| p.y)
        .collect();
    if near.len() >= FEW {
        lowest_layer(near)
    } else {
        lowest_layer(solid.iter().map(|p| p.y).collect())
    }
}

fn lowest_layer(mut heights: Vec<f32>) -> Option<f32> {
    heights.sort_by(f32::total_cmp);
    // The layer that begins at each height, ascending, so that its end only ever moves up.
    let mut end = 0;
    let layers: Vec<(usize, usize)> = heights
        .iter()
        .enumerate()
        .map(|(start, bottom)| {
            while heights
                .get(end)
                .is_some_and(|height| *height < bottom + LAYER)
            {
                end += 1;
            }
            (start, end)
        })
        .collect();
    let held = |(start, end): &(usize, usize)| end.saturating_sub(*start);
    let fullest = layers.iter().map(held).max()?;
    let (start, end) = layers
        .iter()
        .find(|layer| held(layer) as f32 >= ENOUGH * fullest as f32)?;
    heights.get(usize::midpoint(*start, *end)).copied()
}

#[cfg(test)]
mod tests {
    use super::lowest_layer;

    #[test]
    fn the_ground_is_the_lowest_full_layer_whatever_stands_on_it_or_lies_astray_below() {
        let strays = [-3.0, -2.0, -1.9];
        let floor = (0..200).map(|k| 0.5 + 0.0002 * k as f32);
        let table = (0..600).map(|_| 1.2);
        let ground = lowest_layer(strays.into_iter().chain(floor).chain(table).collect());
        assert!(
            ground.is_some_and(|height| (0.5..0.55).contains(&height)),
            "{ground:?}"
        );
        assert_eq!(lowest_layer(Vec::new()), None, "nothing at all");
        assert_eq!(lowest_layer(vec![2.0]), Some(2.0), "a single one");
    }
}
