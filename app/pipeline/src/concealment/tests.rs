#![allow(
    clippy::cast_possible_truncation,
    reason = "simulated calls are seconds long"
)]

use super::*;
use fastrand::Rng;
use link_playout::JitterBuffer;
use proptest::prelude::*;
use spmm3::{EXPRESSION, LoadOptions, MotionClip, Playback};
use std::sync::OnceLock;
use synthetic_person::real_files::real_file;
use synthetic_person::reference::{M3, mul, rodrigues, transpose, wide};
use synthetic_person::{Puppet, PuppetSize};

const START: u64 = 5_000_000;
const DISPLAY: u64 = 1_000_000 / 90;

fn skeleton() -> &'static Skeleton {
    static SKELETON: OnceLock<Skeleton> = OnceLock::new();
    SKELETON.get_or_init(|| Puppet::new(PuppetSize::SMALL).skeleton)
}

/// The built-in motion, and real people's where they are at hand.
fn clips() -> &'static [MotionClip] {
    static CLIPS: OnceLock<Vec<MotionClip>> = OnceLock::new();
    CLIPS.get_or_init(|| {
        let expressions = Puppet::new(PuppetSize::SMALL).expressions;
        let built_in = MotionClip::built_in(skeleton(), &expressions, 9.0, 60.0)
            .expect("the built-in motion is possible");
        let files = ["mocap/cmu_02_01_walk.bvh", "mocap/cmu_02_05_punch.bvh"];
        let real = files.into_iter().filter_map(real_file).map(|path| {
            MotionClip::load(&path, skeleton(), &LoadOptions::default())
                .expect("a real capture loads")
        });
        std::iter::once(built_in).chain(real).collect()
    })
}

fn frame(sequence: u32, captured: u64, motion: MotionParams) -> MotionFrame {
    MotionFrame {
        sequence,
        captured: Micros(captured),
        motion,
    }
}

fn step(from: &MotionParams, to: &MotionParams) -> Extent {
    assert!(to.is_finite(), "a pose is not finite");
    Change::between(from, to).extent()
}

/// A call over a bad path: what a display at 90 Hz shows.
struct Path {
    rate_hz: u64,
    loss: f64,
    jitter_us: u64,
    /// Microseconds after the start when nothing arrives, and whether what was sent then comes at its end.
    outage: (u64, u64),
    in_order: bool,
    seed: u64,
}

fn watch(
    clip: &MotionClip,
    seconds: u64,
    path: &Path,
    mut see: impl FnMut(u64, &MotionConcealment, &MotionParams, ConcealmentState),
) {
    let mut random = Rng::with_seed(path.seed);
    let mut arrivals = Vec::new();
    let mut latest = 0;
    for k in 0..seconds * path.rate_hz {
        let at = k * 1_000_000 / path.rate_hz;
        let out = at >= path.outage.0 && at < path.outage.1;
        let lost = random.f64() < path.loss || (out && !path.in_order);
        let mut arrived = at + 20_000 + random.u64(0..=path.jitter_us);
        if path.in_order {
            if out {
                arrived = arrived.max(path.outage.1);
            }
            arrived = arrived.max(latest);
            latest = arrived;
        }
        if !lost {
            arrivals.push((arrived, k as u32 + 1, at));
        }
    }
    arrivals.sort_unstable();
    let mut arrivals = arrivals.into_iter().peekable();
    let (mut buffer, mut bridge) = (JitterBuffer::new(), MotionConcealment::new(skeleton()));
    for tick in 0..seconds * 90 {
        let now = tick * DISPLAY;
        while let Some((arrived, sequence, at)) = arrivals.next_if(|(arrived, ..)| *arrived <= now)
        {
            let motion = clip.sample(at as f64 * 1e-6, Playback::Clamp);
            buffer.push(frame(sequence, START + at, motion), Micros(arrived), None);
        }
        for played in buffer.take(Micros(now)) {
            bridge.push(&played.frame);
        }
        let (pose, state) = bridge.sample(Micros(now));
        see(now, &bridge, &pose, state);
    }
}

fn greater(a: Extent, b: Extent) -> Extent {
    Extent {
        radians: a.radians.max(b.radians),
        expression: a.expression.max(b.expression),
        metres: a.metres.max(b.metres),
    }
}

/// The furthest that a clip moves within so many seconds.
fn fastest(clip: &MotionClip, within: f64) -> Extent {
    let mut most = Change::NONE.extent();
    for k in 0..(clip.duration() * 120.0) as u32 {
        let at = f64::from(k) / 120.0;
        let moved = step(
            &clip.sample(at, Playback::Clamp),
            &clip.sample(at + within, Playback::Clamp),
        );
        most = greater(most, moved);
    }
    most
}

