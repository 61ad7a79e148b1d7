//! Regions from landmarks, and whether the last picture's region still serves, as MediaPipe's calculators have them.

use crate::crop::{Region, turned_box};
use glam::Vec2;
use std::f32::consts::{FRAC_PI_2, PI, TAU};

/// The direction in a region that a vector between two landmarks is to have, as MediaPipe counts angles: against the clock.
#[derive(Debug, Clone, Copy)]
pub(super) enum Towards {
    /// To the right.
    Right,
    /// Up.
    Top,
    /// Down.
    Bottom,
}

/// How far a region is turned in which the vector from `start` to `end` points `towards`, radians in -pi..pi
/// (`DetectionsToRectsCalculator::ComputeRotation`).
pub(super) fn rotation(start: Vec2, end: Vec2, towards: Towards) -> f32 {
    let target = match towards {
        Towards::Right => 0.0,
        Towards::Top => FRAC_PI_2,
        Towards::Bottom => -FRAC_PI_2,
    };
    let d = end - start;
    normalise(target - (-d.y).atan2(d.x))
}

fn normalise(radians: f32) -> f32 {
    radians - TAU * ((radians + PI) / TAU).floor()
}

/// A rectangle in a picture, pixels and radians.
#[derive(Debug, Clone, Copy)]
pub(super) struct Rect {
    pub(super) centre: Vec2,
    pub(super) size: Vec2,
    pub(super) radians: f32,
}

impl Rect {
    /// The square about `centre` of which `edge` is the middle of a side (`AlignmentPointsRectsCalculator`).
    pub(super) fn aligned(centre: Vec2, edge: Vec2, towards: Towards) -> Self {
        Self {
            centre,
            size: Vec2::splat(2.0 * centre.distance(edge)),
            radians: rotation(centre, edge, towards),
        }
    }

    /// The upright box about `points`, said to be turned by `radians` (`DetectionsToRectsCalculator`: it does not turn the box that
    /// it measures).
    pub(super) fn about(points: impl IntoIterator<Item = Vec2>, radians: f32) -> Self {
        let (centre, size) = turned_box(points, 0.0);
        Self {
            centre,
            size,
            radians,
        }
    }

    /// The box about `points` whose sides are turned by `radians`.
    pub(super) fn turned_about(points: impl IntoIterator<Item = Vec2>, radians: f32) -> Self {
        let (centre, size) = turned_box(points, radians);
        Self {
            centre,
            size,
            radians,
        }
    }

    /// The square that `RectTransformationCalculator` makes of it with `square_long`: moved down by `shift_y` of its own height, as it
    /// is turned, then as long as its longer side and enlarged by `scale`. Nothing if it has no size or is not finite.
    pub(super) fn square(self, shift_y: f32, scale: f32) -> Option<Region> {
        let shift = Vec2::from_angle(self.radians).rotate(Vec2::new(0.0, self.size.y * shift_y));
        Region::new(
            self.centre + shift,
            self.size.max_element() * scale,
            self.radians,
        )
    }
}

/// How far the last picture's region may be from the one that was just searched (`RoiTrackingCalculator`).
#[derive(Debug, Clone, Copy)]
pub(super) struct Tracking {
    /// Radians.
    pub(super) rotation: f32,
    /// Along each side, in sides of the searched region.
    pub(super) translation: f32,
    /// In sides of the searched region.
    pub(super) scale: f32,
    /// What is added to the searched region's side, in sides, before all last landmarks must be in it.
    pub(super) margin: f32,
}

impl Tracking {
    /// Whether `last`, the region after the last picture's landmarks `points`, still serves beside `searched`.
    pub(super) fn holds(
        &self,
        last: &Region,
        searched: &Region,
        points: impl IntoIterator<Item = Vec2>,
    ) -> bool {
        let side = searched.side();
        let back = Vec2::from_angle(-searched.radians());
        let moved = back.rotate(last.centre() - searched.centre()).abs();
        let turned = normalise(last.radians() - searched.radians()).abs();
        let reach = side * (1.0 + self.margin) * 0.5;
        turned <= self.rotation
            && moved.max_element() <= side * self.translation
            && (last.side() - side).abs() <= side * self.scale
            && points
                .into_iter()
                .all(|p| back.rotate(p - searched.centre()).abs().max_element() < reach)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_region_is_turned_until_its_vector_points_where_it_should() {
        // MediaPipe's formula by hand: target - atan2(-dy, dx).
        for (end, towards, degrees) in [
            (Vec2::new(0.0, -1.0), Towards::Top, 0.0),
            (Vec2::new(1.0, 0.0), Towards::Top, 90.0),
            (Vec2::new(-1.0, 0.0), Towards::Top, -90.0),
            (Vec2::new(0.0, 1.0), Towards::Bottom, 0.0),
            (Vec2::new(1.0, 0.0), Towards::Bottom, -90.0),
            (Vec2::new(1.0, 1.0), Towards::Right, 45.0),
        ] {
            let got = rotation(Vec2::ZERO, end, towards).to_degrees();
            assert!((got - degrees).abs() < 1e-3, "{end} {towards:?}: {got}");
        }
    }

    #[test]
    fn the_last_region_holds_while_it_is_near_the_searched_one() {
        let tracking = Tracking {
            rotation: 0.7,
            translation: 0.2,
            scale: 0.4,
            margin: -0.1,
        };
        let at = |x: f32, side: f32, radians: f32| {
            Region::new(Vec2::new(x, 50.0), side, radians).unwrap()
        };
        let searched = at(50.0, 100.0, 3.0);
        let inside = [Vec2::new(50.0, 60.0)];
        for (last, points, holds, why) in [
            (at(55.0, 100.0, 3.0), inside, true, "near"),
            (at(75.0, 100.0, 3.0), inside, false, "too far"),
            (at(50.0, 150.0, 3.0), inside, false, "too large"),
            (
                at(50.0, 100.0, -3.0),
                inside,
                true,
                "turned by less than it seems",
            ),
            (at(50.0, 100.0, 2.0), inside, false, "turned too far"),
            (
                at(50.0, 100.0, 3.0),
                [Vec2::new(100.0, 50.0)],
                false,
                "a landmark beyond",
            ),
            (at(50.0, 100.0, 3.0), [Vec2::NAN], false, "no number"),
        ] {
            assert_eq!(tracking.holds(&last, &searched, points), holds, "{why}");
        }
    }
}
