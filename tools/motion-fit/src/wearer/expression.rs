//! The tracked face and gaze as the avatar's: the headset's expressions by their names become ARKit's, which any avatar can show.

use super::sample::{FACE_EXPRESSIONS, WearerFace, WearerGaze, WearerSample};
use glam::{Affine3A, Quat, Vec2, Vec3};
use spmm3::{EXPRESSION, ExpressionBasis, Expressions, Joint, MotionParams};

/// Names of a headset's expressions: `XrFaceExpression2FB` in its order, without its prefix and ending.
pub const FACE_EXPRESSION_NAMES: [&str; FACE_EXPRESSIONS] = [
    "BROW_LOWERER_L",
    "BROW_LOWERER_R",
    "CHEEK_PUFF_L",
    "CHEEK_PUFF_R",
    "CHEEK_RAISER_L",
    "CHEEK_RAISER_R",
    "CHEEK_SUCK_L",
    "CHEEK_SUCK_R",
    "CHIN_RAISER_B",
    "CHIN_RAISER_T",
    "DIMPLER_L",
    "DIMPLER_R",
    "EYES_CLOSED_L",
    "EYES_CLOSED_R",
    "EYES_LOOK_DOWN_L",
    "EYES_LOOK_DOWN_R",
    "EYES_LOOK_LEFT_L",
    "EYES_LOOK_LEFT_R",
    "EYES_LOOK_RIGHT_L",
    "EYES_LOOK_RIGHT_R",
    "EYES_LOOK_UP_L",
    "EYES_LOOK_UP_R",
    "INNER_BROW_RAISER_L",
    "INNER_BROW_RAISER_R",
    "JAW_DROP",
    "JAW_SIDEWAYS_LEFT",
    "JAW_SIDEWAYS_RIGHT",
    "JAW_THRUST",
    "LID_TIGHTENER_L",
    "LID_TIGHTENER_R",
    "LIP_CORNER_DEPRESSOR_L",
    "LIP_CORNER_DEPRESSOR_R",
    "LIP_CORNER_PULLER_L",
    "LIP_CORNER_PULLER_R",
    "LIP_FUNNELER_LB",
    "LIP_FUNNELER_LT",
    "LIP_FUNNELER_RB",
    "LIP_FUNNELER_RT",
    "LIP_PRESSOR_L",
    "LIP_PRESSOR_R",
    "LIP_PUCKER_L",
    "LIP_PUCKER_R",
    "LIP_STRETCHER_L",
    "LIP_STRETCHER_R",
    "LIP_SUCK_LB",
    "LIP_SUCK_LT",
    "LIP_SUCK_RB",
    "LIP_SUCK_RT",
    "LIP_TIGHTENER_L",
    "LIP_TIGHTENER_R",
    "LIPS_TOWARD",
    "LOWER_LIP_DEPRESSOR_L",
    "LOWER_LIP_DEPRESSOR_R",
    "MOUTH_LEFT",
    "MOUTH_RIGHT",
    "NOSE_WRINKLER_L",
    "NOSE_WRINKLER_R",
    "OUTER_BROW_RAISER_L",
    "OUTER_BROW_RAISER_R",
    "UPPER_LID_RAISER_L",
    "UPPER_LID_RAISER_R",
    "UPPER_LIP_RAISER_L",
    "UPPER_LIP_RAISER_R",
    "TONGUE_TIP_INTERDENTAL",
    "TONGUE_TIP_ALVEOLAR",
    "TONGUE_FRONT_DORSAL_PALATE",
    "TONGUE_MID_DORSAL_PALATE",
    "TONGUE_BACK_DORSAL_VELAR",
    "TONGUE_OUT",
    "TONGUE_RETREAT",
];

