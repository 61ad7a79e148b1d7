//! The fit against recorded motion seen by a made-up network: what each part of it is worth.

#![allow(
    clippy::cast_possible_truncation,
    reason = "the landmarks and the avatar are f32, and counts of frames are small"
)]

mod common;
#[path = "common/synthetic.rs"]
mod synthetic;

use motion_fit::body::{BodyFit, FitConfig, FootLock, Parts};
use motion_fit::smoother::{Confidence, SmoothConfig, Smoother};
use spmm3::{Joint, MotionParams, Skeleton};
use synthetic::{Errors, Eye, Network, RATE, Score, motion, moves, performance, run, score};

fn print(name: &str, s: &Score) {
    println!(
        "{name:28} limbs {:4.0} mm, pelvis {:4.1} deg, lean {:+5.1} (rms {:4.1}) deg, slide {:.2} m/s (truth {:.2}), jitter {:4.1} (truth {:4.1}) mm/frame2, root {:4.0} mm, height {:+4.0} mm",
        s.limbs_mm,
        s.pelvis_degrees,
        s.lean_degrees[0],
        s.lean_degrees[1],
        s.slide[0],
        s.slide[1],
        s.jitter[0],
        s.jitter[1],
        s.root_mm,
        s.height_mm
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
        proportions: false,
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
            (
                "ground",
                Parts {
                    ground: true,
                    ..none
                },
                Errors::USUAL,
            ),
            (
                "upright",
                Parts {
                    upright: true,
                    ..none
                },
                Errors::USUAL,
            ),
            (
                "upright, ground",
                Parts {
                    upright: true,
                    ground: true,
                    ..none
                },
                Errors::USUAL,
            ),
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
        let [exact, bare, _, _, _, all, locked] = results[..] else {
            panic!("seven results");
        };
        assert!(
            exact.limbs_mm < 40.0,
            "{name}: the fit itself errs by {:.0} mm",
            exact.limbs_mm
        );
        // Limbs are as near without: bones and pixels place them. What the parts bring is how the body stands.
        assert!(
            all.limbs_mm < 1.05 * bare.limbs_mm
                && all.pelvis_degrees < 0.9 * bare.pelvis_degrees
                && all.slide[0] < 0.6 * bare.slide[0],
            "{name}: the parts bring nothing"
        );
        assert!(locked.limbs_mm < 75.0, "{name}: {:.0} mm", locked.limbs_mm);
        assert!(
            locked.lean_degrees[0].abs() < 5.0,
            "{name}: it leans by {:.1} degrees",
            locked.lean_degrees[0]
        );
        assert!(
            locked.slide[0] < 0.25,
            "{name}: feet slide at {:.2} m/s",
            locked.slide[0]
        );
        assert!(
            locked.jitter[0] < 1.8 * locked.jitter[1],
            "{name}: it jitters by {:.1} mm a frame squared",
            locked.jitter[0]
        );
    }
}

/// A person of other proportions than the avatar.
fn other_person() -> Skeleton {
    let mut rest = *common::skeleton().rest_positions();
    let own = rest;
    let longer = [
        (4, 1.1_f32),
        (5, 1.1),
        (7, 0.92),
        (8, 0.92),
        (18, 0.92),
        (19, 0.92),
        (20, 1.1),
        (21, 1.1),
        (3, 0.95),
        (6, 0.95),
        (9, 0.95),
        (12, 0.95),
        (13, 0.95),
        (14, 0.95),
    ];
    for joint in Joint::ALL.into_iter().skip(1) {
        let Some(parent) = joint.parent() else {
            continue;
        };
        let (i, p) = (joint.index(), parent.index());
        let ratio = longer
            .iter()
            .find(|(j, _)| *j == i)
            .map_or(1.0, |(_, r)| *r);
        rest[i] = rest[p] + (own[i] - own[p]) * ratio;
    }
    Skeleton::new(rest.map(|v| v * 1.08)).expect("finite")
}

#[test]
fn a_person_of_other_proportions_bends_the_avatar_alike() {
    let avatar = common::skeleton();
    let person = other_person();
    // A leg that swings towards the camera may be given the wrong one of two depths for half a second, so one walk seen once tells nothing.
    let mut all = [0.0; 2];
    for name in ["mocap/cmu_02_01_walk.bvh", "mocap/cmu_02_05_punch.bvh"] {
        let Some(truth) = performance(name, 0.3) else {
            return;
        };
        for ((seed, (label, proportions)), own) in (1..=3)
            .flat_map(|seed| {
                [("the avatar's bones", false), ("the person's bones", true)]
                    .map(|bones| (seed, bones))
            })
            .zip([0, 1].into_iter().cycle())
        {
            let mut network = Network::new(eye(), Errors::SMALL, seed);
            let parts = Parts {
                proportions,
                ..Parts::default()
            };
            let mut fit = BodyFit::new(
                &avatar,
                FitConfig {
                    parts,
                    ..FitConfig::new(network.eye.camera)
                },
            );
            let mut degrees = 0.0;
            let mut count = 0.0;
            let mut height = 0.0;
            for (i, frame) in truth.iter().enumerate() {
                let seen = network.look(&person, frame, 1.0 / RATE);
                let fitted = motion(&fit.fit(i as f64 / RATE, Some(&seen)));
                if i < 45 {
                    continue;
                }
                let (t, (f, at)) = (
                    common::forward(&avatar, frame).0,
                    common::forward(&avatar, &fitted),
                );
                // Where bones point: their twist is not seen.
                for (joint, child) in [
                    (1, 4),
                    (2, 5),
                    (4, 7),
                    (5, 8),
                    (16, 18),
                    (17, 19),
                    (18, 20),
                    (19, 21),
                ] {
                    let bone = common::sub(
                        avatar.rest_positions()[child].to_array().map(f64::from),
                        avatar.rest_positions()[joint].to_array().map(f64::from),
                    );
                    let [a, b] = [&t[joint], &f[joint]].map(|m| common::mul_v(m, bone));
                    let dot: f64 = (0..3).map(|k| a[k] * b[k]).sum();
                    degrees += (dot / common::norm(a) / common::norm(b))
                        .clamp(-1.0, 1.0)
                        .acos()
                        .to_degrees();
                    count += 1.0;
                }
                height += (at[7][1].min(at[8][1]) - 0.1119).abs();
            }
            println!(
                "{name}, {label}: bones {:.1} degrees off, lowest ankle {:.0} mm from standing",
                degrees / count,
                height / (truth.len() - 45) as f64 * 1e3
            );
            all[own] += degrees / count;
        }
    }
    assert!(
        all[1] < 0.95 * all[0],
        "the person's bones are no better: {all:?}"
    );
}