#[test]
fn while_frames_flow_the_newest_is_shown_exactly() {
    for clip in clips() {
        for rate_hz in [30, 60] {
            let path = Path {
                rate_hz,
                loss: 0.0,
                jitter_us: 200,
                outage: (0, 0),
                in_order: false,
                seed: 1,
            };
            let (mut live, mut other) = (0, 0);
            watch(clip, 3, &path, |now, bridge, pose, state| {
                if now > 500_000 {
                    let newest = bridge.newest.as_ref().expect("frames have come");
                    if state == ConcealmentState::Live {
                        assert_eq!(*pose, newest.motion, "{}: not the newest frame", clip.name);
                        live += 1;
                    } else {
                        other += 1;
                    }
                }
            });
            println!("{}, {rate_hz} Hz: {live} live, {other} other", clip.name);
            assert!(
                other * 50 <= live,
                "{}: {other} of {live} not live",
                clip.name
            );
        }
    }
}

fn matrix(rotation_vector: Vec3) -> M3 {
    rodrigues(wide(rotation_vector))
}

/// Axis times angle of a rotation matrix, for angles well within 0 and pi.
fn logarithm(m: &M3) -> [f64; 3] {
    let angle = ((m[0][0] + m[1][1] + m[2][2] - 1.0) / 2.0)
        .clamp(-1.0, 1.0)
        .acos();
    let k = angle / (2.0 * angle.sin());
    [
        k * (m[2][1] - m[1][2]),
        k * (m[0][2] - m[2][0]),
        k * (m[1][0] - m[0][1]),
    ]
}

#[test]
fn extrapolation_agrees_with_a_reference_in_double_precision() {
    let mut random = Rng::with_seed(3);
    let mut vector =
        |size: f32| Vec3::from_array(std::array::from_fn(|_| (random.f32() * 2.0 - 1.0) * size));
    for case in 0..20 {
        let (mut a, mut b) = (MotionParams::default(), MotionParams::default());
        for joint in Joint::ALL {
            let at = vector(1.2);
            a.set_axis_angle(joint, at);
            let turn = Quat::from_scaled_axis(vector(0.02 + 0.01 * case as f32));
            b.set_rotation(joint, turn * a.rotation(joint));
        }
        a.root_translation = vector(2.0);
        b.root_translation = a.root_translation + vector(0.05);
        for k in 0..EXPRESSION {
            a.expression_mut()[k] = vector(1.0).x;
            b.expression_mut()[k] = a.expression()[k] + vector(0.1).x;
        }
        // 60 Hz: late after 25 ms.
        let apart = 1.0 / 60.0;
        let mut bridge = MotionConcealment::new(skeleton());
        bridge.push(&frame(1, START, a.clone()));
        bridge.push(&frame(2, START + 16_667, b.clone()));
        bridge.sample(Micros(0));
        for late_ms in [1u64, 20, 60, 100, 200, 300, 900] {
            let (pose, state) = bridge.sample(Micros(25_000 + late_ms * 1000));
            assert_eq!(state, ConcealmentState::Extrapolating, "{late_ms} ms late");
            // The way is summed from the speed in steps of 0.01 ms.
            let speed = |t: f64| match t {
                t if t < 0.06 => 1.0,
                t if t < 0.3 => 0.5 + 0.5 * (std::f64::consts::PI * (t - 0.06) / 0.24).cos(),
                _ => 0.0,
            };
            let steps = late_ms * 100;
            let way: f64 = (0..steps)
                .map(|k| speed((k as f64 + 0.5) * 1e-5) * 1e-5)
                .sum();
            let soft = |v: [f64; 3], most: f64| {
                let length = v.iter().map(|x| x * x).sum::<f64>().sqrt();
                v.map(|x| x / length * most * (length / most).tanh())
            };
            for joint in Joint::ALL {
                let (ra, rb) = (matrix(a.axis_angle(joint)), matrix(b.axis_angle(joint)));
                let turn = logarithm(&mul(rb, transpose(ra))).map(|x| x / apart * way);
                let expected = mul(rodrigues(soft(turn, 0.35)), rb);
                let found = matrix(pose.axis_angle(joint));
                for (x, y) in expected.iter().flatten().zip(found.iter().flatten()) {
                    assert!(
                        (x - y).abs() < 2e-4,
                        "{} at {late_ms} ms: {x} and {y}",
                        joint.name()
                    );
                }
            }
            let moved = b.root_translation - a.root_translation;
            let moved = soft(wide(moved).map(|x| x / apart * way), 0.15);
            for (k, by) in moved.into_iter().enumerate() {
                let expected = f64::from(b.root_translation[k]) + by;
                assert!(
                    (expected - f64::from(pose.root_translation[k])).abs() < 1e-4,
                    "root"
                );
            }
            for k in 0..EXPRESSION {
                let (x, y) = (f64::from(a.expression()[k]), f64::from(b.expression()[k]));
                let expected = y + 0.5 * ((y - x) / apart * way / 0.5).tanh();
                assert!(
                    (expected - f64::from(pose.expression()[k])).abs() < 1e-4,
                    "expression {k}"
                );
            }
        }
    }
}

