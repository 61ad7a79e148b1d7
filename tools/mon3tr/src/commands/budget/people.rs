//! People in a pose, and the work of a picture of them in a headset.

use crate::device_options::DeviceOptions;
use crate::size::{Size, Views};
use crate::viewpoint::eyes;
use anyhow::Context;
use app_kernels::{Blend, Detail};
use app_pipeline::compiled_sources::CompiledSources;
use app_pipeline::deform::Deformer;
use app_pipeline::inference::Inference;
use app_pipeline::plan::Plan;
use app_pipeline::profile::Profile;
use app_pipeline::quality::{KEPT_SHARES, Quality};
use app_session::presence::APART;
use frame_budget::{Person, Work};
use glam::{Affine3A, Quat, Vec3};
use npu_runtime::{Provider, Runtime};
use renderer_splat::camera::Camera;
use renderer_splat::drawing::{Drawing, Foreground, Part};
use renderer_splat::gaussian::PackedGaussian;
use renderer_splat::motion_bound::MotionBound;
use renderer_splat::options::{BackEnd, RendererOptions};
use renderer_splat::renderer::SplatRenderer;
use renderer_vulkan::gpu::Gpu;
use spmm3::networks::GraphParts;
use spmm3::{Avatar, at_ease};
use std::sync::Arc;

/// The headset's field of view from top to bottom, degrees: Meta says 96 for the Quest 3.
const FIELD_DEGREES: f32 = 96.0;
/// The viewer's eyes above the floor, metres.
const EYE_HEIGHT: f32 = 1.6;
/// Where the viewer looks: level.
const AHEAD: Vec3 = Vec3::NEG_Z;

/// A person at ease, at each level of detail.
pub(super) struct Posed {
    levels: Vec<Vec<PackedGaussian>>,
    pub(super) figures: Person,
}

impl Posed {
    /// Poses an avatar as people stand who listen.
    pub(super) fn at_ease(avatar: &Arc<Avatar>, runtime: &Runtime) -> anyhow::Result<Self> {
        let plan = Plan::CpuTail;
        let provider = Provider::Cpu {
            threads: DeviceOptions::threads(),
        };
        let compiled = CompiledSources::default();
        let inference =
            Inference::open(runtime, avatar, GraphParts::Skinned, &[provider], &compiled)?;
        let mut deformer = Deformer::new(avatar, inference, plan)?;
        let state = deformer.deform(&at_ease(&avatar.skeleton), &mut Profile::default())?;
        let blend = Blend::new(state, state, 0.0)?;
        let all = state.packed();
        let mut levels = Vec::new();
        for level in avatar.kept_levels(&KEPT_SHARES[1..]) {
            let detail = Detail::new(avatar.gaussians.len(), level.kept, &level.log2_growth)?;
            // Written over.
            let mut packed = all.get(..detail.len()).unwrap_or_default().to_vec();
            blend.pack_kept(&detail, &mut packed)?;
            levels.push(packed);
        }
        levels.insert(0, all);
        Ok(Self {
            levels,
            figures: figures(avatar)?,
        })
    }
}

/// What of an avatar sets the times of CPU and NPU. Weights of networks have two bytes there.
fn figures(avatar: &Avatar) -> anyhow::Result<Person> {
    let (mesh, attributes) = (avatar.mesh_network()?, avatar.attribute_network()?);
    let layers = [&mesh.first, &mesh.second, &mesh.code, &attributes.first];
    let mut numbers: usize = (layers.iter())
        .map(|layer| layer.weights().len() + layer.bias().len())
        .sum();
    let weights = attributes.second.len()
        + (layers.iter())
            .map(|layer| layer.weights().len())
            .sum::<usize>();
    let outputs =
        attributes.second_bias.len() + (layers.iter()).map(|layer| layer.outputs()).sum::<usize>();
    let depth = [&mesh.first, &mesh.second, &mesh.code].map(|layer| layer.inputs());
    let depth: usize = depth.iter().sum();
    numbers += mesh.decoder.values().len() + mesh.decoder.mean().len();
    numbers += attributes.second.len() + attributes.second_bias.len();
    let (gaussians, bases) = (avatar.gaussians.len(), attributes.bases.values().len());
    Ok(Person {
        gaussians: gaussians as u64,
        vertices: avatar.template.vertices().len() as u64,
        bases: (bases / gaussians.max(1) / 14) as u64,
        network_bytes: 2 * numbers as u64,
        weights: weights as u64,
        outputs: outputs as u64,
        depth: depth as u64,
        fields: mesh.decoder.rank() as u64,
        // A byte each.
        tail_bytes: bases as u64,
    })
}

/// Counts the work of a stereo picture of people in an arc before the viewer, `distance` metres away, as they first stand in a room.
pub(super) fn count(
    people: &[&Posed],
    quality: Quality,
    size: Size,
    distance: f32,
    gpu: &Arc<Gpu>,
) -> anyhow::Result<Work> {
    let parts: Vec<&[PackedGaussian]> = (people.iter())
        .map(|person| {
            person
                .levels
                .get(quality.level)
                .map_or(&[][..], Vec::as_slice)
        })
        .collect();
    let all: usize = parts.iter().map(|part| part.len()).sum();
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "not more than the size"
    )]
    let scaled = |pixels: u32| (pixels as f32 * quality.resolution_scale).round() as u32;
    let (width, height) = (scaled(size.width), scaled(size.height));
    let options = RendererOptions {
        back_end: Some(BackEnd::Tiles),
        ..RendererOptions::new(u32::try_from(all)?, width, height, 2)
    };
    let mut renderer =
        SplatRenderer::new(Arc::clone(gpu), &options).context("cannot prepare the renderer")?;
    let mut slots = Vec::new();
    for part in &parts {
        let count = u32::try_from(part.len())?;
        let mut slot = renderer.foreground_slot_for(count)?;
        let room = slot.gaussians_mut().get_mut(..part.len());
        room.context("a slot is too small")?.copy_from_slice(part);
        slot.set(count, MotionBound::new())?;
        slots.push(slot);
    }
    let middle = (people.len() as f32 - 1.0) / 2.0;
    let foreground: Vec<Part<'_>> = (slots.iter().enumerate())
        .map(|(k, slot)| Part {
            gaussians: Foreground::Slot(slot),
            world_from_part: place((k as f32 - middle) * APART / distance, distance),
        })
        .collect();
    let eye = Vec3::new(0.0, EYE_HEIGHT, 0.0);
    let field = FIELD_DEGREES.to_radians();
    let camera = Camera::look_at(eye, eye + AHEAD, Vec3::Y, field, width, height);
    renderer.draw_with(&Drawing::new(&eyes(camera, Views::Stereo), &foreground))?;
    let lists = renderer.read_back_lists()?.context("tiles drew nothing")?;
    let mut work = Work::of(&lists);
    for view in &mut work.views {
        // 95 MB for both eyes, which nothing here looks at.
        view.pixels = Vec::new();
    }
    Ok(work)
}

/// On the floor at so many radians to the right of straight ahead, facing the viewer.
fn place(angle: f32, distance: f32) -> Affine3A {
    let turn = Quat::from_rotation_y(-angle);
    Affine3A::from_rotation_translation(turn, turn * (AHEAD * distance))
}
