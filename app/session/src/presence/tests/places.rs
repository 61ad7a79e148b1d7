use super::*;
use proptest::prelude::*;
use std::f32::consts::{FRAC_PI_2, PI};

const EYE: Vec3 = Vec3::new(0.4, 1.6, -0.2);

#[test]
fn a_person_first_stands_before_the_viewer_and_faces_them() {
    for (heading, at) in [
        (0.0, Vec2::ZERO),
        (2.0, Vec2::new(3.0, -1.0)),
        (-3.1, Vec2::NEG_ONE),
    ] {
        let standing = standing_at(heading, at);
        let mut presence = Presence::new();
        let before = presence.update(&Viewer::default(), &[Some(standing)], FRAME);
        assert_eq!(before.len(), 1, "without a head no person is placed");
        let placed = presence.update(&viewer(EYE, 0.7, -0.2), &[Some(standing)], FRAME)[0];
        let (spot, faces) = seen(&placed, &standing);
        // Turned to the left by 0.7, the viewer looks along (-sin, -cos).
        let looks = Vec2::new(-0.7_f32.sin(), -0.7_f32.cos());
        let expected = EYE.xz() + looks * 1.6;
        assert!(spot.abs_diff_eq(expected, 1e-4), "{spot} for {expected}");
        assert!(faces.abs_diff_eq(-looks, 1e-4), "{faces} for {}", -looks);
    }
}

#[test]
fn a_person_with_a_place_stays_there_while_the_viewer_goes_about() {
    let mut presence = Presence::new();
    let here = [Some(standing_at(0.3, Vec2::ZERO))];
    let first = presence.update(&viewer(EYE, 0.0, 0.0), &here, FRAME)[0];
    let later = presence.update(&viewer(-EYE, 2.0, 0.4), &here, FRAME)[0];
    assert_eq!(first, later, "the viewer alone has moved");
    let unseen = presence.update(&Viewer::default(), &[None], FRAME)[0];
    assert_eq!(first, unseen, "nothing is tracked");
    let walked = [Some(standing_at(0.3, Vec2::new(0.0, 1.0)))];
    let walks = presence.update(&viewer(EYE, 0.0, 0.0), &walked, FRAME)[0];
    assert_eq!(first, walks, "the person walks as they walk");
}

#[test]
fn several_people_stand_in_an_arc_an_arms_length_apart_each_facing_the_viewer() {
    let people: Vec<Option<Standing>> = (0..5u8)
        .map(|k| Some(standing_at(f32::from(k), Vec2::splat(f32::from(k)))))
        .collect();
    let mut presence = Presence::new();
    let placed = presence.update(&viewer(EYE, 0.0, 0.0), &people, FRAME);
    let stand: Vec<(Vec2, Vec2)> = placed
        .iter()
        .zip(&people)
        .map(|(place, standing)| seen(place, &standing.expect("all are there")))
        .collect();
    for (spot, faces) in &stand {
        let to_viewer = EYE.xz() - *spot;
        assert!((to_viewer.length() - 1.6).abs() < 1e-3, "{spot}");
        assert!(faces.dot(to_viewer.normalize()) > 0.9999, "{faces}");
    }
    for pair in stand.windows(2) {
        let apart = pair[0].0.distance(pair[1].0);
        assert!((apart - 0.9).abs() < 1e-3, "{apart} m");
        assert!(pair[1].0.angle_to(pair[0].0).is_finite(), "a place");
    }
    let [first, last] = [stand[0].0, stand[4].0];
    assert!(first.x < EYE.x && last.x > EYE.x, "from left to right");
    let middle = (stand[2].0 - EYE.xz()).abs_diff_eq(Vec2::new(0.0, -1.6), 1e-3);
    assert!(middle, "the arc's middle is straight ahead: {}", stand[2].0);
}

#[test]
fn a_person_who_joins_later_finds_a_free_place_and_moves_no_other() {
    let mut presence = Presence::new();
    let person = Some(standing_at(0.0, Vec2::ZERO));
    let head = viewer(EYE, 0.0, 0.0);
    let alone = presence.update(&head, &[person], FRAME)[0];
    let both = presence.update(&head, &[person, None], FRAME)[0];
    let placed = presence.update(&head, &[person, person], FRAME);
    assert_eq!((alone, both), (placed[0], placed[0]), "the first stays");
    let apart = placed[0].translation.distance(placed[1].translation);
    assert!((0.6..1.3).contains(&apart), "{apart} m apart");
}

