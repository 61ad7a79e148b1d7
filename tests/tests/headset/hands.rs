//! Controllers and bare hands arrive as the driver sent them.

use glam::{DVec3, Quat};
use serde_json::Value;
use test_support::headset_reference::numbers;
use test_support::monado::{Compositor, Driver, Monado, Pose, Scripted};
use test_support::service::attended;

use crate::program::Program;

/// Frames that input may take from the service's thread to the program. They are counted, because the time of one is not
/// bounded.
const FRAMES: u32 = 100;

/// Asks until the answer is as expected.
fn until(program: &mut Program, why: &str, wished: impl Fn(&Value) -> bool) -> Value {
    let mut told = Value::Null;
    for _ in 0..FRAMES {
        told = program.ask("tell", "hands");
        if wished(&told) {
            return told;
        }
    }
    panic!("never: {why}: {told}");
}

fn assert_pose(told: &Value, sent: &Pose, what: &str) {
    let place = numbers(&told["position"]);
    for (got, sent) in place.iter().zip(sent.position.to_array()) {
        assert!((got - f64::from(sent)).abs() < 1e-4, "{what}: {place:?}");
    }
    let turn = numbers(&told["rotation"]);
    let alike: f64 = (turn.iter().zip(sent.rotation.to_array()))
        .map(|(got, sent)| got * f64::from(sent))
        .sum();
    assert!(alike.abs() > 1.0 - 1e-6, "{what}: {turn:?}, {alike}");
}

#[test]
fn controllers_have_their_pose_and_grab_while_they_are_squeezed() {
    attended(|| {
        let Some(monado) = Monado::start(Driver::Remote, Compositor::Null) else {
            return;
        };
        let mut head = monado.head();
        let mut scripted = Scripted::default();
        let [left, right] = &mut scripted.controllers;
        left.stage_from_grip = Pose::at(-0.31, 1.12, -0.42).turned(Quat::from_rotation_x(0.5));
        let turn = Quat::from_rotation_z(-0.7) * Quat::from_rotation_y(0.3);
        right.stage_from_grip = Pose::at(0.27, 1.41, -0.63).turned(turn);
        let mut program = Program::start(&monado, u64::MAX, &["--steered", "--figure=none"]);
        program.wait_for_frames(5);
        program.take_pose(&mut head, &scripted);
        let told = until(&mut program, "both hands", |told| {
            (0..2).all(|side| !told["controls"][side]["grip"].is_null())
        });
        for (side, controller) in scripted.controllers.iter().enumerate() {
            let hand = &told["controls"][side];
            let name = ["left", "right"][side];
            assert_pose(&hand["grip"], &controller.stage_from_grip, name);
            assert!(!hand["aim"].is_null(), "{name} aims");
            assert_eq!(hand["holds"], false, "{name} holds nothing");
        }
        let mut set = |program: &mut Program, side: usize, pressed: f32| {
            scripted.controllers[side].trigger = pressed;
            scripted.controllers[side].squeeze = pressed;
            head.send(&scripted);
            until(program, &format!("{side} at {pressed}"), |told| {
                told["controls"][side]["holds"] == (pressed > 0.5)
            })
        };
        let told = set(&mut program, 1, 1.0);
        assert_eq!(
            told["controls"][0]["holds"], false,
            "the left hand does not"
        );
        assert_pose(
            &told["controls"][1]["grip"],
            &Pose::at(0.27, 1.41, -0.63).turned(turn),
            "while holding",
        );
        set(&mut program, 1, 0.0);
        let told = set(&mut program, 0, 1.0);
        assert_eq!(told["controls"][1]["holds"], false, "the right hand let go");
        program.end();
        program.ended_well();
    });
}

#[test]
fn the_overlays_button_toggles_once_however_long_it_is_pressed() {
    attended(|| {
        let Some(monado) = Monado::start(Driver::Remote, Compositor::Null) else {
            return;
        };
        let mut head = monado.head();
        let mut scripted = Scripted::default();
        let mut program = Program::start(&monado, u64::MAX, &["--steered", "--figure=none"]);
        program.wait_for_frames(5);
        program.take_pose(&mut head, &scripted);
        for times in 1..=2u32 {
            let left = &mut scripted.controllers[0];
            (left.system, left.b) = (true, true);
            head.send(&scripted);
            until(&mut program, "toggled", |told| {
                told["overlay_toggles"] == times
            });
            for _ in 0..5 {
                let told = program.ask("tell", "still");
                assert_eq!(told["overlay_toggles"], times, "pressed for long");
            }
            let left = &mut scripted.controllers[0];
            (left.system, left.b) = (false, false);
            head.send(&scripted);
            for _ in 0..10 {
                let told = program.ask("tell", "released");
                assert_eq!(told["overlay_toggles"], times, "released");
            }
        }
        program.end();
        program.ended_well();
    });
}

#[test]
fn bare_hands_replace_controllers_that_are_laid_down() {
    attended(|| {
        let Some(monado) = Monado::start(Driver::Remote, Compositor::Null) else {
            return;
        };
        let mut head = monado.head();
        let mut scripted = Scripted::default();
        for hand in &mut scripted.controllers {
            (hand.active, hand.hand_tracking) = (false, true);
        }
        let mut program = Program::start(&monado, u64::MAX, &["--steered", "--figure=none"]);
        program.wait_for_frames(5);
        program.take_pose(&mut head, &scripted);
        let told = until(&mut program, "both hands", |told| {
            (0..2).all(|side| !told["controls"][side]["grip"].is_null())
        });
        for (side, controller) in scripted.controllers.iter().enumerate() {
            // The runtime makes a hand around the grip: its palm is near.
            let place = numbers(&told["controls"][side]["grip"]["position"]);
            let place = DVec3::from_slice(&place);
            let apart = place.distance(controller.stage_from_grip.position.as_dvec3());
            println!("hand {side}: palm {apart:.3} m from the grip");
            assert!(apart < 0.15, "hand {side} at {place}");
        }
        for hand in &mut scripted.controllers {
            hand.hand_tracking = false;
        }
        head.send(&scripted);
        until(&mut program, "no hands", |told| {
            (0..2).all(|side| {
                let hand = &told["controls"][side];
                hand["grip"].is_null() && hand["aim"].is_null() && hand["holds"] == false
            })
        });
        program.end();
        let over = program.ended_well();
        assert_eq!(over["tracks_hands"], true, "hand tracking was granted");
    });
}
