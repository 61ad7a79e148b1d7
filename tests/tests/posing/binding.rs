//! States: skinning, residuals and F_m2g.

use crate::person::{PUPPET, Pose, driven_mesh_of, mesh_of};
use glam::{Quat, Vec3};
use half::f16;
use renderer_splat::gaussian::Gaussian;
use renderer_splat::posing::{BoundMesh, BoundMeshParts, Deformation, PosedInput, Poser};
use renderer_vulkan::gpu::Gpu;
use spmm3::{BoundGaussians, GaussianSet, PlanarVertices, SH_C0, SkinWeights, Template};
use std::sync::Arc;
use synthetic_person::reference::{self as reference, M3, ReferenceGaussian};
use synthetic_person::{Puppet, PuppetSize};
use test_support::vulkan::{assert_silent, gpu, open_gpu, or_skip, rerun_with_other_subgroups};

/// Largest distance, metres: f32 rounding two metres from the origin is a tenth of it.
const MICROMETRES: f64 = 5e-6;

/// The most by which numbers of posed Gaussians may differ: half a step of the packed layout and the arithmetic's rounding.
/// Entries of a rotation's matrix: 0.0025 degrees each for three numbers.
pub(crate) const TURNED: f64 = 2e-4;
/// Octaves of a scale.
const GROWN: f64 = 0.5 / 2048.0 + 2e-5;
const FADED: f64 = 0.5 / 65_535.0 + 2e-6;
/// Of the colour, relative, and absolute where halves end.
const TINTED: f64 = 5e-4;
const DARK: f64 = 7e-5;

/// How far a Gaussian is from what it should be, each figure as a share of what is allowed.
pub(crate) fn misses(want: &ReferenceGaussian, got: &Gaussian) -> [f64; 5] {
    let moved = reference::norm(reference::sub(want.position, got.position.map(f64::from)));
    let turned = matrix_distance(want.rotation, got.rotation);
    let log2 = |k: usize| f64::from(got.scale[k]).log2();
    let grown = [0, 1, 2].map(|k| (want.log_scale[k] * std::f64::consts::LOG2_E - log2(k)).abs());
    let opacity = 1.0 / (1.0 + (-want.opacity_logit).exp());
    let faded = (opacity - f64::from(got.opacity)).abs();
    let tinted = [0, 1, 2].map(|k| {
        let colour = (0.5 + f64::from(SH_C0) * want.colour[k]).max(0.0);
        (colour - f64::from(got.colour[k])).abs() / (colour * TINTED + DARK)
    });
    let most = |values: [f64; 3]| values.into_iter().fold(0.0, f64::max);
    [
        moved / MICROMETRES,
        turned / TURNED,
        most(grown) / GROWN,
        faded / FADED,
        most(tinted),
    ]
}

/// Greatest difference of two rotations' entries.
pub(crate) fn matrix_distance(want: M3, got: [f32; 4]) -> f64 {
    let got = reference::quaternion_matrix(got.map(f64::from));
    let entries = want.iter().flatten().zip(got.iter().flatten());
    entries.map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
}

/// Who computes what the networks give.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Networks {
    Reference,
    Device,
}

impl Networks {
    /// How much more than [`misses`] allows may be missed: sums of hundreds of terms round in single precision before they are posed.
    fn tolerance(self) -> f64 {
        match self {
            Self::Reference => 1.0,
            Self::Device => 1.5,
        }
    }
}

