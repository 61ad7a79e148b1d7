//! What to show now: the newest frame while frames flow, and a person who keeps their countenance while they do not.
//!
//! A late or lost frame is bridged by going on with the last velocities, which die away; silence, by easing to a person at
//! ease on the same spot; and when frames come again, what is shown flows back into them. Nothing ever jumps. Which frames
//! are due is `link_playout::JitterBuffer`'s business; nothing here asks for the time.

mod change;

pub(crate) use change::between;
use change::{Change, Extent};
use glam::{Quat, Vec3};
use link_codec::{Micros, MotionFrame};
use serde::Serialize;
use spmm3::{Joint, MotionParams, Skeleton, at_ease};
use std::{f32::consts::PI, time::Duration};

/// Frames come this often, until two have told it.
const INTERVAL: f32 = 1.0 / 30.0;
/// What two frames can tell about it, seconds.
const INTERVALS: [f32; 2] = [0.004, 0.05];
/// A frame is late after this many intervals.
const LATE: f32 = 1.5;
/// Frames this far apart (seconds) are shown one after the other as they are, even if one between is missing.
const STEP: f32 = 0.04;
/// A display that asks this rarely (seconds) does not make a frame late.
const TICK: f32 = 0.02;
/// Velocities of frames further apart (seconds) say nothing about now.
const RECENT: f32 = 0.1;
/// Extrapolation runs at full speed for so long (seconds) ...
const FULL: f32 = 0.06;
/// ... and has come to a standstill after this.
const STANDSTILL: f32 = 0.3;
/// The furthest that extrapolation goes, however fast the last motion was: 20 degrees.
const REACH: Extent = Extent {
    radians: 0.35,
    expression: 0.5,
    metres: 0.15,
};
/// Seconds of silence until the person begins to ease, and how long that takes.
const SILENCE: f32 = 1.5;
const EASE: f32 = 1.5;
/// Between two frames that follow on each other a person does not move further; what does is blended.
/// 0.7 rad in 1/30 s are 1200 degrees a second: faster than a pitcher's elbow between two frames of 60 Hz.
const LARGEST_STEP: Extent = Extent {
    radians: 0.7,
    expression: 2.0,
    metres: 0.3,
};
/// Seconds in which what is shown flows back into the frames: as long as the silence was, within these.
const BLEND: [f32; 2] = [0.06, 0.25];
/// What is far off takes longer, a second for each of these, within the same limits.
const BLEND_SPEED: Extent = Extent {
    radians: 8.0,
    expression: 20.0,
    metres: 3.0,
};
/// A display that was away does not find its blend half over (seconds).
const AWAY: f32 = 1.0 / 30.0;

/// What is shown, and why.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum ConcealmentState {
    /// The newest frame, exactly.
    Live,
    /// A frame is late: the last motion goes on and dies away, then the pose is held.
    Extrapolating,
    /// Frames have been missing for long: on the way to rest.
    Easing,
    /// Standing at ease; also before the first frame.
    Resting,
    /// Frames come again, and what is shown flows into them.
    Returning,
}

impl ConcealmentState {
    /// All of them, in the order of their numbers.
    pub const ALL: [Self; 5] = [
        Self::Live,
        Self::Extrapolating,
        Self::Easing,
        Self::Resting,
        Self::Returning,
    ];
}

/// The frame that is shown, and how motion went on there.
#[derive(Debug, Clone)]
struct Anchor {
    frame: MotionFrame,
    /// When it was first shown.
    since: Micros,
    /// A second.
    velocity: Change,
    /// Seconds from frame to frame.
    interval: f32,
}

/// What is left of where the person was shown before the frames came again; it decays.
#[derive(Debug, Clone)]
struct Remainder {
    change: Change,
    since: Micros,
    seconds: f32,
}

impl Remainder {
    fn left(&self, now: Micros) -> f32 {
        decayed(seconds(self.since, now) / self.seconds)
    }
}

