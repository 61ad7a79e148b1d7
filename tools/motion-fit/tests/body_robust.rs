//! The fit against mistakes of networks: left and right exchanged, limbs hidden, bodies gone, and numbers without sense.

#![allow(
    clippy::cast_possible_truncation,
    reason = "the landmarks and the avatar are f32, and counts of frames are small"
)]

mod common;
#[path = "common/synthetic.rs"]
mod synthetic;

use common::Random;
use glam::{Quat, Vec2, Vec3};
use motion_fit::{
    body::{BodyFit, BodyPose, FitConfig, Parts},
    landmarks::{BodyLandmarks, BodyPoint},
};
use spmm3::{Joint, MotionParams};
use synthetic::{Errors, Eye, Network, RATE, motion, moves, performance, run, score, swapped};

fn eye() -> Eye {
    Eye::new(1.3, 5.0, 0.1)
}

/// In which frames the fitted hips' or shoulders' line points the other way than the truth's.
fn turned_about(truth: &[MotionParams], poses: &[BodyPose]) -> Vec<bool> {
    let skeleton = common::skeleton();
    truth
        .iter()
        .zip(poses)
        .map(|(truth, pose)| {
            let t = common::forward(&skeleton, truth).1;
            let f = common::forward(&skeleton, &motion(pose)).1;
            [(1, 2), (16, 17), (7, 8)].into_iter().any(|(l, r)| {
                let line = |p: &[common::V3; 22]| common::sub(p[l], p[r]);
                let (a, b) = (line(&t), line(&f));
                let dot: f64 = (0..3).map(|i| a[i] * b[i]).sum();
                // Ankles that are close together tell nothing.
                common::norm(a) > 0.15 && dot < -0.25 * common::norm(a) * common::norm(b)
            })
        })
        .collect()
}

fn longest(flags: &[bool]) -> usize {
    let mut best = 0;
    let mut now = 0;
    for flag in flags {
        now = if *flag { now + 1 } else { 0 };
        best = best.max(now);
    }
    best
}

#[test]
fn exchanged_labels_in_a_third_of_the_pictures_do_not_turn_the_body_about() {
    let skeleton = common::skeleton();
    for (name, yaw) in [
        ("mocap/cmu_02_01_walk.bvh", 0.9),
        ("mocap/cmu_02_01_walk.bvh", 0.2),
        ("mocap/cmu_02_05_punch.bvh", 0.0),
    ] {
        let Some(truth) = performance(name, yaw) else {
            return;
        };
        let mut random = Random(21);
        let lots: Vec<bool> = truth.iter().map(|_| random.unit() < 0.35).collect();
        for (label, parts) in [
            ("all", Parts::default()),
            (
                "labels as they are",
                Parts {
                    labels: false,
                    ..Parts::default()
                },
            ),
        ] {
            let exact = run(&truth, eye(), Errors::USUAL, parts, 11, |_| false);
            let unswapped = score(&skeleton, &truth, &moves(&exact), RATE, 15);
            let poses = run(&truth, eye(), Errors::USUAL, parts, 11, |i| lots[i]);
            let s = score(&skeleton, &truth, &moves(&poses), RATE, 15);
            let about = turned_about(&truth, &poses);
            let count = about.iter().filter(|a| **a).count();
            println!(
                "{name} {label}: limbs {:.0} mm ({:.0} without mistakes), {count} of {} frames turned about, {} in a row",
                s.limbs_mm,
                unswapped.limbs_mm,
                about.len(),
                longest(&about)
            );
            if label == "all" {
                let wrong = poses
                    .iter()
                    .zip(&lots)
                    .filter(|(pose, mistaken)| pose.swapped != **mistaken)
                    .count();
                println!("   {wrong} pictures' labels taken wrongly");
                assert!(longest(&about) <= 3, "{name}: turned about too long");
            }
        }
    }
}

