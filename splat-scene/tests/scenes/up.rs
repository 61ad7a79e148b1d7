//! Which way is up: detected, and turned.

use glam::{DVec3, Quat, Vec3};
use splat_scene::cameras::Cameras;
use splat_scene::{Placement, Scene, UpAxis, UpEvidence};

use crate::expected::{Axes, Difference, Raw, difference};
use crate::harmonics::raw;
use crate::sog_writer::sog;
use crate::spz4_writer::{extension, parts, spz4};
use crate::writers::{self, Dress};

const ALMOST: Difference = Difference {
    position: 1e-5,
    log_scale: 0.0,
    angle: 1e-5,
    opacity: 1e-6,
    colour: 2e-5,
};

/// The vector that an axis is.
fn vector(axis: UpAxis) -> Vec3 {
    match axis {
        UpAxis::PlusX => Vec3::X,
        UpAxis::MinusX => Vec3::NEG_X,
        UpAxis::PlusY => Vec3::Y,
        UpAxis::MinusY => Vec3::NEG_Y,
        UpAxis::PlusZ => Vec3::Z,
        UpAxis::MinusZ => Vec3::NEG_Z,
    }
}

fn few(coefficients: usize) -> Vec<Raw> {
    let mut random = fastrand::Rng::with_seed(31);
    (0..9_u8)
        .map(|at| raw(&mut random, coefficients, f32::from(at)))
        .collect()
}

/// A floor of 4 x 4 at a height of `level` with a pillar of 1 x 1 x 2 on it and nothing else, in a file whose `up` is up.
fn courtyard(up: UpAxis, level: f32) -> Vec<Raw> {
    let mut random = fastrand::Rng::with_seed(32);
    let turn = Quat::from_rotation_arc(Vec3::Y, vector(up));
    (0..12_000)
        .map(|index| {
            let mut signed = || random.f32() - 0.5;
            let place = if index % 6 > 0 {
                Vec3::new(4.0 * signed(), 0.02 * signed(), 4.0 * signed())
            } else {
                Vec3::new(signed(), 1.0 + 2.0 * signed(), signed())
            };
            let mut raw = raw(&mut random, 0, 0.0);
            raw.position = (turn * (place + level * Vec3::Y)).to_array();
            raw.opacity = 0.9;
            raw
        })
        .collect()
}

#[test]
fn an_axis_is_read_as_it_is_written() {
    for axis in UpAxis::ALL {
        assert_eq!(axis.to_string().parse(), Ok(axis), "{axis}");
    }
    let text = "up".parse::<UpAxis>().unwrap_err().to_string();
    assert!(text.contains("`up`") && text.contains("+z"), "{text}");
}

#[test]
fn each_axis_can_be_turned_up_and_takes_the_whole_scene_along() {
    for axis in UpAxis::ALL {
        for house in [false, true] {
            let raws = few(15);
            let (file, axes) = if house {
                (writers::spz_payload(&raws, 3, 12, 0), Axes::House)
            } else {
                (writers::ply(&raws, Dress::Plain), Axes::Colmap)
            };
            let mut scene = Scene::read(&file, "x").unwrap();
            let before = scene.clone();
            let usual = if house { UpAxis::PlusY } else { UpAxis::MinusY };
            assert_eq!(scene.up(), usual, "as it is read");
            scene.turn_up(axis);
            assert_eq!(scene.up(), axis, "as it was turned");
            // Where the file's axis points, measured by a Gaussian.
            let own = DVec3::from_array(raws[4].position.map(f64::from));
            let height = own.dot(vector(axis).as_dvec3());
            let off = (f64::from(scene.positions()[4][1]) - height).abs();
            assert!(off < 3e-4, "{axis}: height {off} from {height}");
            // It is the same scene, turned: turned back, it is equal.
            scene.turn_up(usual);
            for (a, b) in scene.positions().iter().zip(before.positions()) {
                assert_eq!(a, b, "{axis} and back");
            }
            let limit = if house {
                Difference {
                    position: 0.000_22,
                    log_scale: 0.0313,
                    angle: 0.006,
                    opacity: 0.002,
                    colour: 0.035,
                }
            } else {
                ALMOST
            };
            difference(&scene, &raws, axes).assert_within(&limit);
        }
    }
}

