//! From made-up captures, whose truth is known, to first avatars.

mod made_up;

use capture::{Capture, CaptureError, FramePose, HeldOut};
use glam::DVec3;
use made_up::{Scenario, Truth};
use person_template::{First, TemplateError, TemplateOptions, first_avatar};
use scan_rig::body::BodyModel;
use spmm3::{Avatar, JOINTS, Joint, MotionParams, SkinningTransforms};
use std::path::Path;
use std::sync::OnceLock;
use synthetic_person::real_files::makehuman;

const SCENARIO: Scenario = Scenario {
    cameras: 6,
    frames: 6,
    side: 200,
    noise: (0.006, 0.02),
};

/// The template is fitted to so many of them; the poses of the others after it.
const FITTED: usize = 4;

struct Made {
    model: BodyModel,
    truth: Truth,
    captured: Vec<FramePose>,
    first: First,
    again: First,
}

fn options() -> TemplateOptions {
    TemplateOptions {
        name: "made up".to_owned(),
        gaussians: 8000,
        frames: FITTED,
        ..TemplateOptions::default()
    }
}

fn of_folder(folder: &Path, makehuman: &Path) -> Result<First, TemplateError> {
    let capture = Capture::open(folder)?;
    first_avatar(&capture, makehuman, &options(), &|_| ())
}

/// The capture and its avatar, made once; the second time on one thread.
fn made() -> Option<&'static Made> {
    static MADE: OnceLock<Option<Made>> = OnceLock::new();
    MADE.get_or_init(|| {
        let makehuman = makehuman()?;
        let folder = tempfile::tempdir().expect("a folder");
        let model = BodyModel::load(&makehuman).expect("the package is whole");
        let truth = made_up::write(folder.path(), &model, SCENARIO, &HeldOut::default())
            .expect("a capture");
        let captured = Capture::open(folder.path()).expect("it opens");
        let first = of_folder(folder.path(), &makehuman).expect("an avatar");
        let alone = rayon::ThreadPoolBuilder::new().num_threads(1).build();
        let again = alone
            .expect("a thread")
            .install(|| of_folder(folder.path(), &makehuman));
        println!("{:#?}", first.report);
        Some(Made {
            model,
            truth,
            captured: captured.poses().expect("poses").to_vec(),
            first,
            again: again.expect("an avatar"),
        })
    })
    .as_ref()
}

/// Joints of a motion in the world, metres.
fn joints(avatar: &Avatar, motion: &MotionParams) -> [DVec3; JOINTS] {
    let posed = avatar.skeleton.pose(motion);
    Joint::ALL.map(|joint| (posed.position(joint) + motion.root_translation).as_dvec3())
}

/// The template in a motion, the root included, metres.
fn vertices(avatar: &Avatar, motion: &MotionParams) -> Vec<DVec3> {
    let mut transforms = SkinningTransforms::default();
    let posed = avatar.skeleton.pose(motion);
    avatar.skeleton.skinning(&posed, &mut transforms);
    (avatar
        .template
        .vertices()
        .iter()
        .zip(avatar.template.skin()))
    .map(|(vertex, skin)| {
        let moved: glam::Vec3 = (skin.joints.iter().zip(skin.weights))
            .map(|(joint, weight)| {
                let map = transforms.posed_from_rest(Joint::ALL[usize::from(*joint)]);
                map.transform_point3(*vertex) * weight
            })
            .sum();
        (moved + motion.root_translation).as_dvec3()
    })
    .collect()
}

/// How far the body's joints are from the true ones over some frames, on average, millimetres.
fn joints_off<'a>(made: &Made, frames: impl Iterator<Item = (usize, &'a MotionParams)>) -> f64 {
    let (mut sum, mut count) = (0.0, 0.0);
    for (frame, motion) in frames {
        let found = joints(&made.first.avatar, motion);
        for joint in Joint::ALL.into_iter().take(Joint::Jaw.index()) {
            let truth = made.truth.joints[frame][joint.index()];
            (sum, count) = (sum + found[joint.index()].distance(truth), count + 1.0);
        }
    }
    1e3 * sum / count
}

