use super::super::{SHADOW_GAUSSIANS, contact_shadow};
use super::*;
use renderer_splat::gaussian::Gaussian;

fn cast(standing: &Standing, floor_from_person: &Affine3A) -> Vec<Gaussian> {
    let shadow = contact_shadow(standing, floor_from_person);
    shadow.gaussians().iter().map(|g| g.unpacked()).collect()
}

/// Share of light that the shadow takes from a point of the floor.
fn darkness(shadow: &[Gaussian], x: f32, z: f32) -> f32 {
    let passes = |gaussian: &Gaussian| {
        let [dx, dz] = [x - gaussian.position[0], z - gaussian.position[2]];
        let radius = gaussian.scale[0];
        1.0 - gaussian.opacity * (-(dx * dx + dz * dz) / (2.0 * radius * radius)).exp()
    };
    1.0 - shadow.iter().map(passes).product::<f32>()
}

#[test]
fn it_is_dark_under_the_soles_faint_beside_them_and_nothing_a_few_steps_away() {
    let standing = standing_at(0.0, Vec2::ZERO);
    let shadow = cast(&standing, &Affine3A::IDENTITY);
    for sole in standing.soles {
        let middle = sole.iter().sum::<Vec3>() / sole.len() as f32;
        let [under, near, far] = [0.0, 0.3, 2.0]
            .map(|away| darkness(&shadow, middle.x + away * middle.x.signum(), middle.z));
        assert!((0.35..0.9).contains(&under), "under the sole {under}");
        assert!((0.02..0.3).contains(&near), "beside it {near}");
        assert!(far < 1.0 / 255.0, "far away {far}");
    }
}

#[test]
fn its_gaussians_are_black_and_lie_flat_on_the_floor() {
    let shadow = cast(&standing_at(1.0, Vec2::ONE), &Affine3A::IDENTITY);
    assert!(
        (20..=SHADOW_GAUSSIANS).contains(&shadow.len()),
        "{}",
        shadow.len()
    );
    for gaussian in &shadow {
        assert_eq!(gaussian.colour, [0.0; 3], "black");
        assert!((0.0..0.01).contains(&gaussian.position[1]), "on the floor");
        assert!(
            gaussian.scale[1] < 0.002 && gaussian.scale[0] > 0.02,
            "flat"
        );
        assert!(
            gaussian.opacity >= 1.0 / 255.0 && gaussian.opacity < 0.6,
            "soft"
        );
    }
}

#[test]
fn it_goes_where_the_person_was_put() {
    let standing = standing_at(0.7, Vec2::new(-1.0, 0.5));
    let floor_from_person = pose(Vec3::new(2.0, 0.0, -3.0), 1.1, 0.0);
    let here = cast(&standing, &Affine3A::IDENTITY);
    let there = cast(&standing, &floor_from_person);
    assert_eq!(here.len(), there.len(), "as many");
    for (here, there) in here.iter().zip(&there) {
        let expected = floor_from_person.transform_point3(Vec3::from_array(here.position));
        let got = Vec3::from_array(there.position);
        assert!(got.abs_diff_eq(expected, 1e-4), "{got} for {expected}");
    }
}

#[test]
fn it_grows_wide_and_faint_as_the_person_rises_and_is_gone_high_up() {
    let raised = |metres: f32| {
        let mut motion = motion(0.0, Vec2::ZERO);
        motion.root_translation.y += metres;
        let standing = Standing::of(skeleton(), &motion).expect("a pose");
        let shadow = cast(&standing, &Affine3A::IDENTITY);
        let sole = standing.soles[0].iter().sum::<Vec3>() / standing.soles[0].len() as f32;
        (shadow.len(), darkness(&shadow, sole.x, sole.z))
    };
    let heights = [0.0, 0.1, 0.3, 0.8].map(|metres| raised(metres).1);
    assert!(heights.is_sorted_by(|low, high| low > high), "{heights:?}");
    assert_eq!(raised(30.0), (0, 0.0), "too faint to be drawn");
}