/// Decides what to show.
///
/// # How far a pose moves between two calls
/// With e the way from the frame to what was shown when frames came again, T the blend's length (60 to 250 ms) and dt the
/// time between the calls, a pose moves by at most
/// - `Live`: what the frames themselves move by, or [`Self::LARGEST_TURN`] and 0.3 m if that is less: frames that differ by
///   more are blended;
/// - `Returning`: the same, the blend's part being at most pi/2 dt/T e (7 % of e for 250 ms at 90 Hz);
/// - `Extrapolating`: dt times the last velocity, in all 20 degrees and 0.15 m at most, and the blend's part;
/// - `Easing`: pi/2 dt/1.5 s of the way to rest (1.2 % at 90 Hz).
#[derive(Debug, Clone)]
pub struct MotionConcealment {
    skeleton: Skeleton,
    at_ease: MotionParams,
    /// The newest frame but one that was handed in, and the newest.
    previous: Option<MotionFrame>,
    newest: Option<MotionFrame>,
    /// Whether the newest has not been shown yet.
    fresh: bool,
    anchor: Option<Anchor>,
    /// While easing: where it began, and the way to rest.
    easing: Option<(MotionParams, Change)>,
    remainder: Option<Remainder>,
    shown: Option<(Micros, MotionParams)>,
}

impl MotionConcealment {
    /// The furthest that any joint turns between two calls 1/90 s apart, radians, whatever frames come.
    pub const LARGEST_TURN: f32 = LARGEST_STEP.radians;

    /// Shows a person at ease at the origin until the first frame.
    #[must_use]
    pub fn new(skeleton: &Skeleton) -> Self {
        Self {
            skeleton: skeleton.clone(),
            at_ease: at_ease(skeleton),
            previous: None,
            newest: None,
            fresh: false,
            anchor: None,
            easing: None,
            remainder: None,
            shown: None,
        }
    }

    /// Takes a frame that is due. Several may be handed in before the next [`Self::sample`], oldest first: the last is
    /// shown, the one before it tells velocities. A frame that is not finite is ignored.
    pub fn push(&mut self, frame: &MotionFrame) {
        if !frame.motion.is_finite() {
            return;
        }
        self.previous = self.newest.replace(frame.clone());
        self.fresh = true;
    }

    /// From one frame to the next, as they came lately.
    #[must_use]
    pub fn interval(&self) -> Duration {
        Duration::from_secs_f32(
            self.anchor
                .as_ref()
                .map_or(INTERVAL, |anchor| anchor.interval),
        )
    }

    /// What to show at `now`. Called with times that do not go back; does not allocate.
    pub fn sample(&mut self, now: Micros) -> (MotionParams, ConcealmentState) {
        let now = self.shown.as_ref().map_or(now, |(at, _)| now.max(*at));
        if std::mem::take(&mut self.fresh) {
            self.show_newest(now);
        }
        let (mut pose, mut state) = self.without_remainder(now);
        if let Some(remainder) = &self.remainder {
            match remainder.left(now) {
                0.0 => self.remainder = None,
                left => {
                    pose = remainder.change.applied(&pose, left);
                    if state == ConcealmentState::Live {
                        state = ConcealmentState::Returning;
                    }
                }
            }
        }
        self.shown = Some((now, pose.clone()));
        (pose, state)
    }

    /// The pose that frames, extrapolation and easing give.
    fn without_remainder(&mut self, now: Micros) -> (MotionParams, ConcealmentState) {
        let Some(anchor) = &self.anchor else {
            return (self.at_ease.clone(), ConcealmentState::Resting);
        };
        let age = seconds(anchor.since, now);
        let late = LATE * anchor.interval;
        if age <= late {
            return (anchor.frame.motion.clone(), ConcealmentState::Live);
        }
        if age <= SILENCE {
            return (
                extrapolated(anchor, age - late),
                ConcealmentState::Extrapolating,
            );
        }
        let (skeleton, at_ease) = (&self.skeleton, &self.at_ease);
        let (held, to_rest) = self.easing.get_or_insert_with(|| {
            let held = extrapolated(anchor, STANDSTILL);
            let to_rest = Change::between(&held, &standing_where(&held, at_ease, skeleton));
            (held, to_rest)
        });
        let share = 1.0 - decayed((age - SILENCE) / EASE);
        let state = if share < 1.0 {
            ConcealmentState::Easing
        } else {
            ConcealmentState::Resting
        };
        (to_rest.applied(held, share), state)
    }

