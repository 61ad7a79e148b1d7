//! Faces that a network saw on renders whose expression is known, and faces made here.

#![allow(clippy::cast_possible_truncation, reason = "small random numbers")]

use super::*;
use crate::landmarks::FACE_LANDMARKS;
use glam::{DMat3, Vec2, Vec3};
use spmm3::{EXPRESSION, ExpressionPreset, Expressions};
use std::collections::BTreeMap;

/// Landmarks of one face; those that nothing reads are zero.
type Points = Box<[Vec3; FACE_LANDMARKS]>;

/// The recorded faces by name, see the file's head.
fn seen() -> BTreeMap<&'static str, Points> {
    let mut ids: Vec<usize> = Vec::new();
    let mut faces = BTreeMap::new();
    for line in include_str!("seen.txt").lines() {
        let mut words = line.split(' ');
        let name = words.next().expect("a name");
        if name == "landmarks" {
            ids = words.map(|w| w.parse().expect("a landmark")).collect();
        } else if name != "#" {
            let values: Vec<f32> = words
                .map(|w| w.parse::<f32>().expect("a length") / 10.0)
                .collect();
            let mut points = Box::new([Vec3::ZERO; FACE_LANDMARKS]);
            for (id, at) in ids.iter().zip(values.chunks_exact(3)) {
                points[*id] = Vec3::from_slice(at);
            }
            faces.insert(name, points);
        }
    }
    faces
}

fn landmarks(points: &Points) -> FaceLandmarks {
    FaceLandmarks {
        points: points.clone(),
        confidence: 1.0,
    }
}

/// A fit that has watched the neutral face for two seconds.
fn acquainted(faces: &BTreeMap<&str, Points>) -> FaceFit {
    let mut fit = FaceFit::new();
    for k in 0..60 {
        fit.measure(&landmarks(&faces["neutral"]), f64::from(k) / 30.0, None)
            .expect("a face");
    }
    fit
}

fn measure(name: &str) -> FaceMeasures {
    let faces = seen();
    acquainted(&faces)
        .measure(&landmarks(&faces[name]), 2.0, None)
        .expect("a face")
}

/// Each preset has a slot of its own, so that coefficients are weights.
const SLOTS: [(&str, f32); 11] = [
    ("a", 0.192),
    ("e", 0.070),
    ("i", 0.035),
    ("o", 0.122),
    ("u", 0.035),
    ("mbp", 0.0),
    ("fv", 0.035),
    ("smile", 0.0),
    ("blink", 0.0),
    ("brows_up", 0.0),
    ("brows_down", 0.0),
];

fn presets() -> Expressions {
    SLOTS
        .iter()
        .enumerate()
        .map(|(slot, (name, jaw))| {
            let mut coefficients = [0.0; EXPRESSION];
            coefficients[slot] = 1.0;
            (
                (*name).to_owned(),
                ExpressionPreset {
                    coefficients,
                    jaw: *jaw,
                },
            )
        })
        .collect()
}

fn weight(pose: &FacePose, name: &str) -> f32 {
    let slot = SLOTS.iter().position(|(n, _)| *n == name).expect("known");
    pose.expression[slot]
}

/// Head turned as on the renders, seen by a camera in front: x right, y down, z away.
fn camera_from(head: DMat3) -> DMat3 {
    DMat3::from_diagonal(DVec3::new(1.0, -1.0, -1.0)) * head
}

fn degrees_between(a: DMat3, b: DQuat) -> f64 {
    let relative = a.transpose() * DMat3::from_quat(b);
    let trace = relative.x_axis.x + relative.y_axis.y + relative.z_axis.z;
    ((trace - 1.0) / 2.0).clamp(-1.0, 1.0).acos().to_degrees()
}

#[test]
fn rendered_heads_are_turned_as_they_were_posed() {
    let faces = seen();
    let (mut sum, mut most, mut count) = (0.0f64, 0.0f64, 0.0);
    for name in faces.keys() {
        let mut head = DMat3::IDENTITY;
        if let Some((axis, degrees)) = name.split_once('_') {
            let angle = degrees.parse::<f64>().map_or(0.0, f64::to_radians);
            head = match axis {
                "yaw" => DMat3::from_rotation_y(angle),
                "pitch" => DMat3::from_rotation_x(angle),
                "roll" => DMat3::from_rotation_z(angle),
                _ => continue,
            };
        }
        let found = measure(name).camera_from_head;
        let error = degrees_between(camera_from(head), found);
        assert!(error < 6.0, "{name}: off by {error:.1} degrees");
        (sum, most, count) = (sum + error, most.max(error), count + 1.0);
    }
    println!(
        "heads on renders: {:.1} degrees off on average, {most:.1} at most",
        sum / count
    );
}

