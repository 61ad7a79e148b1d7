//! People who come while a session is shown, and oneself on demand.

use crate::people::seen;
use crate::stage::{BLACK, avatar, config, expected, needs, pose, psnr};
use app_pipeline::control::Control;
use app_pipeline::timeline::LatencyMode;
use app_session::display::{
    DrawnPicture, LiveSession, OffscreenDisplay, PictureObserver, SessionError, Standpoint,
};
use app_session::own_motion::OwnMotion;
use app_session::participant::{Origin, Participant};
use app_session::session::Session;
use glam::Affine3A;
use renderer_splat::camera::Camera;
use std::sync::mpsc::{Sender, channel};
use std::time::{Duration, Instant};
use test_support::{onnx, vulkan};

/// How far the arms of each are swung: oneself, and two others.
const SWINGS: [f32; 3] = [0.1, 0.4, -0.6];

fn person(swing: f32) -> Participant {
    Participant {
        avatar: avatar(),
        sits: false,
        origin: Origin::Clip {
            frames: vec![pose(swing)],
            rate_hz: 30.0,
        },
    }
}

/// What is seen: how many people, their places, from where, and the picture.
type Seen = (usize, Vec<Affine3A>, Standpoint, Vec<u8>);

/// Lets people come one after the other, looks at themselves, then away.
struct Visit {
    door: Sender<Participant>,
    own: OwnMotion,
    /// The steps that were begun.
    step: usize,
    stands: Option<Standpoint>,
    /// The last picture of each step.
    seen: Vec<Seen>,
    begun: Instant,
}

impl PictureObserver for Visit {
    fn is_over(&mut self, _: &LiveSession<'_>, _: Option<Instant>) -> Result<bool, SessionError> {
        self.own.show(Instant::now(), &pose(SWINGS[0]));
        if self.step == 0 {
            self.door.send(person(SWINGS[1])).expect("it is taken in");
            self.step = 1;
        }
        assert!(
            self.begun.elapsed() < Duration::from_secs(120),
            "step {} does not come to an end",
            self.step
        );
        Ok(self.step == 5)
    }

    fn cameras(&mut self, people: &Standpoint) -> Vec<Camera> {
        self.stands = Some(*people);
        vec![seen(people)]
    }

    fn drawn(&mut self, picture: DrawnPicture<'_>) -> Result<(), SessionError> {
        let there = picture.people.len();
        let wanted = match self.step {
            1 => 1,
            2 | 4 => 2,
            _ => 3,
        };
        if there != wanted {
            return Ok(());
        }
        let pixels = picture
            .renderer
            .read_back(0)
            .expect("a picture")
            .over(BLACK);
        let places = picture.people.iter().map(|(.., place)| *place).collect();
        let stands = self.stands.expect("it was asked before");
        self.seen.push((there, places, stands, pixels));
        match self.step {
            1 => self.door.send(person(SWINGS[2])).expect("it is taken in"),
            2 => assert!(self.own.toggle(), "one looks at oneself"),
            3 => assert!(!self.own.toggle(), "and away"),
            _ => {}
        }
        self.step += 1;
        Ok(())
    }
}

#[test]
fn people_come_while_others_are_shown_and_oneself_on_demand() {
    let (Some(gpu), Some(runtime)) = (vulkan::gpu(), onnx::runtime()) else {
        return;
    };
    let (door, newcomers) = channel();
    let own = OwnMotion::default();
    let oneself = Participant {
        origin: Origin::Own(own.clone()),
        ..person(0.0)
    };
    let mut visit = Visit {
        door,
        own,
        step: 0,
        stands: None,
        seen: Vec::new(),
        begun: Instant::now(),
    };
    let mut display = OffscreenDisplay::new(needs(&gpu), None, &mut visit);
    let config = config(&runtime, LatencyMode::Interpolate);
    let report = Session::new(config, vec![oneself], Control::default())
        .with_newcomers(newcomers)
        .run(&mut display)
        .expect("a session");
    assert!(display.first_picture().is_some(), "there were people");
    assert_eq!(report.people.len(), 3, "oneself and both others");
    let there = [&SWINGS[1..2], &SWINGS[1..], &SWINGS, &SWINGS[1..]];
    assert_eq!(visit.seen.len(), there.len());
    for ((count, places, stands, picture), swings) in visit.seen.iter().zip(there) {
        let people: Vec<_> = swings
            .iter()
            .map(|swing| pose(*swing))
            .zip(places.clone())
            .collect();
        let expected = expected((&gpu, &runtime), &people, seen(stands));
        let likeness = psnr(picture, &expected);
        assert!(likeness > 38.0, "{count} people: {likeness:.1} dB");
        let width = 0.9 * (swings.len() - 1) as f32;
        assert!((stands.width - width).abs() < 0.01, "{stands:?}");
    }
}

#[test]
fn who_has_come_too_late_to_be_shown_is_let_go() {
    let (Some(gpu), Some(runtime)) = (vulkan::gpu(), onnx::runtime()) else {
        return;
    };
    /// Leaves at once.
    struct Leaves(Sender<Participant>);
    impl PictureObserver for Leaves {
        fn is_over(
            &mut self,
            _: &LiveSession<'_>,
            _: Option<Instant>,
        ) -> Result<bool, SessionError> {
            for swing in SWINGS {
                self.0.send(person(swing)).expect("it is taken in");
            }
            Ok(true)
        }

        fn cameras(&mut self, people: &Standpoint) -> Vec<Camera> {
            vec![seen(people)]
        }

        fn drawn(&mut self, _: DrawnPicture<'_>) -> Result<(), SessionError> {
            Ok(())
        }
    }
    let (door, newcomers) = channel();
    let mut leaves = Leaves(door);
    let mut display = OffscreenDisplay::new(needs(&gpu), None, &mut leaves);
    let config = config(&runtime, LatencyMode::Interpolate);
    let oneself = Participant {
        origin: Origin::Own(OwnMotion::default()),
        ..person(0.0)
    };
    let report = Session::new(config, vec![oneself], Control::default())
        .with_newcomers(newcomers)
        .run(&mut display)
        .expect("a session");
    assert_eq!(report.people.len(), 1, "oneself");
}