#[test]
fn a_silent_person_comes_to_stand_at_ease_on_the_spot_and_comes_back() {
    for clip in clips() {
        for begins in [1_000_000u64, 1_300_000, 1_700_000] {
            let path = Path {
                rate_hz: 60,
                loss: 0.0,
                jitter_us: 1_000,
                outage: (begins, begins + 5_000_000),
                in_order: false,
                seed: 2,
            };
            let mut seen = Vec::new();
            let mut last: Option<MotionParams> = None;
            let mut slide = 0.0f32;
            let ankles = |pose: &MotionParams| {
                let joints = skeleton().pose(pose);
                [Joint::LeftAnkle, Joint::RightAnkle]
                    .map(|ankle| joints.position(ankle) + pose.root_translation)
            };
            let mut before = Vec3::ZERO;
            watch(clip, 8, &path, |now, bridge, pose, state| {
                if seen.last().is_none_or(|(_, s)| *s != state) {
                    seen.push((now, state));
                }
                if let Some(last) = &last
                    && state == ConcealmentState::Easing
                {
                    for (a, b) in ankles(last).into_iter().zip(ankles(pose)) {
                        slide = slide.max((b - a).length() * 90.0);
                    }
                }
                if state == ConcealmentState::Live {
                    let [left, right] = ankles(pose);
                    before = (left + right) * 0.5;
                }
                if state == ConcealmentState::Resting && now > begins {
                    let [left, right] = ankles(pose);
                    let aside = (left + right) * 0.5 - before;
                    assert!(
                        Vec3::new(aside.x, 0.0, aside.z).length() < 0.25,
                        "{aside} from where they stood"
                    );
                    let floor = skeleton().rest_positions()[Joint::LeftAnkle.index()].y;
                    assert!(
                        (left.y - floor).abs() < 2e-3 && (right.y - floor).abs() < 2e-3,
                        "feet off the floor"
                    );
                    assert!(
                        pose.expression().iter().all(|e| e.abs() < 1e-5),
                        "the face is not neutral"
                    );
                    let joints = skeleton().pose(pose);
                    for (wrist, hip) in [
                        (Joint::LeftWrist, Joint::LeftHip),
                        (Joint::RightWrist, Joint::RightHip),
                    ] {
                        assert!(
                            joints.position(wrist).y < joints.position(hip).y + 0.08,
                            "arms do not hang"
                        );
                    }
                }
                if now > begins + 5_000_000 + 350_000 && state == ConcealmentState::Live {
                    let newest = bridge.newest.as_ref().expect("frames have come");
                    assert_eq!(*pose, newest.motion, "not back");
                }
                last = Some(pose.clone());
            });
            let after: Vec<_> = seen
                .iter()
                .filter(|(at, _)| *at > begins)
                .map(|(_, s)| *s)
                .collect();
            println!(
                "{}, silent from {:.1} s: an ankle moves at {slide:.2} m/s at most while easing",
                clip.name,
                begins as f64 * 1e-6
            );
            assert_eq!(
                after,
                [
                    ConcealmentState::Extrapolating,
                    ConcealmentState::Easing,
                    ConcealmentState::Resting,
                    ConcealmentState::Returning,
                    ConcealmentState::Live
                ],
                "{}: {seen:?}",
                clip.name
            );
            let returned = seen
                .iter()
                .rfind(|(_, s)| *s == ConcealmentState::Returning)
                .map_or(0, |(at, _)| *at);
            let live = seen.last().map_or(0, |(at, _)| *at);
            assert!(
                live - returned <= 260_000,
                "the blend took {} us",
                live - returned
            );
        }
    }
}

#[test]
fn frames_that_are_no_numbers_and_clocks_that_go_back_change_nothing() {
    let mut bridge = MotionConcealment::new(skeleton());
    let (at_first, state) = bridge.sample(Micros(1_000_000));
    assert_eq!(state, ConcealmentState::Resting, "before the first frame");
    let mut broken = MotionParams::default();
    broken.values_mut()[7] = f32::NAN;
    bridge.push(&frame(1, START, broken));
    assert_eq!(
        bridge.sample(Micros(500_000)),
        (at_first, ConcealmentState::Resting),
        "after it"
    );
}

