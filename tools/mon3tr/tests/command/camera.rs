//! A camera that sees an avatar's renders: the tracked motion, in a file and at the other end of a call, is the one that was drawn.

use crate::house::House;
use crate::support::{Outcome, command, mon3tr};
use glam::{DVec3, Vec3};
use link_call::{Authentication, CallEvent, Viewer};
use link_http::Client;
use link_playout::Clock;
use link_voice::VoiceQueue;
use spmm3::{
    Avatar, Joint, LOOP_SECONDS, LoadOptions, MotionClip, MotionParams, Playback, Skeleton,
};
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

/// Frames of the built-in motion that are drawn, at 30 Hz.
const FRAMES: usize = 60;
/// Frames within which the person is found.
const FINDING: usize = 10;
/// Largest median error of the limbs' joints, and of the wrist that moves, metres. `./run eval capture` prints what is reached.
const LARGEST_ERROR: f64 = 0.12;
const LARGEST_WRIST: f64 = 0.15;
/// The right wrist among the limbs.
const WRIST: usize = 11;
/// The view's vertical field of view, which is the picture's longer side.
const FOV: &str = "28";
/// Motions that have to arrive at the other end.
const ARRIVE: usize = 40;
/// Longest that they may take: the test's machine may be busy.
const LONGEST: Duration = Duration::from_secs(120);

const LIMBS: [Joint; 12] = [
    Joint::LeftHip,
    Joint::RightHip,
    Joint::LeftKnee,
    Joint::RightKnee,
    Joint::LeftAnkle,
    Joint::RightAnkle,
    Joint::LeftShoulder,
    Joint::RightShoulder,
    Joint::LeftElbow,
    Joint::RightElbow,
    Joint::LeftWrist,
    Joint::RightWrist,
];

/// Whether what a camera needs is there; on CI it must be.
pub(crate) fn networks() -> bool {
    let there =
        std::env::var_os("MON3TR_NETWORKS").is_some_and(|path| PathBuf::from(path).is_dir());
    if !there {
        let why = "MON3TR_NETWORKS names no folder; ./run test fetches the camera's networks";
        assert!(std::env::var("CI").as_deref() != Ok("true"), "{why}");
        println!("skipped: {why}");
    }
    there
}

/// Draws the built-in motion of `package`, tracks the pictures, and sends them as a camera's.
pub(crate) fn a_camera_sees_what_was_drawn(package: &Path, folder: &Path) {
    let avatar = Avatar::load(package).expect("the baked package");
    let text = |path: &Path| path.to_str().expect("temporary paths are UTF-8").to_owned();
    let (package, pictures) = (text(package), text(&folder.join("pictures")));
    let frames = FRAMES.to_string();
    mon3tr(&[
        "render", &package, "--view", "front", "--size", "540x720", "--frames", &frames, "--out",
        &pictures,
    ])
    .succeeds();
    std::fs::remove_file(folder.join("pictures/animation.webp")).expect("render leaves one");
    let truth = MotionClip::built_in(&avatar.skeleton, &avatar.expressions, LOOP_SECONDS, 30.0)
        .expect("the built-in motion");
    let truth: Vec<[DVec3; 12]> = (0..FRAMES)
        .map(|k| {
            limbs(
                &avatar.skeleton,
                &truth.sample(k as f64 / 30.0, Playback::Clamp),
            )
        })
        .collect();

    let motion = folder.join("tracked/motion.npz");
    let garbage = folder.join("pictures/no-picture.png");
    std::fs::write(&garbage, "no picture").expect("a file");
    let shown = mon3tr(&[
        "track",
        &pictures,
        "--avatar",
        &package,
        "--fov",
        FOV,
        "--out",
        &text(&motion),
    ])
    .succeeds();
    assert!(shown.contains("60 frames at 30.000 Hz"), "{shown}");
    // The last one in the order of names: the motion is that of all before it.
    std::fs::remove_file(garbage).expect("the file");
    let options = LoadOptions::default();
    let tracked = MotionClip::load(&motion, &avatar.skeleton, &options).expect("a motion file");
    assert_eq!(
        tracked.expression_basis.as_ref(),
        Some(&avatar.expression_basis),
        "the motion says whose face it moves"
    );
    let errors = (tracked.frames.iter().zip(&truth).skip(FINDING))
        .map(|(tracked, truth)| error(&limbs(&avatar.skeleton, tracked), truth))
        .collect();
    let median = middle(errors);
    println!("tracked: {:.0} mm", 1e3 * median);
    assert!(median < LARGEST_ERROR, "{median} m in the file");
    let wrist = |frames: &[[DVec3; 12]]| {
        let pairs = frames.iter().zip(&truth).skip(FINDING);
        pairs
            .map(|(a, b)| a[WRIST].distance(b[WRIST]))
            .fold(0.0, f64::max)
    };
    let frames: Vec<_> = (tracked.frames.iter())
        .map(|motion| limbs(&avatar.skeleton, motion))
        .collect();
    let still = vec![limbs(&avatar.skeleton, &spmm3::at_ease(&avatar.skeleton)); FRAMES];
    let (tracked, standing) = (wrist(&frames), wrist(&still));
    println!("the wrist: {tracked:.3} m at worst, {standing:.3} m for a person who stands still");
    assert!(
        standing > 2.0 * LARGEST_WRIST,
        "the motion moves the wrist: {standing}"
    );
    assert!(
        tracked < standing / 2.0,
        "the wrist is followed: {tracked} m at worst"
    );

    let house = House::open();
    std::fs::copy(&package, &house.avatar).expect("the house has the avatar");
    let sender = house.sender(&["--camera", &pictures, "--fov", FOV]);
    let arrived = received(&house, &sender.viewers);
    // Pictures are skipped where the machine is busy, and the folder begins again at its end: any of the drawn poses may be meant.
    let errors = (arrived.iter().skip(ARRIVE / 3))
        .map(|motion| {
            let seen = limbs(&avatar.skeleton, motion);
            let of = truth.iter().map(|truth| error(&seen, truth));
            of.fold(f64::INFINITY, f64::min)
        })
        .collect();
    let median = middle(errors);
    println!("received: {:.0} mm", 1e3 * median);
    assert!(median < LARGEST_ERROR, "{median} m at the other end");
    let height = |motion: &MotionParams| limbs(&avatar.skeleton, motion)[WRIST].y;
    let heights = || arrived.iter().map(height);
    let span = heights().fold(f64::MIN, f64::max) - heights().fold(f64::MAX, f64::min);
    assert!(
        span > LARGEST_WRIST,
        "the wrist that arrives moves: {span} m"
    );
    drop(sender);
}

