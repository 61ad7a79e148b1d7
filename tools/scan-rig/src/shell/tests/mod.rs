//! The shell on a scan of the body model itself, whose registration is exact.

mod scene;

use super::*;
use scene::Scene;
use super::head::expressed;
use scene::{data, picture, psnr, save};

/// The expressions of the avatar's presets, in the units that they are made of: names, jaw in degrees, strengths.
type Preset = (&'static str, f64, &'static [(&'static str, f64)]);

const PRESETS: [Preset; 12] = [
    ("blink", 0.0, &[("eye-left-closure", 1.0), ("eye-right-closure", 1.0)]),
    ("smile", 0.0, &[("mouth-corner-puller", 0.9), ("mouth-part-later", 0.3), ("eye-left-slit", 0.3), ("eye-right-slit", 0.3)]),
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
    ("brows_down", 0.0, &[("eyebrows-left-down", 1.0), ("eyebrows-right-down", 1.0)]),
    ("a", 11.0, &[]),
    ("e", 4.0, &[("mouth-part-later", 0.7), ("mouth-retraction", 0.3)]),
    ("i", 2.0, &[("mouth-part-later", 0.6), ("mouth-retraction", 0.5)]),
    ("o", 7.0, &[("mouth-pursing", 0.8)]),
    ("u", 2.0, &[("mouth-pursing", 1.0), ("mouth-protusion", 0.3)]),
    ("mbp", 0.0, &[("mouth-compression", 0.8)]),
    ("fv", 2.0, &[("mouth-upward-retraction", 0.5)]),
    ("wide", 18.0, &[("mouth-open", 0.5)]),
];

#[test]
fn the_neutral_face_looks_as_it_was_scanned_and_every_expression_can_be_drawn() {
    let Some(data) = data() else { return };
    let model = &data.model;
    let near_head = |face: usize| model.head_share(model.faces[face][0] as usize) > 0.1;
    let before = Scene::new(data, 0.005, near_head);
    let mut after = Scene::new(data, 0.005, near_head);
    let options = ShellOptions { unseen: false, ..ShellOptions::default() };
    let start = std::time::Instant::now();
    let report = complete(&mut after.bound, model, &after.registered, &data.textures, &options).expect("a shell");
    println!("{:?} {report:?} of {}", start.elapsed(), after.bound.scan.len());
    let views = [0.0, 30.0].map(|azimuth| before.face_view(0.8, azimuth));
    for (view, name) in views.iter().zip(["neutral_0", "neutral_30"]) {
        let pictures = [picture(&before.bound.scan, view), picture(&after.bound.scan, view)];
        let db = psnr(&pictures[0], &pictures[1]);
        println!("{name}: {db:.1} dB");
        save(name, &pictures, view);
        assert!(db > 33.0, "{name} is {db:.1} dB from the scan");
    }
    for (name, jaw, units) in PRESETS {
        let vertices = expressed(model, &after.registered, &after.bound.mesh.vertices, units, jaw.to_radians());
        let moved = after.moved(&vertices);
        for view in &views {
            assert!(picture(&moved, view).iter().all(|pixel| pixel.is_finite()), "{name}");
        }
        let plain = before.moved(&expressed(model, &before.registered, &before.bound.mesh.vertices, units, jaw.to_radians()));
        save(&format!("face_{name}"), &[picture(&plain, &views[0]), picture(&moved, &views[0]), picture(&moved, &views[1])], &views[0]);
    }
}
