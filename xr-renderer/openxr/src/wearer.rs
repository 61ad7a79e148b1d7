//! Where the wearer's own head and hands are, for whoever captures their motion.
//!
//! The time is the present one where the runtime tells its clock: no prediction is in it. Whom the motion drives is not known here.

use std::time::Instant;

use glam::Affine3A;
use openxr::{Posef, ReferenceSpaceType, Session, Space, Time, Vulkan};

use crate::error::{XrContext, XrError};
use crate::ext::hand_tracking::HandJointPoses;
use crate::pose::base_from_space;

/// One hand of the wearer, in floor space.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct WearerHand {
    /// The 26 joints of a bare hand in `XR_EXT_hand_tracking`'s order, each where it is known; nothing where it is not tracked.
    pub joints: Option<HandJointPoses>,
    /// The grip of the controller that it holds.
    pub floor_from_grip: Option<Affine3A>,
}

/// The wearer at one time, in floor space: metres, y up, -z ahead.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Wearer {
    /// When, by this machine's clock.
    pub at: Instant,
    /// When, by the runtime's clock, seconds.
    pub seconds: f64,
    /// Between the eyes, -z ahead; nothing where it is not known.
    pub floor_from_view: Option<Affine3A>,
    /// Left, right.
    pub hands: [WearerHand; 2],
    /// How often floor space was moved (recentred) so far.
    pub origin: u32,
}

/// What locates the wearer's head.
pub(crate) struct WearerHead {
    view: Space,
    origin: u32,
}

impl WearerHead {
    pub(crate) fn new(session: &Session<Vulkan>) -> Result<Self, XrError> {
        let view = session
            .create_reference_space(ReferenceSpaceType::VIEW, Posef::IDENTITY)
            .during("xrCreateReferenceSpace")?;
        Ok(Self { view, origin: 0 })
    }

    /// Floor space was moved.
    pub(crate) fn moved(&mut self) {
        self.origin = self.origin.wrapping_add(1);
    }

    /// The wearer whose hands are `hands` at that time.
    pub(crate) fn locate(
        &self,
        floor: &Space,
        (at, time): (Instant, Time),
        hands: [WearerHand; 2],
    ) -> Result<Wearer, XrError> {
        Ok(Wearer {
            at,
            seconds: time.as_nanos() as f64 * 1e-9,
            floor_from_view: base_from_space(floor, &self.view, time).during("xrLocateSpace")?,
            hands,
            origin: self.origin,
        })
    }
}
