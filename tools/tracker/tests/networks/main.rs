//! MediaPipe's networks on a picture of a person: against MediaPipe itself, and where there is nothing to see.
//!
//! `person/waist-up.webp` is a render of this project's own avatar (a part of `docs/stills.webp`); `person/mediapipe.txt` is what the
//! Python package mediapipe 0.10.21 gives for it (`solutions.holistic`, `model_complexity=1`, `smooth_landmarks=False`,
//! `refine_face_landmarks=True`, the tenth time): part, number, x and y in pixels, every eighth landmark of the face. `person/mediapipe-heavy.txt`
//! is the body of the same with `model_complexity=2`.

mod mask;
mod still;

use glam::Vec2;
use motion_fit::landmarks::Observation;
use npu_runtime::Runtime;
use std::path::Path;
use still::{Still, tracker};
use tracker::Tracker;
use tracker::mediapipe::{BodyBy, HandsBy, Options};
use tracker::workers::Seen;

/// What is seen after `still` was shown for ten pictures, 30 a second.
fn watched(tracker: &mut Tracker, still: &Still) -> Seen {
    let mut seen = None;
    for number in 0..10 {
        let picture = still.at(f64::from(number) / 30.0);
        seen = Some(tracker.observe(&picture).unwrap());
    }
    seen.unwrap()
}