#[test]
fn joints_are_found_to_fifteen_millimetres_in_all_frames_though_captured_poses_are_noisy() {
    let Some(made) = made() else { return };
    let first = &made.first;
    let skeleton = &first.avatar.skeleton;
    let captured: Vec<MotionParams> = made.captured.iter().map(|pose| pose.on(skeleton)).collect();
    let chosen = |frame: usize| first.report.frames.contains(&frame);
    for (name, template) in [
        ("fitted with the template", true),
        ("fitted after it", false),
    ] {
        let of = |poses: &'_ [MotionParams]| {
            joints_off(
                made,
                poses
                    .iter()
                    .enumerate()
                    .filter(|(frame, _)| chosen(*frame) == template),
            )
        };
        let (before, partly, after) = (of(&captured), of(&first.uncorrected), of(&first.poses));
        println!(
            "joints of frames {name}: {before:.1} mm off as captured, {partly:.1} with each frame's own correction, {after:.1} with the shared one"
        );
        assert!(after <= 15.0, "{after} mm");
        assert!(after < 0.75 * before, "{after} mm, {before} mm as captured");
    }
    assert_eq!(
        first.report.posed, SCENARIO.frames,
        "every frame was fitted"
    );
    assert_eq!(first.poses.len(), SCENARIO.frames, "a motion a frame");
}

#[test]
fn fingers_and_toes_keep_their_form() {
    let Some(made) = made() else { return };
    let (model, template) = (&made.model, &made.first.avatar.template);
    // The average body's, which has a form of its own, but for the size.
    let of = |joints: &[Joint]| {
        let mut ratios: Vec<f64> = Vec::new();
        for v in (0..model.body_vertices).filter(|v| model.share(*v, joints) > 0.99) {
            for n in model.neighbours.of(v) {
                let n = *n as usize;
                let found = template.vertices()[v].distance(template.vertices()[n]);
                ratios.push((f64::from(found) / model.rest[v].distance(model.rest[n])).ln());
            }
        }
        ratios.sort_by(f64::total_cmp);
        let at = |share: usize| ratios[ratios.len() * share / 100];
        (at(97) - at(50)).max(at(50) - at(3)).exp()
    };
    for (name, joints) in [
        ("fingers", [Joint::LeftIndex3, Joint::RightThumb3]),
        ("toes", [Joint::LeftFoot, Joint::RightFoot]),
    ] {
        let most = of(&joints);
        println!(
            "{name}: 94 % of the edges are within a factor of {most:.2} of their usual length"
        );
        assert!(most < 1.5, "{name}: a factor of {most}");
    }
}

#[test]
fn the_dressed_template_covers_the_masks() {
    let Some(made) = made() else { return };
    let report = &made.first.report;
    println!(
        "overlap {:.4}, before clothes {:.4}",
        report.dressed_overlap, report.body_overlap
    );
    assert!(report.dressed_overlap >= 0.97, "{}", report.dressed_overlap);
    assert!(report.warnings.is_empty(), "{:?}", report.warnings);
}

#[test]
#[expect(clippy::cast_possible_truncation, reason = "a share of a count")]
fn the_dressed_surface_is_the_true_one_to_a_centimetre() {
    let Some(made) = made() else { return };
    let mut off = Vec::new();
    for frame in &made.first.report.frames {
        let found = vertices(&made.first.avatar, &made.first.poses[*frame]);
        let truth = &made.truth.vertices[*frame];
        // Vertices may slide along the surface: the distance from the true one's nearest vertices' plane is what counts.
        for v in (0..made.model.body_vertices).filter(|v| made.model.outer[*v]) {
            let normal = normal(&made.model, truth, v);
            off.push((found[v] - truth[v]).dot(normal).abs());
        }
    }
    off.sort_by(f64::total_cmp);
    let [median, tenth] = [0.5, 0.9].map(|share| off[(share * off.len() as f64) as usize] * 1e3);
    println!("surface: median {median:.1} mm, 90 % within {tenth:.1} mm");
    assert!(median < 6.0 && tenth < 20.0, "{median} and {tenth} mm");
}

