//! People in the viewer's hands: who is held by which hand, and where it takes them.

use super::place::{Place, wrapped};
use super::standing::Standing;
use super::viewer::trusted;
use glam::{Affine3A, Quat, Vec2, Vec3, Vec3Swizzles};
use renderer_openxr::input::Hand;
use spmm3::Joint;

/// A hand reaches a person this close to the line from pelvis to head, metres.
const REACH: f32 = 0.45;
/// No person is taken further from the viewer, metres.
const MOST_AWAY: f32 = 8.0;
/// Fastest way along the floor, metres a second.
const SPEED: f32 = 4.0;
/// Fastest turn, radians a second.
const TURN_SPEED: f32 = 6.0;
/// Frames do not lie further apart, seconds: after a pause people go on where they were.
const LONGEST_FRAME: f32 = 0.1;
/// From one frame to the next a hand does not move further, metres, nor turn further, radians: it was found again elsewhere.
const JUMP: f32 = 0.5;
const TURN_JUMP: f32 = 1.0;
/// As far as a ray's point on the floor is followed, metres: beyond, a trembling hand would move it by metres.
const FAR: f32 = 6.0;
/// A ray this steep (length of its shadow) points to no side.
const STEEP: f32 = 0.05;
/// An arm's length, metres: people further away move further than the hand, up to so many times.
const ARM: f32 = 0.6;
const MOST_GAIN: f32 = 4.0;

/// What the two hands hold.
#[derive(Debug, Clone, Default)]
pub(super) struct Grabs {
    hands: [Grasp; 2],
    /// Where the viewer last stood, x and z.
    viewer: Vec2,
}

#[derive(Debug, Clone, Copy, Default)]
struct Grasp {
    closed: bool,
    hold: Option<Grab>,
}

#[derive(Debug, Clone, Copy)]
struct Grab {
    person: usize,
    by_ray: bool,
    /// The grip or the aim when it was last tracked.
    last: Affine3A,
    /// How far the person is behind the hand, metres (x, z) and radians.
    ahead: Vec2,
    turn_ahead: f32,
}

impl Grabs {
    /// Moves who is held.
    pub(super) fn update(
        &mut self,
        viewer: Option<Vec2>,
        hands: &[Hand; 2],
        places: &mut [Option<Place>],
        people: &[Option<Standing>],
        seconds: f32,
    ) {
        self.viewer = viewer.unwrap_or(self.viewer);
        for (k, hand) in hands.iter().enumerate() {
            let Some(mut grasp) = self.hands.get(k).copied() else {
                continue;
            };
            let closes = hand.holds && !grasp.closed;
            grasp.closed = hand.holds;
            if closes {
                let other = self.hands.get(1 - k).and_then(|other| other.hold);
                grasp.hold = taken(hand, places, people, other.map(|hold| hold.person));
            } else if !hand.holds {
                grasp.hold = None;
            } else if let Some(hold) = &mut grasp.hold {
                let person = people.get(hold.person).and_then(Option::as_ref);
                let place = places.get_mut(hold.person).and_then(Option::as_mut);
                if let (Some(standing), Some(place)) = (person, place) {
                    hold.carry(hand, standing, place, self.viewer, seconds);
                }
            }
            if let Some(kept) = self.hands.get_mut(k) {
                *kept = grasp;
            }
        }
    }
}

/// Whom a hand that closes now takes hold of: the nearest in its reach, else the first that it points at.
fn taken(
    hand: &Hand,
    places: &[Option<Place>],
    people: &[Option<Standing>],
    held: Option<usize>,
) -> Option<Grab> {
    let bodies = || {
        let known = places.iter().zip(people).enumerate();
        known.filter_map(|(person, (place, standing))| {
            let (floor_from_person, standing) =
                (place.as_ref()?.floor_from_person(), standing.as_ref()?);
            let at = |joint| floor_from_person.transform_point3(standing.joint(joint));
            (held != Some(person)).then(|| (person, [at(Joint::Pelvis), at(Joint::Head)]))
        })
    };
    let hold = |last: Affine3A, by_ray: bool, (_, person): (f32, usize)| Grab {
        person,
        by_ray,
        last,
        ahead: Vec2::ZERO,
        turn_ahead: 0.0,
    };
    let nearest = |(a, _): &(f32, usize), (b, _): &(f32, usize)| a.total_cmp(b);
    let by_grip = trusted(hand.floor_from_grip).and_then(|grip| {
        bodies()
            .map(|(person, body)| (from_line(grip.translation.into(), body), person))
            .filter(|(distance, _)| *distance <= REACH)
            .min_by(nearest)
            .map(|found| hold(grip, false, found))
    });
    by_grip.or_else(|| {
        let aim = trusted(hand.floor_from_aim)?;
        bodies()
            .filter_map(|(person, body)| Some((along_ray(&aim, body)?, person)))
            .min_by(nearest)
            .map(|found| hold(aim, true, found))
    })
}

