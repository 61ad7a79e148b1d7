//! Files of strangers.

use splat_scene::Scene;
use splat_scene::cameras::Cameras;
use spmm3::{Avatar, LoadOptions, MotionClip, Skeleton};
use std::io::Cursor;
use std::sync::LazyLock;
use synthetic_person::{Puppet, PuppetSize};

/// An avatar's package.
pub(crate) fn package(bytes: &[u8]) {
    let _ = Avatar::read(Cursor::new(bytes));
}

pub(crate) fn package_seeds() -> Vec<Vec<u8>> {
    // It is written as files are.
    let name = format!("mon3tr-fuzz-{}.m3a", std::process::id());
    let file = std::env::temp_dir().join(name);
    let avatar = Puppet::new(PuppetSize::SMALL).avatar();
    avatar.save(&file).expect("written");
    let bytes = std::fs::read(&file).expect("it was just written");
    std::fs::remove_file(&file).expect("it is no longer needed");
    vec![bytes]
}

/// A scene of Gaussians, of any of the formats; or a list of cameras.
pub(crate) fn scene(bytes: &[u8]) {
    for name in ["scene.ply", "scene.splat", "scene.spz"] {
        let _ = Scene::read(bytes, name);
    }
    let _ = Cameras::parse(bytes, "cameras.json");
}

pub(crate) fn scene_seeds() -> Vec<Vec<u8>> {
    let names = [
        "x", "y", "z", "f_dc_0", "f_dc_1", "f_dc_2", "opacity", "scale_0", "scale_1", "scale_2",
        "rot_0", "rot_1", "rot_2", "rot_3",
    ];
    let properties: String = names
        .iter()
        .map(|name| format!("property float {name}\n"))
        .collect();
    let header =
        format!("ply\nformat binary_little_endian 1.0\nelement vertex 3\n{properties}end_header\n");
    let values = (0..3 * names.len()).flat_map(|at| (at as f32 * 0.1 - 2.0).to_le_bytes());
    let ply: Vec<u8> = header.into_bytes().into_iter().chain(values).collect();
    let cameras = r#"[{"id":0,"width":64,"height":48,"fx":50.0,"fy":50.0,"position":[0,0,1],"rotation":[[1,0,0],[0,1,0],[0,0,1]]}]"#;
    vec![ply, vec![7; 32 * 3], cameras.into()]
}

static SKELETON: LazyLock<Skeleton> =
    LazyLock::new(|| Puppet::new(PuppetSize::SMALL).avatar().skeleton);

/// A recorded motion: BVH text, or numbers in an archive.
pub(crate) fn motion(bytes: &[u8]) {
    let _ = MotionClip::from_npz(bytes, &SKELETON);
    if let Ok(text) = std::str::from_utf8(bytes) {
        let _ = MotionClip::from_bvh(text, &SKELETON, &LoadOptions::default());
    }
}

pub(crate) fn motion_seeds() -> Vec<Vec<u8>> {
    let bvh = "HIERARCHY\nROOT Hips\n{\n OFFSET 0 0 0\n CHANNELS 6 Xposition Yposition Zposition Zrotation Xrotation Yrotation\n \
               JOINT LeftUpLeg\n {\n  OFFSET 1 0 0\n  CHANNELS 3 Zrotation Xrotation Yrotation\n  End Site\n  {\n   OFFSET 0 -1 0\n  }\n }\n}\n\
               MOTION\nFrames: 2\nFrame Time: 0.033\n0 1 0 0 0 0 0 0 0\n0 1 0 0 0 0 1 2 3\n";
    vec![bvh.as_bytes().to_vec()]
}
