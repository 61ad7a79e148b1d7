//! A wearer with bare hands: what the runtime tells of them is what the avatar does.

use crate::program::Program;
use glam::{Affine3A, Quat, Vec3};
use motion_fit::wearer::{Stance, WearerFit, WearerHand, WearerSample};
use serde_json::Value;
use spmm3::{Joint, Skeleton};
use synthetic_person::Puppet;
use test_support::headset_reference::numbers;
use test_support::monado::{Compositor, Driver, Monado, Pose, Scripted};
use test_support::service::attended;

/// Questions that a pose may take to be answered as scripted. They are counted, because the time of one is not bounded.
const QUESTIONS: u32 = 100;
/// Samples that the fit has to follow a pose.
const SAMPLES: u32 = 5;
/// The wrist among `XR_EXT_hand_tracking`'s joints.
const WRIST: usize = 1;
/// What the wrists may be off by, metres.
const NEAR: f32 = 0.03;

fn pose(told: &Value) -> Option<Affine3A> {
    #[allow(
        clippy::cast_possible_truncation,
        reason = "they were single precision before they were told"
    )]
    let floats = |value: &Value| numbers(value).iter().map(|v| *v as f32).collect::<Vec<_>>();
    let place = told.get("position")?;
    let turn = <[f32; 4]>::try_from(floats(&told["rotation"])).ok()?;
    Some(Affine3A::from_rotation_translation(
        Quat::from_array(turn),
        Vec3::from_slice(&floats(place)),
    ))
}

fn affine(pose: &Pose) -> Affine3A {
    Affine3A::from_rotation_translation(pose.rotation, pose.position)
}

fn sample(told: &Value) -> WearerSample {
    let wearer = &told["wearer"];
    WearerSample {
        seconds: wearer["seconds"].as_f64().expect("a time"),
        floor_from_view: pose(&wearer["view"]),
        hands: [0, 1].map(|side: usize| {
            let hand = &wearer["hands"][side];
            let joints = hand["joints"].as_array().map(|joints| {
                let mut poses = [None; 26];
                for (to, joint) in poses.iter_mut().zip(joints) {
                    *to = pose(joint);
                }
                poses
            });
            WearerHand {
                joints,
                floor_from_grip: pose(&hand["grip"]),
            }
        }),
        ..WearerSample::default()
    }
}

/// Asks until the view and the wrists are where they were put.
fn until(program: &mut Program, view: &Affine3A, wrists: &[Option<Affine3A>; 2]) -> WearerSample {
    let near = |told: Option<Affine3A>, put: &Affine3A| {
        told.is_some_and(|told| told.abs_diff_eq(*put, 1e-3))
    };
    let mut last = WearerSample::default();
    for _ in 0..QUESTIONS {
        last = sample(&program.ask("tell", "wearer"));
        let hands = last.hands.iter().zip(wrists).all(|(hand, wrist)| {
            let told = hand.joints.and_then(|joints| joints[WRIST]);
            match wrist {
                Some(wrist) => near(told, wrist),
                None => told.is_some(),
            }
        });
        if hands && near(last.floor_from_view, view) {
            return last;
        }
    }
    panic!("never there: {last:?}");
}

/// Where the wrists of the avatar are in floor space.
fn fitted(fit: &mut WearerFit, skeleton: &Skeleton, sample: &WearerSample) -> [Vec3; 2] {
    let motion = fit.step(sample).expect("a head").motion;
    let posed = skeleton.pose(&motion);
    [Joint::LeftWrist, Joint::RightWrist].map(|wrist| {
        let at = posed.position(wrist) + motion.root_translation;
        let floor = fit.floor_from_motion(at.as_dvec3()).expect("begun");
        floor.as_vec3()
    })
}

#[test]
fn the_wrists_of_a_wearers_bare_hands_are_the_avatars() {
    attended(|| {
        let Some(monado) = Monado::start(Driver::Remote, Compositor::Null) else {
            return;
        };
        let skeleton = Puppet::small().skeleton;
        let mut head = monado.head();
        let mut scripted = Scripted::default();
        let places = [
            ([-0.2, 1.3, -0.4], [0.2, 1.3, -0.4]),
            ([-0.4, 1.5, -0.25], [0.1, 1.1, -0.35]),
            ([-0.1, 1.2, -0.45], [0.5, 1.35, -0.1]),
        ];
        for hand in &mut scripted.controllers {
            (hand.active, hand.hand_tracking) = (false, true);
        }
        let mut program = Program::start(&monado, u64::MAX, &["--steered", "--figure=none"]);
        program.wait_for_frames(5);
        program.take_pose(&mut head, &scripted);
        let view = affine(&scripted.stage_from_head);
        // The runtime makes a hand around the grip that the script has: the wrist is fixed against it.
        let first = until(&mut program, &view, &[None; 2]);
        let grip_from_wrist = [0, 1].map(|side: usize| {
            let joints = first.hands[side].joints.expect("a hand");
            let grip = affine(&scripted.controllers[side].stage_from_grip);
            let grip_from_wrist = grip.inverse() * joints[WRIST].expect("a wrist");
            let away = grip_from_wrist.translation.length();
            assert!(
                away < 0.15,
                "hand {side}: the wrist is {away} m from the grip"
            );
            grip_from_wrist
        });
        let mut fit = WearerFit::new(&skeleton, Stance::Standing);
        for (number, (left, right)) in places.into_iter().enumerate() {
            let angle = 0.3 * number as f32;
            for (hand, [x, y, z]) in scripted.controllers.iter_mut().zip([left, right]) {
                let turn = Quat::from_rotation_x(angle) * Quat::from_rotation_z(-angle);
                hand.stage_from_grip = Pose::at(x, y, z).turned(turn);
            }
            let at = Pose::at(0.05 * number as f32, 1.6, -0.02 * number as f32);
            scripted.stage_from_head = at.turned(Quat::from_rotation_y(0.5 * angle));
            head.send(&scripted);
            let wrists = [0, 1].map(|side: usize| {
                affine(&scripted.controllers[side].stage_from_grip) * grip_from_wrist[side]
            });
            let view = affine(&scripted.stage_from_head);
            until(&mut program, &view, &wrists.map(Some));
            let mut off = [f32::NAN; 2];
            for _ in 0..SAMPLES {
                let sample = sample(&program.ask("tell", "again"));
                let found = fitted(&mut fit, &skeleton, &sample);
                off = [0, 1]
                    .map(|side: usize| found[side].distance(Vec3::from(wrists[side].translation)));
            }
            println!(
                "place {number}: wrists off by {:.1?} mm",
                off.map(|v| v * 1e3)
            );
            assert!(
                off.iter().all(|off| *off <= NEAR),
                "place {number}: {off:?} m"
            );
        }
        program.end();
        program.ended_well();
    });
}
