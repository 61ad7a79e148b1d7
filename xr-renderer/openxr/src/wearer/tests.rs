use super::*;
use crate::ext::body_tracking::{BODY_JOINTS, BodyJoint};
use crate::ext::face_tracking::FaceSource;
use crate::fake::{FakeRuntime, posef};
use glam::{Quat, Vec3};
use openxr::SpaceLocationFlags;
use openxr::sys::{self, Result as XrResult};
use std::time::Duration;

/// Joints without legs.
const UPPER: usize = 70;
/// Each extension's own name, and the calls that it makes: to make its tracker, to read it, to end it.
const EXTENSIONS: [(&str, [&str; 3]); 3] = [
    (
        "XR_FB_body_tracking",
        [
            "xrCreateBodyTrackerFB",
            "xrLocateBodyJointsFB",
            "xrDestroyBodyTrackerFB",
        ],
    ),
    (
        "XR_FB_face_tracking2",
        [
            "xrCreateFaceTracker2FB",
            "xrGetFaceExpressionWeights2FB",
            "xrDestroyFaceTracker2FB",
        ],
    ),
    (
        "XR_FB_eye_tracking_social",
        [
            "xrCreateEyeTrackerFB",
            "xrGetEyeGazesFB",
            "xrDestroyEyeTrackerFB",
        ],
    ),
];

/// Somewhere else for each joint, turned.
fn place(joint: usize) -> Affine3A {
    let share = joint as f32 / 84.0;
    Affine3A::from_rotation_translation(
        Quat::from_rotation_y(share) * Quat::from_rotation_x(2.0 * share),
        Vec3::new(share, 1.0 + share, -2.0 * share),
    )
}

struct Scene {
    trackers: WearerTrackers,
    floor: Space,
    now: Instant,
    /// Both eyes', by other means.
    gaze: Option<Affine3A>,
    fake: FakeRuntime,
}

impl Scene {
    /// A wearer whose body, face and eyes are known.
    fn of(fake: FakeRuntime) -> Self {
        fake.set(|world| {
            let known = SpaceLocationFlags::ORIENTATION_VALID | SpaceLocationFlags::POSITION_VALID;
            let both =
                SpaceLocationFlags::ORIENTATION_TRACKED | SpaceLocationFlags::POSITION_TRACKED;
            let watched = &mut world.watched;
            (watched.body_active, watched.body_confidence) = (true, 0.75);
            for (joint, location) in watched.body.iter_mut().enumerate() {
                let location_flags = if joint % 2 == 0 { known | both } else { known };
                let pose = posef(&place(joint));
                *location = sys::BodyJointLocationFB {
                    location_flags,
                    pose,
                };
            }
            for (joint, pose) in watched.skeleton.iter_mut().enumerate() {
                *pose = posef(&Affine3A::from_translation(Vec3::Y * joint as f32));
            }
            (watched.face_valid, watched.face_eyes_valid) = (true, true);
            watched.face_confidences = [0.9, 0.4];
            for (expression, weight) in watched.face.iter_mut().enumerate() {
                *weight = expression as f32 / 70.0;
            }
            let eye = |x: f32| Affine3A::from_translation(Vec3::new(x, 1.6, 0.0));
            watched.gazes = [-0.03, 0.03].map(|x| Some((posef(&eye(x)), 0.5 + x)));
        });
        let (session, _, _) = fake.session(&fake.instance());
        Self {
            trackers: WearerTrackers::new(&session, fake.system()).expect("trackers"),
            floor: session
                .create_reference_space(ReferenceSpaceType::LOCAL_FLOOR, Posef::IDENTITY)
                .expect("a space"),
            now: Instant::now(),
            gaze: None,
            fake,
        }
    }

    fn new() -> Self {
        Self::of(FakeRuntime::with_everything())
    }

    /// Of a headset that was changed before it was opened.
    fn with(change: impl FnOnce(&mut crate::fake::World)) -> Self {
        let fake = FakeRuntime::with_everything();
        fake.set(change);
        Self::of(fake)
    }

    fn locate(&mut self) -> Wearer {
        let when = (self.now, Time::from_nanos(5));
        let hands = [WearerHand::default(); 2];
        let wearer = self.trackers.locate(&self.floor, when, hands, || self.gaze);
        wearer.expect("a wearer")
    }
}

/// Whether body, face and gaze are there.
fn there(wearer: &Wearer) -> [bool; 3] {
    [
        wearer.body.is_some(),
        wearer.face.is_some(),
        wearer.gazes.iter().all(Option::is_some),
    ]
}

