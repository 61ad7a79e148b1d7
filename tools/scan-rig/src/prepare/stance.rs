//! How a person stands, from landmarks in space and the scan: where up is to a degree or two, where the person faces, how tall
//! the scan is.

use super::landmarks::{
    ANKLES, EARS, ELBOWS, HEELS, HIPS, INDICES, KNEES, NOSE, SHOULDERS, TOES, WRISTS, mirrored,
};
use crate::points::KeyPoint;
use crate::scan::Scan;
use glam::{DQuat, DVec3};
use motion_fit::landmarks::BODY_LANDMARKS;

type Points = [KeyPoint; BODY_LANDMARKS];

/// The middle of a pair.
fn middle(points: &Points, pair: [usize; 2]) -> DVec3 {
    (points[pair[0]].position + points[pair[1]].position) / 2.0
}

/// Where a body's weight acts, from its landmarks: the segments' masses and centres after Winter, *Biomechanics and Motor Control of
/// Human Movement*, table 4.1.
#[must_use]
pub fn centre_of_mass(points: &Points) -> DVec3 {
    let at = |landmark: usize| points[landmark].position;
    let (shoulders, hips, ears) = (
        middle(points, SHOULDERS),
        middle(points, HIPS),
        middle(points, EARS),
    );
    let mut sum = shoulders.lerp(hips, 0.5) * 0.497 + ears * 0.081;
    for side in [0, 1] {
        let [shoulder, elbow, wrist] = [SHOULDERS, ELBOWS, WRISTS].map(|pair| at(pair[side]));
        let [hip, knee, ankle, heel, toe] =
            [HIPS, KNEES, ANKLES, HEELS, TOES].map(|pair| at(pair[side]));
        sum += shoulder.lerp(elbow, 0.436) * 0.028;
        sum += elbow.lerp(wrist, 0.682) * 0.022;
        sum += hip.lerp(knee, 0.433) * 0.100;
        sum += knee.lerp(ankle, 0.433) * 0.0465;
        sum += heel.lerp(toe, 0.5) * 0.0145;
    }
    sum
}

/// The direction from the feet to the centre of mass above them: up to a degree or two, since a person who stands still has it there.
#[must_use]
pub fn body_axis(points: &Points) -> Option<DVec3> {
    // Between heel and tip, nearer to the heel: where the weight of a quiet stance is.
    let feet = middle(points, HEELS).lerp(middle(points, TOES), 0.42);
    let ankles = middle(points, ANKLES);
    // Tips and heels are uncertain; ankles are not, and lie above the hind part of the feet.
    (centre_of_mass(points) - feet.lerp(ankles, 0.3)).try_normalize()
}

/// A turn beyond which the plane below the feet is not followed, in radians: beyond it the scan would have to say more than its soles do.
const FARTHEST: f64 = 0.12;
/// How much a turn away from the body's axis costs, in heights per squared radian: soles that touch the floor at one toe's or one
/// heel's length from the centre turn the axis by 3 degrees at most.
const PRIOR: f64 = 0.5;
/// Share of the feet's points that may lie below the plane they stand on.
const BELOW: f64 = 0.01;

/// Up as the soles have it: the direction near `axis` in which the centre of mass is lowest above the plane that the feet touch, as is the
/// case for what stands. `feet` are points on the feet, `height` is the person's.
#[must_use]
pub fn stand(feet: &[DVec3], centre: DVec3, axis: DVec3, height: f64) -> DVec3 {
    if feet.len() < 100 {
        return axis;
    }
    let first = axis.any_orthonormal_vector();
    let second = axis.cross(first);
    let direction = |turn: [f64; 2]| (axis + first * turn[0] + second * turn[1]).normalize();
    let mut levels = Vec::new();
    let mut cost = |turn: [f64; 2]| {
        let up = direction(turn);
        levels.clear();
        levels.extend(feet.iter().map(|point| point.dot(up)));
        #[expect(
            clippy::cast_precision_loss,
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "a share of a count"
        )]
        let below = (levels.len() as f64 * BELOW) as usize;
        let (_, level, _) = levels.select_nth_unstable_by(below, f64::total_cmp);
        (centre.dot(up) - *level) / height + PRIOR * (turn[0].powi(2) + turn[1].powi(2))
    };
    // Ever finer steps in eight directions: the cost has edges, which gradients do not see.
    let (mut turn, mut step) = ([0.0, 0.0], 0.03);
    let mut least = cost(turn);
    while step > 5e-4 {
        let mut moved = false;
        for (x, y) in [
            (1, 0),
            (-1, 0),
            (0, 1),
            (0, -1),
            (1, 1),
            (1, -1),
            (-1, 1),
            (-1, -1),
        ] {
            let tried = [turn[0] + step * f64::from(x), turn[1] + step * f64::from(y)];
            let far = tried[0].hypot(tried[1]) > FARTHEST;
            let found = cost(tried);
            if !far && found < least {
                (least, turn, moved) = (found, tried, true);
            }
        }
        if !moved {
            step /= 2.0;
        }
    }
    direction(turn)
}

/// Up from three witnesses: the body's axis and the direction across the soles, whose mean it is, and from side to side also the lines through
/// shoulders, hips and ears, which are level in the mean. Each errs by 2 to 4 degrees for people in boots, and not alike.
#[must_use]
pub fn upright(points: &Points, axis: DVec3, soles: DVec3) -> DVec3 {
    let up = (axis + soles).normalize();
    let Some(front) = facing(points, up) else {
        return up;
    };
    let left = up.cross(front);
    let slope = |pair: [usize; 2]| {
        let line = points[pair[0]].position - points[pair[1]].position;
        line.dot(up).atan2(line.dot(left))
    };
    let slope = (slope(SHOULDERS) + slope(HIPS) + slope(EARS)) / 3.0;
    (up - left * (slope / 3.0)).normalize()
}