#[test]
fn each_rendered_expression_is_shown_again_mostly_by_its_own_preset() {
    let presets = presets();
    for name in [
        "a",
        "e",
        "i",
        "o",
        "u",
        "smile",
        "blink",
        "brows_up",
        "brows_down",
        "neutral",
        "smile_open",
        "o_yaw",
        "blink_yaw",
        "jaw_6",
        "jaw_12",
        "jaw_20",
    ] {
        let pose = apply(&measure(name), &presets);
        let line: Vec<_> = SLOTS
            .iter()
            .map(|(n, _)| format!("{n} {:.2}", weight(&pose, n)))
            .collect();
        println!(
            "{name:10} jaw {:4.1} {}",
            pose.jaw.to_degrees(),
            line.join(" ")
        );
    }
    for name in ["a", "u", "smile", "blink"] {
        let pose = apply(&measure(name), &presets);
        let own = weight(&pose, name);
        assert!(own > 0.5, "{name}: its own preset has {own}");
        for (other, _) in SLOTS.iter().filter(|(n, _)| *n != name) {
            let weight = weight(&pose, other);
            assert!(weight < own, "{name}: {other} has {weight}, itself {own}");
        }
    }
    // These pairs differ by a little jaw and strength only.
    for (name, pair) in [("e", ["e", "i"]), ("i", ["e", "i"]), ("o", ["o", "u"])] {
        let pose = apply(&measure(name), &presets);
        let both: f32 = pair.map(|n| weight(&pose, n)).into_iter().sum();
        assert!(both > 0.5, "{name}: {pair:?} have {both} together");
    }
    let rest = apply(&measure("neutral"), &presets);
    assert!(rest.expression.iter().all(|w| w.abs() < 0.1), "{rest:?}");
    assert!(rest.jaw < 0.02, "shut: {}", rest.jaw);
}

#[test]
fn the_jaw_follows_the_opening_and_the_eyes_the_irises() {
    let presets = presets();
    let jaw = |name: &str| apply(&measure(name), &presets).jaw.to_degrees();
    let angles = ["neutral", "jaw_6", "jaw_12", "jaw_20"].map(jaw);
    assert!(angles.is_sorted(), "{angles:?}");
    assert!((12.0..24.0).contains(&angles[3]), "20 degrees: {angles:?}");
    let yaw = |name: &str| measure(name).gaze.x.to_degrees();
    let yaws = ["gyaw_-30", "gyaw_-15", "neutral", "gyaw_15", "gyaw_30"].map(yaw);
    assert!(yaws.is_sorted(), "{yaws:?}");
    assert!(yaws[0] < -15.0 && yaws[4] > 15.0, "{yaws:?}");
    let left = apply(&measure("gyaw_30"), &presets).eyes[0] * DVec3::Z;
    assert!(left.x > 0.25, "to the person's left: {left}");
    for name in ["yaw_-25", "yaw_25"] {
        assert!(
            yaw(name).abs() < 15.0,
            "{name}: the eyes go with the head, {}",
            yaw(name)
        );
    }
}

#[test]
fn a_blink_is_complete_in_the_picture_that_shows_it_and_over_in_the_next() {
    let faces = seen();
    let mut fit = acquainted(&faces);
    let before = fit
        .measure(&landmarks(&faces["neutral"]), 2.0, None)
        .expect("a face");
    let shut = fit
        .measure(&landmarks(&faces["blink"]), 2.033, None)
        .expect("a face");
    let after = fit
        .measure(&landmarks(&faces["neutral"]), 2.066, None)
        .expect("a face");
    assert_eq!(before.blink, [0.0; 2], "open");
    assert_eq!(shut.blink, [1.0; 2], "shut");
    assert_eq!(after.blink, [0.0; 2], "open again");
    assert_eq!(shut.gaze, before.gaze, "hidden irises do not turn the eyes");
}

/// A face of other proportions than the reference: everything about it is stretched and its mouth, lids and brows are set.
struct Made {
    stretch: DVec3,
    open: f64,
    spread: f64,
    lid: f64,
}

impl Made {
    /// As seen by a distant camera that sees the head turned by `camera_from_head`, `scale` pixels a unit.
    fn seen(&self, base: &Points, camera_from_head: DMat3, scale: f64, at: DVec3) -> Points {
        let unit = f64::from(base[33].distance(base[263]));
        let middle = (base[33] + base[263]).as_dvec3() * 0.5;
        let mut points = base.clone();
        for (k, point) in points.iter_mut().enumerate() {
            // The network's face in the head's axes.
            let mut p = (point.as_dvec3() - middle) / unit * DVec3::new(1.0, -1.0, -1.0);
            match k {
                13 | 82 | 312 => p.y += 0.5 * self.open,
                14 | 87 | 317 => p.y -= 0.5 * self.open,
                61 => p.x -= 0.5 * self.spread,
                291 => p.x += 0.5 * self.spread,
                386 | 385 | 387 | 159 | 158 | 160 => p.y -= self.lid,
                _ => {}
            }
            *point = (camera_from_head * (p * self.stretch) * scale + at).as_vec3();
        }
        points
    }
}