fn alive(fake: &FakeRuntime) -> usize {
    let kinds = ["body tracker", "face tracker", "eye tracker"];
    kinds.map(|kind| fake.alive(kind)).iter().sum()
}

#[test]
fn body_face_and_gaze_are_what_the_runtime_says() {
    let mut scene = Scene::new();
    let wearer = scene.locate();
    let body = wearer.body.expect("a body");
    assert_eq!(body.confidence, 0.75, "of the body");
    for joint in 0..BODY_JOINTS {
        let BodyJoint {
            floor_from_joint,
            tracked,
        } = body.joints[joint].expect("it is known");
        assert!(floor_from_joint.abs_diff_eq(place(joint), 1e-5), "{joint}");
        assert_eq!(tracked, joint % 2 == 0, "joint {joint}");
        let rest = body.t_pose[joint].expect("it is known");
        let at = Vec3::Y * joint as f32;
        assert!(
            Vec3::from(rest.translation).abs_diff_eq(at, 1e-5),
            "{joint}"
        );
    }
    let face = wearer.face.expect("a face");
    assert_eq!(face.weights, std::array::from_fn(|k| k as f32 / 70.0), "it");
    assert_eq!(face.confidences, [0.9, 0.4], "lower, upper");
    assert!(face.eyes_look, "eyes follow");
    assert_eq!(face.source, FaceSource::Seen, "seen");
    for (gaze, x) in wearer.gazes.iter().zip([-0.03, 0.03]) {
        let gaze = gaze.expect("it is known");
        let at = Vec3::new(x, 1.6, 0.0);
        assert!(
            Vec3::from(gaze.floor_from_eye.translation).abs_diff_eq(at, 1e-5),
            "{x}"
        );
        assert_eq!(gaze.confidence, 0.5 + x, "{x}");
    }
    for (_, [_, read, _]) in EXTENSIONS {
        let times = scene.fake.calls(read);
        assert!(times.iter().all(|time| time.contains('5')), "{times:?}");
    }
}

#[test]
fn poses_are_in_floor_space_wherever_its_origin_is() {
    let mut scene = Scene::new();
    let moved = Affine3A::from_rotation_translation(Quat::from_rotation_y(0.5), Vec3::X);
    let session = scene.trackers.session.clone();
    scene.floor = session
        .create_reference_space(ReferenceSpaceType::STAGE, posef(&moved))
        .expect("a space");
    let wearer = scene.locate();
    let joint = wearer.body.expect("a body").joints[7].expect("a head");
    let expected = moved.inverse() * place(7);
    assert!(
        joint.floor_from_joint.abs_diff_eq(expected, 1e-5),
        "a joint"
    );
    let eye = wearer.gazes[0].expect("an eye").floor_from_eye;
    let expected = moved.inverse() * Affine3A::from_translation(Vec3::new(-0.03, 1.6, 0.0));
    assert!(eye.abs_diff_eq(expected, 1e-5), "an eye");
}

#[test]
fn nobody_is_watched_before_somebody_asks_and_trackers_end_with_the_session() {
    let mut scene = Scene::new();
    assert_eq!(alive(&scene.fake), 0, "before");
    scene.locate();
    scene.locate();
    assert_eq!(alive(&scene.fake), 3, "one each");
    let Scene { trackers, fake, .. } = scene;
    drop(trackers);
    assert_eq!(alive(&fake), 0, "afterwards");
    for (name, [make, _, end]) in EXTENSIONS {
        assert_eq!(fake.calls(make).len(), 1, "{name} made");
        assert_eq!(fake.calls(end).len(), 1, "{name} ended");
    }
}

#[test]
fn each_missing_extension_leaves_the_others_and_gets_no_call() {
    for (place, (off, calls)) in EXTENSIONS.into_iter().enumerate() {
        let mut scene = Scene::with(|world| world.extensions.retain(|name| *name != off));
        let mut expected = [true; 3];
        expected[place] = false;
        assert_eq!(there(&scene.locate()), expected, "without {off}");
        for call in calls {
            assert!(scene.fake.calls(call).is_empty(), "{call} without {off}");
        }
    }
}

#[test]
fn a_headset_that_cannot_is_not_asked_to() {
    let mut scene = Scene::with(|world| world.system = Default::default());
    assert_eq!(there(&scene.locate()), [false; 3], "nothing");
    scene.now += Duration::from_secs(60);
    assert_eq!(there(&scene.locate()), [false; 3], "nor later");
    for (_, [make, ..]) in EXTENSIONS {
        assert!(scene.fake.calls(make).is_empty(), "{make}");
    }
}

