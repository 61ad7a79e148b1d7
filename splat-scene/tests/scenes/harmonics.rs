//! Rotated spherical harmonics and scenes against an evaluation in f64 from the definition.

use glam::{DMat3, DVec3, Quat, Vec3};
use splat_scene::{Placement, Scene, SceneBuilder, ShRotation, Splat, sh_basis};

use crate::expected::{Axes, Raw, difference, directions, harmonics, seen};

#[test]
fn the_basis_functions_are_real_spherical_harmonics() {
    for direction in directions() {
        let expected = harmonics(direction);
        for (index, (a, b)) in sh_basis(direction.to_array())
            .into_iter()
            .zip(expected)
            .enumerate()
        {
            assert!(
                (a - b).abs() < 1e-12,
                "function {index} is {a}, by definition {b}"
            );
        }
    }
}

fn rotations() -> impl Iterator<Item = Quat> {
    let mut random = fastrand::Rng::with_seed(3);
    let drawn = std::iter::repeat_with(move || {
        Quat::from_array(std::array::from_fn(|_| random.f32() - 0.5)).normalize()
    });
    let half = std::f32::consts::PI;
    [
        Quat::IDENTITY,
        Quat::from_rotation_x(half),
        Quat::from_rotation_y(1.0),
        Quat::from_rotation_z(0.3),
    ]
    .into_iter()
    .chain(drawn.take(60))
}

#[test]
fn turned_coefficients_show_each_colour_in_the_turned_direction() {
    let mut random = fastrand::Rng::with_seed(4);
    for rotation in rotations() {
        let turn = ShRotation::new(rotation);
        for coefficients in [0, 3, 8, 15] {
            let before: Vec<[f32; 3]> = (0..coefficients)
                .map(|_| std::array::from_fn(|_| random.f32() * 2.0 - 1.0))
                .collect();
            let mut after = before.clone();
            turn.apply(after.as_flattened_mut());
            let matrix = DMat3::from_quat(rotation.as_dquat().normalize());
            for direction in directions() {
                let a = seen([0.1; 3], &before, direction);
                let b = seen([0.1; 3], &after, matrix * direction);
                assert!(
                    (a - b).abs().max_element() < 3e-6,
                    "{a} became {b} under {rotation}"
                );
            }
        }
    }
}

#[test]
fn a_placed_scene_is_the_same_scene_elsewhere() {
    let mut random = fastrand::Rng::with_seed(5);
    for rotation in rotations() {
        let raws: Vec<Raw> = (0..6_u8)
            .map(|at| raw(&mut random, 8, f32::from(at)))
            .collect();
        let mut scene = scene(&raws);
        difference(&scene, &raws, Axes::House).assert_within(&small(1e-5));
        let (scale, move_by) = (0.5 + random.f32(), Vec3::new(0.3, -2.0, 1.0));
        scene.place(&Placement::new(scale, rotation, move_by).unwrap());
        // Where each Gaussian must be, from f64, without the crate.
        let matrix = DMat3::from_quat(rotation.as_dquat().normalize());
        for (index, raw) in raws.iter().enumerate() {
            let from = DVec3::from_array(raw.position.map(f64::from));
            let to = matrix * (from * f64::from(scale)) + move_by.as_dvec3();
            let got = DVec3::from_array(scene.positions()[index].map(f64::from));
            assert!(got.distance(to) < 2e-5, "{from} went to {got}, not {to}");
            let got = covariance(scene.rotations()[index], scene.log_scales()[index]);
            let [w, x, y, z] = raw.rotation;
            let own = covariance([x, y, z, w], raw.log_scale);
            let expected = matrix * own * matrix.transpose() * f64::from(scale * scale);
            let off = (got - expected)
                .to_cols_array()
                .iter()
                .fold(0.0_f64, |a, b| a.max(b.abs()));
            let size = expected
                .to_cols_array()
                .iter()
                .fold(0.0_f64, |a, b| a.max(b.abs()));
            assert!(off < 1e-5 * size, "covariance {got} is not {expected}");
            let (rest, _) = scene.sh_rest()[24 * index..][..24].as_chunks();
            for direction in directions() {
                let a = seen(raw.colour, &raw.rest, direction);
                let b = seen(scene.colours()[index], rest, matrix * direction);
                assert!((a - b).abs().max_element() < 3e-6, "colour {a} became {b}");
            }
        }
    }
}

#[test]
fn placements_that_are_none_are_refused() {
    let (turn, move_by) = (Quat::IDENTITY, Vec3::ZERO);
    for scale in [0.0, -1.0, f32::NAN, f32::INFINITY] {
        assert!(
            Placement::new(scale, turn, move_by).is_err(),
            "scale {scale}"
        );
    }
    for turn in [
        Quat::from_xyzw(0.0, 0.0, 0.0, 0.0),
        Quat::from_xyzw(f32::NAN, 0.0, 0.0, 1.0),
    ] {
        assert!(
            Placement::new(1.0, turn, move_by).is_err(),
            "rotation {turn}"
        );
    }
    for move_by in [Vec3::splat(1e30), Vec3::new(0.0, f32::NAN, 0.0)] {
        assert!(
            Placement::new(1.0, turn, move_by).is_err(),
            "translation {move_by}"
        );
    }
}

fn covariance([x, y, z, w]: [f32; 4], log_scale: [f32; 3]) -> DMat3 {
    let axes = DMat3::from_quat(Quat::from_xyzw(x, y, z, w).as_dquat().normalize());
    let squares = DVec3::from_array(log_scale.map(|s| (2.0 * f64::from(s)).exp()));
    axes * DMat3::from_diagonal(squares) * axes.transpose()
}

fn small(limit: f64) -> crate::expected::Difference {
    crate::expected::Difference {
        position: limit,
        log_scale: limit,
        angle: limit,
        opacity: limit,
        colour: limit,
    }
}

/// A random Gaussian near `at` on the x axis, with so many coefficients above degree 0.
pub(crate) fn raw(random: &mut fastrand::Rng, coefficients: usize, at: f32) -> Raw {
    let mut signed = || random.f32() * 2.0 - 1.0;
    Raw {
        position: [at + 0.3 * signed(), signed(), signed()],
        log_scale: std::array::from_fn(|_| -3.0 + 2.0 * signed()),
        rotation: std::array::from_fn(|_| signed()),
        opacity: 0.5 + 0.45 * signed(),
        colour: std::array::from_fn(|_| 1.6 * signed()),
        rest: (0..coefficients)
            .map(|_| std::array::from_fn(|_| 0.6 * signed()))
            .collect(),
    }
}

/// A scene made in memory of Gaussians in OpenXR's axes.
fn scene(raws: &[Raw]) -> Scene {
    let mut builder = SceneBuilder::new(2).unwrap();
    for raw in raws {
        let [w, x, y, z] = raw.rotation;
        let splat = Splat {
            position: raw.position,
            rotation: [x, y, z, w],
            log_scale: raw.log_scale,
            opacity: raw.opacity,
            colour: raw.colour,
        };
        builder.push(&splat, raw.rest.as_flattened()).unwrap();
    }
    builder.finish()
}
