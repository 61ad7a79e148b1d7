//! The standard reader on a scene that a trainer wrote.

use std::path::{Path, PathBuf};

use splat_scene::{Format, Scene};

/// A file of `shared/data`, which lies beside the repository; nothing, after a line that says so, where it is missing. On CI
/// that is a failure. (The same as the `tests` crate's, which is above this one.)
pub(crate) fn real_file(name: &str) -> Option<PathBuf> {
    let path = Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("../../shared/data")
        .join(name);
    if path.exists() {
        return Some(path);
    }
    assert!(
        std::env::var("CI").as_deref() != Ok("true"),
        "{} is missing, and CI must have it",
        path.display()
    );
    println!("skipped: {} is not here", path.display());
    None
}

#[test]
fn a_trained_scene_is_read_whole_and_comes_back_from_our_ply_as_it_was() {
    let Some(path) = real_file("splats/playbot3.ply") else {
        return;
    };
    let scene = Scene::load(&path).expect("the scene is sound");
    assert_eq!(scene.len(), 31_000, "all Gaussians of its header");
    assert_eq!(scene.sh_degree(), 2, "24 f_rest properties");
    assert_eq!(scene.format(), Format::Ply, "its layout");
    assert_eq!(scene.dropped().total(), 0, "no Gaussian is unsound");
    let (all, most) = (scene.bounds().unwrap(), scene.robust_bounds().unwrap());
    for axis in 0..3 {
        assert!(
            all.min[axis] <= most.min[axis]
                && most.min[axis] < most.max[axis]
                && most.max[axis] <= all.max[axis],
            "the robust box lies in the whole one"
        );
    }
    println!("bounds {all:?}, robust {most:?}");

    let again = Scene::read(&scene.to_ply(), "written.ply").expect("our own file is sound");
    assert_eq!(again.positions(), scene.positions(), "positions");
    assert_eq!(again.log_scales(), scene.log_scales(), "scales");
    assert_eq!(again.colours(), scene.colours(), "colours");
    assert_eq!(again.sh_rest(), scene.sh_rest(), "harmonics");
    for (a, b) in again.rotations().iter().zip(scene.rotations()) {
        let dot: f32 = a.iter().zip(b).map(|(a, b)| a * b).sum();
        assert!(dot > 1.0 - 1e-6, "rotation {b:?} came back as {a:?}");
    }
    for (a, b) in again.opacities().iter().zip(scene.opacities()) {
        assert!((a - b).abs() < 1e-6, "opacity {b} came back as {a}");
    }
}
