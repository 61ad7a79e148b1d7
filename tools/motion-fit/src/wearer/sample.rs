//! What a headset says of its wearer at one time, in its own floor space.

use glam::Affine3A;

/// Joints of a hand as `XR_EXT_hand_tracking` has them: palm, wrist, four of the thumb, five of each finger from index to little, each
/// from its root to its tip.
pub const HAND_JOINTS: usize = 26;

/// `floor_from_joint` of a hand's joints; nothing for one that is not known. -z points to the finger tips, y out of the hand's back.
pub type HandJoints = [Option<Affine3A>; HAND_JOINTS];

/// Joints of a body as `XrFullBodyJointMETA` has them: those of `XrBodyJointFB`, and then the legs'.
pub const WEARER_JOINTS: usize = 84;

/// Expressions of a face as `XrFaceExpression2FB` has them.
pub const FACE_EXPRESSIONS: usize = 70;

/// One hand.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct WearerHand {
    /// The bare hand's joints; nothing where it is not tracked.
    pub joints: Option<HandJoints>,
    /// The grip pose of a controller that it holds, as `OpenXR` defines it. Joints count for more where both are known.
    pub floor_from_grip: Option<Affine3A>,
}

/// A joint of the body.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct WearerJoint {
    /// Metres; the axes are the runtime's own.
    pub floor_from_joint: Affine3A,
    /// Whether it was measured, and not inferred.
    pub tracked: bool,
}

/// The body.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct WearerBody {
    /// 0..=1.
    pub confidence: f32,
    /// Nothing for joints that are not known.
    pub joints: [Option<WearerJoint>; WEARER_JOINTS],
    /// The same joints of the wearer in T-pose, in a space of their own: y up, metres. How a joint is turned is known by its axes there.
    pub t_pose: [Option<Affine3A>; WEARER_JOINTS],
}

/// The face.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct WearerFace {
    /// Strengths of the expressions, 0..=1.
    pub weights: [f32; FACE_EXPRESSIONS],
    /// Of the mouth, 0..=1.
    pub confidence: f32,
    /// Whether the strengths of `EYES_LOOK_...` tell where the eyes look.
    pub eyes_look: bool,
}

/// Where an eye looks.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct WearerGaze {
    /// It looks along -z.
    pub floor_from_eye: Affine3A,
    /// 0..=1.
    pub confidence: f32,
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
    /// The body, where the headset tracks it.
    pub body: Option<WearerBody>,
    /// The face, where the headset tracks it.
    pub face: Option<WearerFace>,
    /// Left, right: the eyes, where the headset tracks them.
    pub gazes: [Option<WearerGaze>; 2],
    /// Another number whenever floor space was moved (recentred): the wearer begins anew where they are.
    pub origin: u32,
}
