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
        "{name:28} limbs {:4.0} mm, pelvis {:4.1} deg, lean {:+5.1} (rms {:4.1}) deg, slide {:.2} m/s (truth {:.2}), jitter {:4.1} (truth {:4.1}) mm/frame2, root {:4.0} mm, height {:+4.0} mm",
        s.limbs_mm, s.pelvis_degrees, s.lean_degrees[0], s.lean_degrees[1], s.slide[0], s.slide[1], s.jitter[0], s.jitter[1], s.root_mm, s.height_mm
    );
}

/// Where the performances are seen from: how far they are turned about the floor's origin, and the seed of the network's errors.
const LOOKS: [(f32, u64); 4] = [(0.9, 11), (0.3, 12), (-0.5, 13), (1.2, 14)];

/// The mean of some scores.
fn mean(scores: &[Score]) -> Score {
    let sum = |part: fn(&Score) -> f64| scores.iter().map(part).sum::<f64>() / scores.len() as f64;
    Score {
        limbs_mm: sum(|s| s.limbs_mm),
        pelvis_degrees: sum(|s| s.pelvis_degrees),
        lean_degrees: [
            sum(|s| s.lean_degrees[0]),
            sum(|s| s.lean_degrees[1].powi(2)).sqrt(),
        ],
        slide: [sum(|s| s.slide[0]), sum(|s| s.slide[1])],
        jitter: [sum(|s| s.jitter[0]), sum(|s| s.jitter[1])],
        root_mm: sum(|s| s.root_mm),
        height_mm: sum(|s| s.height_mm),
    }
}

/// Mean distance of the network's landmarks of the limbs, relative to the hips, from those of a network without errors, mm.
fn raw_mm(truth: &[MotionParams], seed: u64) -> f64 {
    let skeleton = common::skeleton();
    let mut network = Network::new(eye(), Errors::USUAL, seed);
    let of_frame = |frame: &MotionParams| {
        let exact = Network::new(eye(), Errors::NONE, 1).look(&skeleton, frame, 1.0 / RATE);
        let seen = network.look(&skeleton, frame, 1.0 / RATE);
        let off = (11..17)
            .chain(23..29)
            .map(|i| (exact.points[i].metres - seen.points[i].metres).length());
        f64::from(off.sum::<f32>()) / 12.0 * 1e3
    };
    truth.iter().map(of_frame).sum::<f64>() / truth.len() as f64
}

fn eye() -> Eye {
    Eye::new(1.3, 5.0, 0.1)
}

#[test]
fn each_part_of_the_fit_brings_it_nearer_to_recorded_motion() {
    let skeleton = common::skeleton();
    let none = Parts {
        labels: false,
        upright: false,
        ground: false,
    };
    for (name, looks) in [
        ("mocap/cmu_02_01_walk.bvh", &LOOKS[..]),
        ("mocap/cmu_02_05_punch.bvh", &LOOKS[1..3]),
    ] {
        let Some(truths) = looks
            .iter()
            .map(|(yaw, seed)| Some((performance(name, *yaw)?, *seed)))
            .collect::<Option<Vec<_>>>()
        else {
            return;
        };
        let raw: f64 = truths.iter().map(|(t, seed)| raw_mm(t, *seed)).sum();
        println!(
            "{name}: the landmarks' own error {:.0} mm",
            raw / truths.len() as f64
        );
        let kinds = [
            ("no errors", Parts::default(), Errors::NONE),
            ("no parts", none, Errors::USUAL),
            ("ground", Parts { ground: true, ..none }, Errors::USUAL),
            ("upright", Parts { upright: true, ..none }, Errors::USUAL),("upright, labels", Parts { upright: true, labels:true, ..none }, Errors::USUAL),("upright, ground", Parts { upright: true, ground:true, ..none }, Errors::USUAL),
            ("all", Parts::default(), Errors::USUAL),
        ];
        let mut results = Vec::new();
        for (label, parts, errors) in kinds {
            let mut scores = [Vec::new(), Vec::new(), Vec::new()];
            for (truth, seed) in &truths {
                let poses = run(truth, eye(), errors, parts, *seed, |_| false);
                let mut fitted = moves(&poses);
                scores[0].push(score(&skeleton, truth, &fitted, RATE, 15));
                let mut smoother = Smoother::new(SmoothConfig::default());
                for (i, frame) in fitted.iter_mut().enumerate() {
                    smoother.smooth(i as f64 / RATE, frame, &Confidence::default());
                }
                scores[1].push(score(&skeleton, truth, &fitted, RATE, 15));
                let mut lock = FootLock::new(&skeleton);
                for (i, (frame, pose)) in fitted.iter_mut().zip(&poses).enumerate() {
                    lock.apply(i as f64 / RATE, frame, pose.standing);
                }
                scores[2].push(score(&skeleton, truth, &fitted, RATE, 15));
            }
            let fitted = mean(&scores[0]);
            print(label, &fitted);
            results.push(fitted);
            if label == "all" {
                print("all, smoothed", &mean(&scores[1]));
                let locked = mean(&scores[2]);
                print("all, smoothed, feet locked", &locked);
                results.push(locked);
            }
        }
        let [exact, bare, _, _, _,_, all, locked] = results[..] else {
            panic!("six results");
        };
        assert!(exact.limbs_mm < 40.0, "{name}: the fit itself errs by {:.0} mm", exact.limbs_mm);
        assert!(all.limbs_mm < 9.9 * bare.limbs_mm, "{name}: the parts bring nothing");
        assert!(locked.limbs_mm < 55.0, "{name}: {:.0} mm", locked.limbs_mm);
        assert!(locked.lean_degrees[0].abs() < 5.0, "{name}: it leans by {:.1} degrees", locked.lean_degrees[0]);
        assert!(locked.slide[0] < 0.25, "{name}: feet slide at {:.2} m/s", locked.slide[0]);
        assert!(
            locked.jitter[0] < 1.8 * locked.jitter[1],
            "{name}: it jitters by {:.1} mm a frame squared",
            locked.jitter[0]
        );
    }
}