#[test]
fn a_clip_that_starts_exchanged_is_recovered() {
    for (name, yaw) in [
        ("mocap/cmu_02_01_walk.bvh", 0.9),
        ("mocap/cmu_02_05_punch.bvh", 0.0),
    ] {
        let Some(truth) = performance(name, yaw) else {
            return;
        };
        for count in [5, 30, 60] {
            let poses = run(&truth, eye(), Errors::USUAL, Parts::default(), 11, |i| {
                i < count
            });
            let about = turned_about(&truth, &poses);
            println!(
                "{name}, {count} pictures exchanged at the start: {} turned about, the last at {:?}",
                about.iter().filter(|a| **a).count(),
                about.iter().rposition(|a| *a)
            );
            assert!(
                !about[12..].iter().any(|a| *a),
                "{name}, {count}: still turned about after the trial"
            );
        }
    }
}

#[test]
fn a_back_that_a_network_imagined_is_turned_round_when_it_sees_better() {
    let Some(truth) = performance("mocap/cmu_02_05_punch.bvh", 0.0) else {
        return;
    };
    let skeleton = common::skeleton();
    // Left and right exchanged and depth mirrored: all agrees with a person seen from behind.
    let behind = |seen: &BodyLandmarks| {
        let mut seen = swapped(seen);
        for point in &mut seen.points {
            point.metres.z = -point.metres.z;
        }
        seen
    };
    for (from, to) in [(0, 20), (100, 115)] {
        let mut network = Network::new(eye(), Errors::USUAL, 4);
        let mut fit = BodyFit::new(&skeleton, FitConfig::new(network.eye.camera));
        let mut poses = Vec::new();
        for (i, frame) in truth.iter().take(200).enumerate() {
            let mut seen = network.look(&skeleton, frame, 1.0 / RATE);
            if (from..to).contains(&i) {
                seen = behind(&seen);
            }
            poses.push(fit.fit(i as f64 / RATE, Some(&seen)));
        }
        let about = turned_about(&truth[..200], &poses);
        println!(
            "seen from behind in pictures {from} to {to}: {} turned about, the last at {:?}",
            about.iter().filter(|a| **a).count(),
            about.iter().rposition(|a| *a)
        );
        assert!(
            !about[to + 36..].iter().any(|a| *a),
            "{from}: still turned about more than a second later"
        );
        assert!(
            from == 0 || longest(&about) <= 3,
            "{from}: the body turned about"
        );
    }
}

#[test]
fn a_hidden_leg_stays_plausible_and_comes_back() {
    let Some(truth) = performance("mocap/cmu_02_05_punch.bvh", 0.0) else {
        return;
    };
    let skeleton = common::skeleton();
    let mut network = Network::new(eye(), Errors::USUAL, 4);
    let mut fit = BodyFit::new(&skeleton, FitConfig::new(network.eye.camera));
    let mut random = Random(8);
    let hidden = 100..130;
    let mut after = 0.0;
    for (i, frame) in truth.iter().take(200).enumerate() {
        let mut seen = network.look(&skeleton, frame, 1.0 / RATE);
        if hidden.contains(&i) {
            for landmark in [25, 27, 29, 31] {
                let point = &mut seen.points[landmark];
                point.confidence = 0.001;
                point.pixel += Vec2::new(200.0, -300.0) * random.signed() as f32;
                point.metres = Vec3::new(0.3, -0.3, 0.4) * random.signed() as f32;
            }
        }
        let pose = fit.fit(i as f64 / RATE, Some(&seen));
        let fitted = motion(&pose);
        let knee = fitted.axis_angle(Joint::LeftKnee);
        assert!(
            knee.x > -0.3 && knee.x < 2.7 && knee.y.abs() < 0.5 && knee.z.abs() < 0.5,
            "frame {i}: the knee bends to {knee}"
        );
        let t = common::forward(&skeleton, frame).1;
        let f = common::forward(&skeleton, &fitted).1;
        let ankle = common::norm(common::sub(
            common::sub(t[7], t[0]),
            common::sub(f[7], f[0]),
        ));
        if hidden.contains(&i) {
            assert!(
                ankle < 0.5,
                "frame {i}: the hidden ankle is {ankle:.2} m off"
            );
            if i > hidden.start + 10 {
                assert!(pose.confidence[4] < 0.2, "a hidden leg is said to be sure");
            }
        } else if i >= 135 {
            after += ankle / 65.0;
        }
    }
    println!("ankle after it came back: {:.0} mm off", after * 1e3);
    assert!(after < 0.12, "the ankle did not come back: {after:.2} m");
}

