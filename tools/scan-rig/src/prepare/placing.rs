//! Where the person stands: up, front, the floor, the size.

use super::found::{Found, Known, USUAL_HEIGHT};
use super::hints::{Hints, PlacedLandmark, with};
use super::landmarks::{ANKLES, HEELS, HIPS, SHOULDERS, TOES, limbs};
use super::looking::{MOST_DRAWN, look_around};
use super::networks::Networks;
use super::refused;
use super::sample::thinned;
use super::similarity::Similarity;
use super::stance::{
    body_axis, centre_of_mass, exchanged, extent, facing, is_exchanged, stand, turn_to, upright,
};
use crate::RigError;
use crate::points::KeyPoint;
use crate::scan::Scan;
use crate::sight::Sight;
use glam::DVec3;
use motion_fit::landmarks::BODY_LANDMARKS;
use spmm3::Joint;

/// Views of the body while up is looked for, and their share of the usual size.
const FIRST_VIEWS: (u32, f64) = (8, 0.6);
/// Up is looked for again while it turns by more than this, radians.
const SETTLED: f64 = 0.06;
/// ... and so many times.
const PASSES: usize = 3;
/// An axis of the scene that is up to this is up, radians.
const AS_GOOD_AS_AXIS: f64 = 0.065;

/// Where the scan's person stands.
pub(super) struct Stood {
    pub(super) person_from_normal: Similarity,
    /// What is known of up, in the person's space.
    pub(super) known: Option<Known>,
    /// From the best axis to up, radians.
    pub(super) tilt: f64,
}

/// Turns up until the views agree with it.
pub(super) fn stood(
    found: &Found,
    height: f64,
    hints: &Hints,
    sight: &mut Sight,
    networks: &mut Networks,
) -> Result<Stood, RigError> {
    sight.set(&thinned(&found.normal, MOST_DRAWN));
    let mut up = found.known.map_or(found.up, |known| known.up);
    let mut front = up.any_orthonormal_vector();
    let mut known = found.known;
    let hints = hints.landmarks(&found.normal_from_scene);
    let mut pass = 0;
    loop {
        pass += 1;
        let (seen, ..) = look_around(&found.normal, up, front, FIRST_VIEWS, sight, networks)?;
        let mut points = seen.points;
        let place = |points: &mut _, known| {
            onto_the_floor(&found.normal, points, &hints, known, USUAL_HEIGHT, height)
        };
        let mut turned = place(&mut points, known)?;
        let new_up = turned.rotation.inverse() * DVec3::Y;
        let moved = new_up.angle_between(up);
        log::debug!("up turned by {:.1} degrees", moved.to_degrees());
        if moved < SETTLED || pass == PASSES {
            if known.is_none()
                && let Some(up) = axis_at(new_up)
            {
                known = Some(Known { up, level: None });
                turned = place(&mut points, known)?;
            }
            let up = turned.rotation.inverse() * DVec3::Y;
            return Ok(Stood {
                person_from_normal: turned,
                known: known.map(|known| Known {
                    up: DVec3::Y,
                    level: known.level.map(|_| 0.0),
                }),
                tilt: up.angle_between(found.up),
            });
        }
        up = new_up;
        front = turned.rotation.inverse() * DVec3::Z;
    }
}

/// The axis of the scene that is as near to up as a body can tell: a scan that is that upright was stood upright by the program that wrote it,
/// by the device's sense of gravity or by hand.
fn axis_at(up: DVec3) -> Option<DVec3> {
    DVec3::AXES
        .into_iter()
        .flat_map(|axis| [axis, -axis])
        .find(|axis| axis.angle_between(up) < AS_GOOD_AS_AXIS)
}

/// The movement after which the person stands on y = 0 above the origin, faces +z, and is so many metres tall. Exchanges left and right of
/// `points` if all views took one for the other; `placed` are landmarks that the user knows better. `size` is about how tall the person is
/// now.
pub(super) fn onto_the_floor(
    scan: &Scan,
    points: &mut [KeyPoint; BODY_LANDMARKS],
    placed: &[PlacedLandmark],
    known: Option<Known>,
    size: f64,
    height: f64,
) -> Result<Similarity, RigError> {
    let missing = || refused::incomplete("head or feet");
    let mut marked = with(points, placed);
    let unseen = limbs(&marked).filter(|(_, point)| point.support <= 0.0);
    let unseen: Vec<Joint> = unseen.map(|(joint, _)| joint).collect();
    if !unseen.is_empty() {
        return Err(refused::unseen(&unseen));
    }
    let up = match known {
        Some(known) => known.up,
        None => {
            let axis = body_axis(&marked).ok_or_else(missing)?;
            let feet = feet_of(scan, &marked, 0.14 * size);
            let soles = stand(&feet, centre_of_mass(&marked), axis, size);
            upright(&marked, axis, soles)
        }
    };
    let mut front = facing(&marked, up).ok_or_else(missing)?;
    if is_exchanged(&marked, front) {
        *points = exchanged(points);
        marked = with(points, placed);
        front = -front;
    }
    let (lowest, top) = extent(scan, &marked, up, size);
    let lowest = lowest.ok_or_else(|| refused::incomplete("feet"))?;
    let top = top.ok_or_else(|| refused::incomplete("a head"))?;
    // Where a floor was taken off, the soles were cut by its thickness. A platform is higher than the floor.
    let floor = known.and_then(|known| known.level);
    let floor = floor.filter(|level| (lowest - level).abs() < 0.03 * size);
    let bottom = floor.unwrap_or(lowest);
    if bottom >= top {
        return Err(missing());
    }
    let scale = height / (top - bottom);
    let rotation = turn_to(up, front);
    let trunk = [SHOULDERS, HIPS].concat();
    let middle = trunk.iter().map(|at| marked[*at].position).sum::<DVec3>() / 4.0;
    let middle = rotation * middle;
    Ok(Similarity {
        scale,
        rotation,
        translation: -DVec3::new(middle.x, bottom, middle.z) * scale,
    })
}