fn normal(model: &BodyModel, vertices: &[DVec3], vertex: usize) -> DVec3 {
    let around = model.neighbours.of(vertex);
    // From the neighbours' ring: enough for a distance.
    let centre: DVec3 =
        around.iter().map(|n| vertices[*n as usize]).sum::<DVec3>() / around.len().max(1) as f64;
    let first = around
        .first()
        .map_or(DVec3::X, |n| vertices[*n as usize] - centre);
    let second = around
        .get(1)
        .map_or(DVec3::Y, |n| vertices[*n as usize] - centre);
    first.cross(second).normalize_or(DVec3::Z)
}

/// Whether a joint is an arm's below the shoulder, or the trunk's away from it.
fn is_arms(joint: Joint) -> bool {
    let of = [
        Joint::LeftElbow,
        Joint::RightElbow,
        Joint::LeftWrist,
        Joint::RightWrist,
    ];
    joint.index() >= Joint::LeftIndex1.index() || of.contains(&joint)
}

fn is_trunks(joint: Joint) -> bool {
    let of = [
        Joint::Pelvis,
        Joint::Spine1,
        Joint::Spine2,
        Joint::LeftHip,
        Joint::RightHip,
    ];
    of.contains(&joint)
}

/// Vertices of the arms that are within so many metres of the trunk in the first frame, in which arms hang, and those of the trunk near them.
fn touching(made: &Made, reach: f64) -> Vec<usize> {
    let skin = made.first.avatar.template.skin();
    let share = |v: usize, which: fn(Joint) -> bool| -> f32 {
        let dense = skin[v].dense();
        let of = Joint::ALL.into_iter().filter(|joint| which(*joint));
        of.map(|joint| dense[joint.index()]).sum()
    };
    let outer = || (0..made.model.body_vertices).filter(|v| made.model.outer[*v]);
    let arms: Vec<usize> = outer().filter(|v| share(*v, is_arms) > 0.5).collect();
    let trunk: Vec<usize> = outer().filter(|v| share(*v, is_trunks) > 0.5).collect();
    let truth = &made.truth.vertices[0];
    let near = |one: &[usize], other: &[usize]| -> Vec<usize> {
        let is_near = |v: &&usize| other.iter().any(|o| truth[**v].distance(truth[*o]) < reach);
        one.iter().filter(is_near).copied().collect()
    };
    [near(&arms, &trunk), near(&trunk, &arms)].concat()
}

#[test]
#[expect(clippy::cast_possible_truncation, reason = "a share of a count")]
fn where_arms_touch_the_body_each_keeps_its_own_surface() {
    let Some(made) = made() else { return };
    // The first frame, in which they do, was fitted to.
    let frames = &made.first.report.frames;
    assert!(frames.contains(&0), "{frames:?}");
    let touching = touching(made, 0.04);
    assert!(touching.len() > 50, "{} vertices touch", touching.len());
    // Where outlines of arm and trunk are one, growth that took the one for the other would pull them together, which shows where they are apart.
    let mut off = Vec::new();
    for frame in frames.iter().filter(|frame| **frame != 0) {
        let found = vertices(&made.first.avatar, &made.first.poses[*frame]);
        let truth = &made.truth.vertices[*frame];
        for v in &touching {
            let normal = normal(&made.model, truth, *v);
            off.push((found[*v] - truth[*v]).dot(normal).abs());
        }
    }
    off.sort_by(f64::total_cmp);
    let [median, tenth] = [0.5, 0.9].map(|share| off[(share * off.len() as f64) as usize] * 1e3);
    println!(
        "{} vertices touch: elsewhere their median is {median:.1} mm off, 90 % within {tenth:.1} mm",
        touching.len()
    );
    assert!(median < 10.0 && tenth < 25.0, "{median} and {tenth} mm");
}

