//! Which pixels are the person.

use super::still::{Still, tracker};
use motion_fit::landmarks::{BODY_LANDMARKS, BodyLandmarks, BodyPoint};
use npu_runtime::{Provider, Runtime};
use tracker::mediapipe::{Mask, Options, PersonMask};
use tracker::networks::NetworkSet;
use tracker::picture::PictureView;

/// The network, and the landmarks of the person in the tests' picture; nothing where this machine lacks what they need.
fn network_and_body() -> Option<(PersonMask, BodyLandmarks)> {
    let mut tracker = tracker(Options::default())?;
    let seen = tracker.observe(&Still::person().at(0.0)).unwrap();
    let folder = NetworkSet::folder_of_environment().unwrap();
    let set = NetworkSet::open(&folder, &PersonMask::NAMES, &Runtime::open(None).unwrap()).unwrap();
    let network = PersonMask::open(&set, Provider::Cpu { threads: 1 }).unwrap();
    Some((network, seen.into_observation().body_landmarks()?.clone()))
}

fn of(network: &mut PersonMask, still: &Still, body: &BodyLandmarks) -> Option<Mask> {
    let picture = PictureView::new(still.width, still.height, &still.rgb).unwrap();
    network.run(picture, body).unwrap()
}

#[test]
fn the_mask_is_the_person_and_not_what_is_around() {
    let Some((mut network, body)) = network_and_body() else {
        return;
    };
    let still = Still::person();
    let mask = of(&mut network, &still, &body).expect("a person");
    assert_eq!(mask.probabilities.len(), still.width * still.height);
    // Nose, shoulders and elbows are on the person; the upper corners of the picture are not.
    for landmark in [0, 11, 12, 13, 14] {
        let at = body.points[landmark].pixel.as_usizevec2();
        let here = mask.probabilities[at.y * still.width + at.x];
        assert!(here > 0.9, "{here} at landmark {landmark}");
    }
    for x in [4, still.width - 5] {
        let here = mask.probabilities[4 * still.width + x];
        assert!(here < 0.1, "{here} in a corner");
    }
}

#[test]
fn there_is_no_mask_where_there_is_no_person_or_no_body_to_look_at() {
    let Some((mut network, body)) = network_and_body() else {
        return;
    };
    let person = Still::person();
    let black = Still::black(person.width, person.height);
    assert_eq!(of(&mut network, &black, &body), None, "darkness");
    for pixel in [0.0, f32::NAN, f32::INFINITY] {
        let mut nowhere = BodyLandmarks {
            points: [BodyPoint::default(); BODY_LANDMARKS],
        };
        for point in &mut nowhere.points {
            (point.pixel, point.confidence) = (glam::Vec2::splat(pixel), 1.0);
        }
        assert_eq!(of(&mut network, &person, &nowhere), None, "at {pixel}");
    }
}
