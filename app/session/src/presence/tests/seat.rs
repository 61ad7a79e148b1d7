use super::super::Seated;
use super::super::seat::Seat;
use super::*;
use app_pipeline::concealment::ConcealmentState;
use app_pipeline::lanes::{MotionSource, Pose};
use app_pipeline::profile::FrameTimes;
use proptest::prelude::*;
use spmm3::MotionClip;
use std::time::Instant;
use synthetic_person::Random;
use synthetic_person::reference::{Rigid, forward_kinematics};

/// All joints' frames in motion space by the reference's kinematics, in f64.
fn joints(skeleton: &Skeleton, motion: &MotionParams) -> Vec<Rigid> {
    let mut joints = forward_kinematics(skeleton.rest_positions(), motion.values());
    let root = motion.root_translation.as_dvec3().to_array();
    for joint in &mut joints {
        for (at, moved) in joint.translation.iter_mut().zip(root) {
            *at += moved;
        }
    }
    joints
}

/// Heights of heel, ball and toe tip over the floor, metres, for either foot.
fn soles(skeleton: &Skeleton, motion: &MotionParams) -> Vec<f64> {
    let posed = joints(skeleton, motion);
    let rest = skeleton.rest_positions();
    let feet = [
        (Joint::LeftAnkle, Joint::LeftFoot),
        (Joint::RightAnkle, Joint::RightFoot),
    ];
    let mut heights = Vec::new();
    for (ankle, ball) in feet {
        let [ankle_at, ball_at] = [ankle, ball].map(|j| rest[j.index()]);
        let length = f64::from(ball_at.z - ankle_at.z);
        // From each joint to a point of the sole below or before it, at rest on y = 0.
        for (joint, at, ahead) in [
            (ankle, ankle_at, -0.4 * length),
            (ankle, ankle_at, 0.0),
            (ball, ball_at, 0.0),
            (ball, ball_at, 0.6 * length),
        ] {
            let point = posed[joint.index()].apply([0.0, -f64::from(at.y), ahead]);
            heights.push(point[1]);
        }
    }
    heights
}

/// The puppet's skeleton with legs and trunk of other lengths: its joints' rest positions, y stretched above the ankles.
fn other(scale: f32, shank: f32, thigh: f32) -> Skeleton {
    let rest = skeleton().rest_positions();
    let y = |joint: Joint| rest[joint.index()].y;
    let (ankle, knee, hip) = (y(Joint::LeftAnkle), y(Joint::LeftKnee), y(Joint::LeftHip));
    let stretched = |y: f32| {
        let over = |from: f32, to: f32| (y.min(to) - from).max(0.0);
        y.min(ankle) + over(ankle, knee) * shank + over(knee, hip) * thigh + over(hip, f32::MAX)
    };
    let moved = rest.map(|at| Vec3::new(at.x, stretched(at.y), at.z) * scale);
    Skeleton::new(moved).expect("finite")
}

fn seat(skeleton: &Skeleton, sent: &MotionParams) -> MotionParams {
    let mut motion = sent.clone();
    Seat::new(skeleton).take(&mut motion, Instant::now());
    motion
}

#[test]
fn a_standing_person_sits_at_the_seats_height_with_both_feet_flat_on_the_floor() {
    let motion = seat(skeleton(), &motion(1.2, Vec2::new(2.0, -1.0)));
    for height in soles(skeleton(), &motion) {
        assert!((-1e-4..0.02).contains(&height), "a sole {height} m up");
    }
    let at = |joint: Joint| joints(skeleton(), &motion)[joint.index()].translation;
    let [hip, knee, ankle] = [Joint::LeftHip, Joint::LeftKnee, Joint::LeftAnkle].map(at);
    assert!(
        (0.48..0.60).contains(&hip[1]),
        "hips over a seat of 0.45 m: {}",
        hip[1]
    );
    let level = |a: [f64; 3], b: [f64; 3]| (b[0] - a[0]).hypot(b[2] - a[2]);
    assert!(level(hip, knee) > 0.85 * thigh(), "thighs lie on the seat");
    assert!(level(knee, ankle) < 0.3 * thigh(), "shanks stand");
    // Facing 1.2 rad to the left of +z.
    let ahead = (knee[0] - hip[0]) * 1.2_f64.sin() + (knee[2] - hip[2]) * 1.2_f64.cos();
    assert!(
        ahead > 0.8 * thigh(),
        "the knees are before the hips: {ahead}"
    );
}