/// The first motions that a viewer gets.
fn received(house: &House, link: &str) -> Vec<MotionParams> {
    let _entered = house.runtime.enter();
    let client = Client::new(None).expect("a client");
    let link = link.parse().expect("a room's link");
    let viewer = Viewer::join(
        client,
        link,
        Authentication::default(),
        Clock::start(),
        VoiceQueue::default(),
    );
    let (mut arrived, began) = (Vec::new(), Instant::now());
    while arrived.len() < ARRIVE {
        assert!(began.elapsed() < LONGEST, "{} motions came", arrived.len());
        match viewer.next(Duration::from_secs(1)) {
            Ok(CallEvent::Frame { frame, .. }) => arrived.push(frame.motion.clone()),
            Ok(CallEvent::Failed(error)) => panic!("the call failed: {error}"),
            Ok(_) | Err(_) => {}
        }
    }
    house.runtime.block_on(viewer.hang_up());
    arrived
}

/// The limbs' joints relative to the middle of the hips, metres, by forward kinematics in f64 that share nothing with the program's.
fn limbs(skeleton: &Skeleton, motion: &MotionParams) -> [DVec3; 12] {
    let rest = skeleton.rest_positions();
    let joints = synthetic_person::reference::forward_kinematics(rest, motion.values());
    let at = |joint: Joint| {
        DVec3::from_array(
            joints[joint.index()].apply(synthetic_person::reference::wide(Vec3::ZERO)),
        )
    };
    let hips = (at(Joint::LeftHip) + at(Joint::RightHip)) / 2.0;
    LIMBS.map(|joint| at(joint) - hips)
}

fn error(a: &[DVec3; 12], b: &[DVec3; 12]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a.distance(*b)).sum::<f64>() / 12.0
}

fn middle(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    values[values.len() / 2]
}

#[test]
fn what_a_camera_cannot_do_is_said_in_one_line() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let path = |name: &str| {
        let path = folder.path().join(name);
        path.to_str().expect("temporary paths are UTF-8").to_owned()
    };
    let package = crate::support::puppet(&folder);
    let package = package.to_str().expect("UTF-8");
    let track =
        |video: &str| mon3tr(&["track", video, "--avatar", package, "--out", &path("m.npz")]);
    track("0").fails_naming(&["recording", "send --camera"]);
    let absent = path("nothing.mp4");
    track(&absent).fails_naming(&[&format!("error: there is no file or folder {absent}: give")]);
    std::fs::create_dir(path("empty")).expect("a folder");
    track(&path("empty")).fails_naming(&["empty"]);
    for (flag, file, ending) in [
        ("--render", "side.gif", ".webp"),
        ("--out", "m.bvh", ".npz"),
    ] {
        mon3tr(&["track", &absent, flag, &path(file)]).fails_naming(&[file, ending]);
    }
    mon3tr(&["send", "--avatar", package, "--camera", "/dev/video99"])
        .fails_naming(&["/dev/video99"]);
    mon3tr(&[
        "send", "--avatar", package, "--camera", "a.mp4", "--motion", "b.bvh",
    ])
    .fails_naming(&["--camera", "--motion"]);
    mon3tr(&["track", &path("m.y4m"), "--fov", "500"]).fails_naming(&["500", "10..150"]);
    mon3tr(&["track", &path("m.y4m"), "--hands", "three"]).fails_naming(&["three", "--hands"]);
    mon3tr(&["track", &path("m.y4m"), "--camera-provider", "gpu"])
        .fails_naming(&["gpu", "qnn, nnapi, xnnpack, cpu"]);
    mon3tr(&["send", "--avatar", package, "--preview"]).fails_naming(&["required"]);
    let mut unseen = command(&["send", "--avatar", package, "--camera", "0", "--preview"]);
    for variable in ["DISPLAY", "WAYLAND_DISPLAY", "WAYLAND_SOCKET"] {
        unseen.env_remove(variable);
    }
    Outcome::of(&mut unseen).fails_naming(&["needs a display", "leave out --preview"]);
    if !networks() {
        return;
    }
    // Pictures without anyone in them.
    std::fs::create_dir(path("grey")).expect("a folder");
    for k in 0..3 {
        let grey = image::RgbImage::from_pixel(320, 240, image::Rgb([120, 120, 120]));
        grey.save(path(&format!("grey/{k}.png")))
            .expect("a picture");
    }
    track(&path("grey")).fails_naming(&["no person", "3 pictures"]);
    // What Android alone has, is on no machine that runs this.
    let nnapi = ["--camera-provider", "nnapi"];
    let on_nnapi = ["track", &path("grey"), "--avatar", package];
    mon3tr(&[&on_nnapi[..], &nnapi].concat()).fails_naming(&["nnapi", "Android", "cpu"]);
}
