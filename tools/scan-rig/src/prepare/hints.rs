//! Joints that the user placed: they stand in for what the network says of them, or cannot say, while the person is stood upright.

use super::landmarks::{JOINTS, limbs};
use super::refused;
use super::similarity::Similarity;
use crate::RigError;
use crate::median::median;
use crate::points::KeyPoint;
use crate::scan::Scan;
use glam::{DVec3, Vec3};
use motion_fit::landmarks::BODY_LANDMARKS;
use splat_scene::Scene;
use spmm3::Joint;

/// A joint is no farther from what the scan shows of the person, metres: a heavy person's hips are 0.2 from the skin.
const FARTHEST: f64 = 0.25;
/// Gaussians with less opacity show nothing.
const SHOWS: f32 = 0.1;
/// As many views as the body has see a landmark that the user placed.
const SUPPORT: f64 = 12.0;

/// A landmark and where the user put it.
pub(super) type PlacedLandmark = (usize, DVec3);

/// The user's joints, in the scene's axes and units.
pub(super) struct Hints(Vec<(Joint, DVec3)>);

impl Hints {
    /// Of joints in the file's own units and axes.
    pub(super) fn new(scene: &Scene, joints: &[(Joint, Vec3)]) -> Self {
        let at = |place: Vec3| scene.point_of_file(place).as_dvec3();
        let joints = joints.iter().map(|(joint, place)| (*joint, at(*place)));
        Self(joints.collect())
    }

    /// The landmarks that the user's joints are, in another space.
    pub(super) fn landmarks(&self, space_from_scene: &Similarity) -> Vec<PlacedLandmark> {
        let landmark = |joint: Joint| JOINTS.iter().find(|(known, _)| *known == joint);
        (self.0.iter())
            .filter_map(|(joint, at)| Some((landmark(*joint)?.1, space_from_scene.point(*at))))
            .collect()
    }

    /// Refuses a joint that is far from the person: most likely one of its numbers is wrong. `person` is the person's scan, about in metres.
    pub(super) fn check(
        &self,
        scene: &Scene,
        person: &Scan,
        person_from_scene: &Similarity,
        corners: (Vec3, Vec3),
    ) -> Result<(), RigError> {
        for (joint, place) in &self.0 {
            let place = person_from_scene.point(*place);
            let shown = person.positions.iter().zip(&person.opacities);
            let apart = shown
                .filter(|(_, opacity)| **opacity > SHOWS)
                .map(|(at, _)| at.as_dvec3().distance_squared(place))
                .fold(f64::INFINITY, f64::min)
                .sqrt();
            if apart.is_nan() || apart >= FARTHEST {
                return Err(refused::astray(scene, *joint, apart, corners));
            }
        }
        Ok(())
    }
}

/// The network's landmarks, and the user's in their places.
pub(super) fn with(
    points: &[KeyPoint; BODY_LANDMARKS],
    placed: &[PlacedLandmark],
) -> [KeyPoint; BODY_LANDMARKS] {
    let mut points = *points;
    for (landmark, position) in placed {
        points[*landmark] = KeyPoint {
            position: *position,
            residual: 0.0,
            support: SUPPORT,
        };
    }
    points
}

/// How well views agree on the joints of the limbs that the user did not place, metres: the median. 0 if the user placed all.
pub(super) fn residual(points: &[KeyPoint; BODY_LANDMARKS], placed: &[PlacedLandmark]) -> f64 {
    let is_placed = |joint: Joint| {
        let of_joint = |(landmark, _): &PlacedLandmark| JOINTS.contains(&(joint, *landmark));
        placed.iter().any(of_joint)
    };
    let found = limbs(points).filter(|(joint, _)| !is_placed(*joint));
    median(found.map(|(_, point)| point.residual)).unwrap_or_default()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn placed_joints_do_not_make_the_others_look_exact() {
        let mut points = [KeyPoint::default(); BODY_LANDMARKS];
        for point in &mut points {
            point.residual = 0.04;
        }
        let placed: Vec<PlacedLandmark> = (JOINTS.iter().skip(1))
            .map(|(_, landmark)| (*landmark, DVec3::ZERO))
            .collect();
        assert_eq!(residual(&points, &placed), 0.04, "eleven of twelve placed");
        // Most are wrong, and placed: what is left is as it was.
        let (wrong, _) = JOINTS.split_at(7);
        for (_, landmark) in wrong {
            points[*landmark].residual = 0.2;
        }
        let placed: Vec<PlacedLandmark> = (wrong.iter())
            .map(|(_, landmark)| (*landmark, DVec3::ZERO))
            .collect();
        assert_eq!(residual(&points, &placed), 0.04, "seven placed");
        let all: Vec<PlacedLandmark> = JOINTS.iter().map(|(_, at)| (*at, DVec3::ZERO)).collect();
        assert_eq!(residual(&points, &all), 0.0, "all placed");
    }
}