/// Points of the scan near the feet.
fn feet_of(scan: &Scan, points: &[KeyPoint; BODY_LANDMARKS], radius: f64) -> Vec<DVec3> {
    let feet: Vec<DVec3> = [ANKLES, HEELS, TOES]
        .concat()
        .iter()
        .map(|at| points[*at].position)
        .collect();
    let all = scan.positions.iter().zip(&scan.opacities);
    let opaque = all
        .filter(|(_, opacity)| **opacity > 0.3)
        .map(|(point, _)| point.as_dvec3());
    opaque
        .filter(|point| feet.iter().any(|foot| (*point - *foot).length() < radius))
        .collect()
}

#[cfg(test)]
mod tests {
    use super::super::landmarks::{EARS, ELBOWS, EYES, INDICES, KNEES, NOSE, WRISTS};
    use super::*;
    use glam::{Quat, Vec3};

    /// A figure of 1.7 m that faces +z, and Gaussians about its landmarks.
    fn figure() -> (Scan, [KeyPoint; BODY_LANDMARKS]) {
        let mut points = [KeyPoint {
            position: DVec3::new(0.0, 1.55, 0.1),
            residual: 0.01,
            support: 5.0,
        }; BODY_LANDMARKS];
        points[NOSE].position.z = 0.13;
        for (pair, [x, y, z]) in [
            (EYES, [0.03, 1.6, 0.1]),
            (EARS, [0.08, 1.6, 0.0]),
            (SHOULDERS, [0.18, 1.4, 0.0]),
            (ELBOWS, [0.3, 1.15, 0.0]),
            (WRISTS, [0.35, 0.9, 0.05]),
            (INDICES, [0.36, 0.8, 0.07]),
            (HIPS, [0.1, 0.9, 0.0]),
            (KNEES, [0.11, 0.5, 0.0]),
            (ANKLES, [0.11, 0.08, -0.03]),
            (HEELS, [0.11, 0.02, -0.07]),
            (TOES, [0.11, 0.02, 0.15]),
        ] {
            points[pair[0]].position = DVec3::new(x, y, z);
            points[pair[1]].position = DVec3::new(-x, y, z);
        }
        let mut scan = Scan::default();
        let mut put = |at: Vec3| {
            scan.positions.push(at);
            scan.rotations.push(Quat::IDENTITY);
            scan.scales.push(Vec3::splat(0.01));
            scan.opacities.push(0.9);
            scan.colours.push(Vec3::ONE);
        };
        for point in &points {
            for step in 0_u8..40 {
                let angle = f32::from(step);
                put(point.position.as_vec3() + 0.03 * Vec3::new(angle.sin(), 0.0, angle.cos()));
            }
        }
        (0..40).for_each(|_| put(Vec3::new(0.0, 1.7, 0.0)));
        (scan, points)
    }

    #[test]
    fn a_joint_that_no_view_shows_is_asked_for_and_the_users_will_do() {
        let (scan, points) = figure();
        let known = Some(Known {
            up: DVec3::Y,
            level: None,
        });
        let whole =
            onto_the_floor(&scan, &mut points.clone(), &[], known, 1.7, 1.7).expect("it stands");
        let mut partial = points;
        partial[HIPS[0]] = KeyPoint::default();
        let refused =
            onto_the_floor(&scan, &mut partial, &[], known, 1.7, 1.7).expect_err("no hip");
        assert!(
            refused.to_string().contains("--joint left_hip=x,y,z"),
            "{refused}"
        );
        let hip = [(HIPS[0], points[HIPS[0]].position)];
        let with_it =
            onto_the_floor(&scan, &mut partial, &hip, known, 1.7, 1.7).expect("with the hip");
        assert_eq!(with_it, whole, "as if it had been seen");
    }
}
