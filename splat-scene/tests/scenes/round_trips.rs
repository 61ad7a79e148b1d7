//! Random scenes through each format and back, to within the format's quantisation.

use proptest::prelude::*;
use splat_scene::{Format, Scene};

use crate::expected::{Axes, Difference, Raw, difference};
use crate::harmonics::raw;
use crate::sog_writer::sog;
use crate::spz4_writer::{extension, parts, spz4};
use crate::writers::{self, Dress};

/// Scenes of 1 to 40 Gaussians of any SH degree, far enough apart to tell them from one another.
fn scenes() -> impl Strategy<Value = Vec<Raw>> {
    (
        any::<u64>(),
        1..=40_u8,
        prop::sample::select(vec![0, 3, 8, 15]),
    )
        .prop_map(|(seed, count, coefficients)| {
            let mut random = fastrand::Rng::with_seed(seed);
            (0..count)
                .map(|at| raw(&mut random, coefficients, f32::from(at)))
                .collect()
        })
}

const EXACT: Difference = Difference {
    position: 0.0,
    log_scale: 0.0,
    angle: 1e-6,
    opacity: 1e-6,
    colour: 1e-5,
};

proptest! {
    #![proptest_config(ProptestConfig { cases: 48, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn standard_ply_in_any_dress_is_read_exactly(raws in scenes()) {
        for dress in [Dress::Plain, Dress::Strange, Dress::Text] {
            let scene = Scene::read(&writers::ply(&raws, dress), "x").unwrap();
            difference(&scene, &raws, Axes::Colmap).assert_within(&EXACT);
        }
    }

    #[test]
    fn our_own_ply_comes_back_as_it_was(raws in scenes()) {
        let scene = Scene::read(&writers::ply(&raws, Dress::Plain), "x").unwrap();
        let file = scene.to_ply();
        let again = Scene::read(&file, "x").unwrap();
        let mut written = Vec::new();
        scene.write_ply(&mut written).unwrap();
        prop_assert_eq!(&written, &file);
        difference(&again, &raws, Axes::Colmap).assert_within(&EXACT);
        // Another program reads the same numbers from these bytes.
        let raws_again = crate::third_party::raws(&file);
        difference(&scene, &raws_again, Axes::Colmap).assert_within(&EXACT);
    }

    #[test]
    fn compressed_ply_is_read_to_its_quantisation(raws in scenes(), colour_bounds: bool) {
        let scene = Scene::read(&writers::compressed_ply(&raws, colour_bounds), "x").unwrap();
        prop_assert_eq!(scene.format(), Format::CompressedPly);
        // Up to 40 units in x in steps of 1/2047, colours of up to 0.95 (the scene's range is 0.05 to 0.95).
        difference(&scene, &raws, Axes::Colmap).assert_within(&Difference {
            position: 0.011,
            log_scale: 0.0021,
            angle: 0.005,
            opacity: 0.002,
            colour: 0.07,
        });
    }

    #[test]
    fn splat_is_read_to_its_quantisation(mut raws in scenes()) {
        raws.iter_mut().for_each(|raw| raw.rest.clear());
        let scene = Scene::read(&writers::splat(&raws), "x").unwrap();
        prop_assert_eq!(scene.format(), Format::Splat);
        difference(&scene, &raws, Axes::Colmap).assert_within(&Difference {
            position: 0.0,
            log_scale: 1e-5,
            angle: 0.02,
            opacity: 0.002,
            colour: 0.002,
        });
    }

    #[test]
    fn spz_is_read_to_its_quantisation(raws in scenes(), antialiased: bool, bare: bool) {
        for (version, angle) in [(2, 0.25), (3, 0.006)] {
            for fractional_bits in [9, 12] {
                let payload =
                    writers::spz_payload(&raws, version, fractional_bits, u8::from(antialiased));
                let file = if bare { payload } else { writers::gzip(&payload) };
                let scene = Scene::read(&file, "x").unwrap();
                prop_assert_eq!(scene.format(), Format::Spz { version });
                prop_assert_eq!(scene.antialiased(), antialiased);
                difference(&scene, &raws, Axes::House).assert_within(&Difference {
                    position: 0.87 * f64::from(-i32::from(fractional_bits)).exp2(),
                    log_scale: 0.0313,
                    angle,
                    opacity: 0.002,
                    colour: 0.035,
                });
            }
        }
    }

    #[test]
    fn spz_of_version_4_is_read_to_its_quantisation(raws in scenes(), antialiased: bool) {
        let scene = Scene::read(&spz4(&raws, 12, u8::from(antialiased)), "x").unwrap();
        prop_assert_eq!(scene.format(), Format::Spz { version: 4 });
        prop_assert_eq!(scene.antialiased(), antialiased);
        difference(&scene, &raws, Axes::House).assert_within(&SPZ);
    }

    #[test]
    fn spz_in_other_axes_is_turned_into_openxrs(raws in scenes(), system in 1..=16_u32) {
        let axes = Axes::SPZ[system as usize - 1];
        let stated = extension(0xADBE_0003, &system.to_le_bytes());
        let unknown = extension(0x1234_0001, b"anything");
        let mut four = parts(&raws, 12, 2);
        four.extensions = [unknown, stated.clone()].concat();
        let mut three = writers::spz_payload(&raws, 3, 12, 2);
        three.extend(stated);
        for file in [four.join(), writers::gzip(&three), three] {
            let scene = Scene::read(&file, "x").unwrap();
            difference(&scene, &raws, axes).assert_within(&SPZ);
        }
    }

    #[test]
    fn sog_is_read_to_its_quantisation(raws in scenes()) {
        for version in [1, 2] {
            let scene = Scene::read(&sog(&raws, version), "x").unwrap();
            prop_assert_eq!(scene.format(), Format::Sog { version });
            difference(&scene, &raws, Axes::Colmap).assert_within(&Difference {
                // Half of 1/65535 of a logarithm of up to 5, times 42, on one axis.
                position: 0.002,
                log_scale: 0.008,
                // Half of 1/255 of a part's range, on three of them, doubled where the fourth is small.
                angle: 0.02,
                opacity: 0.006,
                colour: 0.03,
            });
        }
    }
}

const SPZ: Difference = Difference {
    position: 0.000_22,
    log_scale: 0.0313,
    angle: 0.006,
    opacity: 0.002,
    colour: 0.035,
};

#[test]
fn compressed_ply_takes_each_gaussian_with_its_own_chunk() {
    let mut random = fastrand::Rng::with_seed(8);
    let raws: Vec<Raw> = (0..600_u16)
        .map(|at| raw(&mut random, 3, f32::from(at)))
        .collect();
    let scene = Scene::read(&writers::compressed_ply(&raws, true), "x").unwrap();
    difference(&scene, &raws, Axes::Colmap).assert_within(&Difference {
        position: 0.07,
        log_scale: 0.0021,
        angle: 0.005,
        opacity: 0.002,
        colour: 0.04,
    });
}

#[test]
fn a_scene_of_no_gaussians_is_a_scene() {
    let scene = Scene::read(
        &splat_scene::SceneBuilder::new(1).unwrap().finish().to_ply(),
        "x",
    )
    .unwrap();
    assert!(scene.is_empty(), "no Gaussian was written");
    assert_eq!(scene.sh_degree(), 1, "the properties were");
    assert!(
        scene.bounds().is_none() && scene.robust_bounds().is_none(),
        "nothing to go around"
    );
}
