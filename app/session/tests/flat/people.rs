//! People together on a flat display.

use crate::stage::{BLACK, avatar, camera, expected, needs, pose, psnr, run};
use app_pipeline::timeline::LatencyMode;
use app_session::display::{
    DrawnPicture, LiveSession, OffscreenDisplay, PictureObserver, SessionError, Standpoint,
};
use app_session::participant::{Origin, Participant};
use app_session::presence::{Lineup, Standing};
use glam::{Affine3A, Quat, Vec3};
use renderer_splat::camera::Camera;
use std::time::Instant;
use test_support::{onnx, vulkan};

/// Keeps the last of some pictures, and where its people stood.
#[derive(Default)]
struct Last {
    people: usize,
    pictures: u32,
    stands: Option<Standpoint>,
    picture: Vec<u8>,
    places: Vec<Affine3A>,
}

impl Last {
    /// Of so many people.
    fn of(people: usize) -> Self {
        Self {
            people,
            ..Self::default()
        }
    }
}

pub(crate) fn seen(people: &Standpoint) -> Camera {
    let (eye, target) = (Vec3::new(0.3, 1.2, 3.5), Vec3::Y * 0.9);
    let of = camera(0.0);
    let eye = people.floor + people.heading * eye;
    Camera::look_at(
        eye,
        people.floor + target,
        Vec3::Y,
        0.7,
        of.width,
        of.height,
    )
}

impl PictureObserver for Last {
    fn is_over(&mut self, _: &LiveSession<'_>, _: Option<Instant>) -> Result<bool, SessionError> {
        Ok(self.pictures == 30)
    }

    fn cameras(&mut self, people: &Standpoint) -> Vec<Camera> {
        self.stands = Some(*people);
        vec![seen(people)]
    }

    fn drawn(&mut self, picture: DrawnPicture<'_>) -> Result<(), SessionError> {
        self.pictures += u32::from(picture.people.len() == self.people);
        self.picture = picture
            .renderer
            .read_back(0)
            .expect("a picture")
            .over(BLACK);
        self.places = picture.people.iter().map(|(.., place)| *place).collect();
        Ok(())
    }
}

#[test]
fn several_people_stand_side_by_side_where_the_picture_says_and_each_is_recorded() {
    let (Some(gpu), Some(runtime)) = (vulkan::gpu(), onnx::runtime()) else {
        return;
    };
    let swings = [0.4, -0.6];
    let people = swings.map(|swing| Participant {
        avatar: avatar(),
        sits: false,
        origin: Origin::Clip {
            frames: vec![pose(swing)],
            rate_hz: 30.0,
        },
    });
    let mut last = Last::of(2);
    let mut display = OffscreenDisplay::new(needs(&gpu), None, &mut last);
    let report = run(
        &runtime,
        LatencyMode::Interpolate,
        people.to_vec(),
        &mut display,
    );
    assert!(display.first_picture().is_some(), "there were people");
    let stands = last.stands.expect("people");
    assert!((stands.width - 0.9).abs() < 0.05, "{stands:?}");
    let [left, right] = last.places[..] else {
        panic!("{} people", last.places.len());
    };
    let apart = left.translation.distance(right.translation);
    assert!((apart - 0.9).abs() < 0.05, "{apart} m apart");
    assert!(
        left.translation.x < right.translation.x,
        "the first on the left"
    );
    let both = [(pose(swings[0]), left), (pose(swings[1]), right)];
    let likeness = psnr(
        &last.picture,
        &expected((&gpu, &runtime), &both, seen(&stands)),
    );
    assert!(likeness > 40.0, "{likeness:.1} dB like two people");
    let wrong = [(pose(swings[1]), left), (pose(swings[0]), right)];
    let unlike = psnr(
        &last.picture,
        &expected((&gpu, &runtime), &wrong, seen(&stands)),
    );
    assert!(
        unlike < likeness - 6.0,
        "{unlike:.1} dB like them exchanged"
    );
    for person in &report.people {
        assert!(
            person.collector.pictures().count() >= 25,
            "each is recorded"
        );
    }
    assert!(report.people[1].call.is_none(), "a clip is no call");
}

#[test]
fn seven_people_stand_in_a_row_that_is_as_wide_as_it_says() {
    let mut lineup = Lineup::default();
    let avatar = avatar();
    let standing = |swing: f32| Standing::of(&avatar.skeleton, &pose(swing));
    let people: Vec<_> = (0..7u8).map(|k| standing(f32::from(k) * 0.1)).collect();
    let places = lineup.update(&people, &[true; 7]);
    // The puppet's pelvis is above its origin.
    let at: Vec<Vec3> = places
        .iter()
        .map(|place| place.translation.into())
        .collect();
    assert!(
        (at[6].x - at[0].x - 5.4).abs() < 0.05,
        "six times 0.9 m: {at:?}"
    );
    for two in at.windows(2) {
        assert!((two[1].x - two[0].x - 0.9).abs() < 0.05, "{at:?}");
        assert!(two[0].z.abs() < 0.05, "in a row: {at:?}");
    }
}

#[test]
fn who_stays_moves_up_when_another_one_leaves() {
    let mut lineup = Lineup::default();
    let avatar = avatar();
    let standing = Standing::of(&avatar.skeleton, &pose(0.1));
    let mut xs = |present: [bool; 3]| {
        let people = present.map(|present| standing.filter(|_| present));
        let places = lineup.update(&people, &present);
        let xs: Vec<f32> = places.iter().map(|place| place.translation.x).collect();
        (xs, lineup.count())
    };
    let (three, count) = xs([true; 3]);
    assert_eq!(count, 3);
    assert!((three[2] - three[0] - 1.8).abs() < 1e-4, "{three:?}");
    let (two, count) = xs([true, false, true]);
    assert_eq!(count, 2);
    assert!((two[2] - two[0] - 0.9).abs() < 1e-4, "{two:?}");
    let (again, _) = xs([true; 3]);
    assert_eq!(again, three, "as before");
}

#[test]
fn one_person_stands_where_their_motion_takes_them_and_the_camera_faces_them() {
    let (Some(gpu), Some(runtime)) = (vulkan::gpu(), onnx::runtime()) else {
        return;
    };
    let turn = Quat::from_rotation_y(1.2);
    let mut motion = pose(0.2);
    motion.set_rotation(spmm3::Joint::Pelvis, turn);
    motion.root_translation = Vec3::new(2.0, 0.0, -3.0);
    let person = Participant {
        avatar: avatar(),
        sits: false,
        origin: Origin::Clip {
            frames: vec![motion.clone()],
            rate_hz: 30.0,
        },
    };
    let mut last = Last::of(1);
    let mut display = OffscreenDisplay::new(needs(&gpu), None, &mut last);
    run(
        &runtime,
        LatencyMode::Interpolate,
        vec![person],
        &mut display,
    );
    drop(display);
    let stands = last.stands.expect("a person");
    assert_eq!(last.places, [Affine3A::IDENTITY], "not moved");
    assert_eq!(stands.width, 0.0, "one person");
    let off = stands.floor - Vec3::new(2.0, 0.0, -3.0);
    assert!(off.length() < 0.2, "the floor below the pelvis: {off}");
    assert!(
        stands.heading.angle_between(turn) < 1e-3,
        "{:?}",
        stands.heading
    );
    let alone = [(motion, Affine3A::IDENTITY)];
    let likeness = psnr(
        &last.picture,
        &expected((&gpu, &runtime), &alone, seen(&stands)),
    );
    assert!(likeness > 40.0, "{likeness:.1} dB like the person there");
}