/// ARKit's shape in each slot of [`ExpressionBasis::ARKIT_52`], and the headset's expressions whose mean it is. The pairs are those of
/// `ARKitFace` in Meta's Movement SDK for Unity; where it takes one part of a shape that the headset gives in two or four, all are taken.
/// `LIP_TIGHTENER`, `CHEEK_SUCK` and the tongue have no slot.
pub const ARKIT_OF_HEADSET: [(&str, &[&str]); EXPRESSION] = [
    ("browDownLeft", &["BROW_LOWERER_L"]),
    ("browDownRight", &["BROW_LOWERER_R"]),
    (
        "browInnerUp",
        &["INNER_BROW_RAISER_L", "INNER_BROW_RAISER_R"],
    ),
    ("browOuterUpLeft", &["OUTER_BROW_RAISER_L"]),
    ("browOuterUpRight", &["OUTER_BROW_RAISER_R"]),
    ("cheekPuff", &["CHEEK_PUFF_L", "CHEEK_PUFF_R"]),
    ("cheekSquintLeft", &["CHEEK_RAISER_L"]),
    ("cheekSquintRight", &["CHEEK_RAISER_R"]),
    ("eyeBlinkLeft", &["EYES_CLOSED_L"]),
    ("eyeBlinkRight", &["EYES_CLOSED_R"]),
    ("eyeLookDownLeft", &["EYES_LOOK_DOWN_L"]),
    ("eyeLookDownRight", &["EYES_LOOK_DOWN_R"]),
    ("eyeLookInLeft", &["EYES_LOOK_RIGHT_L"]),
    ("eyeLookInRight", &["EYES_LOOK_LEFT_R"]),
    ("eyeLookOutLeft", &["EYES_LOOK_LEFT_L"]),
    ("eyeLookOutRight", &["EYES_LOOK_RIGHT_R"]),
    ("eyeLookUpLeft", &["EYES_LOOK_UP_L"]),
    ("eyeLookUpRight", &["EYES_LOOK_UP_R"]),
    ("eyeSquintLeft", &["LID_TIGHTENER_L"]),
    ("eyeSquintRight", &["LID_TIGHTENER_R"]),
    ("eyeWideLeft", &["UPPER_LID_RAISER_L"]),
    ("eyeWideRight", &["UPPER_LID_RAISER_R"]),
    ("jawForward", &["JAW_THRUST"]),
    ("jawLeft", &["JAW_SIDEWAYS_LEFT"]),
    ("jawOpen", &["JAW_DROP"]),
    ("jawRight", &["JAW_SIDEWAYS_RIGHT"]),
    ("mouthClose", &["LIPS_TOWARD"]),
    ("mouthDimpleLeft", &["DIMPLER_L"]),
    ("mouthDimpleRight", &["DIMPLER_R"]),
    ("mouthFrownLeft", &["LIP_CORNER_DEPRESSOR_L"]),
    ("mouthFrownRight", &["LIP_CORNER_DEPRESSOR_R"]),
    (
        "mouthFunnel",
        &[
            "LIP_FUNNELER_LB",
            "LIP_FUNNELER_LT",
            "LIP_FUNNELER_RB",
            "LIP_FUNNELER_RT",
        ],
    ),
    ("mouthLeft", &["MOUTH_LEFT"]),
    ("mouthLowerDownLeft", &["LOWER_LIP_DEPRESSOR_L"]),
    ("mouthLowerDownRight", &["LOWER_LIP_DEPRESSOR_R"]),
    ("mouthPressLeft", &["LIP_PRESSOR_L"]),
    ("mouthPressRight", &["LIP_PRESSOR_R"]),
    ("mouthPucker", &["LIP_PUCKER_L", "LIP_PUCKER_R"]),
    ("mouthRight", &["MOUTH_RIGHT"]),
    ("mouthRollLower", &["LIP_SUCK_LB", "LIP_SUCK_RB"]),
    ("mouthRollUpper", &["LIP_SUCK_LT", "LIP_SUCK_RT"]),
    ("mouthShrugLower", &["CHIN_RAISER_B"]),
    ("mouthShrugUpper", &["CHIN_RAISER_T"]),
    ("mouthSmileLeft", &["LIP_CORNER_PULLER_L"]),
    ("mouthSmileRight", &["LIP_CORNER_PULLER_R"]),
    ("mouthStretchLeft", &["LIP_STRETCHER_L"]),
    ("mouthStretchRight", &["LIP_STRETCHER_R"]),
    ("mouthUpperUpLeft", &["UPPER_LIP_RAISER_L"]),
    ("mouthUpperUpRight", &["UPPER_LIP_RAISER_R"]),
    ("noseSneerLeft", &["NOSE_WRINKLER_L"]),
];
/// Slots of `eyeLook...` of the left and of the right eye.
const LOOKS: [[usize; 4]; 2] = [[10, 12, 14, 16], [11, 13, 15, 17]];
/// A gaze less sure of itself than this is none.
pub const LEAST_GAZE_CONFIDENCE: f32 = 0.3;
/// Largest gaze against the head, radians: to a side, and up or down.
const GAZE: Vec2 = Vec2::new(0.7, 0.5);