fn assert_posed_as_reference(
    gpu: &Arc<Gpu>,
    puppet: &Puppet,
    seeds: [u64; 2],
    networks: Networks,
) -> Poser {
    let mesh = match networks {
        Networks::Reference => mesh_of(puppet),
        Networks::Device => driven_mesh_of(puppet),
    };
    let mut poser = Poser::new(gpu, &mesh).expect("the puppet fits");
    // Together, so that what waits is posed at once.
    let poses = seeds.map(|seed| Pose::random(puppet, seed));
    let ids = poses
        .each_ref()
        .map(|pose| match networks {
            Networks::Reference => pose.input(),
            Networks::Device => pose.driven(),
        })
        .map(|input| poser.push_state(&input).expect("one puppet's"));
    let mut worst = [0.0f64; 5];
    let mut farthest = 0.0f64;
    for (pose, id) in poses.iter().zip(ids) {
        let skinned = pose.skinned(puppet);
        let posed = poser.posed_vertices(id).expect("a state");
        for (want, got) in skinned.iter().zip(&posed) {
            let moved = reference::norm(reference::sub(*want, got.map(f64::from)));
            farthest = farthest.max(moved);
        }
        let expected = reference::gaussians_on_mesh(
            &puppet.template,
            &puppet.gaussians,
            &skinned,
            Some(&pose.residuals(puppet)),
            pose.root.map(f64::from),
        );
        let state = poser.state(id).expect("a state");
        assert_eq!(state.len(), expected.len(), "Gaussians");
        for (index, (want, got)) in expected.iter().zip(&state).enumerate() {
            let missed = misses(want, &got.unpacked());
            for (worst, missed) in worst.iter_mut().zip(missed) {
                *worst = worst.max(missed);
            }
            assert!(
                missed.iter().all(|miss| *miss <= networks.tolerance()),
                "Gaussian {index}: {missed:.2?} of what is allowed"
            );
        }
    }
    println!(
        "vertices at most {:.2} um off; position, rotation, scale, opacity, colour at most {worst:.2?} of what is allowed",
        farthest * 1e6
    );
    assert!(farthest <= MICROMETRES, "a vertex is {farthest} m off");
    assert_silent(gpu);
    poser
}

#[test]
fn states_are_posed_as_in_f64() {
    let Some(gpu) = gpu() else { return };
    drop(assert_posed_as_reference(
        &gpu,
        &PUPPET,
        [3, 4],
        Networks::Reference,
    ));
}

#[test]
fn states_are_posed_as_in_f64_at_other_subgroup_sizes() {
    let Some(gpu) = gpu() else { return };
    let tests = ["--exact", "binding::states_are_posed_as_in_f64"];
    for (size, text) in rerun_with_other_subgroups(&gpu, &tests) {
        assert!(text.contains("1 passed"), "subgroups of {size}: {text}");
    }
}

#[test]
fn more_bases_than_one_block_and_a_person_of_full_size_are_posed_as_in_f64() {
    let Some(gpu) = gpu() else { return };
    let many = Puppet::new(PuppetSize {
        bases: 37,
        gaussians: 1_001,
        ..PuppetSize::SMALL
    });
    drop(assert_posed_as_reference(
        &gpu,
        &many,
        [5, 6],
        Networks::Reference,
    ));
    let full = Puppet::new(PuppetSize {
        // No multiple of a workgroup.
        gaussians: 60_035,
        ..PuppetSize::FULL
    });
    let mut poser = assert_posed_as_reference(&gpu, &full, [7, 8], Networks::Reference);
    let poses = [9, 10].map(|seed| Pose::random(&full, seed));
    for round in 0..6 {
        let input = poses[round % 2].input();
        let before = poser.push_state(&input).expect("one puppet's");
        let after = poser.push_state(&input).expect("one puppet's");
        poser.state(before).expect("a state");
        println!("two states: {:?}", poser.times());
        poser.interpolate(before, after, 0.5).expect("two states");
        println!("a picture's Gaussians: {:?}", poser.times());
    }
}

#[test]
fn networks_on_the_device_give_what_they_give_in_f64() {
    let Some(gpu) = gpu() else { return };
    let odd = Puppet::new(PuppetSize {
        bases: 37,
        gaussians: 1_001,
        controllers: 29,
        controller_hidden: 5,
        mesh_hidden: 67,
        rank: 7,
        ..PuppetSize::SMALL
    });
    for puppet in [&*PUPPET, &odd] {
        let seeds = [11, 12];
        drop(assert_posed_as_reference(
            &gpu,
            puppet,
            seeds,
            Networks::Device,
        ));
    }
    let full = Puppet::new(PuppetSize::FULL);
    let mut poser = assert_posed_as_reference(&gpu, &full, [13, 14], Networks::Device);
    for seed in 15..18 {
        let input = Pose::random(&full, seed);
        let id = poser.push_state(&input.driven()).expect("one puppet's");
        poser.state(id).expect("a state");
        println!("networks of full size: {:?}", poser.times());
    }
}

