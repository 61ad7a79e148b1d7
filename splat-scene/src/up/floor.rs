//! Which side of a scene is down, by its shape: a level surface at one end that reaches under nearly all of it, with nothing
//! alike at the other end or on another side. A room, whose walls and ceiling are alike, and a single object
//! give no evidence.

use glam::Vec3;

use crate::Bounds;
use crate::axes::Direction;

/// Fainter Gaussians are haze.
const OPAQUE: f32 = 0.5;
/// Below this number of Gaussians no floor is looked for.
const FEWEST: usize = 1000;
/// The ground plan is seen in so many cells along each side.
const CELLS: usize = 24;
/// Layers along the axis that is looked along.
const LAYERS: usize = 40;
/// The layers at either end that may hold the floor: scenes have strays below it.
const END_LAYERS: usize = 8;
/// A floor fills so much of the ground plan within one layer.
const FLOOR: f32 = 0.75;
/// The opposite end fills at most this share.
const OPPOSITE: f32 = 0.4;
/// Every other side fills at most this share.
const OTHERS: f32 = 0.6;
/// The least height of a scene above its floor, as a share of its greatest extent: a mere plane has no upper side.
const LEAST_HEIGHT: f32 = 0.03;

/// The direction away from the floor, and the share of the ground plan that the floor fills.
pub(super) fn find(positions: &[[f32; 3]], opacities: &[f32]) -> Option<(Direction, f32)> {
    let solid = solid(positions, opacities)?;
    let bounds = Bounds::around_most(&solid, 0.01)?;
    let ends = [0, 1, 2].map(|axis| fillings(&solid, &bounds, axis));
    let (axis, &[low, high]) = ends
        .iter()
        .enumerate()
        .max_by(|(_, a), (_, b)| a[0].max(a[1]).total_cmp(&b[0].max(b[1])))?;
    let others = ends
        .iter()
        .enumerate()
        .filter(|(other, _)| *other != axis)
        .flat_map(|(_, ends)| *ends)
        .fold(0.0, f32::max);
    let (floor, opposite, sign) = if low > high {
        (low, high, 1.0)
    } else {
        (high, low, -1.0)
    };
    let extents = [0, 1, 2].map(|axis| bounds.max[axis] - bounds.min[axis]);
    let greatest = extents.iter().copied().fold(0.0, f32::max);
    let flat = extents[axis] < LEAST_HEIGHT * greatest;
    if flat || floor < FLOOR || opposite > OPPOSITE || others > OTHERS {
        return None;
    }
    Some((along(axis, sign), floor))
}

/// The direction in which the scene rises from the level of the origin, if it is y's or the opposite: for a file whose y
/// may point up or down, and in which an editor has put the scene.
pub(super) fn stands_on_origin(positions: &[[f32; 3]], opacities: &[f32]) -> Option<Direction> {
    /// The end is so near to the origin, as a share of the height.
    const NEAR: f32 = 0.03;
    let solid = solid(positions, opacities)?;
    let bounds = Bounds::around_most(&solid, 0.01)?;
    let (low, high) = (bounds.min[1], bounds.max[1]);
    let near = NEAR * (high - low);
    match (low.abs() <= near, high.abs() <= near) {
        (true, false) => Some(Direction::Up),
        (false, true) => Some(Direction::Down),
        _ => None,
    }
}

fn solid(positions: &[[f32; 3]], opacities: &[f32]) -> Option<Vec<[f32; 3]>> {
    let solid: Vec<[f32; 3]> = positions
        .iter()
        .zip(opacities)
        .filter(|(_, opacity)| **opacity >= OPAQUE)
        .map(|(position, _)| *position)
        .collect();
    (solid.len() >= FEWEST).then_some(solid)
}

/// How much of the ground plan, seen along an axis, the fullest layer at its lower and at its upper end fills.
fn fillings(positions: &[[f32; 3]], bounds: &Bounds, axis: usize) -> [f32; 2] {
    let cell = |position: &[f32; 3], axis: usize, cells: usize| {
        let (low, high) = (bounds.min[axis], bounds.max[axis]);
        let share = (position[axis] - low) / (high - low).max(f32::MIN_POSITIVE);
        // Around the edge lies the rest of the hundredth that the bounds leave out.
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            clippy::cast_precision_loss,
            reason = "a share of a small count"
        )]
        (-0.02..=1.02)
            .contains(&share)
            .then(|| ((share.clamp(0.0, 1.0) * cells as f32) as usize).min(cells - 1))
    };
    let mut layers = vec![[false; CELLS * CELLS]; LAYERS];
    for position in positions {
        let [u, v] = [(axis + 1) % 3, (axis + 2) % 3].map(|side| cell(position, side, CELLS));
        let (Some(u), Some(v), Some(layer)) = (u, v, cell(position, axis, LAYERS)) else {
            continue;
        };
        if let Some(filled) = layers
            .get_mut(layer)
            .and_then(|layer| layer.get_mut(u * CELLS + v))
        {
            *filled = true;
        }
    }
    let count = |layer: &[bool; CELLS * CELLS]| layer.iter().filter(|filled| **filled).count();
    let plan = (0..CELLS * CELLS)
        .filter(|&cell| layers.iter().any(|layer| layer[cell]))
        .count();
    #[expect(clippy::cast_precision_loss, reason = "at most 576")]
    let fullest = |layers: &[[bool; CELLS * CELLS]]| {
        layers.iter().map(count).max().unwrap_or(0) as f32 / plan.max(1) as f32
    };
    let (lower, _) = layers.split_at(END_LAYERS);
    let (_, upper) = layers.split_at(LAYERS - END_LAYERS);
    [fullest(lower), fullest(upper)]
}

fn along(axis: usize, sign: f32) -> Direction {
    let mut vector = Vec3::ZERO;
    vector[axis] = sign;
    Direction::nearest(vector)
}
