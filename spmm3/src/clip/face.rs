//! A clip's expression in the basis of the avatar that shows it: the one place where bases meet.

use super::MotionClip;
use crate::{EXPRESSION, ExpressionBasis, Expressions, Joint, MotionParams};
use glam::{Quat, Vec3};

/// Opening of the jaw joint at ARKit's `jawOpen` = 1, radians.
const ARKIT_JAW: f32 = 0.35;
/// Turn of an eye at ARKit's `eyeLook...` = 1, radians: sideways, and up or down.
const ARKIT_GAZE: [f32; 2] = [0.6, 0.45];

/// What of ARKit's shapes a named preset gets: the slots of the shapes in [`ExpressionBasis::ARKIT_52`] and their shares.
const ARKIT_PRESETS: [(&str, &[(usize, f32)]); 9] = [
    // eyeBlinkLeft, eyeBlinkRight
    ("blink", &[(8, 0.5), (9, 0.5)]),
    // mouthSmileLeft, mouthSmileRight
    ("smile", &[(43, 0.5), (44, 0.5)]),
    // browInnerUp, browOuterUpLeft, browOuterUpRight
    ("brows_up", &[(2, 0.5), (3, 0.25), (4, 0.25)]),
    // browDownLeft, browDownRight
    ("brows_down", &[(0, 0.5), (1, 0.5)]),
    // mouthStretchLeft, mouthStretchRight
    ("e", &[(45, 0.5), (46, 0.5)]),
    // mouthFunnel
    ("o", &[(31, 1.0)]),
    // mouthPucker
    ("u", &[(37, 1.0)]),
    // mouthPressLeft, mouthPressRight
    ("mbp", &[(35, 0.5), (36, 0.5)]),
    // mouthRollLower
    ("fv", &[(39, 1.0)]),
];
/// The slot of `jawOpen`.
const ARKIT_JAW_OPEN: usize = 24;
/// Slots of `eyeLook` that turn an eye to the person's left, to the right, up and down: of the left eye, then of the right.
const ARKIT_LOOK: [[usize; 4]; 2] = [[14, 12, 16, 10], [13, 15, 17, 11]];

impl MotionClip {
    /// Turns the clip's expression into `basis`, that of the avatar whose named expressions are `presets`. Coefficients of the
    /// same basis stay, ARKit's shapes become presets, jaw and gaze; for any other pair of bases no map is known, and
    /// the face is left at rest but for its jaw and eyes, which are joints. Returns a line that says so.
    #[must_use = "the line tells why a face does not move"]
    pub fn fit_expression(
        &mut self,
        basis: &ExpressionBasis,
        presets: &Expressions,
    ) -> Option<String> {
        let found = self.expression_basis.take()?;
        if found == *basis {
            return None;
        }
        if found == ExpressionBasis::ARKIT_52 {
            self.notes.push(format!(
                "expression: ARKit's blend shapes, shown by this avatar's presets ({basis})"
            ));
            let jaw = self.is_at_rest(Joint::Jaw);
            let eyes = [Joint::LeftEye, Joint::RightEye].map(|eye| self.is_at_rest(eye));
            for frame in &mut self.frames {
                show_arkit(frame, presets, jaw, eyes);
            }
            return None;
        }
        for frame in &mut self.frames {
            frame.expression_mut().fill(0.0);
        }
        Some(format!(
            "the face's expression is left out: its coefficients are of the basis {found}, this avatar's are of {basis}, and \
             there is no map between them; jaw and eyes move"
        ))
    }

    fn is_at_rest(&self, joint: Joint) -> bool {
        let mut frames = self.frames.iter();
        frames.all(|frame| frame.axis_angle(joint) == Vec3::ZERO)
    }
}

/// Turns the expression of one frame from the basis `from` into `to`, as [`MotionClip::fit_expression`] does for all frames of a clip:
/// coefficients of the same basis stay, and ARKit's shapes become `presets`, and move jaw and eyes if these are at rest. For any
/// other pair of bases the expression is left at rest, and this returns false.
#[must_use = "false tells that the face does not move"]
pub fn fit_expression(
    frame: &mut MotionParams,
    from: &ExpressionBasis,
    to: &ExpressionBasis,
    presets: &Expressions,
) -> bool {
    if from == to {
        return true;
    }
    if *from == ExpressionBasis::ARKIT_52 {
        let rests = |joint| frame.axis_angle(joint) == Vec3::ZERO;
        let jaw = rests(Joint::Jaw);
        let eyes = [Joint::LeftEye, Joint::RightEye].map(rests);
        show_arkit(frame, presets, jaw, eyes);
        return true;
    }
    frame.expression_mut().fill(0.0);
    false
}