#[test]
fn an_arm_that_is_raised_takes_nothing_of_the_trunk_it_touched_with_it() {
    let Some(made) = made() else { return };
    let avatar = &made.first.avatar;
    let (mut hanging, mut raised) = (MotionParams::default(), MotionParams::default());
    for (joint, side) in [(Joint::LeftShoulder, 1.0), (Joint::RightShoulder, -1.0)] {
        hanging.set_axis_angle(joint, glam::Vec3::Z * (-1.4 * side));
        raised.set_axis_angle(joint, glam::Vec3::Z * (1.0 * side));
    }
    let (before, after) = (vertices(avatar, &hanging), vertices(avatar, &raised));
    let wrist = |motion: &MotionParams, joint: Joint| joints(avatar, motion)[joint.index()];
    let (mut of_trunk, mut of_arms) = (0, 0);
    for v in touching(made, 0.04) {
        // By where it is, not by its weights: in T-pose an arm's vertices are beyond the shoulder's reach of the trunk.
        let beside = made.first.avatar.template.vertices()[v].x.abs();
        let moved = before[v].distance(after[v]);
        if beside < 0.2 {
            of_trunk += 1;
            assert!(moved < 0.1, "vertex {v} of the trunk moves by {moved} m");
        } else if beside > 0.35 {
            of_arms += 1;
            let arm = if avatar.template.vertices()[v].x > 0.0 {
                Joint::LeftWrist
            } else {
                Joint::RightWrist
            };
            let whole = wrist(&hanging, arm).distance(wrist(&raised, arm));
            assert!(
                moved > 0.3 * whole,
                "vertex {v} of an arm moves by {moved} of {whole} m"
            );
        }
    }
    assert!(
        of_trunk > 20 && of_arms > 20,
        "{of_trunk} of the trunk, {of_arms} of arms"
    );
}

#[test]
fn the_avatar_is_a_package_that_reads_back_and_has_the_expressions() {
    let Some(made) = made() else { return };
    let avatar = &made.first.avatar;
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("first.m3a");
    avatar.save(&path).expect("it is written");
    let read = Avatar::load(&path).expect("it is read");
    assert_eq!(read.template, avatar.template, "the template");
    assert_eq!(read.gaussians, avatar.gaussians, "the Gaussians");
    assert_eq!(avatar.gaussians.len(), 8000, "as many as asked for");
    assert_eq!(
        avatar.controllers.vertices().len(),
        500,
        "the paper's controllers"
    );
    assert_eq!(
        avatar.template.vertices().len(),
        made.model.rest.len(),
        "the model's mesh"
    );
    assert!(made.first.mesh.decoder.rank() >= 16, "the expression basis");
    assert!(
        made.first.report.coloured > 0.8,
        "{}",
        made.first.report.coloured
    );
}

#[test]
fn gaussians_have_the_colours_of_the_pictures() {
    let Some(made) = made() else { return };
    let avatar = &made.first.avatar;
    let count = avatar.gaussians.len();
    let planes = avatar.gaussians.attributes();
    let mut off: Vec<f32> = (0..count)
        .map(|at| {
            let corners = avatar.gaussians.corners()[at];
            let [v, w] = avatar.gaussians.barycentrics()[at];
            let true_colour: glam::Vec3 = (corners.iter().zip([1.0 - v - w, v, w]))
                .map(|(c, share)| made_up::colour(made.model.rest[*c as usize]) * share)
                .sum();
            let channel = |k: usize| 0.5 + spmm3::SH_C0 * planes[(11 + k) * count + at];
            (glam::Vec3::new(channel(0), channel(1), channel(2)) - true_colour)
                .abs()
                .max_element()
        })
        .collect();
    off.sort_by(f32::total_cmp);
    let [median, tenth] = [off[count / 2], off[count * 9 / 10]];
    println!("colours: median {median:.3}, 90 % within {tenth:.3}");
    assert!(median < 0.04 && tenth < 0.2, "{median} and {tenth}");
}