/// A landmark of a reference: part, number, pixels.
type Landmark = (&'static str, usize, Vec2);

/// The landmarks that the reference has.
fn reference() -> Vec<Landmark> {
    landmarks(include_str!("../person/mediapipe.txt"))
}

/// The body's by the larger network.
fn heavy_reference() -> Vec<Landmark> {
    landmarks(include_str!("../person/mediapipe-heavy.txt"))
}

fn landmarks(text: &'static str) -> Vec<Landmark> {
    text.lines()
        .map(|line| {
            let words: Vec<_> = line.split(' ').collect();
            let number = |i: usize| words[i].parse::<f32>().unwrap();
            (
                words[0],
                words[1].parse().unwrap(),
                Vec2::new(number(2), number(3)),
            )
        })
        .collect()
}

/// The same of what was seen.
fn pixel(seen: &Observation, part: &str, number: usize) -> Option<Vec2> {
    match part {
        "body" => seen.body_landmarks().map(|body| body.points[number].pixel),
        "left" => seen.hand_landmarks()[0].map(|hand| hand.pixels[number]),
        "right" => seen.hand_landmarks()[1].map(|hand| hand.pixels[number]),
        _ => seen
            .face_landmarks()
            .map(|face| face.points[number].truncate()),
    }
}

/// Compares the landmarks of `part` with `expected`: their mean and their worst distance, in percent of the part's size, are below `limits`.
fn agrees(seen: &Observation, part: &str, expected: &[Landmark], limits: Vec2) {
    let all: Vec<_> = expected.iter().filter(|(of, ..)| *of == part).collect();
    let low = all
        .iter()
        .fold(Vec2::INFINITY, |low, (_, _, p)| low.min(*p));
    let high = all
        .iter()
        .fold(Vec2::NEG_INFINITY, |high, (_, _, p)| high.max(*p));
    let size = (high - low).max_element();
    let errors: Vec<f32> = all
        .iter()
        .map(|(_, number, expected)| {
            let got = pixel(seen, part, *number).unwrap_or_else(|| panic!("no {part}"));
            got.distance(*expected) / size * 100.0
        })
        .collect();
    let mean = errors.iter().sum::<f32>() / errors.len() as f32;
    let worst = errors.iter().copied().fold(0.0, f32::max);
    println!(
        "{part}: {} landmarks, mean {mean:.2} %, worst {worst:.2} % of {size:.0} pixels",
        errors.len()
    );
    assert!(
        mean < limits.x && worst < limits.y,
        "{part}: mean {mean} %, worst {worst} %"
    );
}

#[test]
fn the_larger_network_s_landmarks_are_mediapipe_s_and_both_networks_meet_between() {
    let full = reference();
    let heavy = heavy_reference();
    let between: Vec<Landmark> = (heavy.iter().zip(&full))
        .map(|((part, number, heavy), (.., full))| (*part, *number, heavy.midpoint(*full)))
        .collect();
    for (body, expected) in [(BodyBy::Heavy, &heavy), (BodyBy::Both, &between)] {
        let Some(mut tracker) = tracker(Options {
            body,
            hands: HandsBy::None,
            ..Options::default()
        }) else {
            return;
        };
        let seen = watched(&mut tracker, &Still::person()).into_observation();
        println!("{}:", body.name());
        agrees(&seen, "body", expected, Vec2::new(0.5, 1.0));
    }
}

#[test]
fn landmarks_are_those_of_mediapipe() {
    let Some(mut tracker) = tracker(Options {
        // As MediaPipe does.
        search_every: 1,
        ..Options::default()
    }) else {
        return;
    };
    let seen = watched(&mut tracker, &Still::person());
    assert_eq!(seen.people, Some(1), "one person");
    let seen = seen.into_observation();
    // MediaPipe lays half a pixel of the network's input elsewhere: up to 3 pixels of this picture for the body.
    for (part, mean_percent, worst_percent) in [
        ("body", 0.5, 1.0),
        ("left", 3.0, 6.0),
        ("right", 3.0, 6.0),
        ("face", 0.5, 1.0),
    ] {
        agrees(
            &seen,
            part,
            &reference(),
            Vec2::new(mean_percent, worst_percent),
        );
    }
    let body = seen.body_landmarks().unwrap();
    let metres = body.points[11].metres.distance(body.points[12].metres);
    assert!((0.2..0.5).contains(&metres), "shoulders {metres} m apart");
    assert!(
        body.points[11].metres.x > body.points[12].metres.x,
        "the left shoulder is right in the picture"
    );
}

#[test]
fn a_mirrored_picture_has_mirrored_landmarks() {
    let Some(mut tracker) = tracker(Options::default()) else {
        return;
    };
    let person = Still::person();
    let plain = watched(&mut tracker, &person).into_observation();
    let mirrored = watched(&mut tracker, &person.mirrored()).into_observation();
    let (plain, mirrored) = (
        plain.body_landmarks().unwrap(),
        mirrored.body_landmarks().unwrap(),
    );
    // The nose and pairs of joints; what a body's half pixel of the input would do is 8 pixels, twice that offset.
    let twin = |i: usize| if i == 0 { 0 } else { i + 2 * (i % 2) - 1 };
    let places = [0, 11, 12, 13, 14, 15, 16];
    let apart = places.map(|i| {
        let there = person.width as f32 - mirrored.points[twin(i)].pixel.x;
        plain.points[i].pixel.x - there
    });
    let mean = apart.iter().sum::<f32>() / apart.len() as f32;
    println!("apart: {apart:?}, mean {mean} pixels");
    assert!(mean.abs() < 4.0, "{apart:?}");
}

#[test]
fn every_way_to_look_at_hands_finds_both() {
    for hands in [HandsBy::Each, HandsBy::None, HandsBy::Alternating] {
        let Some(mut tracker) = tracker(Options {
            hands,
            ..Options::default()
        }) else {
            return;
        };
        let seen = watched(&mut tracker, &Still::person());
        let expected = match hands {
            HandsBy::None => [false, false],
            // The tenth picture is the right one's.
            HandsBy::Alternating => [false, true],
            _ => [true, true],
        };
        assert_eq!(seen.hands_looked_at, expected, "{hands:?}");
        assert_eq!(
            seen.hands.each_ref().map(Option::is_some),
            expected,
            "{hands:?}"
        );
        assert!(seen.face.is_some(), "{hands:?}");
    }
}

#[test]
fn of_two_people_the_nearer_one_is_tracked_and_both_are_counted() {
    let Some(mut tracker) = tracker(Options::default()) else {
        return;
    };
    let person = Still::person();
    // One at half size on the left, one as it is on the right.
    let two = person.rearranged(1000, 600, |x, y| {
        if x < 400 {
            Some((x.checked_sub(50)? * 2, y.checked_sub(300)? * 2))
        } else {
            Some((x - 400, y))
        }
    });
    let first = tracker.observe(&two.at(0.0)).unwrap();
    assert_eq!(first.people, Some(2), "two people");
    let seen = watched(&mut tracker, &two).into_observation();
    let nose = seen.body_landmarks().unwrap().points[0].pixel;
    let expected = reference()[0].2 + Vec2::new(400.0, 0.0);
    assert!(
        nose.distance(expected) < 10.0,
        "the nose is at {nose}, not {expected}"
    );
}

#[test]
fn where_there_is_nobody_nothing_is_seen_and_a_person_is_found_again() {
    let Some(mut tracker) = tracker(Options::default()) else {
        return;
    };
    let grey = Still {
        rgb: vec![128; 640 * 480 * 3],
        ..Still::black(640, 480)
    };
    let person = Still::person();
    for still in [
        Still::black(640, 480),
        Still::black(1, 1),
        Still::black(1, 700),
        Still::black(700, 1),
        Still::black(3, 3),
        person.clone(),
        grey,
    ] {
        let expected = still.width == person.width;
        let seen = watched(&mut tracker, &still).into_observation();
        let parts = [
            seen.body.is_some(),
            seen.hands[0].is_some(),
            seen.hands[1].is_some(),
            seen.face.is_some(),
        ];
        assert_eq!(parts, [expected; 4], "{} x {}", still.width, still.height);
    }
}

#[test]
fn a_person_who_jumps_aside_is_found_again() {
    let Some(mut tracker) = tracker(Options::default()) else {
        return;
    };
    let person = Still::person();
    let at =
        |left: usize| person.rearranged(1800, 600, move |x, y| Some((x.checked_sub(left)?, y)));
    for left in [0, 1200, 300] {
        let seen = watched(&mut tracker, &at(left)).into_observation();
        for (part, number, expected) in reference()
            .into_iter()
            .filter(|(_, number, _)| *number == 0)
        {
            let got = pixel(&seen, part, number).unwrap_or_else(|| panic!("no {part} at {left}"));
            let expected = expected + Vec2::new(left as f32, 0.0);
            // A hand's wrist is half hidden by the cuff: networks and regions differ by a third of the hand.
            assert!(
                got.distance(expected) < 40.0,
                "{part} at {left}: {got}, not {expected}"
            );
        }
    }
}

#[test]
fn missing_and_damaged_networks_are_named() {
    let Ok(runtime) = Runtime::open(None) else {
        assert!(
            std::env::var("CI").as_deref() != Ok("true"),
            "no ONNX Runtime"
        );
        println!("skipped: no ONNX Runtime");
        return;
    };
    let folder = std::env::temp_dir().join(format!("tracker-networks-{}", std::process::id()));
    std::fs::create_dir_all(&folder).unwrap();
    let load = |folder: &Path| {
        Options::default()
            .load(folder, &runtime)
            .unwrap_err()
            .to_string()
    };
    let error = load(&folder);
    assert!(
        error.contains("pose_detection.tflite") && error.contains("./run setup"),
        "{error}"
    );
    for name in Options::default().names() {
        std::fs::write(folder.join(format!("{name}.tflite")), b"no network").unwrap();
    }
    let error = load(&folder);
    assert!(
        error.contains("pose_detection.tflite") && error.contains("./run setup"),
        "{error}"
    );
    std::fs::remove_dir_all(&folder).unwrap();
}