#[test]
fn a_person_who_is_suddenly_elsewhere_flows_there() {
    let mut bridge = MotionConcealment::new(skeleton());
    let mut last = None;
    for tick in 0..180u64 {
        let mut motion = MotionParams::default();
        if tick >= 90 {
            motion.set_axis_angle(Joint::Pelvis, Vec3::Y * 3.1);
            motion.root_translation = Vec3::new(3.0, 0.0, -1.0);
        }
        bridge.push(&frame(
            tick as u32 + 1,
            START + tick * DISPLAY,
            motion.clone(),
        ));
        let (pose, _) = bridge.sample(Micros(tick * DISPLAY));
        if let Some(last) = &last {
            let moved = step(last, &pose);
            assert!(moved.radians < 0.25, "turned {} rad at once", moved.radians);
            assert!(moved.metres < 0.25, "moved {} m at once", moved.metres);
        }
        if tick > 90 + 24 {
            assert_eq!(pose, motion, "not there after 0.27 s");
        }
        last = Some(pose);
    }
}

/// What the bridge may add to the frames' own motion between two pictures at 90 Hz: the blend's pi/2 x 8 rad/s
/// (20 a second, 3 m/s), and the extrapolation's error that shows when a late frame comes after all.
const ADDED: Extent = Extent {
    radians: 0.15,
    expression: 0.4,
    metres: 0.055,
};

#[test]
fn the_furthest_step_between_two_pictures_is_printed_for_some_paths() {
    for clip in clips() {
        let own = fastest(clip, 0.05);
        println!(
            "{}: own motion within 50 ms: {:.3} rad, {:.3} m",
            clip.name, own.radians, own.metres
        );
        for (loss, jitter_us) in [(0.0, 0), (0.05, 5_000), (0.2, 30_000)] {
            let path = Path {
                rate_hz: 60,
                loss,
                jitter_us,
                outage: (2_000_000, 2_600_000),
                in_order: true,
                seed: 5,
            };
            let mut last: Option<MotionParams> = None;
            let (mut turn, mut way, mut live) = (0.0f32, 0.0f32, 0);
            watch(clip, 4, &path, |now, _, pose, state| {
                if let Some(last) = &last
                    && now > 500_000
                {
                    let moved = step(last, pose);
                    turn = turn.max(moved.radians);
                    way = way.max(moved.metres);
                    live += u32::from(state == ConcealmentState::Live);
                }
                last = Some(pose.clone());
            });
            println!(
                "    loss {:.0} %, jitter {} ms, 0.6 s stall: {turn:.3} rad, {way:.3} m; {:.0} % live",
                loss * 100.0,
                jitter_us / 1000,
                f64::from(live) / 3.15
            );
            assert!(turn <= own.radians + ADDED.radians, "turned {turn} rad");
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(48))]
    #[test]
    fn whatever_the_path_does_nothing_jumps(
        which in 0usize..3,
        fast in any::<bool>(),
        in_order in any::<bool>(),
        loss in 0.0f64..0.5,
        jitter_us in 0u64..120_000,
        outage_from in 500_000u64..3_000_000,
        outage in 0u64..4_500_000,
        seed in any::<u64>(),
    ) {
        let clip = &clips()[which % clips().len()];
        let own = fastest(clip, 0.05);
        let path = Path {
            rate_hz: if fast { 60 } else { 30 },
            loss,
            jitter_us,
            outage: (outage_from, outage_from + outage),
            in_order,
            seed,
        };
        let mut last: Option<MotionParams> = None;
        let (mut worst, mut off) = (Change::NONE.extent(), Change::NONE.extent());
        watch(clip, 6, &path, |_, bridge, pose, _| {
            if let Some(last) = &last {
                worst = greater(worst, step(last, pose));
            }
            if let Some(newest) = &bridge.newest {
                off = greater(off, step(&newest.motion, pose));
            }
            last = Some(pose.clone());
        });
        // A blend of 250 ms takes 7 % of what it began with away at once.
        let bound = |own: f32, added: f32, off: f32| own + added.max(0.07 * off);
        let radians = bound(own.radians, ADDED.radians, off.radians).min(MotionConcealment::LARGEST_TURN + 1e-3);
        prop_assert!(worst.radians <= radians, "turned {} of {radians} rad", worst.radians);
        let metres = bound(own.metres, ADDED.metres, off.metres);
        prop_assert!(worst.metres <= metres, "moved {} of {metres} m", worst.metres);
        let expression = bound(own.expression, ADDED.expression, off.expression);
        prop_assert!(worst.expression <= expression, "expression {} of {expression}", worst.expression);
    }
}