#[test]
fn without_a_body_the_pose_comes_to_rest() {
    let Some(truth) = performance("mocap/cmu_02_05_punch.bvh", 0.0) else {
        return;
    };
    let skeleton = common::skeleton();
    let mut network = Network::new(eye(), Errors::USUAL, 4);
    let mut fit = BodyFit::new(&skeleton, FitConfig::new(network.eye.camera));
    for (i, frame) in truth.iter().take(60).enumerate() {
        fit.fit(
            i as f64 / RATE,
            Some(&network.look(&skeleton, frame, 1.0 / RATE)),
        );
    }
    let mut last = None;
    for i in 60..240 {
        let pose = fit.fit(i as f64 / RATE, None);
        assert!(!pose.seen, "a body was seen where none was");
        if let Some(last) = last {
            let moved = pose
                .rotations
                .iter()
                .zip(last)
                .map(|(a, b): (_, Quat)| a.angle_between(b))
                .fold(0.0_f32, f32::max);
            assert!(moved < 0.25, "frame {i}: a joint jumps by {moved} rad");
        }
        last = Some(pose.rotations);
        if i == 239 {
            let ease = spmm3::at_ease(&skeleton);
            for joint in [Joint::LeftElbow, Joint::RightShoulder, Joint::LeftKnee] {
                let off = ease
                    .rotation(joint)
                    .angle_between(pose.rotations[joint.index()]);
                assert!(off < 0.05, "{} is {off} rad from rest", joint.name());
            }
            assert!(
                pose.root_translation.y.abs() < 0.05,
                "the resting body stands {} m above the floor",
                pose.root_translation.y
            );
        }
    }
    let pose = fit.fit(8.0, Some(&network.look(&skeleton, &truth[60], 0.1)));
    assert!(pose.seen, "the body that came back is not seen");
}

#[test]
fn numbers_without_sense_never_panic_and_never_come_out() {
    let skeleton = common::skeleton();
    let mut random = Random(77);
    let sane = MotionParams::default();
    let mut network = Network::new(eye(), Errors::USUAL, 4);
    let mut fit = BodyFit::new(&skeleton, FitConfig::new(eye().camera));
    let odd = [
        f32::NAN,
        f32::INFINITY,
        f32::NEG_INFINITY,
        f32::MAX,
        -1e30,
        f32::MIN_POSITIVE,
        0.0,
        1e6,
    ];
    for round in 0..10_000 {
        let kind = random.bits() % 8;
        let mut seen = network.look(&skeleton, &sane, 0.03);
        let spread = [0.1, 1.0, 30.0, 1e4][(random.bits() % 4) as usize];
        match kind {
            0 => seen.points.fill(BodyPoint::default()),
            1 => seen.points.iter_mut().for_each(|p| p.confidence = 0.0),
            2 => seen.points = [seen.points[12]; 33],
            3 | 4 => {
                for point in &mut seen.points {
                    point.pixel =
                        Vec2::new(random.normal() as f32, random.normal() as f32) * spread * 10.0;
                    point.metres = Vec3::from_array(random.normals().map(|v| v as f32)) * spread;
                    point.confidence = random.unit() as f32;
                }
            }
            5 | 6 => {
                for point in &mut seen.points {
                    let mut any = || odd[(random.bits() % 8) as usize];
                    match any() as i32 {
                        0 => {}
                        _ => {
                            point.pixel.x = any();
                            point.metres.z = any();
                            point.confidence = any();
                        }
                    }
                }
            }
            _ => {}
        }
        let body = (random.unit() > 0.02).then_some(&seen);
        let seconds = match random.bits() % 50 {
            0 => f64::NAN,
            1 => f64::INFINITY,
            2 => -5.0,
            3 => 1e300,
            _ => f64::from(round) * 0.033,
        };
        let pose = fit.fit(seconds, body);
        let fitted = motion(&pose);
        let numbers = [
            pose.reprojection_px,
            pose.camera.pitch_radians,
            pose.camera.height_metres,
        ];
        assert!(
            fitted.is_finite()
                && numbers
                    .iter()
                    .chain(&pose.confidence)
                    .all(|v| v.is_finite())
                && pose.camera.camera_from_world.is_finite()
                && pose.camera.position.is_finite(),
            "round {round}, kind {kind}: {pose:?}"
        );
        assert!(
            pose.root_translation.length() < 1e3,
            "round {round}, kind {kind}: the body is at {}",
            pose.root_translation
        );
    }
    let mut good = fit.fit(1e4, None);
    for i in 0..150 {
        let seen: BodyLandmarks = network.look(&skeleton, &sane, 1.0 / RATE);
        let seen = if i % 40 == 39 { swapped(&seen) } else { seen };
        good = fit.fit(1e4 + 2.0 + f64::from(i) / RATE, Some(&seen));
    }
    println!(
        "after all that: reprojection {:.1} px",
        good.reprojection_px
    );
    assert!(good.reprojection_px < 15.0, "the fit does not recover");
}