/// Where the person faces: across the line of shoulders and hips, level. The sign is that of the landmarks' names.
#[must_use]
pub fn facing(points: &Points, up: DVec3) -> Option<DVec3> {
    let across = |pair: [usize; 2]| points[pair[0]].position - points[pair[1]].position;
    let left = across(SHOULDERS) + across(HIPS);
    left.cross(up).try_normalize()
}

/// Whether nose and feet point backwards: then left and right are exchanged in all views.
#[must_use]
pub fn is_exchanged(points: &Points, facing: DVec3) -> bool {
    let face = points[NOSE].position - middle(points, EARS);
    let feet = middle(points, TOES) - middle(points, HEELS);
    (face * 2.0 + feet).dot(facing) < 0.0
}

/// The same landmarks with left and right exchanged.
#[must_use]
pub fn exchanged(points: &Points) -> Points {
    std::array::from_fn(|landmark| points[mirrored(landmark)])
}

/// The turn after which `up` is +y and `front` (level) is +z.
#[must_use]
pub fn turn_to(up: DVec3, front: DVec3) -> DQuat {
    let z = front
        .reject_from_normalized(up)
        .normalize_or(up.any_orthonormal_vector());
    let person = glam::DMat3::from_cols(up.cross(z), up, z);
    DQuat::from_mat3(&person.transpose())
}

/// Shares of all that a scan shows, by area, that lie below the soles' level and above the crown's: strays.
const SOLES: f64 = 0.0005;
const CROWN: f64 = 0.0002;

/// Levels of the soles and of the top of the head along `up`, in the scan's units: quantiles of opacity times area, near the feet and
/// about the head alone, so that a raised hand does not count. `size` is about how tall the person is. Nothing is shown where a level is
/// missing.
#[must_use]
pub fn extent(scan: &Scan, points: &Points, up: DVec3, size: f64) -> (Option<f64>, Option<f64>) {
    let feet: Vec<DVec3> = [ANKLES, HEELS, TOES]
        .concat()
        .iter()
        .map(|at| points[*at].position)
        .collect();
    let ears = middle(points, EARS);
    let (mut low, mut high, mut total) = (Vec::new(), Vec::new(), 0.0);
    for at in 0..scan.len() {
        let weight = shown_area(scan, at);
        total += weight;
        let point = scan.positions[at].as_dvec3();
        let level = point.dot(up);
        if feet
            .iter()
            .any(|foot| (point - *foot).length() < 0.14 * size)
        {
            low.push((level, weight));
        }
        let away = point - ears;
        if away.reject_from_normalized(up).length() < 0.1 * size && away.dot(up) > 0.0 {
            high.push((-level, weight));
        }
    }
    let bottom = level_below(&mut low, SOLES * total);
    let top = level_below(&mut high, CROWN * total).map(|level| -level);
    (bottom, top)
}

/// Opacity times the area of its larger two axes.
#[must_use]
pub fn shown_area(scan: &Scan, at: usize) -> f64 {
    let [a, b, c] = scan.scales[at].as_dvec3().to_array();
    let area = (a * b).max(b * c).max(a * c);
    f64::from(scan.opacities[at]) * area
}

/// The level below which so much weight lies.
fn level_below(levels: &mut [(f64, f64)], weight: f64) -> Option<f64> {
    levels.sort_by(|a, b| a.0.total_cmp(&b.0));
    let mut sum = 0.0;
    let found = levels.iter().find(|(_, own)| {
        sum += own;
        sum > weight
    });
    found.or(levels.last()).map(|(level, _)| *level)
}

/// Share of what the scan shows, by area, that is farther than `radius` from all bones between the landmarks: things, or other people.
#[must_use]
pub fn share_beside(scan: &Scan, points: &Points, radius: f64) -> f64 {
    let at = |landmark: usize| points[landmark].position;
    let (neck, hips) = (middle(points, SHOULDERS), middle(points, HIPS));
    let ears = middle(points, EARS);
    let mut bones = vec![(neck, hips), (neck, ears + (ears - neck) * 0.3)];
    for side in [0, 1] {
        let pairs = [SHOULDERS, ELBOWS, WRISTS, INDICES];
        bones.extend(
            pairs
                .windows(2)
                .map(|pair| (at(pair[0][side]), at(pair[1][side]))),
        );
        let pairs = [HIPS, KNEES, ANKLES, TOES];
        bones.extend(
            pairs
                .windows(2)
                .map(|pair| (at(pair[0][side]), at(pair[1][side]))),
        );
        bones.push((at(SHOULDERS[side]), at(HIPS[side])));
    }
    let far = |point: DVec3| {
        bones.iter().all(|(start, end)| {
            let along = *end - *start;
            let share =
                ((point - *start).dot(along) / along.length_squared().max(1e-12)).clamp(0.0, 1.0);
            (point - *start - along * share).length() > radius
        })
    };
    let (mut beside, mut all) = (0.0, 0.0);
    for index in 0..scan.len() {
        let area = shown_area(scan, index);
        all += area;
        if far(scan.positions[index].as_dvec3()) {
            beside += area;
        }
    }
    if all > 0.0 { beside / all } else { 0.0 }
}