const PLAIN: Made = Made {
    stretch: DVec3::ONE,
    open: 0.0,
    spread: 0.0,
    lid: 0.0,
};

#[test]
fn a_made_face_is_found_within_a_degree_wherever_and_however_large_it_is() {
    let faces = seen();
    let base = &faces["neutral"];
    let mut seed = 1.0f64;
    let mut random = |low: f64, high: f64| {
        seed = (seed * 9301.0 + 49297.0) % 233_280.0;
        low + (high - low) * seed / 233_280.0
    };
    let mut fit = FaceFit::new();
    // The network's neutral face is itself not exactly straight; what is known is the turn from it.
    let place = DVec3::new(300.0, 200.0, 0.0);
    let straight = PLAIN.seen(base, camera_from(DMat3::IDENTITY), 100.0, place);
    let zero = fit
        .measure(&landmarks(&straight), 0.0, None)
        .expect("a face");
    let zero =
        DMat3::from_diagonal(DVec3::new(1.0, -1.0, -1.0)) * DMat3::from_quat(zero.camera_from_head);
    for trial in 0..200 {
        let axis = DVec3::new(random(-1.0, 1.0), random(-1.0, 1.0), random(-1.0, 1.0));
        let head = DMat3::from_axis_angle(axis.normalize(), random(-0.9, 0.9));
        let scale = random(15.0, 400.0);
        let at = DVec3::new(
            random(0.0, 2000.0),
            random(0.0, 1000.0),
            random(-50.0, 50.0),
        );
        let made = Made {
            stretch: DVec3::ONE,
            open: random(0.0, 0.3),
            spread: random(-0.1, 0.1),
            lid: random(0.0, 0.07),
        };
        let points = made.seen(base, camera_from(head), scale, at);
        let found = fit
            .measure(&landmarks(&points), 0.1 * f64::from(trial), None)
            .expect("a face");
        let error = degrees_between(camera_from(head * zero), found.camera_from_head);
        assert!(error < 1.0, "{trial}: off by {error:.2} degrees");
    }
}

#[test]
fn measures_rise_with_what_a_face_does_whatever_its_proportions() {
    let faces = seen();
    let base = &faces["neutral"];
    for stretch in [
        DVec3::new(1.06, 0.95, 1.1),
        DVec3::new(0.95, 1.06, 0.9),
        DVec3::ONE,
    ] {
        let mut fit = FaceFit::new();
        let turn = camera_from(DMat3::from_rotation_y(0.2));
        let mut look = |made: Made, seconds: f64| {
            let points = made.seen(base, turn, 80.0, DVec3::new(200.0, 100.0, 0.0));
            fit.measure(&landmarks(&points), seconds, None)
                .expect("a face")
        };
        for k in 0..90 {
            look(Made { stretch, ..PLAIN }, f64::from(k) / 30.0);
        }
        let steps = [0.0, 0.25, 0.5, 0.75, 1.0];
        let opened = steps.map(|s| {
            look(
                Made {
                    stretch,
                    open: 0.25 * s,
                    ..PLAIN
                },
                3.0,
            )
            .mouth_open
        });
        let spread = steps.map(|s| {
            look(
                Made {
                    stretch,
                    spread: 0.2 * s - 0.1,
                    ..PLAIN
                },
                3.0,
            )
            .mouth_width
        });
        let shut = steps.map(|s| {
            look(
                Made {
                    stretch,
                    lid: 0.09 * s,
                    ..PLAIN
                },
                3.0,
            )
            .blink[0]
        });
        for rising in [opened, spread, shut] {
            assert!(rising.is_sorted(), "{rising:?}");
        }
        assert!(
            opened[0] < 0.05 && (0.65..1.0).contains(&opened[4]),
            "{opened:?}"
        );
        assert!(spread[0] < -0.7 && spread[4] > 0.7, "{spread:?}");
        assert!(shut[0] == 0.0 && shut[4] == 1.0, "{shut:?}");
    }
}