#[test]
fn recentring_puts_all_people_before_the_viewer_again() {
    let here = [Some(standing_at(1.0, Vec2::ONE))];
    let mut presence = Presence::new();
    presence.update(&viewer(EYE, 0.0, 0.0), &here, FRAME);
    presence.recentre();
    let again = presence.update(&viewer(EYE, 2.0, 0.0), &here, FRAME)[0];
    let mut fresh = Presence::new();
    let expected = fresh.update(&viewer(EYE, 2.0, 0.0), &here, FRAME)[0];
    assert_eq!(again, expected, "as at the start");
}

#[test]
fn looking_straight_up_or_down_people_stand_where_the_body_is_turned() {
    for pitch in [-FRAC_PI_2, -1.55, 1.55, FRAC_PI_2] {
        for yaw in [0.0, 1.0, -2.5] {
            let here = [Some(standing_at(0.0, Vec2::ZERO))];
            let mut presence = Presence::new();
            let placed = presence.update(&viewer(EYE, yaw, pitch), &here, FRAME)[0];
            let (spot, _) = seen(&placed, &here[0].expect("a person"));
            let expected = EYE.xz() + Vec2::new(-yaw.sin(), -yaw.cos()) * 1.6;
            assert!(spot.abs_diff_eq(expected, 1e-3), "{yaw} {pitch}: {spot}");
        }
    }
}

#[test]
fn a_pose_that_cannot_be_is_as_good_as_none() {
    let mut motion = motion(0.0, Vec2::ZERO);
    motion.root_translation.x = f32::NAN;
    assert_eq!(Standing::of(skeleton(), &motion), None, "no number");
    motion.root_translation.x = 1e30;
    assert_eq!(Standing::of(skeleton(), &motion), None, "out of this world");
}

proptest! {
    #[test]
    fn wherever_a_head_is_people_are_put_rigidly_on_the_floor(
        at in prop::array::uniform3(-50.0f32..50.0),
        turn in prop::array::uniform3(-PI..PI),
        heading in -PI..PI,
        walked in prop::array::uniform2(-20.0f32..20.0),
        count in 1usize..8,
    ) {
        let [yaw, pitch, roll] = turn;
        let head = pose(Vec3::from_array(at), yaw, pitch)
            * Affine3A::from_quat(Quat::from_rotation_z(roll));
        let viewer = Viewer { floor_from_head: Some(head), ..Viewer::default() };
        let standing = standing_at(heading, Vec2::from_array(walked));
        let people = vec![Some(standing); count];
        let mut presence = Presence::new();
        for place in presence.update(&viewer, &people, FRAME) {
            prop_assert!(place.is_finite(), "{place:?}");
            let (spot, faces) = seen(place, &standing);
            let to_viewer = head.translation.xz() - spot;
            prop_assert!((to_viewer.length() - 1.6).abs() < 1e-3, "{to_viewer}");
            prop_assert!(faces.dot(to_viewer.normalize()) > 0.999, "{faces}");
            prop_assert_eq!(place.translation.y, 0.0, "the floor's height");
            prop_assert_eq!(place.matrix3.y_axis.to_array(), [0.0, 1.0, 0.0], "upright");
            prop_assert!((place.matrix3.determinant() - 1.0).abs() < 1e-5, "true to scale");
        }
    }
}

#[test]
fn the_first_person_apart_from_the_viewer_is_the_first_whose_pose_is_known() {
    let known = Some(standing_at(0.0, Vec2::ZERO));
    for (people, own, first) in [
        (&[known, known][..], 0, Some(0)),
        (&[known, known], 1, Some(1)),
        (&[known, None, known], 1, Some(2)),
        (&[known, None], 1, None),
        (&[None, known], 0, Some(1)),
        (&[], 1, None),
    ] {
        assert_eq!(first_apart(people, own), first, "{own} of {}", people.len());
    }
}
