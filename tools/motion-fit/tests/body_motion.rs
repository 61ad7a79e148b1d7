//! The fit against recorded motion seen by a made-up network: what each part of it is worth.

mod common;
#[path = "common/synthetic.rs"]
mod synthetic;

use motion_fit::body::{BodyFit, BodyPose, FitConfig, Parts};
use motion_fit::smoother::{Confidence, SmoothConfig, Smoother};
use spmm3::{Joint, MotionParams};
use synthetic::{Errors, Eye, Network, Score, motion, score, swapped};

const RATE: f64 = 30.0;

/// The recording at 30 Hz, turned about the floor's origin and moved there with the middle of its way.
fn performance(name: &str, yaw: f32) -> Option<Vec<MotionParams>> {
    let clip = common::recording(name)?;
    let mut frames = common::frames(&clip, RATE);
    let turn = glam::Quat::from_rotation_y(yaw);
    let pelvis = common::skeleton().rest_positions()[0] * glam::Vec3::new(1.0, 0.0, 1.0);
    let middle = (frames[0].root_translation + frames[frames.len() - 1].root_translation) / 2.0;
    for frame in &mut frames {
        let rotation = turn * frame.rotation(Joint::Pelvis);
        frame.set_rotation(Joint::Pelvis, rotation);
        let mut at = frame.root_translation - middle * glam::Vec3::new(1.0, 0.0, 1.0);
        at = turn * (at + pelvis) - pelvis;
        frame.root_translation = at;
    }
    Some(frames)
}

/// Fits all frames; `mistake` says in which left and right are exchanged.
fn run(
    truth: &[MotionParams],
    eye: Eye,
    errors: Errors,
    parts: Parts,
    mistake: impl Fn(usize) -> bool,
) -> Vec<BodyPose> {
    let skeleton = common::skeleton();
    let mut network = Network::new(eye, errors, 11);
    let config = FitConfig {
        parts,
        ..FitConfig::new(eye.camera)
    };
    let mut fit = BodyFit::new(&skeleton, config);
    truth
        .iter()
        .enumerate()
        .map(|(i, frame)| {
            let mut seen = network.look(&skeleton, frame, 1.0 / RATE);
            if mistake(i) {
                seen = swapped(&seen);
            }
            fit.fit(i as f64 / RATE, Some(&seen))
        })
        .collect()
}

fn print(name: &str, s: &Score) {
    println!(
        "{name:44} limbs {:4.0} mm, pelvis {:4.1} deg, lean {:+5.1} (rms {:4.1}) deg, slide {:.2} m/s (truth {:.2}), jitter {:4.1} (truth {:4.1}) mm/frame2, root {:4.0} mm, height {:+4.0} mm",
        s.limbs_mm, s.pelvis_degrees, s.lean_degrees[0], s.lean_degrees[1], s.slide[0], s.slide[1], s.jitter[0], s.jitter[1], s.root_mm, s.height_mm
    );
}

fn moves(poses: &[BodyPose]) -> Vec<MotionParams> {
    poses.iter().map(motion).collect()
}

#[test]
fn each_part_of_the_fit_brings_it_nearer_to_recorded_motion() {
    let skeleton = common::skeleton();
    let none = Parts {
        labels: false,
        upright: false,
        ground: false,
    };
    for (name, yaw) in [
        ("mocap/cmu_02_01_walk.bvh", 0.9_f32),
        ("mocap/cmu_02_05_punch.bvh", 0.0),
    ] {
        let Some(truth) = performance(name, yaw) else {
            return;
        };
        let eye = Eye::new(1.3, 5.0, 0.1);
        let mut network = Network::new(eye, Errors::USUAL, 11);
        let raw = truth
            .iter()
            .map(|frame| {
                let exact = Network::new(eye, Errors::NONE, 1).look(&skeleton, frame, 1.0 / RATE);
                let seen = network.look(&skeleton, frame, 1.0 / RATE);
                let off = (11..17).chain(23..29).map(|i| (exact.points[i].metres - seen.points[i].metres).length());
                f64::from(off.sum::<f32>()) / 12.0 * 1e3
            })
            .sum::<f64>()
            / truth.len() as f64;
        println!("{name}: the landmarks' own error {raw:.0} mm");
        for (label, parts, errors) in [
            ("no errors", Parts::default(), Errors::NONE),
            ("no parts", none, Errors::USUAL),
            ("upright", Parts { upright: true, ..none }, Errors::USUAL),
            ("ground", Parts { ground: true, ..none }, Errors::USUAL),
            ("upright, ground", Parts { upright: true, ground: true, ..none }, Errors::USUAL),
            ("all", Parts::default(), Errors::USUAL),
        ] {
            let poses = run(&truth, eye, errors, parts, |_| false);
            let s = score(&skeleton, &truth, &moves(&poses), RATE, 15);
            print(&format!("{name} {label}"), &s);
            if label == "all" {
                let mut smoother = Smoother::new(SmoothConfig::default());
                let mut smooth = moves(&poses);
                for (i, frame) in smooth.iter_mut().enumerate() {
                    smoother.smooth(i as f64 / RATE, frame, &Confidence::default());
                }
                let s = score(&skeleton, &truth, &smooth, RATE, 15);
                print(&format!("{name} all, smoothed"), &s);
                for late in 1..4 {
                    let s = score(&skeleton, &truth[..truth.len()-late], &smooth[late..], RATE, 15);
                    print(&format!("   truth {late} frames ago"), &s);
                }
            }
            let last = poses[poses.len() - 1];
            println!("   pitch {:.3} height {:.2} reprojection {:.1}", last.camera.pitch_radians, last.camera.height_metres, last.reprojection_px);
        }
    }
}

#[test]
fn debug_contacts() {
    let skeleton = common::skeleton();
    let truth = performance("mocap/cmu_02_01_walk.bvh", 0.9).unwrap();
    let eye = Eye::new(1.3, 5.0, 0.1);
    let poses = run(&truth, eye, Errors::USUAL, Parts::default(), |_| false);
    for i in 1..truth.len() {
        let t = [i - 1, i].map(|k| common::forward(&skeleton, &truth[k]).1);
        let f = [i - 1, i].map(|k| common::forward(&skeleton, &motion(&poses[k])).1);
        let sp = |p: &[[common::V3; 22]; 2], j: usize| { let d = common::sub(p[1][j], p[0][j]); common::norm(d) * RATE };
        println!("{i:3} L truth ankle {:.2} foot {:.2} h {:.2} fit {:.2} {} | R truth {:.2} foot {:.2} h {:.2} fit {:.2} {} | dz {:+.3} dx {:+.3} dy {:+.3} h {:.3}", sp(&t,7), sp(&t,10), t[1][10][1], sp(&f,7), poses[i].standing[0], sp(&t,8), sp(&t,11), t[1][11][1], sp(&f,8), poses[i].standing[1],
         f[1][0][2]-t[1][0][2], f[1][0][0]-t[1][0][0], f[1][0][1]-t[1][0][1], poses[i].camera.height_metres);
    }
}