#[test]
fn the_same_capture_gives_the_same_avatar_on_one_thread_and_on_many() {
    let Some(made) = made() else { return };
    assert_eq!(made.first.poses, made.again.poses, "the motion");
    assert_eq!(made.first.uncorrected, made.again.uncorrected, "the motion");
    assert_eq!(made.first.report, made.again.report, "the report");
    assert!(made.first.avatar == made.again.avatar, "the avatar");
}

#[test]
fn pictures_that_are_held_out_are_never_looked_at() {
    let Some(makehuman) = makehuman() else { return };
    let model = BodyModel::load(&makehuman).expect("the package is whole");
    let small = Scenario {
        cameras: 5,
        frames: 3,
        side: 96,
        noise: (0.0, 0.0),
    };
    let held_out = HeldOut {
        cameras: vec![2],
        frames: vec![1],
    };
    let folder = tempfile::tempdir().expect("a folder");
    made_up::write(folder.path(), &model, small, &held_out).expect("a capture");
    let capture = Capture::open(folder.path()).expect("it opens");
    for (camera, of) in capture.cameras().iter().enumerate() {
        for frame in 0..capture.frames() {
            if held_out.has_camera(camera) || held_out.has_frame(frame) {
                for kind in ["frames", "masks"] {
                    let file = format!("{kind}/{}/{frame:06}.png", of.name);
                    std::fs::write(folder.path().join(file), "no picture").expect("written");
                }
                assert!(capture.photograph(camera, frame).is_err(), "it is rubbish");
            }
        }
    }
    let first = of_folder(folder.path(), &makehuman).expect("of the others alone");
    assert!(
        !first.report.frames.contains(&1),
        "{:?}",
        first.report.frames
    );
    assert_eq!(
        first.poses.len(),
        3,
        "held-out frames have a pose, the capture's"
    );
}

#[test]
fn captures_without_poses_or_masks_or_with_others_poses_are_refused_in_words() {
    let Some(makehuman) = makehuman() else { return };
    let model = BodyModel::load(&makehuman).expect("the package is whole");
    let small = Scenario {
        cameras: 4,
        frames: 2,
        side: 96,
        noise: (0.0, 0.0),
    };
    let whole = tempfile::tempdir().expect("a folder");
    made_up::write(whole.path(), &model, small, &HeldOut::default()).expect("a capture");
    let capture = Capture::open(whole.path()).expect("it opens");
    let again = |poses: bool, masks: bool, shift: f32| -> Result<First, TemplateError> {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("capture");
        let copied = || -> Result<(), CaptureError> {
            let writer = capture::CaptureWriter::create(&path, capture.cameras(), 2, 30.0)?;
            for camera in 0..4 {
                for frame in 0..2 {
                    let mut photograph = capture.photograph(camera, frame)?;
                    photograph.mask = photograph.mask.filter(|_| masks);
                    writer.write(camera, frame, &photograph)?;
                }
            }
            let mut given = capture.poses().unwrap_or_default().to_vec();
            given.iter_mut().for_each(|pose| pose.pelvis.x += shift);
            writer.finish(poses.then_some(&given[..]), &HeldOut::default())
        };
        copied().expect("it is written");
        of_folder(&path, &makehuman)
    };
    let refused = again(false, true, 0.0).err();
    assert!(
        matches!(refused, Some(TemplateError::NoPoses)),
        "{refused:?}"
    );
    let refused = again(true, false, 0.0).err();
    assert!(
        matches!(refused, Some(TemplateError::NoMasks { pictures: 8 })),
        "{refused:?}"
    );
    let refused = again(true, true, 1.5).err();
    assert!(
        matches!(refused, Some(TemplateError::NoFit { .. })),
        "{refused:?}"
    );
    let options = TemplateOptions {
        gaussians: 3,
        ..options()
    };
    let refused = first_avatar(&capture, &makehuman, &options, &|_| ()).err();
    assert!(
        matches!(refused, Some(TemplateError::Options(_))),
        "{refused:?}"
    );
    let refused = first_avatar(&capture, whole.path(), &self::options(), &|_| ()).err();
    assert!(
        matches!(refused, Some(TemplateError::Body(_))),
        "{refused:?}"
    );
}
