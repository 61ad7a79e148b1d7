//! Each reader on files that other people's programs wrote (`tests/fixtures/README.md`).

use std::path::Path;

use splat_scene::{Format, Scene, SceneError};

use crate::expected::{Axes, Difference, Raw, difference};

fn load(name: &str) -> Result<Scene, SceneError> {
    Scene::load(
        Path::new(env!("CARGO_MANIFEST_DIR"))
            .join("tests/fixtures")
            .join(name),
    )
}

/// The Gaussians of a PLY file whose properties are all `float`, by name.
pub(crate) fn raws(file: &[u8]) -> Vec<Raw> {
    const END: &[u8] = b"end_header\n";
    let end = file.windows(END.len()).position(|w| w == END).unwrap() + END.len();
    let header = std::str::from_utf8(&file[..end]).unwrap();
    let names: Vec<&str> = header
        .lines()
        .filter_map(|line| line.strip_prefix("property float "))
        .collect();
    let values: Vec<f32> = if header.contains("format ascii") {
        let text = std::str::from_utf8(&file[end..]).unwrap();
        text.split_whitespace()
            .map(|word| word.parse().unwrap())
            .collect()
    } else {
        let (words, _) = file[end..].as_chunks();
        words.iter().map(|word| f32::from_le_bytes(*word)).collect()
    };
    let row = |row: &[f32]| {
        let get = |name: &str| row[names.iter().position(|n| *n == name).unwrap()];
        let each = |name: &str, index: usize| get(&format!("{name}{index}"));
        let rest = names
            .iter()
            .filter(|name| name.starts_with("f_rest_"))
            .count()
            / 3;
        Raw {
            position: ["x", "y", "z"].map(get),
            log_scale: std::array::from_fn(|axis| each("scale_", axis)),
            rotation: std::array::from_fn(|axis| each("rot_", axis)),
            opacity: 1.0 / (1.0 + (-get("opacity")).exp()),
            colour: std::array::from_fn(|channel| each("f_dc_", channel)),
            rest: (0..rest)
                .map(|k| std::array::from_fn(|channel| each("f_rest_", channel * rest + k)))
                .collect(),
        }
    };
    values.chunks_exact(names.len()).map(row).collect()
}

fn synthetic() -> Vec<Raw> {
    raws(include_bytes!("../fixtures/synthetic.ply"))
}

/// Rounding of f32 only.
const EXACT: Difference = Difference {
    position: 0.0,
    log_scale: 0.0,
    angle: 1e-6,
    opacity: 1e-6,
    colour: 1e-6,
};

#[test]
fn plyfiles_binary_ply_is_read_exactly() {
    let scene = load("synthetic.ply").unwrap();
    assert_eq!(scene.format(), Format::Ply, "its layout");
    difference(&scene, &synthetic(), Axes::Colmap).assert_within(&EXACT);
}

#[test]
fn plyfiles_text_ply_is_read_exactly() {
    let raws = raws(include_bytes!("../fixtures/synthetic-text.ply"));
    let scene = load("synthetic-text.ply").unwrap();
    assert_eq!(scene.sh_degree(), 1, "9 f_rest properties");
    difference(&scene, &raws, Axes::Colmap).assert_within(&EXACT);
}

#[test]
fn splat_transforms_compressed_ply_is_read_to_its_quantisation() {
    let scene = load("synthetic.compressed.ply").unwrap();
    assert_eq!(scene.format(), Format::CompressedPly, "its layout");
    // Half a step of 1/1023 of 3.5 units on each axis; of 5 in log scale; SH of 1/64 each for up to 15.
    difference(&scene, &synthetic(), Axes::Colmap).assert_within(&Difference {
        position: 0.003,
        log_scale: 0.0026,
        angle: 0.004,
        opacity: 0.002,
        colour: 0.07,
    });
}

