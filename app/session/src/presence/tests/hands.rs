use super::*;
use proptest::prelude::*;
use std::f32::consts::PI;

const HEAD: Vec3 = Vec3::new(0.0, 1.6, 0.0);

/// A room with a person 1.6 m before a viewer at the origin, who looks along -z.
struct Room {
    presence: Presence,
    people: Vec<Option<Standing>>,
    places: Vec<Affine3A>,
}

impl Room {
    fn of(count: usize) -> Self {
        let mut room = Self {
            presence: Presence::new(),
            people: vec![Some(standing_at(0.5, Vec2::new(0.3, -0.2))); count],
            places: Vec::new(),
        };
        room.show([Hand::default(); 2]);
        room
    }

    fn show(&mut self, hands: [Hand; 2]) {
        let viewer = Viewer {
            hands,
            ..viewer(HEAD, 0.0, 0.0)
        };
        let places = self.presence.update(&viewer, &self.people, FRAME);
        self.places = places.to_vec();
    }

    /// The same hand for so many frames.
    fn right(&mut self, hand: Hand, frames: usize) {
        for _ in 0..frames {
            self.show([Hand::default(), hand]);
        }
    }

    fn spot(&self, person: usize) -> Vec2 {
        let standing = self.people[person].expect("a person");
        seen(&self.places[person], &standing).0
    }

    fn faces(&self, person: usize) -> Vec2 {
        let standing = self.people[person].expect("a person");
        seen(&self.places[person], &standing).1
    }
}

fn grip(at: Vec3, yaw: f32) -> Hand {
    Hand {
        floor_from_grip: Some(pose(at, yaw, -0.6)),
        floor_from_aim: None,
        holds: true,
    }
}

fn aim(at: Vec3, yaw: f32, pitch: f32) -> Hand {
    Hand {
        floor_from_grip: None,
        floor_from_aim: Some(pose(at, yaw, pitch)),
        holds: true,
    }
}

/// At the person's shoulder.
const SHOULDER: Vec3 = Vec3::new(0.2, 1.3, -1.4);

#[test]
fn a_person_gripped_goes_as_the_hand_goes_and_stays_where_it_opens() {
    let mut room = Room::of(1);
    let before = room.spot(0);
    room.right(grip(SHOULDER, 0.0), 1);
    assert!(
        room.spot(0).abs_diff_eq(before, 1e-5),
        "closing moves no person"
    );
    let way = Vec3::new(0.3, 0.25, 0.2);
    room.right(grip(SHOULDER + way, 0.0), 40);
    let expected = before + way.xz();
    assert!(
        room.spot(0).abs_diff_eq(expected, 1e-4),
        "{} for {expected}",
        room.spot(0)
    );
    assert_eq!(room.places[0].translation.y, 0.0, "lifting lifts no person");
    let open = Hand {
        holds: false,
        ..grip(SHOULDER, 0.0)
    };
    room.right(open, 5);
    room.right(Hand::default(), 5);
    assert!(
        room.spot(0).abs_diff_eq(expected, 1e-4),
        "released: {}",
        room.spot(0)
    );
}

#[test]
fn a_person_gripped_turns_on_the_spot_as_the_hand_turns_about_y() {
    let mut room = Room::of(1);
    let (spot, faced) = (room.spot(0), room.faces(0));
    for k in 0..=20u8 {
        room.right(grip(SHOULDER, 0.05 * f32::from(k)), 2);
    }
    room.right(grip(SHOULDER, 1.0), 10);
    assert!(room.spot(0).abs_diff_eq(spot, 1e-4), "on the spot");
    // To the left by 1 rad: from facing +z towards +x.
    let expected = Vec2::new(1.0_f32.sin(), 1.0_f32.cos());
    assert!(faced.abs_diff_eq(Vec2::Y, 1e-4), "at first: {faced}");
    assert!(
        room.faces(0).abs_diff_eq(expected, 1e-3),
        "{}",
        room.faces(0)
    );
}

#[test]
fn a_hand_that_was_closed_before_or_is_out_of_reach_holds_no_person() {
    let mut room = Room::of(1);
    let before = room.places.clone();
    let away = Vec3::new(0.9, 1.0, -0.6);
    room.right(grip(away, 0.0), 3);
    room.right(grip(SHOULDER, 0.0), 3);
    room.right(grip(SHOULDER + Vec3::X * 0.3, 0.4), 20);
    assert_eq!(room.places, before, "it closed on no person");
    room.right(Hand::default(), 1);
    room.right(aim(HEAD, -1.2, 0.0), 3);
    room.right(aim(HEAD, 0.0, 0.0), 30);
    assert_eq!(room.places, before, "it closed pointing elsewhere");
}