#[test]
fn a_floor_tells_what_is_up_in_each_format() {
    for (axis, is_told) in [
        (UpAxis::MinusY, true),
        (UpAxis::PlusY, true),
        (UpAxis::PlusZ, true),
        // These are walls.
        (UpAxis::MinusZ, false),
        (UpAxis::PlusX, false),
        (UpAxis::MinusX, false),
    ] {
        let raws = courtyard(axis, 5.0);
        let files = [
            writers::ply(&raws, Dress::Plain),
            writers::compressed_ply(&raws, true),
            writers::splat(&raws),
            writers::gzip(&writers::spz_payload(&raws, 3, 12, 0)),
            spz4(&raws, 12, 0),
            sog(&raws, 2),
        ];
        for file in files {
            let scene = Scene::read(&file, "x").unwrap();
            let detected = scene.detect_up(None);
            if is_told {
                assert_eq!(detected.axis, axis, "{}: {detected:?}", scene.format());
                assert!(
                    matches!(detected.evidence, UpEvidence::Floor { share } if share > 0.75),
                    "{detected:?}"
                );
            } else {
                assert_eq!(detected.evidence, UpEvidence::Format, "{axis}");
                assert_eq!(detected.axis, scene.up(), "it stays as it was read");
            }
        }
    }
}

#[test]
fn a_scene_without_evidence_stays_as_its_format_has_it() {
    let mut random = fastrand::Rng::with_seed(33);
    let mut cloud = |shell: bool| -> Vec<Raw> {
        (0..6000)
            .map(|_| {
                let place = Vec3::from_array(std::array::from_fn(|_| random.f32() * 2.0 - 1.0));
                let mut raw = raw(&mut random, 0, 0.0);
                // A room of four walls, a floor and a ceiling, or a filled cube.
                let out = if shell {
                    place / place.abs().max_element()
                } else {
                    place
                };
                raw.position = (out * 3.0).to_array();
                raw.opacity = 0.9;
                raw
            })
            .collect()
    };
    let mut plane = courtyard(UpAxis::PlusZ, 5.0);
    plane.iter_mut().for_each(|raw| raw.position[2] = 5.0);
    for raws in [cloud(true), cloud(false), few(0), plane] {
        let ply = Scene::read(&writers::ply(&raws, Dress::Plain), "x").unwrap();
        let detected = ply.detect_up(None);
        assert_eq!(
            (detected.axis, detected.evidence),
            (UpAxis::MinusY, UpEvidence::Format),
            "PLY"
        );
        let spz = Scene::read(&spz4(&raws, 12, 0), "x").unwrap();
        let detected = spz.detect_up(None);
        assert_eq!(
            (detected.axis, detected.evidence),
            (UpAxis::PlusY, UpEvidence::Format),
            ".spz"
        );
    }
}

#[test]
fn an_spz_that_stands_on_the_origin_is_told_by_that_and_a_ply_is_not() {
    for (axis, file_sign) in [(UpAxis::PlusY, 1.0), (UpAxis::MinusY, -1.0)] {
        let mut random = fastrand::Rng::with_seed(34);
        let raws: Vec<Raw> = (0..4000)
            .map(|_| {
                let mut raw = raw(&mut random, 0, 0.0);
                // A ball on the floor.
                let on_ball = Vec3::from_array(std::array::from_fn(|_| random.f32() - 0.5));
                let place = on_ball.normalize_or(Vec3::X) + Vec3::Y;
                raw.position = [place.x, file_sign * place.y, place.z];
                raw.opacity = 0.9;
                raw
            })
            .collect();
        let spz = Scene::read(&spz4(&raws, 12, 0), "x")
            .unwrap()
            .detect_up(None);
        assert_eq!((spz.axis, spz.evidence), (axis, UpEvidence::Origin), ".spz");
        let ply = Scene::read(&writers::ply(&raws, Dress::Plain), "x").unwrap();
        let ply = ply.detect_up(None);
        assert_eq!(
            (ply.axis, ply.evidence),
            (UpAxis::MinusY, UpEvidence::Format),
            "PLY"
        );
    }
}

#[test]
fn an_spz_in_the_plys_axes_comes_to_lie_as_the_ply_does() {
    let raws = courtyard(UpAxis::MinusY, 5.0);
    let mut scene = Scene::read(&spz4(&raws, 12, 0), "x").unwrap();
    let cameras_turn = scene.turn_up(scene.detect_up(None).axis);
    let ply = Scene::read(&writers::ply(&raws, Dress::Plain), "x").unwrap();
    for (a, b) in scene.positions().iter().zip(ply.positions()) {
        let off = (Vec3::from_array(*a) - Vec3::from_array(*b)).length();
        assert!(off < 0.000_3, "{a:?} instead of {b:?}");
    }
    // The cameras are in the PLY's axes and lie right already.
    assert!(
        cameras_turn.angle_between(Quat::IDENTITY) < 1e-3,
        "{cameras_turn}"
    );
}

#[test]
fn stated_axes_stand_above_every_other_evidence() {
    let mut four = parts(&courtyard(UpAxis::MinusY, 5.0), 12, 2);
    // Right, front, up.
    four.extensions = extension(0xADBE_0003, &12_u32.to_le_bytes());
    let scene = Scene::read(&four.join(), "x").unwrap();
    let detected = scene.detect_up(Some(&cameras(12, UpAxis::MinusY)));
    assert_eq!(
        (detected.axis, detected.evidence),
        (UpAxis::PlusZ, UpEvidence::Stated),
        "{detected:?}"
    );
    assert_eq!(scene.up(), UpAxis::PlusZ, "it lies so");
}