#[test]
fn networks_run_where_poses_are_copied_to_the_device_too() {
    let Some(mut gpu) = or_skip(open_gpu()) else {
        return;
    };
    let features = Arc::get_mut(&mut gpu).expect("just opened").features_mut();
    features.shares_memory = false;
    drop(assert_posed_as_reference(
        &gpu,
        &PUPPET,
        [3, 4],
        Networks::Device,
    ));
}

#[test]
fn a_slot_serves_both_who_computed_and_who_is_to() {
    let Some(gpu) = gpu() else { return };
    let mut poser = Poser::new(&gpu, &driven_mesh_of(&PUPPET)).expect("the puppet fits");
    let poses = [21, 22].map(|seed| Pose::random(&PUPPET, seed));
    // Four slots: each comes to both, in both orders.
    for round in 0..12 {
        let pose = &poses[(round / 3) % 2];
        let ids = [pose.input(), pose.driven()].map(|input| poser.push_state(&input));
        let [computed, driven] = ids.map(|id| poser.state(id.expect("a pose")).expect("a state"));
        for (index, (want, got)) in computed.iter().zip(&driven).enumerate() {
            let (want, got) = (want.unpacked(), got.unpacked());
            let moved = Vec3::from(want.position).distance(Vec3::from(got.position));
            assert!(
                moved < 2e-6,
                "round {round}: Gaussian {index} is {moved} m off"
            );
        }
        // Three of one kind, so that the slots' turns shift.
        if round % 3 == 0 {
            poser.push_state(&pose.driven()).expect("a pose");
        }
    }
    assert_silent(&gpu);
}

/// Gaussians on triangles of all kinds, each vertex held by one joint at rest.
struct Oddities {
    template: Template,
    bound: BoundGaussians,
    mesh: BoundMesh,
}

const ODD: usize = 6;

impl Oddities {
    fn new() -> Self {
        let corners: [[Vec3; 3]; ODD] = [
            // Plain, and the same turned by half.
            [Vec3::ZERO, Vec3::X, Vec3::Y],
            [Vec3::ZERO, Vec3::NEG_X, Vec3::Y],
            // No area at all: in one place, first edge gone, all in a line along an axis and across.
            [Vec3::ONE, Vec3::ONE, Vec3::ONE],
            [Vec3::ONE, Vec3::ONE, Vec3::new(1.0, 2.0, 1.0)],
            [Vec3::ZERO, Vec3::NEG_Z, Vec3::NEG_Z * 2.0],
            [
                Vec3::ZERO,
                Vec3::new(1.0, 1.0, 0.0),
                Vec3::new(2.0, 2.0, 0.0),
            ],
        ];
        let vertices = corners.as_flattened().to_vec();
        let skin = SkinWeights {
            joints: [0; 4],
            weights: [1.0, 0.0, 0.0, 0.0],
        };
        let skin = vec![skin; vertices.len()];
        let faces: Vec<[u32; 3]> = (0..6).map(|t| [3 * t, 3 * t + 1, 3 * t + 2]).collect();
        let template = Template::new(vertices, faces.clone(), skin.clone()).expect("a template");
        let mut attributes = vec![0.0; 14 * ODD];
        let mut set = |plane: usize, values: [f32; ODD]| {
            attributes[plane * ODD..(plane + 1) * ODD].copy_from_slice(&values);
        };
        set(0, [0.1; ODD]);
        set(1, [-0.2, 0.3, 0.1, 0.2, 0.3, 0.4]);
        set(2, [0.05; ODD]);
        set(3, [0.0, 0.6, 0.1, 0.2, 0.3, 0.0]);
        // The first and the last one have no valid rotation.
        set(6, [0.0, 0.8, 0.9, 0.8, 0.7, 1e-8]);
        let barycentrics = vec![[0.25, 0.5]; ODD];
        let triangles = (0..6).collect();
        let bound = BoundGaussians::new(&template, triangles, barycentrics.clone(), attributes)
            .expect("Gaussians");
        let mesh = BoundMesh::new(&BoundMeshParts {
            joints: 1,
            skin_joints: &[[0; 4]; 3 * ODD],
            skin_weights: &[[1.0, 0.0, 0.0, 0.0]; 3 * ODD],
            corners: &faces,
            barycentrics: &barycentrics,
            attributes: bound.attributes(),
            controllers: 1,
            neighbours: &[[0; 3]; ODD],
            masses: &[[1.0, 0.0, 0.0]; ODD],
            bases: 1,
            units: &[1.0; 14],
            scales: &[f16::ZERO; 14 * ODD],
            values: &[1; 14 * ODD],
        })
        .expect("a mesh");
        Self {
            template,
            bound,
            mesh,
        }
    }
}