fn thigh() -> f64 {
    f64::from(skeleton().rest_offset(Joint::LeftKnee).length())
}

#[test]
fn everything_above_the_pelvis_is_as_sent() {
    let sent = Random::new(5).motion(0.4);
    let seated = seat(skeleton(), &sent);
    let legs = [
        Joint::Pelvis,
        Joint::LeftHip,
        Joint::RightHip,
        Joint::LeftKnee,
        Joint::RightKnee,
        Joint::LeftAnkle,
        Joint::RightAnkle,
        Joint::LeftFoot,
        Joint::RightFoot,
    ];
    for joint in Joint::ALL {
        if !legs.contains(&joint) {
            let (got, want) = (seated.axis_angle(joint), sent.axis_angle(joint));
            assert_eq!(got, want, "{}", joint.name());
        }
    }
    assert_eq!(seated.expression(), sent.expression(), "the face");
}

#[test]
fn a_seated_person_does_not_walk_but_turns_and_leans_a_little() {
    let mut seat = Seat::new(skeleton());
    let begun = Instant::now();
    let mut at = |k: u32, sent: &MotionParams| {
        let mut motion = sent.clone();
        seat.take(&mut motion, begun + Duration::from_millis(33) * k);
        motion
    };
    let first = at(0, &motion(0.0, Vec2::new(1.0, 2.0)));
    let mut sent = motion(0.5, Vec2::new(4.0, -3.0));
    let lean = Quat::from_rotation_y(0.5) * Quat::from_rotation_x(0.4);
    sent.set_rotation(Joint::Pelvis, lean);
    let later = at(30, &sent);
    assert_eq!(
        first.root_translation, later.root_translation,
        "the chair stays"
    );
    let pelvis = later.rotation(Joint::Pelvis);
    let ahead = pelvis * Vec3::Z;
    assert!(
        (ahead.x.atan2(ahead.z) - 0.5).abs() < 1e-3,
        "turned: {ahead}"
    );
    let leans = (pelvis * Vec3::Y).angle_between(Vec3::Y);
    assert!((0.05..0.15).contains(&leans), "0.4 rad became {leans}");
}

#[test]
fn a_turn_faster_than_hips_turn_is_followed_over_several_frames() {
    let mut seat = Seat::new(skeleton());
    let begun = Instant::now();
    let mut faced = 0.0;
    for k in 0..20u32 {
        let mut sent = motion(if k == 0 { 0.0 } else { 2.0 }, Vec2::ZERO);
        seat.take(&mut sent, begun + Duration::from_millis(33) * k);
        let ahead = sent.rotation(Joint::Pelvis) * Vec3::Z;
        let now = ahead.x.atan2(ahead.z);
        assert!(now - faced < 8.0 * 0.034, "frame {k}: {faced} to {now}");
        faced = now;
    }
    assert!((faced - 2.0).abs() < 1e-3, "in the end {faced}");
}

#[test]
fn a_walk_becomes_sitting_without_a_jolt() {
    let expressions = Puppet::new(PuppetSize::SMALL).expressions;
    let clip = MotionClip::built_in(skeleton(), &expressions, 9.0, 60.0).expect("possible");
    let mut seat = Seat::new(skeleton());
    let begun = Instant::now();
    let mut before: Option<(Vec<Rigid>, Vec<Rigid>)> = None;
    for (k, sent) in (0u32..).zip(&clip.frames) {
        let mut motion = sent.clone();
        motion.root_translation.z += 0.02 * k as f32;
        seat.take(&mut motion, begun + Duration::from_micros(16_667) * k);
        let now = (joints(skeleton(), sent), joints(skeleton(), &motion));
        if let Some((sent_before, seated_before)) = &before {
            let step = |from: &[Rigid], to: &[Rigid]| {
                let apart = |a: &Rigid, b: &Rigid| {
                    let d = [0, 1, 2].map(|k| a.translation[k] - b.translation[k]);
                    (d[0] * d[0] + d[1] * d[1] + d[2] * d[2]).sqrt()
                };
                from.iter()
                    .zip(to)
                    .map(|(a, b)| apart(a, b))
                    .fold(0.0, f64::max)
            };
            let (sent, seated) = (step(sent_before, &now.0), step(seated_before, &now.1));
            assert!(seated < sent + 0.01, "frame {k}: {seated} m for {sent} m");
        }
        before = Some(now);
    }
}

