//! Somebody in a headset is captured by it: a call's motion, as another one receives it, has head and wrists where the script put them.

use super::viewer::monado;
use crate::both_ways::{host, prepare};
use crate::house::{House, Program};
use crate::member::Member;
use glam::{Mat3, Quat, Vec3};
use link_call::{CallEvent, Viewer};
use spmm3::{Joint, MotionParams, Skeleton};
use std::time::Duration;
use synthetic_person::Puppet;
use test_support::monado::{Controller, Pose, Scripted};
use test_support::service::attended;
use test_support::speech::syllables;

/// Frames of motion that a pose may take from the driver to another person. They are counted, because the time of one is not bounded.
const FRAMES: u32 = 150;
/// Frames in which a pose that is there stays there.
const STAYS: u32 = 10;
/// From a wrist to where a controller lies in the palm, metres.
const PALM: f32 = 0.075;
/// What the wrists may be off by, metres.
const WRISTS: f32 = 0.03;

/// A place in motion space, where the person faces +z, in the stage, where they face -z.
fn stage(motion: Vec3) -> Vec3 {
    motion * Vec3::new(-1.0, 1.0, -1.0)
}

/// The script of one moment, in motion space.
#[derive(Clone, Copy)]
struct Moment {
    /// How the head is turned to its left, and how far it is from where it was at first, metres.
    turn: f32,
    head: Vec3,
    /// Left, right: where each arm points, and what share of its length the wrist is away from the shoulder at rest.
    arms: [(Vec3, f32); 2],
}

/// A person of that skeleton, who stands at the stage's origin.
struct Actor {
    skeleton: Skeleton,
}

impl Actor {
    fn rest(&self, joint: Joint) -> Vec3 {
        self.skeleton.rest_positions()[joint.index()]
    }

    fn eyes(&self) -> Vec3 {
        let height = (self.rest(Joint::LeftEye).y + self.rest(Joint::RightEye).y) / 2.0;
        Vec3::Y * height
    }

    /// Left, right: the wrists in motion space.
    fn wrists(&self, moment: &Moment) -> [Vec3; 2] {
        let joints = [
            [Joint::LeftShoulder, Joint::LeftElbow, Joint::LeftWrist],
            [Joint::RightShoulder, Joint::RightElbow, Joint::RightWrist],
        ];
        // The eyes' plumb line is the origin, and the neck is behind it.
        let neck = self.eyes() - (self.rest(Joint::LeftEye) + self.rest(Joint::RightEye)) / 2.0;
        [0, 1].map(|side: usize| {
            let [shoulder, elbow, wrist] = joints[side].map(|joint| self.rest(joint));
            let length = shoulder.distance(elbow) + elbow.distance(wrist);
            let (direction, share) = moment.arms[side];
            neck + shoulder + moment.head + direction.normalize() * share * length
        })
    }

    fn script(&self, moment: &Moment) -> Scripted {
        let wrists = self.wrists(moment);
        let head = stage(self.eyes() + moment.head);
        let controllers = [0, 1].map(|side: usize| {
            // The hand goes on where the arm points, its thumb up. A grip has fingers along -y and the thumb along -z.
            let fingers = stage(moment.arms[side].0.normalize());
            let thumb = Vec3::Y.reject_from_normalized(fingers).normalize();
            let axes = Mat3::from_cols(fingers.cross(thumb), -fingers, -thumb);
            let at = stage(wrists[side]) + PALM * fingers;
            let grip = Pose::at(at.x, at.y, at.z).turned(Quat::from_mat3(&axes).normalize());
            Controller::at(grip)
        });
        Scripted {
            stage_from_head: Pose::at(head.x, head.y, head.z)
                .turned(Quat::from_rotation_y(moment.turn)),
            controllers,
            ..Scripted::default()
        }
    }

    /// How far the motion's eyes and wrists are from the script, metres.
    fn errors(&self, moment: &Moment, motion: &MotionParams) -> [f32; 3] {
        let posed = self.skeleton.pose(motion);
        let at = |joint: Joint| posed.position(joint) + motion.root_translation;
        let [left, right] = self.wrists(moment);
        let eyes = (at(Joint::LeftEye) + at(Joint::RightEye)) / 2.0;
        [
            eyes.distance(self.eyes() + moment.head),
            at(Joint::LeftWrist).distance(left),
            at(Joint::RightWrist).distance(right),
        ]
    }
}

