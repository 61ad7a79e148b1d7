//! Seated people: a person who is sent standing sits on a chair. Legs and pelvis are the chair's, everything above is as sent.

use app_pipeline::lanes::{MotionSource, Pose, Visibility};
use app_pipeline::timeline::DisplayLag;
use glam::{Quat, Vec2, Vec3, Vec3Swizzles};
use spmm3::{Joint, LEGS, MotionParams, Skeleton, bend_leg};
use std::time::{Duration, Instant};

/// Height of the chair's seat, metres.
const SEAT: f32 = 0.45;
/// What is between the seat and the hip joints, in lengths of the thigh.
const CUSHION: f32 = 0.2;
/// The knees are no further below or above the hips, in lengths of the thigh: small people get a lower chair, tall ones
/// stretch their legs.
const STEEPEST: f32 = 0.5;
/// How far the feet stand before the knees, in lengths of the shank.
const FEET_AHEAD: f32 = 0.06;
/// How far the feet stand apart, in hip widths.
const FEET_APART: f32 = 1.35;
/// Turn of each foot outwards, radians: 7 degrees.
const TOES_OUT: f32 = 0.12;
/// Share of the pelvis' lean that is left.
const LEAN: f32 = 0.25;
/// Fastest turn on the chair, radians a second: no person's hips turn faster, but an angle about y may jump where the sent
/// pelvis passes head down.
const TURN_SPEED: f32 = 8.0;

/// A source of poses whose person sits, or stands as sent.
///
/// The pelvis stays where it first was over the floor, turns about y as sent, leans by a quarter, and keeps the height of a
/// seat of 0.45 m (less for short legs); the feet stand flat before it. Upper body, head, hands and face are as sent.
#[derive(Debug, Clone)]
pub struct Seated<S> {
    source: S,
    seat: Option<Seat>,
}

impl<S> Seated<S> {
    /// The person from `source`, who has this skeleton, sits.
    pub fn new(source: S, skeleton: &Skeleton) -> Self {
        Self {
            source,
            seat: Some(Seat::new(skeleton)),
        }
    }

    /// The person is as sent.
    pub fn as_sent(source: S) -> Self {
        Self { source, seat: None }
    }

    /// The source of poses.
    pub fn source(&self) -> &S {
        &self.source
    }

    /// The source of poses, back.
    pub fn into_source(self) -> S {
        self.source
    }
}

impl<S: MotionSource> MotionSource for Seated<S> {
    fn next(&mut self, longest: Duration) -> Option<Pose> {
        let mut pose = self.source.next(longest)?;
        if let Some(seat) = &mut self.seat {
            seat.take(&mut pose.motion, pose.times.due);
        }
        Some(pose)
    }

    fn is_over(&self) -> bool {
        self.source.is_over()
    }

    fn display_lag(&self) -> DisplayLag {
        self.source.display_lag()
    }

    fn visibility(&self) -> Visibility {
        self.source.visibility()
    }
}

/// A chair that fits a skeleton, and who sits on it.
#[derive(Debug, Clone)]
pub(super) struct Seat {
    skeleton: Skeleton,
    /// Of the pelvis joint, metres above the floor.
    height: f32,
    /// Each ankle relative to the floor point below the pelvis, for a person who faces +z, metres.
    ankles: [Vec3; 2],
    sitting: Option<Sitting>,
}

#[derive(Debug, Clone, Copy)]
struct Sitting {
    /// The root's x and z.
    spot: Vec2,
    /// Turn about y from +z, radians.
    heading: f32,
    at: Instant,
}

impl Seat {
    pub(super) fn new(skeleton: &Skeleton) -> Self {
        let rest = |joint: Joint| skeleton.rest_positions()[joint.index()];
        let mean = |of: &dyn Fn([Joint; 3]) -> f32| 0.5 * LEGS.into_iter().map(of).sum::<f32>();
        let thigh = mean(&|[_, knee, _]| skeleton.rest_offset(knee).length());
        let shank = mean(&|[_, _, ankle]| skeleton.rest_offset(ankle).length());
        let knees = shank + mean(&|[_, _, ankle]| rest(ankle).y);
        let hips = (SEAT + CUSHION * thigh).min(knees + STEEPEST * thigh);
        let pelvis_above = mean(&|[hip, _, _]| -skeleton.rest_offset(hip).y);
        let rise = (knees - hips).clamp(-STEEPEST * thigh, STEEPEST * thigh);
        let ahead = (thigh * thigh - rise * rise).max(0.0).sqrt() + FEET_AHEAD * shank;
        let ankles = LEGS.map(|[hip, _, ankle]| {
            let hip = skeleton.rest_offset(hip);
            Vec3::new(hip.x * FEET_APART, rest(ankle).y, hip.z + ahead)
        });
        Self {
            skeleton: skeleton.clone(),
            height: hips + pelvis_above,
            ankles,
            sitting: None,
        }
    }

    /// Makes `motion`, which is due at this moment, one of a person who sits.
    pub(super) fn take(&mut self, motion: &mut MotionParams, due: Instant) {
        if !motion.is_finite() {
            return;
        }
        let (sent, lean) = turn_and_lean(motion.rotation(Joint::Pelvis));
        let sitting = self.sitting.get_or_insert_with(|| Sitting {
            spot: motion.root_translation.xz(),
            heading: sent.unwrap_or(0.0),
            at: due,
        });
        let seconds = due.saturating_duration_since(sitting.at).as_secs_f32();
        let most = TURN_SPEED * seconds;
        let turn = sent.map_or(0.0, |sent| super::place::wrapped(sent - sitting.heading));
        sitting.heading = super::place::wrapped(sitting.heading + turn.clamp(-most, most));
        sitting.at = due;

        let facing = Quat::from_rotation_y(sitting.heading);
        let pelvis = facing * Quat::from_scaled_axis(lean * LEAN);
        let rest = self.skeleton.rest_positions()[Joint::Pelvis.index()];
        let floor = sitting.spot + rest.xz();
        motion.root_translation = Vec3::new(sitting.spot.x, self.height - rest.y, sitting.spot.y);
        motion.set_rotation(Joint::Pelvis, pelvis);
        for ((leg, ankle), out) in LEGS.into_iter().zip(self.ankles).zip([1.0, -1.0]) {
            bend_leg(
                motion,
                &self.skeleton,
                leg,
                (Vec3::new(floor.x, self.height, floor.y), pelvis),
                (
                    Vec3::new(floor.x, 0.0, floor.y) + facing * ankle,
                    facing * Quat::from_rotation_y(out * TOES_OUT),
                ),
                facing * Vec3::new(0.1 * out, 1.0, 1.0),
            );
        }
        for toes in [Joint::LeftFoot, Joint::RightFoot] {
            motion.set_rotation(toes, Quat::IDENTITY);
        }
    }
}

/// A rotation's turn about y, if it has one (head down there is none), and what it leans by afterwards: an axis in the
/// ground plane times the sine of the angle, which dies away head down, where the axis is anybody's guess.
fn turn_and_lean(rotation: Quat) -> (Option<f32>, Vec3) {
    let about_y = Vec2::new(rotation.y, rotation.w);
    if about_y.length_squared() < 1e-6 {
        return (None, Vec3::ZERO);
    }
    let turn = 2.0 * rotation.y.atan2(rotation.w);
    let lean = Quat::from_rotation_y(-turn) * rotation;
    (Some(turn), Vec3::new(lean.x, 0.0, lean.z) * (2.0 * lean.w))
}