/// Cameras around the origin that look at it from 30 degrees above, in a PLY's axes of which `up` points up.
fn cameras(count: u8, up: UpAxis) -> Cameras {
    let turn = Quat::from_rotation_arc(Vec3::Y, vector(up));
    let list: Vec<String> = (0..count)
        .map(|id| {
            let around = std::f32::consts::TAU * f32::from(id) / f32::from(count);
            let eye = Vec3::new(3.0 * around.cos(), 1.73, 3.0 * around.sin());
            let forward = -eye.normalize();
            let right = forward.cross(Vec3::Y).normalize();
            let down = forward.cross(right);
            let [right, down, forward, eye] =
                [right, down, forward, eye].map(|v| (turn * v).to_array());
            let row = |index: usize| [right[index], down[index], forward[index]];
            let rows = [row(0), row(1), row(2)];
            format!(
                r#"{{"id":{id},"width":4,"height":3,"position":{eye:?},"rotation":{rows:?},"fx":1,"fy":1}}"#
            )
        })
        .collect();
    Cameras::parse(format!("[{}]", list.join(",")).as_bytes(), "cameras.json").unwrap()
}

#[test]
fn cameras_tell_what_is_up_and_turn_with_the_scene() {
    let raws = few(3);
    for axis in UpAxis::ALL {
        let cameras = cameras(12, axis);
        let mut scene = Scene::read(&writers::ply(&raws, Dress::Plain), "x").unwrap();
        let before = scene.clone();
        let detected = scene.detect_up(Some(&cameras));
        assert_eq!(detected.axis, axis, "{detected:?}");
        assert!(
            matches!(detected.evidence, UpEvidence::Cameras { count: 12, degrees } if degrees < 1.0),
            "{detected:?}"
        );
        let turn = scene.turn_up(axis);
        let camera = &cameras.all()[5];
        let seen = |position: &[f32; 3], turn: Quat| {
            let from_eye = Vec3::from_array(*position) - turn * Vec3::from_array(camera.position);
            (turn * camera.world_from_camera).inverse() * from_eye
        };
        for (a, b) in scene.positions().iter().zip(before.positions()) {
            let off = (seen(a, turn) - seen(b, Quat::IDENTITY)).length();
            assert!(off < 1e-4, "{axis}: seen {off} from where it was seen");
        }
    }
    // Too few, and as many up as down.
    let scene = Scene::read(&writers::ply(&raws, Dress::Plain), "x").unwrap();
    let detected = scene.detect_up(Some(&cameras(3, UpAxis::PlusZ)));
    assert_eq!(detected.evidence, UpEvidence::Format, "three cameras");
}

#[test]
fn a_trained_scene_is_found_to_stand_on_its_ground() {
    let Some(path) = crate::real_scene::real_file("splats/playbot3.ply") else {
        return;
    };
    let scene = Scene::load(path).unwrap();
    let detected = scene.detect_up(None);
    println!("{detected:?}: {}", detected.evidence);
    assert_eq!(detected.axis, UpAxis::MinusY, "{detected:?}");
    assert!(
        matches!(detected.evidence, UpEvidence::Floor { .. }),
        "{detected:?}"
    );
    // The same file with z up, as other trainers write it: file z is OpenXR's y, file y OpenXR's front.
    let mut lying = scene.clone();
    let quarter = Quat::from_rotation_x(-std::f32::consts::FRAC_PI_2);
    lying.place(&Placement::new(1.0, quarter, Vec3::ZERO).unwrap());
    let lying = Scene::read(&lying.to_ply(), "lying.ply").unwrap();
    let detected = lying.detect_up(None);
    assert_eq!(detected.axis, UpAxis::PlusZ, "{detected:?}");
}

#[test]
fn cameras_are_found_where_the_trainer_leaves_them() {
    let folder = tempfile::tempdir().unwrap();
    let deep = folder.path().join("point_cloud/iteration_30000");
    std::fs::create_dir_all(&deep).unwrap();
    let scene = deep.join("point_cloud.ply");
    assert_eq!(Cameras::beside(&scene), None, "none is there");
    let trained = folder.path().join("cameras.json");
    std::fs::write(&trained, "[]").unwrap();
    assert_eq!(
        Cameras::beside(&scene),
        Some(trained.clone()),
        "two folders above"
    );
    let beside = deep.join("cameras.json");
    std::fs::write(&beside, "[]").unwrap();
    assert_eq!(Cameras::beside(&scene), Some(beside), "nearer");
    let other = folder.path().join("scan/scene.ply");
    std::fs::create_dir_all(other.parent().unwrap()).unwrap();
    assert_eq!(Cameras::beside(&other), None, "not of any folder above");
}