impl Grab {
    fn carry(
        &mut self,
        hand: &Hand,
        standing: &Standing,
        place: &mut Place,
        viewer: Vec2,
        seconds: f32,
    ) {
        let now = if self.by_ray {
            hand.floor_from_aim
        } else {
            hand.floor_from_grip
        };
        let Some(now) = trusted(now) else {
            return;
        };
        let before = std::mem::replace(&mut self.last, now);
        let [from, to] = [before, now].map(|pose| Quat::from_mat3a(&pose.matrix3).normalize());
        let jumped = now.translation.distance(before.translation) > JUMP
            || from.angle_between(to) > TURN_JUMP;
        if jumped {
            (self.ahead, self.turn_ahead) = (Vec2::ZERO, 0.0);
            return;
        }
        let spot = place.spot(standing);
        let goal = spot + self.ahead;
        let way = if self.by_ray {
            dragged(&before, &now, goal)
        } else {
            (now.translation - before.translation).xz()
        };
        // Who stood further away is not pulled nearer for that.
        let most = MOST_AWAY.max(spot.distance(viewer));
        let goal = viewer + (goal + way - viewer).clamp_length_max(most);
        let seconds = seconds.clamp(0.0, LONGEST_FRAME);
        let step = (goal - spot).clamp_length_max(SPEED * seconds);
        let turn = wrapped(self.turn_ahead + about_y(to * from.conjugate()));
        let turn_step = turn.clamp(-TURN_SPEED * seconds, TURN_SPEED * seconds);
        *place = place.moved(standing, step, turn_step);
        self.ahead = goal - spot - step;
        self.turn_ahead = turn - turn_step;
    }
}

/// How far a ray that moved takes a person who is to be at `goal`: x and z, metres.
fn dragged(before: &Affine3A, now: &Affine3A, goal: Vec2) -> Vec2 {
    let (Some(from), Some(to)) = (swept(before), swept(now)) else {
        return Vec2::ZERO;
    };
    let distance = goal.distance(before.translation.xz());
    // As the point where the ray passes the person, not its point on the floor behind them.
    let share = (distance / from.length().max(f32::MIN_POSITIVE)).min(1.0);
    let hand = (now.translation - before.translation).xz();
    hand * (distance / ARM).clamp(1.0, MOST_GAIN) + (to - from) * share
}

/// From the hand to where its ray meets the floor: x and z, metres. Where that is far or nowhere, as far as is followed.
/// Nothing where it points straight up.
fn swept(floor_from_aim: &Affine3A) -> Option<Vec2> {
    let ray = -floor_from_aim.matrix3.z_axis.normalize();
    let height = floor_from_aim.translation.y;
    if ray.y < 0.0 && height > 0.0 {
        let way = ray.xz() * (height / -ray.y);
        if way.length() <= FAR {
            return Some(way);
        }
    }
    (ray.xz().length() >= STEEP).then(|| ray.xz().normalize() * FAR)
}

/// The part of a small rotation that is about y, radians.
fn about_y(rotation: Quat) -> f32 {
    wrapped(2.0 * rotation.y.atan2(rotation.w))
}

/// Distance of a point from the line between two others.
fn from_line(point: Vec3, [from, to]: [Vec3; 2]) -> f32 {
    let line = to - from;
    let share = (point - from).dot(line) / line.length_squared().max(f32::MIN_POSITIVE);
    point.distance(from + line * share.clamp(0.0, 1.0))
}

/// How far along an aim's ray it passes the line between two points within reach, if it does.
fn along_ray(aim: &Affine3A, [from, to]: [Vec3; 2]) -> Option<f32> {
    let origin = Vec3::from(aim.translation);
    let ray = Vec3::from(-aim.matrix3.z_axis.normalize());
    let (line, apart) = (to - from, origin - from);
    // The nearest points of two lines (Ericson, Real-Time Collision Detection, 5.1.9), the ray without an end.
    let length = line.length_squared().max(f32::MIN_POSITIVE);
    let (along, c) = (ray.dot(line), ray.dot(apart));
    let f = line.dot(apart);
    let crossing = length - along * along;
    let t = if crossing > 1e-6 * length {
        ((along * f - c * length) / crossing).max(0.0)
    } else {
        0.0
    };
    let share = ((along * t + f) / length).clamp(0.0, 1.0);
    let t = (along * share - c).max(0.0);
    let passes = (origin + ray * t).distance(from + line * share);
    (passes <= REACH).then_some(t)
}
