//! Floor space, in which all that is seen stands: metres, y up, -z where the viewer looked first, the origin on the floor below.

use glam::{Affine3A, Quat, Vec3};
use openxr::{Posef, ReferenceSpaceType, Session, Space, SpaceLocationFlags, Time, Vulkan};

use super::error::{XrContext, XrError};

/// Eyes of a standing adult above the floor, metres: where no floor is known, this far below the head's first place.
pub const EYE_HEIGHT: f32 = 1.65;

/// What a runtime knows of the floor.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Floor {
    /// It has a local space on the floor.
    Local,
    /// It has a stage, whose height the local space is lowered to.
    Stage,
    /// Nothing: an eye height is assumed.
    Assumed,
}

impl std::fmt::Display for Floor {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(match self {
            Self::Local => "local floor",
            Self::Stage => "local, lowered to the stage's floor",
            Self::Assumed => "local, lowered by an assumed eye height",
        })
    }
}

/// The space.
pub(crate) struct FloorSpace {
    pub(crate) floor: Space,
    kind: Floor,
    has_stage: bool,
}

impl FloorSpace {
    /// The best there is.
    pub(crate) fn new(session: &Session<Vulkan>, has_local_floor: bool) -> Result<Self, XrError> {
        let make = |kind, pose| {
            session
                .create_reference_space(kind, pose)
                .during("xrCreateReferenceSpace")
        };
        let known = session
            .enumerate_reference_spaces()
            .during("xrEnumerateReferenceSpaces")?;
        let has_stage = known.contains(&ReferenceSpaceType::STAGE);
        if has_local_floor && known.contains(&ReferenceSpaceType::LOCAL_FLOOR_EXT) {
            return Ok(Self {
                floor: make(ReferenceSpaceType::LOCAL_FLOOR_EXT, Posef::IDENTITY)?,
                kind: Floor::Local,
                has_stage,
            });
        }
        Ok(Self {
            floor: make(ReferenceSpaceType::LOCAL, lowered(EYE_HEIGHT))?,
            kind: Floor::Assumed,
            has_stage,
        })
    }

    /// How the floor is known.
    pub(crate) fn kind(&self) -> Floor {
        self.kind
    }

    /// Lowers an assumed floor to the stage's, once that can be located; again after the viewer was recentred.
    pub(crate) fn settle(&mut self, session: &Session<Vulkan>, time: Time) -> Result<(), XrError> {
        if self.kind != Floor::Assumed || !self.has_stage {
            return Ok(());
        }
        let make = |kind, pose| {
            session
                .create_reference_space(kind, pose)
                .during("xrCreateReferenceSpace")
        };
        let local = make(ReferenceSpaceType::LOCAL, Posef::IDENTITY)?;
        let stage = make(ReferenceSpaceType::STAGE, Posef::IDENTITY)?;
        let Some(local_from_stage) = located(&stage, &local, time)? else {
            return Ok(());
        };
        let height = -local_from_stage.translation.y;
        // A stage that nobody has set up lies at the head.
        if (0.3..=3.0).contains(&height) {
            self.floor = make(ReferenceSpaceType::LOCAL, lowered(height))?;
            self.kind = Floor::Stage;
        } else {
            self.has_stage = false;
        }
        Ok(())
    }

    /// The origin moved: what was derived from the stage is to be derived anew.
    pub(crate) fn moved(&mut self) {
        if self.kind == Floor::Stage {
            self.kind = Floor::Assumed;
        }
    }
}

fn lowered(metres: f32) -> Posef {
    Posef {
        position: openxr::Vector3f {
            x: 0.0,
            y: -metres,
            z: 0.0,
        },
        ..Posef::IDENTITY
    }
}

/// Where a space is in another; nothing while that is not known.
pub(crate) fn located(
    space: &Space,
    base: &Space,
    time: Time,
) -> Result<Option<Affine3A>, XrError> {
    let location = space.locate(base, time).during("xrLocateSpace")?;
    let valid = SpaceLocationFlags::POSITION_VALID | SpaceLocationFlags::ORIENTATION_VALID;
    let known = location.location_flags.contains(valid);
    Ok(known.then(|| affine(location.pose)).flatten())
}

/// A pose as a transform; nothing where it is none.
pub(crate) fn affine(pose: Posef) -> Option<Affine3A> {
    let (position, orientation) = parts(pose)?;
    Some(Affine3A::from_rotation_translation(orientation, position))
}

/// Position in metres and unit quaternion.
pub(crate) fn parts(pose: Posef) -> Option<(Vec3, Quat)> {
    let (p, o) = (pose.position, pose.orientation);
    let position = Vec3::new(p.x, p.y, p.z);
    let orientation = Quat::from_xyzw(o.x, o.y, o.z, o.w);
    let sound = position.is_finite() && (0.5..2.0).contains(&orientation.length());
    sound.then(|| (position, orientation.normalize()))
}

/// A transform as `OpenXR` takes it.
pub(crate) fn pose(transform: Affine3A) -> Posef {
    let (_, orientation, position) = transform.to_scale_rotation_translation();
    Posef {
        orientation: openxr::Quaternionf {
            x: orientation.x,
            y: orientation.y,
            z: orientation.z,
            w: orientation.w,
        },
        position: openxr::Vector3f {
            x: position.x,
            y: position.y,
            z: position.z,
        },
    }
}
