//! 10,000 damaged files for each reader: an error or a sound scene, never a panic.

use fastrand::Rng;
use splat_scene::cameras::Cameras;
use splat_scene::{MAX_COEFFICIENT, MAX_COORDINATE, MAX_LOG_SCALE, Scene};

use crate::expected::Raw;
use crate::harmonics::raw;
use crate::sog_writer::{self, Members};
use crate::spz4_writer::spz4;
use crate::writers::{self, Dress};

const MUTANTS: u64 = 10_000;

fn raws(coefficients: usize) -> Vec<Raw> {
    let mut random = Rng::with_seed(21);
    (0..12_u8)
        .map(|at| raw(&mut random, coefficients, f32::from(at)))
        .collect()
}

/// One to four changes: bits, a cut, bytes moved, doubled or removed, a number in a header, extreme words.
fn mutate(file: &[u8], random: &mut Rng) -> Vec<u8> {
    let mut file = file.to_vec();
    for _ in 0..random.u8(1..=4) {
        if file.is_empty() {
            return file;
        }
        match random.u8(0..7) {
            0 => {
                for _ in 0..random.u8(1..=8) {
                    let at = random.usize(0..file.len());
                    file[at] ^= 1 << random.u8(0..8);
                }
            }
            1 => file.truncate(random.usize(0..file.len())),
            2 => {
                let (start, end) = range(&file, random);
                file.drain(start..end);
            }
            3 => {
                let (start, end) = range(&file, random);
                let piece = file[start..end].to_vec();
                let at = random.usize(0..=file.len());
                file.splice(at..at, piece);
            }
            4 => {
                let (start, end) = range(&file, random);
                let at = random.usize(0..=file.len() - (end - start));
                file.copy_within(start..end, at);
            }
            5 => number(&mut file, random),
            _ => {
                let words = [
                    0,
                    1,
                    u32::MAX,
                    i32::MAX.unsigned_abs(),
                    f32::NAN.to_bits(),
                    f32::MAX.to_bits(),
                    4_194_304,
                    4_194_305,
                ];
                let word = random.choice(words).unwrap_or_default().to_le_bytes();
                let at = random.usize(0..file.len());
                for (to, from) in file[at..].iter_mut().zip(word) {
                    *to = from;
                }
            }
        }
    }
    file
}

fn range(file: &[u8], random: &mut Rng) -> (usize, usize) {
    let start = random.usize(0..file.len());
    let end = (start + random.usize(1..=64)).min(file.len());
    (start, end)
}

/// Puts another number in place of a run of digits among the first 2000 bytes.
fn number(file: &mut Vec<u8>, random: &mut Rng) {
    let head = &file[..file.len().min(2000)];
    let starts: Vec<usize> = (0..head.len())
        .filter(|&at| head[at].is_ascii_digit() && (at == 0 || !head[at - 1].is_ascii_digit()))
        .collect();
    let Some(&start) = random.choice(&starts) else {
        return;
    };
    let digits = file[start..]
        .iter()
        .take_while(|byte| byte.is_ascii_digit())
        .count();
    let numbers = [
        "0",
        "1",
        "11",
        "13",
        "-1",
        "4194304",
        "4194305",
        "4294967295",
        "18446744073709551615",
        "1e30",
        "nan",
        "",
    ];
    let new = random.choice(numbers).unwrap_or_default();
    file.splice(start..start + digits, new.bytes());
}

/// Every value is in the range that a scene promises.
fn assert_sound(scene: &Scene) {
    let count = scene.len();
    assert_eq!(scene.rotations().len(), count, "one length");
    assert_eq!(scene.log_scales().len(), count, "one length");
    assert_eq!(scene.opacities().len(), count, "one length");
    assert_eq!(scene.colours().len(), count, "one length");
    assert_eq!(
        scene.sh_rest().len(),
        3 * count * scene.rest_coefficients(),
        "one length"
    );
    let within = |values: &[f32], most: f32| values.iter().all(|v| v.abs() <= most);
    assert!(
        within(scene.positions().as_flattened(), MAX_COORDINATE),
        "positions"
    );
    assert!(
        within(scene.log_scales().as_flattened(), MAX_LOG_SCALE),
        "log scales"
    );
    assert!(
        within(scene.colours().as_flattened(), MAX_COEFFICIENT),
        "colours"
    );
    assert!(within(scene.sh_rest(), MAX_COEFFICIENT), "harmonics");
    assert!(
        scene.opacities().iter().all(|v| (0.0..=1.0).contains(v)),
        "opacities"
    );
    for rotation in scene.rotations() {
        let length = rotation.iter().map(|v| v * v).sum::<f32>().sqrt();
        assert!((length - 1.0).abs() < 1e-5, "quaternion of length {length}");
    }
}

