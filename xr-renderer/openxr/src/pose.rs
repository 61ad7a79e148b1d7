//! `OpenXR`'s poses as rigid transforms, and places that may be unknown.

use glam::{Affine3A, Quat, Vec3};
use openxr::{Posef, Space, SpaceLocationFlags, Time, Vector3f};

/// The transform of a pose. None where its numbers are not finite or its quaternion is none.
pub(crate) fn rigid(pose: &Posef) -> Option<Affine3A> {
    let q = pose.orientation;
    let rotation = Quat::from_xyzw(q.x, q.y, q.z, q.w);
    let place = point(&pose.position);
    if !(rotation.is_finite() && place.is_finite() && rotation.length_squared() > 0.25) {
        return None;
    }
    Some(Affine3A::from_rotation_translation(
        rotation.normalize(),
        place,
    ))
}

/// A rigid transform as `OpenXR` takes it.
pub(crate) fn posef(base_from_thing: &Affine3A) -> Posef {
    let q = Quat::from_mat3a(&base_from_thing.matrix3).normalize();
    let [x, y, z] = base_from_thing.translation.to_array();
    Posef {
        orientation: openxr::Quaternionf {
            x: q.x,
            y: q.y,
            z: q.z,
            w: q.w,
        },
        position: Vector3f { x, y, z },
    }
}

/// A point or an arrow, metres.
pub(crate) fn point(at: &Vector3f) -> Vec3 {
    Vec3::new(at.x, at.y, at.z)
}

/// Whether the runtime knows both position and orientation.
pub(crate) fn is_known(flags: SpaceLocationFlags) -> bool {
    flags.contains(SpaceLocationFlags::ORIENTATION_VALID | SpaceLocationFlags::POSITION_VALID)
}

/// Where `space` is in `base` at a time, None where the runtime does not know.
///
/// # Errors
/// What the runtime says.
pub(crate) fn base_from_space(
    base: &Space,
    space: &Space,
    time: Time,
) -> openxr::Result<Option<Affine3A>> {
    let location = space.locate(base, time)?;
    let known = is_known(location.location_flags);
    Ok(known.then(|| rigid(&location.pose)).flatten())
}

#[cfg(test)]
mod tests {
    use super::*;
    use openxr::Quaternionf;

    #[test]
    fn a_pose_turns_first_and_moves_then() {
        let half = std::f32::consts::FRAC_1_SQRT_2;
        let pose = Posef {
            orientation: Quaternionf {
                x: 0.0,
                y: half,
                z: 0.0,
                w: half,
            },
            position: Vector3f {
                x: 1.0,
                y: 2.0,
                z: 3.0,
            },
        };
        let floor_from_hand = rigid(&pose).expect("a rigid pose");
        // A quarter turn to the left about y: what was ahead (-z) is to the left (-x).
        let ahead = floor_from_hand.transform_point3(Vec3::NEG_Z);
        assert!(
            (ahead - Vec3::new(0.0, 2.0, 3.0)).length() < 1e-6,
            "{ahead}"
        );
    }

    #[test]
    fn an_all_zero_pose_is_no_pose() {
        let zeros = Quaternionf::default();
        let mut pose = Posef {
            orientation: Quaternionf { w: 0.0, ..zeros },
            position: Vector3f::default(),
        };
        assert!(rigid(&pose).is_none(), "no quaternion");
        pose = Posef::IDENTITY;
        pose.position.y = f32::NAN;
        assert!(rigid(&pose).is_none(), "no place");
    }
}