    fn show_newest(&mut self, now: Micros) {
        let Some(newest) = &self.newest else {
            return;
        };
        let (mut velocity, mut interval) = (
            Change::NONE,
            self.anchor.as_ref().map_or(INTERVAL, |a| a.interval),
        );
        if let Some(previous) = &self.previous
            && newest.sequence > previous.sequence
            && newest.captured > previous.captured
        {
            let apart = seconds(previous.captured, newest.captured);
            if apart <= RECENT {
                velocity = Change::between(&previous.motion, &newest.motion).scaled(apart.recip());
            }
            let frames =
                f32::from(u16::try_from(newest.sequence - previous.sequence).unwrap_or(u16::MAX));
            interval = (apart / frames).clamp(INTERVALS[0], INTERVALS[1]);
        }
        if let Some((shown_at, shown)) = &self.shown {
            let silence = self
                .anchor
                .as_ref()
                .map_or(f32::INFINITY, |a| seconds(a.since, now));
            let follows = self.anchor.as_ref().is_some_and(|anchor| {
                let apart = newest
                    .captured
                    .0
                    .checked_sub(anchor.frame.captured.0)
                    .map_or(f32::INFINITY, |us| Duration::from_micros(us).as_secs_f32());
                apart <= (LATE * interval).max(STEP) && silence <= LATE * anchor.interval + TICK
            });
            let next = self.remainder.as_ref().map_or_else(
                || newest.motion.clone(),
                |remainder| {
                    remainder
                        .change
                        .applied(&newest.motion, remainder.left(now))
                },
            );
            let step = Change::between(shown, &next).extent();
            if !follows || step.over(&LARGEST_STEP) > 1.0 {
                let change = Change::between(&newest.motion, shown);
                let far = change.extent().over(&BLEND_SPEED);
                let wait = if follows { BLEND[1] } else { silence };
                let away = Duration::from_secs_f32(AWAY).as_micros();
                let earliest = now.0.saturating_sub(u64::try_from(away).unwrap_or(0));
                self.remainder = Some(Remainder {
                    change,
                    since: (*shown_at).max(Micros(earliest)),
                    seconds: wait.max(far).clamp(BLEND[0], BLEND[1]),
                });
            }
        }
        self.easing = None;
        self.anchor = Some(Anchor {
            frame: newest.clone(),
            since: now,
            velocity,
            interval,
        });
    }
}

/// The last motion going on for `late` seconds more.
///
/// The speed falls from all of it at 60 ms to none at 300 ms as a raised cosine; the way is its integral, softly bounded.
fn extrapolated(anchor: &Anchor, late: f32) -> MotionParams {
    let falling = STANDSTILL - FULL;
    let x = ((late - FULL) / falling).clamp(0.0, 1.0);
    let way = late.min(FULL) + 0.5 * falling * (x + (PI * x).sin() / PI);
    anchor
        .velocity
        .scaled(way)
        .saturated(&REACH)
        .applied(&anchor.frame.motion, 1.0)
}

/// The person at ease, with the heading of `held` and the middle between the ankles where it is there, on the floor. So
/// neither foot slides further than half of what they stood apart too far.
fn standing_where(
    held: &MotionParams,
    at_ease: &MotionParams,
    skeleton: &Skeleton,
) -> MotionParams {
    let between_ankles = |motion: &MotionParams| {
        let joints = skeleton.pose(motion);
        let left = joints.position(Joint::LeftAnkle);
        motion.root_translation + (left + joints.position(Joint::RightAnkle)) * 0.5
    };
    let mut rest = at_ease.clone();
    // The turn about the vertical that is in the hips' rotation (swing-twist).
    let hips = held.rotation(Joint::Pelvis);
    let twist = Quat::from_xyzw(0.0, hips.y, 0.0, hips.w);
    let heading = if twist.length_squared() > 1e-6 {
        twist.normalize()
    } else {
        Quat::IDENTITY
    };
    rest.set_rotation(Joint::Pelvis, heading * at_ease.rotation(Joint::Pelvis));
    let aside = between_ankles(held) - between_ankles(&rest);
    rest.root_translation += Vec3::new(aside.x, 0.0, aside.z);
    rest
}

/// 1 to 0 over x = 0..1, a half cosine: at rest at both ends, never steeper than pi/2.
fn decayed(x: f32) -> f32 {
    if x >= 1.0 {
        0.0
    } else {
        0.5 + 0.5 * (PI * x.max(0.0)).cos()
    }
}

fn seconds(from: Micros, to: Micros) -> f32 {
    Duration::from_micros(to.0.saturating_sub(from.0)).as_secs_f32()
}

#[cfg(test)]
mod tests;
