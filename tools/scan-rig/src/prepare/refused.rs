//! Scans that no avatar can be made of, and what their owners can do.

use super::landmarks::limbs;
use crate::RigError;
use crate::points::KeyPoint;
use glam::Vec3;
use motion_fit::landmarks::BODY_LANDMARKS;
use splat_scene::Scene;
use spmm3::Joint;

/// The fewest Gaussians that make a person.
pub(super) const FEWEST: usize = 8_000;
/// The most that are taken.
pub(super) const MOST: usize = 1_000_000;

pub(super) fn empty() -> RigError {
    RigError::unsuited("the file has no Gaussians: give a scan of a standing person")
}

pub(super) fn outside(scene: &Scene) -> RigError {
    let all = scene.bounds().map_or_else(String::new, |bounds| {
        format!(
            "; the scan is within {}",
            boxed(scene, bounds.min.into(), bounds.max.into())
        )
    });
    RigError::unsuited(format!("no Gaussian is inside the box that was given{all}"))
}

pub(super) fn too_few(count: usize) -> RigError {
    RigError::unsuited(format!(
        "the person has {count} Gaussians, which are too few for an avatar: give a scan with 10,000 or more on the person"
    ))
}

pub(super) fn too_many(count: usize) -> RigError {
    RigError::unsuited(format!(
        "the person has {count} Gaussians, more than the {MOST} that an avatar takes: reduce the scan first, in SuperSplat or with \
         `splat-transform`"
    ))
}

pub(super) fn nobody(best: f64) -> RigError {
    RigError::unsuited(format!(
        "no standing person is seen in the scan (the pose network's score is {best:.1} of 4): give a scan of one person who stands, \
         from head to feet; if there is one, choose it with --box x0,y0,z0,x1,y1,z1"
    ))
}

pub(super) fn several(scene: &Scene, people: &[(Vec3, Vec3)]) -> RigError {
    let boxes: Vec<String> = people
        .iter()
        .map(|(low, high)| format!("--box {}", boxed(scene, *low, *high)))
        .collect();
    RigError::unsuited(format!(
        "the scan shows {} people: choose one with {}",
        people.len(),
        boxes.join(" or ")
    ))
}

pub(super) fn several_seen(views: usize) -> RigError {
    RigError::unsuited(format!(
        "the scan shows several people ({views} of 12 views do), who stand close: choose one with --box x0,y0,z0,x1,y1,z1, or cut the \
         others away"
    ))
}

pub(super) fn crowded(beside: f64) -> RigError {
    RigError::unsuited(format!(
        "{:.0} % of what the scan shows is not the person but other people or things that touch the person: choose the person with \
         --box x0,y0,z0,x1,y1,z1, or cut the rest away",
        100.0 * beside
    ))
}

pub(super) fn incomplete(what: &str) -> RigError {
    RigError::unsuited(format!(
        "the scan shows a person without {what}: give a scan of the whole person, from head to feet"
    ))
}

/// Networks see a person in so few views.
pub(super) fn seldom_seen(views: usize) -> RigError {
    RigError::unsuited(format!(
        "only {views} of 12 views of the scan show a person: give a scan of one person who stands freely and was recorded from all sides; \
         if others or furniture are near, choose the person with --box x0,y0,z0,x1,y1,z1"
    ))
}

/// No two views show these joints.
pub(super) fn unseen(joints: &[Joint]) -> RigError {
    let hints: Vec<String> = (joints.iter())
        .map(|joint| format!("--joint {}=x,y,z", joint.name()))
        .collect();
    RigError::unsuited(format!(
        "the views of the scan do not show where all of the person's joints are: give a scan of one person who stands freely, or say where \
         they are, with {}",
        hints.join(" ")
    ))
}

/// Views differ where these joints are.
pub(super) fn unsure(points: &[KeyPoint; BODY_LANDMARKS]) -> RigError {
    /// Joints that are named.
    const NAMED: usize = 3;
    let mut worst: Vec<(Joint, f64)> = (limbs(points))
        .map(|(joint, point)| (joint, point.residual))
        .collect();
    worst.sort_by(|a, b| b.1.total_cmp(&a.1));
    let named: Vec<String> = (worst.iter().take(NAMED))
        .map(|(joint, apart)| format!("{} by {:.0} mm", joint.name(), 1e3 * apart))
        .collect();
    RigError::unsuited(format!(
        "the views of the scan do not agree where the person's joints are ({}): give a scan of one person who stands freely; if others or \
         furniture are near, choose the person with --box x0,y0,z0,x1,y1,z1; or say where these joints are, with --joint name=x,y,z",
        named.join(", ")
    ))
}

/// A joint of the user's that is so many metres from the person, whose box has these corners.
pub(super) fn astray(
    scene: &Scene,
    joint: Joint,
    metres: f64,
    (low, high): (Vec3, Vec3),
) -> RigError {
    RigError::unsuited(format!(
        "--joint {} is {metres:.1} m from the person: check its numbers, which are in the file's own coordinates; there the person is within \
         {}",
        joint.name(),
        boxed(scene, low, high)
    ))
}

/// A box in the file's units, as `--box` takes it.
fn boxed(scene: &Scene, low: Vec3, high: Vec3) -> String {
    let (a, b) = (scene.point_in_file(low), scene.point_in_file(high));
    let (low, high) = (a.min(b), a.max(b));
    let numbers = [low.to_array(), high.to_array()].concat();
    let text: Vec<String> = numbers
        .iter()
        .map(|number| format!("{number:.2}"))
        .collect();
    text.join(",")
}
