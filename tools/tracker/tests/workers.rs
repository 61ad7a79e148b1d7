//! The threads of the tracker, with models that are scripts.

use glam::Vec2;
use motion_fit::landmarks::{BodyLandmarks, BodyPoint, HandLandmarks};
use std::sync::{Arc, Mutex};
use tracker::models::{
    BodyEstimate, BodyModel, FaceEstimate, FaceHint, FaceModel, HandEstimate, HandHint, HandModel,
    HandModels, Models, Side,
};
use tracker::picture::PictureView;
use tracker::source::Picture;
use tracker::{Tracker, TrackerError};

fn picture(number: u32) -> Arc<Picture> {
    Arc::new(Picture {
        width: 2,
        height: 1,
        rgb: vec![128; 6],
        seconds: f64::from(number) / 30.0,
        ..Picture::empty()
    })
}

type Log = Arc<Mutex<Vec<String>>>;

fn note(log: &Log, text: String) {
    log.lock().unwrap().push(text);
}

/// A body whose landmarks are all at x, or none, or an error, by turns.
struct Body(Vec<Option<f32>>);

impl BodyModel for Body {
    fn run(&mut self, _: PictureView<'_>, _: f64) -> Result<Option<BodyEstimate>, TrackerError> {
        let point = |x| BodyPoint {
            pixel: Vec2::new(x, 1.0),
            confidence: 1.0,
            ..BodyPoint::default()
        };
        Ok(self.0.remove(0).map(|x| {
            BodyEstimate::Landmarks(BodyLandmarks {
                points: [point(x); 33],
            })
        }))
    }

    fn people(&self) -> Option<usize> {
        Some(2)
    }
}

struct Hand(Log);

fn hand(x: f32) -> HandEstimate {
    HandEstimate::Landmarks(HandLandmarks {
        pixels: [Vec2::new(x, 0.0); 21],
        metres: [glam::Vec3::ZERO; 21],
        confidence: 1.0,
    })
}

impl HandModel for Hand {
    fn follow(
        &mut self,
        _: PictureView<'_>,
        side: Side,
    ) -> Result<Option<HandEstimate>, TrackerError> {
        note(&self.0, format!("follow {side:?}"));
        Ok(Some(hand(7.0)))
    }

    fn find(
        &mut self,
        _: PictureView<'_>,
        side: Side,
        hint: &HandHint,
        followed: Option<HandEstimate>,
    ) -> Result<Option<HandEstimate>, TrackerError> {
        assert!(followed.is_some(), "what was followed comes back");
        note(&self.0, format!("find {side:?} at {}", hint.wrist.x));
        if hint.wrist.x.is_nan() {
            return Err(TrackerError::NoFolder);
        }
        assert!(hint.wrist.x < 100.0, "a fault of the model");
        Ok(followed)
    }

    fn forget(&mut self, side: Side) {
        note(&self.0, format!("forget {side:?}"));
    }
}

struct Face(Log);

impl FaceModel for Face {
    fn follow(&mut self, _: PictureView<'_>) -> Result<Option<FaceEstimate>, TrackerError> {
        Ok(None)
    }

    fn find(
        &mut self,
        _: PictureView<'_>,
        hint: Option<&FaceHint>,
        _: Option<FaceEstimate>,
    ) -> Result<Option<FaceEstimate>, TrackerError> {
        note(&self.0, format!("face {:?}", hint.map(|h| h.points[0].x)));
        Ok(None)
    }
}

fn tracker(
    bodies: &[Option<f32>],
    hands: impl Fn(Box<dyn HandModel>, Box<dyn HandModel>) -> HandModels,
) -> (Tracker, Log) {
    let log = Log::default();
    let hand = || Box::new(Hand(Arc::clone(&log)));
    let models = Models {
        body: Box::new(Body(bodies.to_vec())),
        hands: hands(hand(), hand()),
        face: Some(Box::new(Face(Arc::clone(&log)))),
    };
    (Tracker::new(models).unwrap(), log)
}

fn taken(log: &Log) -> Vec<String> {
    let mut lines = std::mem::take(&mut *log.lock().unwrap());
    lines.sort();
    lines
}

#[test]
fn hands_and_face_hear_where_the_body_is_in_the_same_picture() {
    let (mut tracker, log) = tracker(&[Some(5.0), None], |a, b| HandModels::Each([a, b]));
    let seen = tracker.observe(&picture(3)).unwrap();
    assert_eq!(
        taken(&log),
        [
            "face Some(5.0)",
            "find Left at 5",
            "find Right at 5",
            "follow Left",
            "follow Right"
        ],
        "a body"
    );
    assert_eq!(seen.people, Some(2), "people");
    assert_eq!(seen.hands_looked_at, [true; 2], "both");
    let observation = seen.into_observation();
    assert!(
        (observation.seconds - 0.1).abs() < 1e-9,
        "the picture's time"
    );
    assert!(
        observation.body.is_some() && observation.hands.iter().all(Option::is_some),
        "{observation:?}"
    );

    let seen = tracker.observe(&picture(4)).unwrap();
    assert_eq!(
        taken(&log),
        [
            "face None",
            "follow Left",
            "follow Right",
            "forget Left",
            "forget Right"
        ],
        "no body"
    );
    assert_eq!(seen.hands, [None, None], "no hands without a body");
}

#[test]
fn alternating_hands_take_turns() {
    let (mut tracker, log) = tracker(&[Some(5.0); 2], |a, _| HandModels::Alternating(a));
    let seen = [0, 1].map(|n| tracker.observe(&picture(n)).unwrap());
    assert_eq!(seen[0].hands_looked_at, [true, false], "first the left one");
    assert_eq!(seen[1].hands_looked_at, [false, true], "then the right one");
    assert!(
        seen[0].hands[1].is_none() && seen[1].hands[1].is_some(),
        "one each"
    );
    assert_eq!(
        taken(&log)
            .iter()
            .filter(|l| l.starts_with("follow"))
            .count(),
        2,
        "two looks"
    );
}

#[test]
fn an_error_of_one_model_does_not_end_the_others() {
    let (mut tracker, _) = tracker(&[Some(f32::NAN), Some(5.0)], |a, b| {
        HandModels::Each([a, b])
    });
    assert!(
        matches!(tracker.observe(&picture(0)), Err(TrackerError::NoFolder)),
        "the model's own error"
    );
    let seen = tracker.observe(&picture(1)).unwrap();
    assert!(
        seen.hands.iter().all(Option::is_some),
        "the next picture is looked at"
    );
}

#[test]
fn a_model_that_panics_is_an_error_and_not_a_wait_without_end() {
    let (tell, told) = std::sync::mpsc::channel();
    let look = move || {
        // The body's goes on, so that its answers would fill the channel.
        let bodies = [&[Some(500.0)][..], &[Some(5.0); 20]].concat();
        let (mut tracker, log) = tracker(&bodies, |a, b| HandModels::Each([a, b]));
        for number in 0..10 {
            let error = tracker.observe(&picture(number)).unwrap_err();
            assert!(
                matches!(error, TrackerError::Stopped { unit: "hands" }),
                "{error}"
            );
        }
        drop(tracker);
        tell.send(taken(&log).len()).unwrap();
    };
    let thread = std::thread::spawn(look);
    let looks = told
        .recv_timeout(std::time::Duration::from_secs(20))
        .expect("every picture is answered, and the threads end");
    thread.join().unwrap();
    assert!(looks <= 5, "{looks} looks: more than at the first picture");
}