#[test]
fn a_refusal_leaves_the_others_and_is_asked_again_once_the_wearer_may_have_given_leave() {
    for (place, (name, [make, ..])) in EXTENSIONS.into_iter().enumerate() {
        let mut scene = Scene::new();
        scene
            .fake
            .fail(make, XrResult::ERROR_PERMISSION_INSUFFICIENT);
        let mut expected = [true; 3];
        expected[place] = false;
        assert_eq!(there(&scene.locate()), expected, "{name} refused");
        let tries = scene.fake.calls(make).len();
        assert_eq!(there(&scene.locate()), expected, "{name} still refused");
        assert_eq!(scene.fake.calls(make).len(), tries, "not asked every frame");
        scene.fake.heal(make);
        scene.now += Duration::from_secs(4);
        assert_eq!(there(&scene.locate()), [true; 3], "{name} granted");
    }
}

#[test]
fn a_failing_read_leaves_the_others_and_works_again_afterwards() {
    for (place, (name, [_, read, _])) in EXTENSIONS.into_iter().enumerate() {
        let mut scene = Scene::new();
        scene.fake.fail(read, XrResult::ERROR_RUNTIME_FAILURE);
        let mut expected = [true; 3];
        expected[place] = false;
        assert_eq!(there(&scene.locate()), expected, "{name} fails");
        scene.fake.heal(read);
        assert_eq!(there(&scene.locate()), [true; 3], "{name} works");
    }
}

#[test]
fn what_is_not_active_or_no_pose_is_nothing() {
    let mut scene = Scene::new();
    scene.fake.set(|world| {
        world.watched.body[3].pose.position.x = f32::NAN;
        world.watched.body[4].pose.orientation = openxr::Quaternionf::default();
        world.watched.body[5].location_flags = SpaceLocationFlags::ORIENTATION_VALID;
        world.watched.skeleton[3].orientation.w = f32::INFINITY;
        world.watched.body_confidence = f32::NAN;
        world.watched.face[24] = f32::NAN;
        world.watched.face[25] = 7.0;
        world.watched.face_confidences = [f32::NAN, -1.0];
        let (pose, _) = world.watched.gazes[1].as_mut().expect("a gaze");
        pose.position.z = f32::NAN;
    });
    let wearer = scene.locate();
    let body = wearer.body.expect("a body");
    assert_eq!(body.confidence, 0.0, "no confidence");
    let unknown = (0..BODY_JOINTS).filter(|joint| body.joints[*joint].is_none());
    assert_eq!(unknown.collect::<Vec<_>>(), [3, 4, 5], "joints");
    assert!(body.t_pose[3].is_none(), "at rest");
    let face = wearer.face.expect("a face");
    assert_eq!(face.weights[24..26], [0.0, 1.0], "weights");
    assert_eq!(face.confidences, [0.0; 2], "its confidence");
    assert_eq!(
        wearer.gazes.map(|gaze| gaze.is_some()),
        [true, false],
        "eyes"
    );
    scene.fake.set(|world| {
        world.watched.body_active = false;
        world.watched.face_valid = false;
        world.watched.gazes = [None; 2];
    });
    assert_eq!(there(&scene.locate()), [false; 3], "nothing is active");
}

#[test]
fn legs_are_there_only_where_runtime_and_headset_have_them() {
    let full = "XR_META_body_tracking_full_body";
    let known = |scene: &mut Scene| {
        let body = scene.locate().body.expect("a body");
        let joints = body.joints.iter().filter(|joint| joint.is_some()).count();
        let rest = body.t_pose.iter().filter(|joint| joint.is_some()).count();
        assert_eq!(joints, rest, "the T-pose's");
        joints
    };
    assert_eq!(known(&mut Scene::new()), BODY_JOINTS, "all");
    let mut without = Scene::with(|world| world.extensions.retain(|name| *name != full));
    assert_eq!(known(&mut without), UPPER, "no extension");
    let mut without = Scene::with(|world| world.system.full_body = false);
    assert_eq!(known(&mut without), UPPER, "no support");
    let mut refused = Scene::new();
    let result = XrResult::ERROR_FEATURE_UNSUPPORTED;
    refused.fake.fail_times("xrCreateBodyTrackerFB", result, 1);
    assert_eq!(known(&mut refused), UPPER, "refused");
}