#[test]
fn a_person_held_by_a_ray_stays_where_the_ray_is() {
    let mut room = Room::of(1);
    let hand = Vec3::new(0.0, 1.2, 0.0);
    room.right(aim(hand, 0.0, -0.1), 1);
    // A shallow ray swings by 0.3 rad to the left: so does the person around the hand.
    for k in 1..=30u8 {
        room.right(aim(hand, 0.01 * f32::from(k), -0.1), 2);
    }
    room.right(aim(hand, 0.3, -0.1), 30);
    let expected = Vec2::new(-0.3_f32.sin(), -0.3_f32.cos()) * 1.6;
    assert!(
        room.spot(0).abs_diff_eq(expected, 0.02),
        "{} for {expected}",
        room.spot(0)
    );
    assert!(
        room.faces(0).dot(-expected.normalize()) > 0.999,
        "still facing the hand"
    );
}

#[test]
fn a_ray_that_comes_down_brings_the_person_nearer_in_the_measure_of_its_point_on_the_floor() {
    let mut room = Room::of(1);
    let hand = Vec3::new(0.0, 1.2, 0.0);
    let pitch = |radius: f32| -(1.2 / radius).atan();
    room.right(aim(hand, 0.0, pitch(3.2)), 1);
    for k in 1..=30u8 {
        room.right(aim(hand, 0.0, pitch(3.2 - 0.05 * f32::from(k))), 2);
    }
    room.right(aim(hand, 0.0, pitch(1.7)), 30);
    // 1.6 m of 3.2 m, now of 1.7 m.
    let spot = room.spot(0);
    assert!(spot.abs_diff_eq(Vec2::new(0.0, -0.85), 0.02), "{spot}");
}

#[test]
fn a_ray_above_the_horizon_drags_level_and_the_further_the_more() {
    let mut room = Room::of(1);
    let hand = Vec3::new(0.0, 1.2, 0.0);
    room.right(aim(hand, 0.0, 0.05), 1);
    room.right(aim(hand, 0.0, 0.3), 30);
    assert!(
        room.spot(0).abs_diff_eq(Vec2::new(0.0, -1.6), 1e-3),
        "up is no way to go"
    );
    room.right(aim(hand + Vec3::NEG_Z * 0.3, 0.0, 0.3), 60);
    let gone = -1.6 - room.spot(0).y;
    assert!((0.3 * 2.0..0.3 * 4.0).contains(&gone), "{gone} m for 0.3 m");
}

#[test]
fn a_second_hand_on_a_person_is_ignored_and_another_person_can_be_held_by_it() {
    let mut room = Room::of(2);
    let (first, second) = (room.spot(0), room.spot(1));
    let on = |spot: Vec2| Vec3::new(spot.x, 1.2, spot.y);
    room.show([grip(on(first), 0.0), grip(on(first) + Vec3::Z * 0.1, 0.0)]);
    for _ in 0..30 {
        room.show([grip(on(first), 0.0), grip(on(first) + Vec3::Z * 0.4, 0.0)]);
    }
    assert!(
        room.spot(0).abs_diff_eq(first, 1e-5),
        "the second hand pulled"
    );
    room.show([grip(on(first), 0.0), Hand::default()]);
    room.show([grip(on(first), 0.0), grip(on(second), 0.0)]);
    for _ in 0..30 {
        room.show([grip(on(first), 0.0), grip(on(second) + Vec3::X * 0.4, 0.0)]);
    }
    let expected = second + Vec2::X * 0.4;
    assert!(
        room.spot(1).abs_diff_eq(expected, 1e-4),
        "each hand its own"
    );
}

#[test]
fn a_hand_lost_from_sight_moves_no_person_and_takes_up_anew_where_it_is_found_far_away() {
    let mut room = Room::of(1);
    let before = room.spot(0);
    let lost = Hand {
        holds: true,
        ..Hand::default()
    };
    room.right(grip(SHOULDER, 0.0), 2);
    room.right(lost, 20);
    assert!(room.spot(0).abs_diff_eq(before, 1e-5), "lost");
    let elsewhere = SHOULDER + Vec3::X * 2.0;
    room.right(grip(elsewhere, 0.0), 20);
    assert!(room.spot(0).abs_diff_eq(before, 1e-5), "found elsewhere");
    room.right(grip(elsewhere + Vec3::X * 0.2, 0.0), 20);
    let expected = before + Vec2::X * 0.2;
    assert!(
        room.spot(0).abs_diff_eq(expected, 1e-4),
        "still held: {}",
        room.spot(0)
    );
}

