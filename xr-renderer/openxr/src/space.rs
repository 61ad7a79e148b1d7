//! Floor space, in which the scene and its people stand: metres, y up, -z where the viewer looked first, the origin on the floor below.

use openxr::{Posef, ReferenceSpaceType, Session, Space, Time, Vulkan};

use crate::error::{XrContext, XrError};
use crate::pose::base_from_space;

/// Eyes of a standing adult above the floor, metres: where no floor is known, this far below the head's first place.
pub const EYE_HEIGHT: f32 = 1.65;

/// How the floor's height is known.
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

    /// Lowers an assumed floor to the stage's, once the stage can be located, and again after recentring.
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
        let Some(local_from_stage) =
            base_from_space(&local, &stage, time).during("xrLocateSpace")?
        else {
            return Ok(());
        };
        let height = -local_from_stage.translation.y;
        // A stage that was not set up lies at the head.
        if (0.3..=3.0).contains(&height) {
            self.floor = make(ReferenceSpaceType::LOCAL, lowered(height))?;
            self.kind = Floor::Stage;
        } else {
            self.has_stage = false;
        }
        Ok(())
    }

    /// The origin moved: the floor has to be derived from the stage again.
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
