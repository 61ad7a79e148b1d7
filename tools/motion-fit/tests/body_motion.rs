//! The fit against recorded motion seen by a made-up network: what each part of it is worth.

mod common;
#[path = "common/synthetic.rs"]
mod synthetic;

use motion_fit::body::{FootLock, Parts};
use motion_fit::smoother::{Confidence, SmoothConfig, Smoother};
use spmm3::MotionParams;
use synthetic::{Errors, Eye, Network, RATE, Score, moves, performance, run, score};

fn print(name: &str, s: &Score) {
    println!(
        "{name:44} limbs {:4.0} mm, pelvis {:4.1} deg, lean {:+5.1} (rms {:4.1}) deg, slide {:.2} m/s (truth {:.2}), jitter {:4.1} (truth {:4.1}) mm/frame2, root {:4.0} mm, height {:+4.0} mm",
        s.limbs_mm, s.pelvis_degrees, s.lean_degrees[0], s.lean_degrees[1], s.slide[0], s.slide[1], s.jitter[0], s.jitter[1], s.root_mm, s.height_mm
    );
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
                let mut lock = FootLock::new(&skeleton);
                for (i, (frame, pose)) in smooth.iter_mut().zip(&poses).enumerate() {
                    lock.apply(i as f64 / RATE, frame, pose.standing);
                }
                let s = score(&skeleton, &truth, &smooth, RATE, 15);
                print(&format!("{name} all, smoothed, feet locked"), &s);
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