/// Shows a wearer's face on one avatar.
#[derive(Debug, Clone)]
pub struct WearerExpression {
    basis: ExpressionBasis,
    presets: Expressions,
    /// Of each slot of ARKit's, the share of each of the headset's expressions.
    shares: Vec<(usize, usize, f32)>,
}

impl WearerExpression {
    /// For an avatar with that basis of expressions, whose named ones are `presets`.
    #[must_use]
    pub fn new(basis: &ExpressionBasis, presets: &Expressions) -> Self {
        let mut shares = Vec::new();
        for (slot, (_, names)) in ARKIT_OF_HEADSET.iter().enumerate() {
            for name in *names {
                let found = FACE_EXPRESSION_NAMES.iter().position(|known| known == name);
                shares.extend(found.map(|expression| (slot, expression, 1.0 / count(names))));
            }
        }
        Self {
            basis: basis.clone(),
            presets: presets.clone(),
            shares,
        }
    }

    /// Sets the expression, the jaw and the eyes of `motion`, which are at rest, to what `sample` tells. Returns how sure the face is
    /// (0..=1); nothing where it is not tracked.
    pub fn show(&self, sample: &WearerSample, motion: &mut MotionParams) -> Option<f32> {
        let looks = [0, 1].map(|side: usize| {
            let view = sample.floor_from_view.as_ref()?;
            look(view, sample.gazes.get(side)?.as_ref()?)
        });
        for (eye, look) in [Joint::LeftEye, Joint::RightEye].into_iter().zip(looks) {
            if let Some(look) = look {
                motion.set_rotation(eye, look);
            }
        }
        let face = sample.face.as_ref()?;
        let mut shapes = self.arkit(face);
        for (look, slots) in looks.iter().zip(LOOKS) {
            if look.is_some() || !face.eyes_look {
                for slot in slots {
                    shapes[slot] = 0.0;
                }
            }
        }
        motion.expression_mut().copy_from_slice(&shapes);
        // ARKit's shapes are known to every avatar.
        let _ = spmm3::fit_expression(
            motion,
            &ExpressionBasis::ARKIT_52,
            &self.basis,
            &self.presets,
        );
        Some(if face.confidence.is_finite() {
            face.confidence.clamp(0.0, 1.0)
        } else {
            0.0
        })
    }

    fn arkit(&self, face: &WearerFace) -> [f32; EXPRESSION] {
        let mut shapes = [0.0; EXPRESSION];
        for (slot, expression, share) in &self.shares {
            let weight = face.weights.get(*expression).copied().unwrap_or(0.0);
            let weight = if weight.is_finite() { weight } else { 0.0 };
            if let Some(shape) = shapes.get_mut(*slot) {
                *shape += share * weight.clamp(0.0, 1.0);
            }
        }
        shapes
    }
}

/// The turn of the avatar's eye against its head.
fn look(floor_from_view: &Affine3A, gaze: &WearerGaze) -> Option<Quat> {
    if !(gaze.confidence >= LEAST_GAZE_CONFIDENCE && gaze.floor_from_eye.is_finite()) {
        return None;
    }
    let view_from_floor = floor_from_view.matrix3.inverse();
    let ahead = view_from_floor * (gaze.floor_from_eye.matrix3 * Vec3::NEG_Z);
    // A view looks along -z with the right at x; the avatar's head along z with the left at x.
    let ahead = (Vec3::new(-ahead.x, ahead.y, -ahead.z)).try_normalize()?;
    let aside = ahead.x.atan2(ahead.z).clamp(-GAZE.x, GAZE.x);
    let up = ahead.y.clamp(-1.0, 1.0).asin().clamp(-GAZE.y, GAZE.y);
    // Positive turns about y look to the person's left, about x down.
    Some(Quat::from_rotation_y(aside) * Quat::from_rotation_x(-up))
}

fn count(names: &[&str]) -> f32 {
    #[allow(clippy::cast_precision_loss, reason = "a few")]
    let count = names.len() as f32;
    count.max(1.0)
}