#[test]
fn antimatter15s_splat_is_read_to_its_quantisation() {
    let scene = load("synthetic.splat").unwrap();
    assert_eq!(scene.format(), Format::Splat, "detected by its content");
    let mut raws = synthetic();
    for raw in &mut raws {
        raw.rest.clear();
    }
    // That program cuts bytes off instead of rounding them.
    difference(&scene, &raws, Axes::Colmap).assert_within(&Difference {
        position: 0.0,
        log_scale: 1e-5,
        angle: 0.032,
        opacity: 0.004,
        colour: 0.004,
    });
}

#[test]
fn niantics_spz_is_read_to_its_quantisation() {
    // Version 2 leaves w to be found from bytes of the others, which is coarse where w is small.
    for (version, angle) in [(2, 0.06), (3, 0.006)] {
        let scene = load(&format!("synthetic-v{version}.spz")).unwrap();
        assert_eq!(scene.format(), Format::Spz { version }, "its header");
        assert!(!scene.antialiased(), "its flags");
        // Niantic's writer turned COLMAP's axes into the format's own.
        difference(&scene, &synthetic(), Axes::Colmap).assert_within(&Difference {
            position: 0.000_22,
            log_scale: 0.0313,
            angle,
            opacity: 0.002,
            colour: 0.02,
        });
    }
}

#[test]
fn splat_transforms_spz_is_read_to_its_quantisation() {
    let scene = load("synthetic-v4.spz").unwrap();
    assert_eq!(scene.format(), Format::Spz { version: 4 }, "its header");
    assert_eq!(scene.sh_degree(), 3, "its header");
    // Half a step of 1/4096 on each axis and of 1/16; SH of 5 bits in degree 1, 4 above, for up to 15. Before its version 3
    // that program turned the PLY's axes into the format's, as Niantic's does.
    difference(&scene, &synthetic(), Axes::Colmap).assert_within(&Difference {
        position: 0.000_22,
        log_scale: 0.0313,
        angle: 0.006,
        opacity: 0.002,
        colour: 0.2,
    });
}

/// The Gaussians of the SOG scene as the program that wrote it reads them back.
fn synthetic_sog() -> Vec<Raw> {
    raws(include_bytes!("../fixtures/synthetic.sog.ply"))
}

/// Rounding, to f32 on both sides and of quaternions without unit length.
const ALMOST_EXACT: Difference = Difference {
    position: 1e-6,
    log_scale: 1e-6,
    angle: 1e-6,
    opacity: 1e-6,
    colour: 2e-6,
};

#[test]
fn splat_transforms_sog_is_read_to_its_quantisation() {
    let scene = load("synthetic.sog").unwrap();
    assert_eq!(scene.format(), Format::Sog { version: 2 }, "its meta.json");
    assert_eq!(scene.sh_degree(), 3, "its meta.json");
    difference(&scene, &synthetic_sog(), Axes::Colmap).assert_within(&ALMOST_EXACT);
    // 16 bits of the positions' logarithm, cut off; 256 values for a range of 5.5; bytes of a quaternion's parts and of
    // opacity, cut off; and 16 sets of SH coefficients for 24 Gaussians, which is no step at all.
    difference(&scene, &synthetic(), Axes::Colmap).assert_within(&Difference {
        position: 0.000_3,
        log_scale: 0.022,
        angle: 0.025,
        opacity: 0.004,
        colour: 1.0,
    });
}

#[test]
fn splat_transforms_sog_is_read_from_a_folder_too() {
    let folder = tempfile::tempdir().unwrap();
    let file = include_bytes!("../fixtures/synthetic.sog");
    let mut zip = zip::ZipArchive::new(std::io::Cursor::new(file)).unwrap();
    zip.extract(folder.path()).unwrap();
    let scene = Scene::load(folder.path().join("meta.json")).unwrap();
    difference(&scene, &synthetic_sog(), Axes::Colmap).assert_within(&ALMOST_EXACT);
    std::fs::remove_file(folder.path().join("quats.webp")).unwrap();
    let text = Scene::load(folder.path().join("meta.json"))
        .unwrap_err()
        .to_string();
    assert!(text.contains("quats.webp"), "what is missing: {text}");
}