/// ARKit's shapes in `frame` become presets; its jaw and eyes move where nothing else moves them.
fn show_arkit(frame: &mut MotionParams, presets: &Expressions, jaw: bool, eyes: [bool; 2]) {
    let mut shapes = [0.0f32; EXPRESSION];
    for (to, from) in shapes.iter_mut().zip(frame.expression()) {
        *to = from.clamp(0.0, 1.0);
    }
    let mut coefficients = [0.0f32; EXPRESSION];
    for (name, shares) in ARKIT_PRESETS {
        let weight: f32 = shares
            .iter()
            .map(|(slot, share)| share * shapes[*slot])
            .sum();
        let Some(preset) = presets.get(name) else {
            continue;
        };
        for (sum, value) in coefficients.iter_mut().zip(preset.coefficients) {
            *sum += weight * value;
        }
    }
    frame.expression_mut().copy_from_slice(&coefficients);
    if jaw {
        frame.set_axis_angle(Joint::Jaw, Vec3::X * ARKIT_JAW * shapes[ARKIT_JAW_OPEN]);
    }
    for (side, eye) in [Joint::LeftEye, Joint::RightEye].into_iter().enumerate() {
        if eyes[side] {
            let [left, right, up, down] = ARKIT_LOOK[side].map(|slot| shapes[slot]);
            let turn = Quat::from_rotation_y(ARKIT_GAZE[0] * (left - right))
                * Quat::from_rotation_x(ARKIT_GAZE[1] * (down - up));
            frame.set_rotation(eye, turn);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::ExpressionPreset;

    /// A clip of one frame whose slot `slot` is `value` in `basis`.
    fn clip(basis: ExpressionBasis, slots: &[(usize, f32)]) -> MotionClip {
        let mut frame = MotionParams::default();
        for (slot, value) in slots {
            frame.expression_mut()[*slot] = *value;
        }
        MotionClip {
            name: "test".to_owned(),
            frames: vec![frame],
            frame_seconds: 0.1,
            expression_basis: Some(basis),
            notes: Vec::new(),
            unmapped: Vec::new(),
        }
    }

    fn presets() -> Expressions {
        let preset = |slot: usize| {
            let mut coefficients = [0.0; EXPRESSION];
            coefficients[slot] = 2.0;
            ExpressionPreset {
                coefficients,
                jaw: 0.0,
            }
        };
        [
            ("blink".to_owned(), preset(3)),
            ("smile".to_owned(), preset(4)),
        ]
        .into()
    }

    #[test]
    fn coefficients_of_the_avatars_own_basis_stay_as_they_are() {
        let mut own = clip(ExpressionBasis::FLAME_2020, &[(0, 1.5), (49, -0.5)]);
        let before = own.frames.clone();
        let line = own.fit_expression(&ExpressionBasis::FLAME_2020, &presets());
        assert_eq!(line, None, "nothing is lost");
        assert_eq!(own.frames, before, "the identity");
    }

    #[test]
    fn flames_numbers_leave_a_face_of_another_basis_at_rest_and_a_line_says_so() {
        let mut flame = clip(ExpressionBasis::FLAME_2020, &[(0, 1.5), (7, -2.0)]);
        flame.frames[0].set_axis_angle(Joint::Jaw, Vec3::X * 0.1);
        let line = flame
            .fit_expression(&ExpressionBasis::MAKEHUMAN_1, &presets())
            .expect("a line");
        assert!(
            line.contains("flame-2020") && line.contains("mon3tr-makehuman-1"),
            "{line}"
        );
        assert!(!line.contains('\n'), "one line");
        let frame = &flame.frames[0];
        assert!(frame.expression().iter().all(|v| *v == 0.0), "at rest");
        assert_eq!(frame.axis_angle(Joint::Jaw), Vec3::X * 0.1, "a joint");
        let again = flame.fit_expression(&ExpressionBasis::MAKEHUMAN_1, &presets());
        assert_eq!(again, None, "a second time there is nothing to leave out");
    }

    #[test]
    fn one_frame_is_turned_as_a_clip_is() {
        let shapes = [(8, 1.0), (43, 0.5), (24, 1.0), (14, 1.0)];
        for from in [
            ExpressionBasis::ARKIT_52,
            ExpressionBasis::FLAME_2020,
            ExpressionBasis::MAKEHUMAN_1,
        ] {
            let mut whole = clip(from.clone(), &shapes);
            let mut frame = whole.frames[0].clone();
            let line = whole.fit_expression(&ExpressionBasis::MAKEHUMAN_1, &presets());
            let known =
                fit_expression(&mut frame, &from, &ExpressionBasis::MAKEHUMAN_1, &presets());
            assert_eq!(known, line.is_none(), "{from}");
            assert_eq!(frame, whole.frames[0], "{from}");
        }
    }

    #[test]
    fn arkits_shapes_become_the_avatars_presets_and_turn_jaw_and_eyes() {
        // eyeBlink of both sides, mouthSmileLeft, jawOpen, eyeLookOutLeft, eyeLookInRight.
        let shapes = [
            (8, 1.0),
            (9, 1.0),
            (43, 0.5),
            (24, 1.0),
            (14, 1.0),
            (13, 1.0),
        ];
        let mut arkit = clip(ExpressionBasis::ARKIT_52, &shapes);
        let line = arkit.fit_expression(&ExpressionBasis::MAKEHUMAN_1, &presets());
        assert_eq!(line, None, "a map is known");
        assert_eq!(arkit.notes.len(), 1, "{:?}", arkit.notes);
        let frame = &arkit.frames[0];
        let mut expected = [0.0; EXPRESSION];
        expected[3] = 2.0;
        expected[4] = 0.5;
        assert_eq!(
            frame.expression(),
            expected,
            "blink and half of half a smile"
        );
        assert_eq!(frame.axis_angle(Joint::Jaw), Vec3::X * ARKIT_JAW, "the jaw");
        for eye in [Joint::LeftEye, Joint::RightEye] {
            let looks = frame.rotation(eye) * Vec3::Z;
            assert!(looks.x > 0.5, "{}: {looks}", eye.name());
        }
    }
}