#[test]
fn a_person_with_another_face_at_rest_becomes_neutral_within_two_seconds() {
    let faces = seen();
    let base = &faces["neutral"];
    let mut fit = FaceFit::new();
    // Full, slightly parted lips, a narrow mouth and narrow eyes.
    let odd = Made {
        stretch: DVec3::ONE,
        open: 0.04,
        spread: -0.08,
        lid: 0.03,
    };
    let points = odd.seen(base, camera_from(DMat3::IDENTITY), 80.0, DVec3::ZERO);
    let mut last = None;
    for k in 0..60 {
        last = fit.measure(&landmarks(&points), f64::from(k) / 30.0, None);
    }
    let last = last.expect("a face");
    assert!(last.mouth_open < 0.05, "{}", last.mouth_open);
    assert!(last.mouth_width.abs() < 0.15, "{}", last.mouth_width);
    assert_eq!(last.blink, [0.0; 2], "these eyes are open");
    let pose = apply(&last, &presets());
    assert!(
        pose.expression.iter().all(|w| w.abs() < 0.2),
        "{:?}",
        pose.expression
    );
}

#[test]
fn a_head_at_the_pictures_edge_is_turned_by_the_line_of_sight() {
    let faces = seen();
    let camera = Camera {
        size: Vec2::new(1280.0, 720.0),
        focal: 900.0,
        centre: Vec2::new(640.0, 360.0),
    };
    let mut fit = FaceFit::new();
    let at = DVec3::new(640.0 + 450.0, 360.0, 0.0);
    let points = PLAIN.seen(&faces["neutral"], camera_from(DMat3::IDENTITY), 60.0, at);
    let plain = fit.measure(&landmarks(&points), 0.0, None).expect("a face");
    let right = fit
        .measure(&landmarks(&points), 0.0, Some(&camera))
        .expect("a face");
    let turn = DMat3::from_rotation_y(0.5f64.atan());
    let expected = turn * DMat3::from_quat(plain.camera_from_head);
    // The face's own middle is a little aside of the eyes' middle, where it was put.
    let error = degrees_between(expected, right.camera_from_head);
    assert!(error < 3.0, "off by {error:.1} degrees");
}

#[test]
fn presets_that_an_avatar_lacks_are_left_out() {
    let face = measure("smile_open");
    let none = apply(&face, &Expressions::new());
    assert!(none.expression.iter().all(|w| *w == 0.0), "no coefficients");
    assert!(none.jaw > 0.05, "but a jaw: {}", none.jaw);
    let mut some = presets();
    some.remove("smile");
    let pose = apply(&face, &some);
    assert_eq!(weight(&pose, "smile"), 0.0, "none");
}

#[test]
fn ten_thousand_broken_faces_give_nothing_or_finite_measures() {
    let faces = seen();
    let mut state = 77u64;
    let mut unit = || {
        state = state
            .wrapping_mul(6364136223846793005)
            .wrapping_add(1442695040888963407);
        (state >> 40) as f32 / (1u64 << 24) as f32
    };
    let odd = [
        f32::NAN,
        f32::INFINITY,
        f32::MAX,
        f32::MIN,
        0.0,
        1e-30,
        -1e9,
    ];
    let presets = presets();
    let mut fit = FaceFit::new();
    let mut read = 0;
    for trial in 0..10_000 {
        let mut points = faces["neutral"].clone();
        let broken = unit() * unit() * 0.2;
        let noise = unit() * unit() * 300.0;
        for point in points.iter_mut() {
            for axis in 0..3 {
                point[axis] += (unit() - 0.5) * noise;
                if unit() < broken {
                    point[axis] = odd[(unit() * 7.0) as usize];
                }
            }
        }
        let face = FaceLandmarks {
            points,
            confidence: if unit() < 0.1 { f32::NAN } else { 0.5 + unit() },
        };
        let seconds = [f64::NAN, -1.0, f64::from(trial) / 30.0, 1e300][trial as usize % 4];
        let camera = Camera {
            size: Vec2::ONE,
            focal: odd[trial as usize % 7],
            centre: Vec2::splat(odd[trial as usize % 5]),
        };
        let Some(found) = fit.measure(&face, seconds, Some(&camera)) else {
            continue;
        };
        read += 1;
        let numbers = [
            found.mouth_open,
            found.mouth_width,
            found.corners,
            found.lip_press,
        ];
        let all = numbers.into_iter().chain(found.brows).chain(found.blink);
        assert!(
            all.chain([found.gaze.x, found.gaze.y])
                .all(|v| v.abs() <= 1.5),
            "{found:?}"
        );
        assert!((0.0..=1.0).contains(&found.confidence), "{found:?}");
        assert!(
            (found.camera_from_head.length() - 1.0).abs() < 1e-6,
            "{found:?}"
        );
        let pose = apply(&found, &presets);
        assert!(pose.expression.iter().all(|v| v.abs() < 3.0), "{pose:?}");
        assert!((0.0..0.5).contains(&pose.jaw), "{pose:?}");
    }
    assert!(
        read > 1000,
        "{read} faces were read: the test proves little"
    );
}
