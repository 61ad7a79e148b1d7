//! The shell on a scan of the body model itself, whose registration is exact.

mod faults;
mod scene;

use super::head::expressed;
use super::*;
use glam::Vec3;
use scene::Scene;
use scene::{data, face, is_looked_at, picture, psnr, save};

/// The expressions of the avatar's presets, in the units that they are made of: names, jaw in degrees, strengths.
type Preset = (&'static str, f64, &'static [(&'static str, f64)]);

const PRESETS: [Preset; 12] = [
    (
        "blink",
        0.0,
        &[("eye-left-closure", 1.0), ("eye-right-closure", 1.0)],
    ),
    (
        "smile",
        0.0,
        &[
            ("mouth-corner-puller", 0.9),
            ("mouth-part-later", 0.3),
            ("eye-left-slit", 0.3),
            ("eye-right-slit", 0.3),
        ],
    ),
    (
        "brows_up",
        0.0,
        &[
            ("eyebrows-left-up", 1.3),
            ("eyebrows-right-up", 1.3),
            ("eyebrows-left-inner-up", 0.2),
            ("eyebrows-right-inner-up", 0.2),
            ("eyebrows-left-extern-up", 0.5),
            ("eyebrows-right-extern-up", 0.5),
        ],
    ),
    (
        "brows_down",
        0.0,
        &[("eyebrows-left-down", 1.0), ("eyebrows-right-down", 1.0)],
    ),
    ("a", 11.0, &[]),
    (
        "e",
        4.0,
        &[("mouth-part-later", 0.7), ("mouth-retraction", 0.3)],
    ),
    (
        "i",
        2.0,
        &[("mouth-part-later", 0.6), ("mouth-retraction", 0.5)],
    ),
    ("o", 7.0, &[("mouth-pursing", 0.8)]),
    (
        "u",
        2.0,
        &[("mouth-pursing", 1.0), ("mouth-protusion", 0.3)],
    ),
    ("mbp", 0.0, &[("mouth-compression", 0.8)]),
    ("fv", 2.0, &[("mouth-upward-retraction", 0.5)]),
    ("wide", 18.0, &[("mouth-open", 0.5)]),
];

#[test]
fn the_neutral_face_looks_as_it_was_scanned_and_every_expression_can_be_drawn() {
    let Some(face) = face() else { return };
    let (model, before, after) = (face.data.model, &face.before, &face.after);
    println!("{:?} of {}", face.report, after.bound.scan.len());
    let views = [0.0, 30.0].map(|azimuth| before.face_view(0.8, azimuth));
    for (view, name) in views.iter().zip(["neutral_0", "neutral_30"]) {
        let pictures = [
            picture(&before.bound.scan, view),
            picture(&after.bound.scan, view),
        ];
        let db = psnr(&pictures[0], &pictures[1]);
        println!("{name}: {db:.1} dB");
        save(name, &pictures, view);
        assert!(db > 33.0, "{name} is {db:.1} dB from the scan");
    }
    for (name, jaw, units) in PRESETS {
        let vertices = expressed(
            model,
            &after.registered,
            &after.bound.mesh.vertices,
            units,
            jaw.to_radians(),
        );
        let moved = after.moved(&vertices);
        let pictures: Vec<Vec<Vec3>> = views.iter().map(|view| picture(&moved, view)).collect();
        assert!(
            pictures.iter().flatten().all(|pixel| pixel.is_finite()),
            "{name}"
        );
        if is_looked_at() {
            let plain = before.moved(&expressed(
                model,
                &before.registered,
                &before.bound.mesh.vertices,
                units,
                jaw.to_radians(),
            ));
            let all = [vec![picture(&plain, &views[0])], pictures].concat();
            save(&format!("face_{name}"), &all, &views[0]);
        }
    }
}

/// How many pixels of a picture are of this kind, within `half` pixels of where a point is.
fn count(
    pixels: &[Vec3],
    view: &crate::pinhole::Pinhole,
    at: DVec3,
    half: f64,
    kind: impl Fn(Vec3) -> bool,
) -> usize {
    let middle = view.project(at).unwrap_or_default();
    (0_u32..)
        .zip(pixels)
        .filter(|(k, pixel)| {
            let (x, y) = (f64::from(k % view.width), f64::from(k / view.width));
            (x - middle.x).abs() < half && (y - middle.y).abs() < half && kind(**pixel)
        })
        .count()
}

#[test]
fn an_open_mouth_is_dark_inside_and_shows_teeth_that_a_closed_one_hides() {
    let Some(face) = face() else { return };
    let (model, scene) = (face.data.model, &face.after);
    let vertices = scene.bound.mesh.vertices.clone();
    let view = scene.face_view(0.8, 0.0);
    let teeth: Vec<DVec3> = (model.faces.iter().zip(&model.parts))
        .filter(|(_, part)| **part == crate::body::BodyPart::Teeth)
        .map(|(face, _)| vertices[face[0] as usize])
        .collect();
    let mouth = teeth.iter().sum::<DVec3>() / teeth.len() as f64;
    let dark = |c: Vec3| c.max_element() < 0.22;
    let white = |c: Vec3| c.min_element() > 0.38 && c.max_element() - c.min_element() < 0.15;
    let closed = picture(&scene.bound.scan, &view);
    let open = expressed(
        model,
        &scene.registered,
        &vertices,
        &[("mouth-open", 0.3), ("mouth-part-later", 0.6)],
        0.2,
    );
    let open = picture(&scene.moved(&open), &view);
    let (dark_before, dark_after) = (
        count(&closed, &view, mouth, 60.0, dark),
        count(&open, &view, mouth, 60.0, dark),
    );
    let (white_before, white_after) = (
        count(&closed, &view, mouth, 45.0, white),
        count(&open, &view, mouth, 45.0, white),
    );
    save("mouth", &[closed, open], &view);
    assert!(
        dark_before < 30 && dark_after > 200,
        "dark: {dark_before} pixels, then {dark_after}"
    );
    assert!(
        white_before < 10 && white_after > 100,
        "teeth: {white_before} pixels, then {white_after}"
    );
}

#[test]
fn eyes_turn_with_their_joints_about_their_middles() {
    let Some(face) = face() else { return };
    let (model, scene, report) = (face.data.model, &face.after, &face.report);
    for (eye, joint) in report
        .eyeballs
        .iter()
        .zip([spmm3::Joint::LeftEye, spmm3::Joint::RightEye])
    {
        let eye = eye.as_ref().expect("an eyeball");
        let turn = glam::DMat3::from_axis_angle(scene.registered.rotations[15].y_axis, 0.3);
        let vertices: Vec<DVec3> = (scene
            .bound
            .mesh
            .vertices
            .iter()
            .zip(&scene.bound.mesh.weights))
        .map(|(v, row)| {
            v.lerp(
                eye.centre + turn * (*v - eye.centre),
                f64::from(row[joint.index()]),
            )
        })
        .collect();
        let moved = scene.moved(&vertices);
        // The pupil: the darkest Gaussians of this eyeball.
        let pupil = |positions: &[Vec3]| -> DVec3 {
            let own = (0..positions.len()).filter(|at| {
                let face = scene.bound.triangles[*at] as usize;
                model.parts[face] == crate::body::BodyPart::Eyes
                    && model.weights[model.faces[face][0] as usize][joint.index()] > 0.5
                    && scene.bound.scan.colours[*at].max_element() < 0.2
            });
            own.map(|at| positions[at].as_dvec3() - eye.centre)
                .sum::<DVec3>()
                .normalize()
        };
        let (before, after) = (pupil(&scene.bound.scan.positions), pupil(&moved.positions));
        let error = after.angle_between(turn * before);
        assert!(error < 0.01, "{joint:?} looks {error} rad beside its joint");
        assert!(
            before.angle_between(eye.gaze) < 0.15,
            "the pupil is {} rad beside the gaze",
            before.angle_between(eye.gaze)
        );
        assert!((0.009..0.018).contains(&eye.radius), "{}", eye.radius);
    }
}

#[test]
fn a_hole_in_a_scan_is_filled_in_the_colours_around_it() {
    let Some(data) = data() else { return };
    let model = data.model;
    let is_hole = |face: usize| {
        let middle = model.faces[face]
            .iter()
            .map(|v| model.rest[*v as usize])
            .sum::<DVec3>()
            / 3.0;
        middle.distance(model.joints[spmm3::Joint::Spine3.index()] + DVec3::new(0.05, -0.05, 0.12))
            < 0.08
    };
    let whole = Scene::new(data, 0.012, |_| true);
    let mut holed = Scene::new(data, 0.012, |face| !is_hole(face));
    let options = ShellOptions {
        face: false,
        ..ShellOptions::default()
    };
    let target = whole.registered.joints[spmm3::Joint::Spine3.index()];
    let view = crate::pinhole::Pinhole::look_at(
        target + DVec3::new(0.1, 0.0, 1.4),
        target,
        DVec3::Y,
        900.0,
        400,
        400,
    );
    let truth = picture(&whole.bound.scan, &view);
    let before = picture(&holed.bound.scan, &view);
    let report = complete(
        &mut holed.bound,
        model,
        &holed.registered,
        &data.textures,
        &options,
    )
    .unwrap_or_else(|e| panic!("{e}"));
    let after = picture(&holed.bound.scan, &view);
    let (low, high) = (psnr(&before, &truth), psnr(&after, &truth));
    println!(
        "{:?}; {low:.1} dB with the hole, {high:.1} dB filled",
        report.coverage
    );
    save("hole", &[truth, before, after], &view);
    assert!(
        report.coverage.open_before > report.coverage.open_after + 0.004,
        "{:?}",
        report.coverage
    );
    assert!(high > low + 8.0 && high > 32.0, "{low} dB, then {high} dB");
}