/// Reads mutants of `file`, each put through `wrap`; the number that could still be read. Some must be refused, or the
/// changes would test nothing.
fn read_mutants(file: &[u8], seed: u64, name: &str, wrap: fn(Vec<u8>) -> Vec<u8>) -> u64 {
    assert_sound(&Scene::read(&wrap(file.to_vec()), name).expect("sound before it is changed"));
    let mut read = 0;
    for mutant in 0..MUTANTS {
        let mut random = Rng::with_seed(seed << 32 | mutant);
        match Scene::read(&wrap(mutate(file, &mut random)), name) {
            Ok(scene) => {
                assert_sound(&scene);
                read += 1;
            }
            Err(error) => {
                let text = error.to_string();
                assert!(text.len() < 1000, "a message to read: {text}");
            }
        }
    }
    println!("{name}: {read} of {MUTANTS} mutants read");
    assert!(read <= MUTANTS - 50, "{read} mutants read");
    read
}

fn as_it_is(file: Vec<u8>) -> Vec<u8> {
    file
}

fn zipped(payload: Vec<u8>) -> Vec<u8> {
    writers::gzip(&payload)
}

#[test]
fn mutants_of_standard_ply_never_panic() {
    let file = writers::ply(&raws(3), Dress::Strange);
    let read = read_mutants(&file, 1, "a.ply", as_it_is);
    assert!(read >= 500, "{read} mutants read");
}

#[test]
fn mutants_of_text_ply_never_panic() {
    let file = writers::ply(&raws(0), Dress::Text);
    let read = read_mutants(&file, 2, "a.ply", as_it_is);
    assert!(read >= 500, "{read} mutants read");
}

#[test]
fn mutants_of_compressed_ply_never_panic() {
    for (seed, colour_bounds) in [(3, true), (4, false)] {
        let file = writers::compressed_ply(&raws(3), colour_bounds);
        let read = read_mutants(&file, seed, "a.ply", as_it_is);
        assert!(read >= 500, "{read} mutants read");
    }
}

#[test]
fn mutants_of_splat_never_panic() {
    for (seed, name) in [(5, "a.splat"), (6, "a.bin")] {
        let read = read_mutants(&writers::splat(&raws(0)), seed, name, as_it_is);
        assert!(read >= 50, "{read} mutants read");
    }
}

#[test]
fn mutants_of_spz_never_panic_outside_their_gzip() {
    for version in [2, 3] {
        let file = writers::gzip(&writers::spz_payload(&raws(3), version, 12, 0));
        // Hardly any is read: gzip's checksum refuses it. The changes inside are the other test's.
        read_mutants(&file, u64::from(5 + version), "a.spz", as_it_is);
    }
}

#[test]
fn mutants_of_spz_never_panic_inside_their_gzip() {
    for version in [2, 3] {
        let payload = writers::spz_payload(&raws(8), version, 12, 3);
        for wrap in [zipped, as_it_is] {
            let read = read_mutants(&payload, u64::from(8 + version), "a.spz", wrap);
            assert!(read >= 500, "{read} mutants read");
        }
    }
}

#[test]
fn mutants_of_spz_version_4_never_panic() {
    // The flags state extensions, which are not there until a change puts the table elsewhere.
    let read = read_mutants(&spz4(&raws(8), 12, 3), 13, "a.spz", as_it_is);
    assert!(read >= 500, "{read} mutants read");
}

#[test]
fn mutants_of_third_party_streams_and_images_never_panic() {
    let spz = include_bytes!("../fixtures/synthetic-v4.spz");
    read_mutants(spz, 14, "a.spz", as_it_is);
    // Hardly any is read: the zip has a checksum of each member. The changes inside are the other tests'.
    let sog = include_bytes!("../fixtures/synthetic.sog");
    read_mutants(sog, 15, "a.sog", as_it_is);
}

#[test]
fn mutants_of_sog_never_panic_inside_their_zip() {
    for version in [1, 2] {
        let members = sog_writer::members(&raws(3), version);
        let mut read = 0;
        for mutant in 0..MUTANTS {
            let mut random = Rng::with_seed(u64::from(15 + version) << 32 | mutant);
            let mut members: Members = members.clone();
            let index = random.usize(0..members.len());
            members[index].1 = mutate(&members[index].1, &mut random);
            let file = sog_writer::bundle(&members, zip::CompressionMethod::Stored);
            match Scene::read(&file, "a.sog") {
                Ok(scene) => {
                    assert_sound(&scene);
                    read += 1;
                }
                Err(error) => {
                    let text = error.to_string();
                    assert!(text.len() < 1000, "a message to read: {text}");
                }
            }
        }
        println!("version {version}: {read} of {MUTANTS} mutants read");
        assert!((100..MUTANTS - 50).contains(&read), "{read} mutants read");
    }
}

#[test]
fn mutants_of_cameras_never_panic() {
    let file = crate::cameras::EXAMPLE.as_bytes();
    let mut read = 0;
    for mutant in 0..MUTANTS {
        let mut random = Rng::with_seed(12 << 32 | mutant);
        if let Ok(cameras) = Cameras::parse(&mutate(file, &mut random), "cameras.json") {
            for camera in cameras.all() {
                assert!(camera.world_from_camera.is_normalized(), "a rotation");
                assert!(camera.position.iter().all(|v| v.is_finite()), "a place");
                assert!(camera.fx > 0.0 && camera.fy > 0.0, "focal lengths");
                assert!(camera.width > 0 && camera.height > 0, "a size");
            }
            read += 1;
        }
    }
    assert!((50..MUTANTS - 50).contains(&read), "{read} mutants read");
}