/// One pose again and again.
struct Still(MotionParams, Option<Instant>);

impl MotionSource for Still {
    fn next(&mut self, _: Duration) -> Option<Pose> {
        let due = self.1.take()?;
        Some(Pose {
            motion: self.0.clone(),
            times: FrameTimes {
                captured: Some(due),
                ..FrameTimes::new(ConcealmentState::Live, due)
            },
        })
    }

    fn is_over(&self) -> bool {
        self.1.is_none()
    }
}

#[test]
fn a_seated_source_is_its_source_but_for_the_pose() {
    let (sent, due) = (motion(0.0, Vec2::ZERO), Instant::now());
    let mut seated = Seated::new(Still(sent.clone(), Some(due)), skeleton());
    assert!(!seated.is_over(), "there is a pose");
    let pose = seated.next(Duration::ZERO).expect("a pose");
    assert_eq!(
        (pose.times.due, pose.times.captured),
        (due, Some(due)),
        "its times"
    );
    assert_eq!(pose.motion, seat(skeleton(), &sent), "its motion");
    assert!(
        seated.next(Duration::ZERO).is_none() && seated.is_over(),
        "over"
    );
    assert_eq!(seated.into_source().0, sent, "the source comes back");
    let mut standing = Seated::as_sent(Still(sent.clone(), Some(due)));
    let pose = standing.next(Duration::ZERO).expect("a pose");
    assert_eq!(pose.motion, sent, "no seat was asked for");
}

proptest! {
    #[test]
    fn whatever_is_sent_and_however_long_the_legs_the_feet_stand_on_the_floor(
        seed in any::<u64>(),
        reach in 0.0f32..3.0,
        scale in 0.5f32..1.25,
        shank in 0.7f32..1.3,
        thigh in 0.7f32..1.3,
    ) {
        let skeleton = other(scale, shank, thigh);
        let motion = seat(&skeleton, &Random::new(seed).motion(reach));
        prop_assert!(motion.is_finite());
        for height in soles(&skeleton, &motion) {
            prop_assert!((-1e-4..0.02).contains(&height), "a sole {height} m up");
        }
        let pelvis = joints(&skeleton, &motion)[0].translation[1];
        prop_assert!((0.2..0.85).contains(&pelvis), "pelvis {pelvis} m up");
    }

    #[test]
    fn poses_that_are_close_give_seats_that_are_close(
        seed in any::<u64>(),
        reach in 0.0f32..3.0,
        nudge in prop::array::uniform3(-0.002f32..0.002),
    ) {
        let mut random = Random::new(seed);
        let (sent, begun) = (random.motion(reach), Instant::now());
        let mut close = sent.clone();
        let turned = Quat::from_scaled_axis(Vec3::from_array(nudge)) * sent.rotation(Joint::Pelvis);
        close.set_rotation(Joint::Pelvis, turned);
        let mut seat = Seat::new(skeleton());
        let (mut first, mut second) = (sent, close);
        seat.take(&mut first, begun);
        // A frame later: what is left of a jump head down is what the chair turns in a millisecond.
        seat.take(&mut second, begun + Duration::from_millis(1));
        let pairs = joints(skeleton(), &first);
        for (a, b) in pairs.iter().zip(joints(skeleton(), &second)) {
            for (from, to) in a.translation.iter().zip(b.translation) {
                prop_assert!((from - to).abs() < 0.02, "{from} to {to}");
            }
        }
    }
}