#[test]
fn no_person_is_taken_further_than_eight_metres() {
    let mut room = Room::of(1);
    let hand = |z: f32| aim(Vec3::new(0.0, 1.2, z), 0.0, 0.0);
    room.right(hand(0.0), 1);
    for k in 0..200u8 {
        room.right(hand(-0.1 * f32::from(k)), 5);
    }
    let away = room.spot(0).length();
    assert!((7.9..8.001).contains(&away), "{away} m");
}

/// What a tracker may say: close by, far, absurd, nothing.
fn any_pose() -> impl Strategy<Value = Option<Affine3A>> {
    let tracked = (
        prop::array::uniform3(-3.0f32..3.0),
        prop::array::uniform3(-PI..PI),
    )
        .prop_map(|(at, [yaw, pitch, roll])| {
            Some(
                pose(Vec3::from_array(at), yaw, pitch)
                    * Affine3A::from_quat(Quat::from_rotation_z(roll)),
            )
        });
    let absurd = prop::sample::select(vec![
        Affine3A::ZERO,
        Affine3A::NAN,
        Affine3A::from_translation(Vec3::splat(f32::INFINITY)),
        Affine3A::from_translation(Vec3::splat(1e20)),
        Affine3A::from_scale(Vec3::splat(1e-20)),
        Affine3A::IDENTITY,
    ]);
    prop_oneof![6 => tracked, 1 => absurd.prop_map(Some), 1 => Just(None)]
}

/// Hands that mostly go on from where they were, as hands do.
fn any_hand() -> impl Strategy<Value = (Option<Affine3A>, Option<Affine3A>, Vec3, bool)> {
    let drift = prop::array::uniform3(-0.1f32..0.1).prop_map(Vec3::from_array);
    (any_pose(), any_pose(), drift, prop::bool::weighted(0.9))
}

proptest! {
    #[test]
    fn whatever_hands_and_heads_do_people_stay_on_the_floor_at_true_scale_and_within_bounds(
        script in prop::collection::vec((any_pose(), any_hand(), any_hand(), 1u8..20), 1..30),
        count in 1usize..4,
    ) {
        let mut presence = Presence::new();
        let standing = standing_at(0.4, Vec2::ONE);
        let people = vec![Some(standing); count];
        let mut before: Option<Vec<Vec2>> = None;
        // As far from the origin as any head could be that placed a person, and from there as far as hands take people.
        let mut furthest = 2.0_f32;
        for (head, left, right, frames) in script {
            for frame in 0..frames {
                let hand = |(grip, aim, drift, holds): &(Option<Affine3A>, Option<Affine3A>, Vec3, bool)| {
                    let gone = Affine3A::from_translation(*drift * f32::from(frame));
                    Hand {
                        floor_from_grip: grip.map(|grip| gone * grip),
                        floor_from_aim: aim.map(|aim| gone * aim),
                        holds: *holds,
                    }
                };
                let viewer = Viewer { floor_from_head: head, hands: [hand(&left), hand(&right)] };
                let known = super::super::viewer::trusted(head).map(|head| head.translation.xz());
                furthest = furthest.max(known.map_or(0.0, Vec2::length) + 8.0);
                let places = presence.update(&viewer, &people, FRAME);
                let mut spots = Vec::new();
                for place in places {
                    prop_assert!(place.is_finite(), "{place:?}");
                    prop_assert_eq!(place.translation.y, 0.0, "the floor's height");
                    prop_assert_eq!(place.matrix3.y_axis.to_array(), [0.0, 1.0, 0.0], "upright");
                    prop_assert!((place.matrix3.determinant() - 1.0).abs() < 1e-5, "rigid");
                    let spot = seen(place, &standing).0;
                    prop_assert!(spot.length() <= furthest + 1e-2, "{spot} is beyond {furthest} m");
                    spots.push(spot);
                }
                if let (Some(before), true) = (&before, known.is_none() || frame > 0) {
                    for (from, to) in before.iter().zip(&spots) {
                        // 4 m a second.
                        prop_assert!(from.distance(*to) <= 4.0 / 90.0 + 1e-3, "{from} to {to}");
                    }
                }
                before = Some(spots);
            }
        }
    }
}
