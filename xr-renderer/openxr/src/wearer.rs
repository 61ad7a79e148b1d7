//! Where the wearer's own head, hands and body are, and what their face does, for whoever captures their motion.
//!
//! Trackers of body, face and eyes start with the first question: who never asks does not have the wearer watched.
//!
//! The time is the present one where the runtime tells its clock: no prediction is in it. Whom the motion drives is not known here.

use std::time::Instant;

use glam::Affine3A;
use openxr::{Posef, ReferenceSpaceType, Session, Space, SystemId, Time, Vulkan};

use crate::error::{XrContext, XrError};
use crate::ext::OnFirstUse;
use crate::ext::body_tracking::{Body, BodyTracking};
use crate::ext::eye_tracking::{EyeTracking, Gaze};
use crate::ext::face_tracking::{Face, FaceTracking};
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
    /// The body's joints, where the headset tracks them.
    pub body: Option<Body>,
    /// The face's expressions, where the headset tracks them.
    pub face: Option<Face>,
    /// Left, right: where the eyes look, where the headset tracks them.
    pub gazes: [Option<Gaze>; 2],
    /// How often floor space was moved (recentred) so far.
    pub origin: u32,
}

/// What watches the wearer, but for their hands.
pub(crate) struct WearerTrackers {
    session: Session<Vulkan>,
    system: SystemId,
    view: Space,
    body: OnFirstUse<BodyTracking>,
    face: OnFirstUse<FaceTracking>,
    eyes: OnFirstUse<EyeTracking>,
    origin: u32,
}

impl WearerTrackers {
    pub(crate) fn new(session: &Session<Vulkan>, system: SystemId) -> Result<Self, XrError> {
        let view = session
            .create_reference_space(ReferenceSpaceType::VIEW, Posef::IDENTITY)
            .during("xrCreateReferenceSpace")?;
        Ok(Self {
            session: session.clone(),
            system,
            view,
            body: OnFirstUse::new("the wearer's body"),
            face: OnFirstUse::new("the wearer's face"),
            eyes: OnFirstUse::new("the wearer's gaze"),
            origin: 0,
        })
    }

    /// Floor space was moved.
    pub(crate) fn moved(&mut self) {
        self.origin = self.origin.wrapping_add(1);
    }

    /// The wearer whose hands are `hands` at that time. `gaze` is both eyes', and asked for where nothing tells each one's: it is taken for sure.
    pub(crate) fn locate(
        &mut self,
        floor: &Space,
        (at, time): (Instant, Time),
        hands: [WearerHand; 2],
        gaze: impl FnOnce() -> Option<Affine3A>,
    ) -> Result<Wearer, XrError> {
        let (session, system) = (&self.session, self.system);
        let body = self.body.read(
            at,
            || BodyTracking::new(session, system),
            |body| body.locate(floor, time),
        );
        let face = self.face.read(
            at,
            || FaceTracking::new(session, system),
            |face| face.read(time),
        );
        Ok(Wearer {
            at,
            seconds: time.as_nanos() as f64 * 1e-9,
            floor_from_view: base_from_space(floor, &self.view, time).during("xrLocateSpace")?,
            hands,
            body,
            face,
            gazes: self.gazes(floor, (at, time), gaze),
            origin: self.origin,
        })
    }

    /// Where the wearer's eyes look at that time, left and right: nothing else of them is watched. `gaze` as in [`Self::locate`].
    pub(crate) fn gazes(
        &mut self,
        floor: &Space,
        (at, time): (Instant, Time),
        gaze: impl FnOnce() -> Option<Affine3A>,
    ) -> [Option<Gaze>; 2] {
        let (session, system) = (&self.session, self.system);
        let gazes = self.eyes.read(
            at,
            || EyeTracking::new(session, system),
            |eyes| eyes.read(floor, time).map(Some),
        );
        gazes.unwrap_or_else(|| {
            let both = gaze().map(|floor_from_eye| Gaze {
                floor_from_eye,
                confidence: 1.0,
            });
            [both; 2]
        })
    }
}

#[cfg(test)]
mod tests;