#[test]
fn the_better_tracking_of_a_body_is_asked_for_and_is_no_condition() {
    let name = "xrRequestBodyTrackingFidelityMETA";
    let asked = |scene: &mut Scene| {
        assert!(scene.locate().body.is_some(), "a body in any case");
        scene.locate();
        scene.fake.calls(name)
    };
    assert_eq!(asked(&mut Scene::new()), ["HIGH"], "once");
    let mut without = Scene::with(|world| world.system.body_fidelity = false);
    assert!(asked(&mut without).is_empty(), "no choice");
    let extension = "XR_META_body_tracking_fidelity";
    let mut without = Scene::with(|world| world.extensions.retain(|one| *one != extension));
    assert!(asked(&mut without).is_empty(), "no extension");
    let mut refused = Scene::new();
    refused.fake.fail(name, XrResult::ERROR_FEATURE_UNSUPPORTED);
    assert_eq!(asked(&mut refused), ["HIGH"], "refused");
}

#[test]
fn one_gaze_for_both_eyes_serves_where_nothing_tells_each_ones() {
    let gaze = Affine3A::from_rotation_y(0.3);
    let mut scene = Scene::new();
    scene.gaze = Some(gaze);
    let eye = scene.locate().gazes[0].expect("an eye").floor_from_eye;
    assert!(!eye.abs_diff_eq(gaze, 0.1), "each eye's own");
    scene.fake.set(|world| world.watched.gazes = [None; 2]);
    assert_eq!(scene.locate().gazes, [None; 2], "shut eyes look nowhere");
    let mut without = Scene::with(|world| world.system.eye_tracking = false);
    without.gaze = Some(gaze);
    let both = Some(Gaze {
        floor_from_eye: gaze,
        confidence: 1.0,
    });
    assert_eq!(without.locate().gazes, [both; 2], "both eyes");
}

#[test]
fn the_t_pose_is_asked_for_again_when_it_changed() {
    let mut scene = Scene::new();
    let asked = |scene: &Scene| scene.fake.calls("xrGetBodySkeletonFB").len();
    scene.locate();
    scene.locate();
    assert_eq!(asked(&scene), 1, "once");
    scene.fake.set(|world| {
        world.watched.skeleton_changes += 1;
        world.watched.skeleton[7].position.y = 1.5;
    });
    let body = scene.locate().body.expect("a body");
    assert_eq!(asked(&scene), 2, "again");
    assert_eq!(body.t_pose[7].expect("a head").translation.y, 1.5, "new");
    scene
        .fake
        .fail("xrGetBodySkeletonFB", XrResult::ERROR_RUNTIME_FAILURE);
    scene.fake.set(|world| world.watched.skeleton_changes += 1);
    let body = scene.locate().body.expect("a body");
    assert!(body.t_pose.iter().all(Option::is_none), "not known");
    assert!(
        body.joints.iter().all(Option::is_some),
        "but the joints are"
    );
    let failed = asked(&scene);
    scene.locate();
    assert_eq!(
        asked(&scene),
        failed + 1,
        "and asked for with the next frame"
    );
}

#[test]
fn a_face_is_asked_for_by_the_sources_that_the_headset_has() {
    let sources = [
        ([true, true], "[VISUAL, AUDIO]"),
        ([true, false], "[VISUAL]"),
        ([false, true], "[AUDIO]"),
    ];
    for (has, asked) in sources {
        let mut scene =
            Scene::with(|world| [world.system.face_seen, world.system.face_heard] = has);
        scene.locate();
        assert_eq!(
            scene.fake.calls("xrCreateFaceTracker2FB"),
            [asked],
            "{has:?}"
        );
    }
    let mut scene = Scene::new();
    scene.fake.set(|world| {
        world.watched.face_source = sys::FaceTrackingDataSource2FB::AUDIO;
        world.watched.face_eyes_valid = false;
    });
    let face = scene.locate().face.expect("a face");
    assert_eq!(face.source, FaceSource::Heard, "by the microphone");
    assert!(!face.eyes_look, "which hears no eyes");
}

#[test]
fn who_asks_for_the_gaze_alone_has_nothing_else_watched() {
    let mut scene = Scene::new();
    let when = (scene.now, Time::from_nanos(5));
    let gazes = (scene.trackers).gazes(&scene.floor, when, || unreachable!("each eye is known"));
    assert!(gazes.iter().all(Option::is_some), "{gazes:?}");
    assert_eq!(alive(&scene.fake), 1, "the eyes");
    for (name, [make, ..]) in EXTENSIONS {
        let made = scene.fake.calls(make).len();
        assert_eq!(made, usize::from(name.contains("eye")), "{name}");
    }
    assert_eq!(there(&scene.locate()), [true; 3], "asked for later");
}