#[test]
fn collapsed_triangles_and_vanished_rotations_are_posed_as_on_the_cpu() {
    let Some(gpu) = gpu() else { return };
    let odd = Oddities::new();
    let planes: Vec<f32> = (0..3)
        .flat_map(|axis| odd.template.vertices().iter().map(move |v| v[axis]))
        .collect();
    let mut skinning = [0.0; 12];
    for diagonal in [0, 4, 8] {
        skinning[diagonal] = 1.0;
    }
    let mut poser = Poser::new(&gpu, &odd.mesh).expect("a few Gaussians");
    let input = PosedInput {
        deformation: Deformation::Computed {
            canonical_vertices: &planes,
            potentials: &[3.0],
        },
        skinning: &skinning,
        root: [0.5, -1.0, 2.0],
    };
    let state = poser.push_state(&input).expect("a pose");
    let got = poser.state(state).expect("a state");
    let mut want = GaussianSet::zeroed(ODD);
    let posed = PlanarVertices::new(&planes, 3 * ODD).expect("three planes");
    odd.bound
        .pose(posed, None, Vec3::from(input.root), &mut want)
        .expect("the same mesh");
    for (index, got) in got
        .iter()
        .map(renderer_splat::gaussian::PackedGaussian::unpacked)
        .enumerate()
    {
        let moved = want.positions[index].distance(got.position.into());
        assert!(moved < 1e-6, "Gaussian {index} is {moved} m off");
        let cosine = want.rotations[index].dot(Quat::from_array(got.rotation));
        assert!(1.0 - cosine.abs() < 1e-6, "Gaussian {index}: {cosine}");
    }
    assert_silent(&gpu);
}

#[test]
fn gaussians_that_depend_on_nan_in_a_pose_are_not_drawn() {
    let Some(gpu) = gpu() else { return };
    let puppet = &*PUPPET;
    let mut poser = Poser::new(&gpu, &mesh_of(puppet)).expect("the puppet fits");
    let mut pose = Pose::random(puppet, 11);
    let broken = puppet.gaussians.corners()[0][0];
    pose.canonical[broken as usize] = f32::NAN;
    pose.potentials[0] = f32::INFINITY;
    let state = poser.push_state(&pose.input()).expect("one puppet's");
    let got = poser.state(state).expect("a state");
    let held = puppet.controllers.neighbours().iter();
    let reached: Vec<bool> = (held.zip(puppet.controllers.masses()))
        .zip(puppet.gaussians.corners())
        .map(|((named, _), corners)| corners.contains(&broken) || named.contains(&0))
        .collect();
    let mut drawn = 0;
    for (index, (got, reached)) in got.iter().zip(reached).enumerate() {
        let gaussian = got.unpacked();
        let finite = gaussian.position.iter().chain(&gaussian.rotation);
        assert!(finite.clone().all(|x| x.is_finite()), "Gaussian {index}");
        assert!(
            !reached || gaussian.opacity == 0.0,
            "Gaussian {index} shows"
        );
        drawn += usize::from(gaussian.opacity > 0.0);
    }
    assert!(drawn > 100, "{drawn} others are drawn");
}