/// The next motion.
fn next(viewer: &Viewer) -> MotionParams {
    let mut silent = 0;
    loop {
        match viewer.next(Duration::from_secs(1)) {
            Ok(CallEvent::Frame { frame, .. }) => return frame.motion.clone(),
            Ok(CallEvent::Failed(why)) => panic!("the call failed: {why}"),
            Ok(_) => {}
            Err(_) => {
                silent += 1;
                assert!(silent < 60, "no motion comes");
            }
        }
    }
}

#[test]
fn a_wearers_head_and_wrists_are_where_the_script_put_them_in_the_motion_that_others_receive() {
    attended(|| {
        let Some((monado, mut head)) = monado() else {
            return;
        };
        let house = House::open();
        let actor = Actor {
            skeleton: Puppet::small().skeleton,
        };
        let [ahead, aside] = [Vec3::Z, Vec3::X];
        let still = Moment {
            turn: 0.0,
            head: Vec3::ZERO,
            arms: [(ahead + 0.3 * aside, 0.7), (ahead - 0.3 * aside, 0.7)],
        };
        let moments = [
            still,
            Moment {
                arms: [(ahead + 0.8 * aside, 0.85), (ahead + 0.5 * Vec3::Y, 0.6)],
                ..still
            },
            Moment {
                turn: 0.4,
                head: Vec3::new(0.05, -0.04, 0.03),
                arms: [(aside + 0.2 * Vec3::Y, 0.9), (ahead - 0.6 * Vec3::Y, 0.7)],
            },
            Moment {
                turn: -0.5,
                head: Vec3::new(-0.06, 0.0, 0.05),
                arms: [
                    (ahead - 0.3 * aside - 0.5 * Vec3::Y, 0.65),
                    (0.4 * Vec3::Y - aside, 0.9),
                ],
            },
            still,
        ];
        head.send(&actor.script(&moments[0]));
        let host = host(&house);
        let arguments = [
            &host.arguments()[..],
            &["--display", "xr", "--size", "160x120"],
        ];
        let (cache, arguments) = prepare(&house, "ada", &syllables(1), &arguments.concat());
        let mut command = monado.client(env!("CARGO_BIN_EXE_mon3tr"));
        command
            .args(&arguments)
            .env("RUST_LOG", "warn,link=info,app=info,renderer_openxr=debug");
        let (mut ada, _keys) = Program::start_steered(&house, &cache, &mut command);
        let call = ada.word_after("mon3tr call ");
        super::viewer::is_focused(&mut ada, 1);

        let bob = Member::of(&house, &call, 2);
        let seat = bob.seat_of("ada");
        let seated = bob.sits("bob").expect("a seat is free");
        let viewer = bob.watches(&seat);
        let mut worst = [0.0f32; 3];
        for (number, moment) in moments.iter().enumerate() {
            head.send(&actor.script(moment));
            let mut nearest = [f32::INFINITY; 3];
            let came = (0..FRAMES).any(|_| {
                let errors = actor.errors(moment, &next(&viewer));
                nearest = [0, 1, 2].map(|k: usize| nearest[k].min(errors[k]));
                errors.iter().all(|error| *error <= WRISTS)
            });
            assert!(came, "moment {number}: {nearest:?} m\n{}", ada.said());
            let mut off = [0.0f32; 3];
            for _ in 0..STAYS {
                let errors = actor.errors(moment, &next(&viewer));
                off = [0, 1, 2].map(|k: usize| off[k].max(errors[k]));
            }
            let mm = off.map(|error| error * 1e3);
            println!("moment {number}: eyes, wrists off by at most {mm:.1?} mm");
            worst = [0, 1, 2].map(|k: usize| worst[k].max(off[k]));
        }
        house.runtime.block_on(viewer.hang_up());
        house.runtime.block_on(seated.hang_up());
        assert!(worst.iter().all(|error| *error <= WRISTS), "{worst:?} m");
        ada.ask_to_end();
        let report = ada.report();
        assert!(
            report["sent"]["sent"].as_u64() >= Some(u64::from(STAYS)),
            "{report:#}"
        );
    });
}
