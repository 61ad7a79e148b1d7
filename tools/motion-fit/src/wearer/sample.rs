//! What a headset says of its wearer at one time, in its own floor space.

use glam::Affine3A;

/// Joints of a hand as `XR_EXT_hand_tracking` has them: palm, wrist, four of the thumb, five of each finger from index to little, each
/// from its root to its tip.
pub const HAND_JOINTS: usize = 26;

/// `floor_from_joint` of a hand's joints; nothing for one that is not known. -z points to the finger tips, y out of the hand's back.
pub type HandJoints = [Option<Affine3A>; HAND_JOINTS];

/// One hand.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct WearerHand {
    /// The bare hand's joints; nothing where it is not tracked.
    pub joints: Option<HandJoints>,
    /// The grip pose of a controller that it holds, as `OpenXR` defines it. Joints count for more where both are known.
    pub floor_from_grip: Option<Affine3A>,
}

/// The wearer at one time.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct WearerSample {
    /// On the headset's clock.
    pub seconds: f64,
    /// Between the eyes, -z ahead; nothing where the headset does not know.
    pub floor_from_view: Option<Affine3A>,
    /// Left, right.
    pub hands: [WearerHand; 2],
    /// Another number whenever floor space was moved (recentred): the wearer begins anew where they are.
    pub origin: u32,
}
