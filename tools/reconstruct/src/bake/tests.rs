//! A whole bake of the tube person: small, but with every step in it.

use super::{BakeOptions, Baked, Clock, Subject, bake_subject};
use crate::fit::{AttributeOptions, mesh_code};
use crate::simulate::{Fabric, PoseSampler, Surface};
use crate::synthetic::puppet;
use glam::{Quat, Vec3};
use spmm3::{BoundGaussians, EXPRESSION, ExpressionPreset, Expressions, GaussianSet, Joint, SH_C0};
use std::sync::OnceLock;

const ALBEDO: Vec3 = Vec3::new(0.6, 0.5, 0.4);

/// A lamp from above.
fn lamp(surface: &Surface, posed: &[Vec3]) -> Vec<Vec3> {
    let towards = Vec3::new(0.3, 0.9, 0.3).normalize();
    surface
        .normals(posed)
        .iter()
        .map(|n| Vec3::splat(0.6 + 0.4 * n.dot(towards)))
        .collect()
}

fn bake_tubes() -> Baked {
    let puppet = puppet();
    let template = &puppet.template;
    let surface = Surface::new(template.vertices().len(), template.faces());
    let light = lamp(&surface, template.vertices());
    let mut set = GaussianSet::zeroed(template.faces().len());
    for (i, face) in template.faces().iter().enumerate() {
        let [a, b, c] = face.map(|v| template.vertices()[v as usize]);
        set.positions[i] = (a + b + c) / 3.0;
        set.rotations[i] = Quat::from_rotation_arc(Vec3::Z, (b - a).cross(c - a).normalize());
        set.log_scales[i] = Vec3::new(0.01, 0.01, 0.002).map(f32::ln);
        set.opacity_logits[i] = 3.0;
        let factor = face.iter().map(|v| light[*v as usize]).sum::<Vec3>() / 3.0;
        set.colours[i] = (ALBEDO * factor - 0.5) / SH_C0;
    }
    let triangles: Vec<u32> = (0u32..).take(set.len()).collect();
    let thirds = vec![[1.0 / 3.0; 2]; set.len()];
    let mut smile = ExpressionPreset {
        coefficients: [0.0; EXPRESSION],
        jaw: 0.0,
    };
    smile.coefficients[0] = 1.0;
    let subject = Subject {
        gaussians: BoundGaussians::bind(template, &set, triangles, thirds)
            .expect("every triangle takes a Gaussian"),
        albedo: vec![ALBEDO; set.len()],
        bridges: vec![],
        expressions: Expressions::from([("smile".to_owned(), smile)]),
        light: &|posed| lamp(&surface, posed),
        puppet: puppet.clone(),
    };
    let options = BakeOptions {
        poses: 250,
        attribute_poses: 120,
        controllers: 40,
        attributes: AttributeOptions {
            hidden: 6,
            bases: 8,
            ..AttributeOptions::default()
        },
        ..BakeOptions::default()
    };
    let clock = Clock::new(&());
    bake_subject(&options, subject, clock, None).expect("the tube person bakes")
}

fn with_threads(threads: usize) -> Baked {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build();
    pool.expect("threads start").install(bake_tubes)
}

fn baked() -> &'static Baked {
    static BAKED: OnceLock<Baked> = OnceLock::new();
    BAKED.get_or_init(|| with_threads(2))
}

#[test]
fn networks_beat_no_networks_on_poses_they_have_not_seen() {
    let report = &baked().report;
    let mesh = &report.mesh_held_out;
    assert!(
        mesh.garment_with.mean_mm < 0.75 * mesh.garment_without.mean_mm,
        "cloth: {:?} against {:?}",
        mesh.garment_with,
        mesh.garment_without
    );
    let attributes = &report.attributes_held_out;
    for (what, [without, with]) in [
        ("colour", attributes.colour),
        ("log-scale", attributes.log_scale),
    ] {
        assert!(with < 0.75 * without, "{what}: {with} against {without}");
    }
    assert!(
        attributes.position_mm[1] < attributes.position_mm[0],
        "places: {:?}",
        attributes.position_mm
    );
}

#[test]
fn a_seed_gives_one_avatar_whatever_the_number_of_threads() {
    let (one, two) = (with_threads(1), baked());
    assert_eq!(one.mesh, two.mesh, "F_mesh differs");
    assert_eq!(one.attributes, two.attributes, "F_attr differs");
    assert_eq!(one.gaussians, two.gaussians, "the Gaussians differ");
    assert_eq!(one.importance, two.importance, "their order differs");
    let package = |baked: &Baked| {
        let avatar = baked.clone().into_avatar().expect("the parts fit");
        avatar.to_bytes().expect("a package")
    };
    let (one, two) = (package(&one), package(two));
    assert!(
        one == two,
        "packages of {} and {} bytes differ",
        one.len(),
        two.len()
    );
}

#[test]
fn expressions_pass_through_f_mesh_exactly() {
    let baked = baked();
    let mut sampler = PoseSampler::new(11, &baked.expressions, 1);
    for strength in [-3.0f32, -0.2, 0.0, 0.7, 5.0] {
        let mut motion = sampler.sample();
        motion.expression_mut()[0] = strength;
        let code = mesh_code(&baked.mesh, &motion);
        assert!(
            (code[0] - strength).abs() < 2e-6,
            "{} for {strength}",
            code[0]
        );
    }
}

#[test]
fn the_root_rotation_has_no_effect() {
    let baked = baked();
    let mut motion = PoseSampler::new(5, &baked.expressions, 1).sample();
    let before = (
        mesh_code(&baked.mesh, &motion),
        crate::fit::potentials(&baked.attributes, &motion),
    );
    motion.set_axis_angle(Joint::Pelvis, Vec3::new(0.5, 2.0, -1.0));
    let after = (
        mesh_code(&baked.mesh, &motion),
        crate::fit::potentials(&baked.attributes, &motion),
    );
    assert_eq!(before, after, "the root's orientation reached a network");
}

#[test]
fn controllers_cover_the_surface_and_are_densest_on_the_face() {
    let baked = baked();
    let puppet = puppet();
    let points = baked.template.vertices();
    let nearest = |p: Vec3| {
        let distances = baked
            .controllers
            .vertices()
            .iter()
            .map(|c| points[*c as usize].distance(p));
        distances.fold(f32::INFINITY, f32::min)
    };
    let mut worst = [0.0f32; 2];
    for (point, fabric) in points.iter().zip(&puppet.fabric) {
        let of = usize::from(*fabric == Fabric::Face);
        worst[of] = worst[of].max(nearest(*point));
    }
    assert!(
        worst[0] < 0.2,
        "a vertex is {} m from any controller",
        worst[0]
    );
    assert!(
        worst[1] < worst[0],
        "the face is covered no better: {worst:?}"
    );
}

#[test]
fn gaussians_of_one_controller_lie_together() {
    let first: Vec<u16> = baked()
        .controllers
        .neighbours()
        .iter()
        .map(|n| n[0])
        .collect();
    assert!(
        first.is_sorted(),
        "the Gaussians are not sorted by controller"
    );
}