#[test]
fn after_a_pause_of_the_pictures_a_person_is_found_anew() {
    let skeleton = common::skeleton();
    let eye = eye();
    let mut network = Network::new(eye, Errors::NONE, 5);
    let mut fit = BodyFit::new(&skeleton, FitConfig::new(eye.camera));
    let mut truth = spmm3::at_ease(&skeleton);
    for i in 0..60 {
        let seen = network.look(&skeleton, &truth, 1.0 / RATE);
        fit.fit(f64::from(i) / RATE, Some(&seen));
    }
    // A minute later the person stands elsewhere, with the back to the camera: no way leads there in a picture.
    truth.set_rotation(Joint::Pelvis, Quat::from_rotation_y(3.0));
    truth.root_translation.x += 0.8;
    let seen = network.look(&skeleton, &truth, 1.0 / RATE);
    let pose = fit.fit(62.0, Some(&seen));
    let turned = motion(&pose).rotation(Joint::Pelvis) * Vec3::Z;
    assert!(turned.z < -0.9, "faces away: {turned}");
}

#[test]
fn a_head_and_shoulders_before_a_desk_are_a_person_who_stands_upright_below_them() {
    let skeleton = common::skeleton();
    let eye = Eye::new(1.45, 0.8, 0.0);
    let mut truth = spmm3::at_ease(&skeleton);
    let mut network = Network::new(eye, Errors::USUAL, 3);
    let mut fit = BodyFit::new(&skeleton, FitConfig::new(eye.camera));
    let at = |motion: &MotionParams, joint: usize| common::forward(&skeleton, motion).1[joint];
    let mut worst: f64 = 0.0;
    let mut last = None;
    for i in 0..120 {
        // To the left and to the right by ten centimetres.
        truth.root_translation.x = 0.1 * (f64::from(i) / 20.0).sin() as f32;
        let mut seen = network.look(&skeleton, &truth, 1.0 / RATE);
        for point in &mut seen.points[13..] {
            point.confidence = 0.02;
        }
        let pose = fit.fit(f64::from(i) / RATE, Some(&seen));
        assert!(pose.seen, "picture {i}: a person");
        let fitted = motion(&pose);
        let view = pose.camera.camera_from_world;
        for joint in [15, 16, 17] {
            let to_sight = |p: Vec3| view * (p - pose.camera.position);
            let [x, y, z] = at(&fitted, joint).map(|v| v as f32);
            let place = to_sight(Vec3::new(x, y, z));
            let [u, v] = eye.project([place.x, place.y, place.z].map(f64::from));
            let [a, b] = eye.project(eye.see(at(&truth, joint)));
            if i > 20 {
                worst = worst.max((u - a).hypot(v - b));
            }
            let depth = f64::from(place.z) / eye.see(at(&truth, joint))[2];
            assert!(
                (0.8..1.25).contains(&depth),
                "picture {i}: at {depth} of its distance"
            );
        }
        last = Some(fitted);
    }
    let last = last.expect("pictures");
    println!("head and shoulders alone: at most {worst:.0} pixels off");
    assert!(worst < 80.0, "{worst:.0} pixels of 960 off");
    for joint in [Joint::Pelvis, Joint::LeftKnee, Joint::RightKnee] {
        let turn = last.axis_angle(joint);
        assert!(turn.x.abs() < 0.3, "{joint:?} is bent: {turn}");
    }
    assert!(
        last.root_translation.y.abs() < 0.05,
        "the feet stand: {}",
        last.root_translation
    );
}
