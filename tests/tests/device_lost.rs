//! A lost device, and its replacement by another: a test program of its own, since its device is unusable afterwards.

use renderer_splat::background::Background;
use renderer_splat::camera::Camera;
use renderer_splat::drawing::{Drawing, Foreground, Part};
use renderer_splat::error::RenderError;
use renderer_splat::gaussian::PackedGaussian;
use renderer_splat::options::{BackEnd, RendererOptions};
use renderer_splat::picture::Image;
use renderer_splat::posing::{Deformation, PosedInput, StateId};
use renderer_splat::renderer::SplatRenderer;
use std::sync::Arc;
use synthetic_person::Puppet;
use test_support::bound_person::bound_mesh;
use test_support::splat_scenes::{front_camera, random_gaussians, random_scene};
use test_support::vulkan::{assert_silent, open_gpu, or_skip};
use test_support::walking::Walking;

#[test]
fn a_renderer_goes_on_after_its_device_is_lost() {
    let Some(gpu) = or_skip(open_gpu()) else {
        return;
    };
    let camera = front_camera(128, 96);
    let options = RendererOptions {
        background: Some(Arc::new(Background::pack(&random_scene(500, 0, 7)))),
        back_end: Some(BackEnd::Tiles),
        ..RendererOptions::new(300, 128, 96, 1)
    };
    let foreground: Vec<PackedGaussian> = random_gaussians(300, 3)
        .iter()
        .map(PackedGaussian::from)
        .collect();
    let mut renderer = SplatRenderer::new(gpu.clone(), &options).expect("a renderer");
    renderer.set_foreground(&foreground).expect("a foreground");
    renderer.draw(&[camera]).expect("a picture");
    let before = renderer.read_back(0).expect("a view");
    let drawn = |picture: &Image| picture.pixels().iter().any(|pixel| pixel[3] > 0.5);
    assert!(drawn(&before), "something is in the picture");

    let mut slot = Walking::new(&renderer);
    slot.write(&random_gaussians(300, 3));

    gpu.declare_lost();
    let lost = renderer.draw(&[camera]);
    assert!(
        matches!(&lost, Err(error) if error.is_device_lost()),
        "{lost:?}"
    );
    let again = renderer.recover().expect("another device");
    assert!(!Arc::ptr_eq(&again, &gpu), "not the lost one");
    renderer.set_foreground(&foreground).expect("a foreground");
    renderer.draw(&[camera]).expect("a picture again");
    let after = renderer.read_back(0).expect("a view");
    let foreign = slot.draw(&mut renderer, &[camera], false);
    assert!(
        matches!(foreign, Err(RenderError::ForeignSlot)),
        "{foreign:?}"
    );
    slot = Walking::new(&renderer);
    slot.write(&random_gaussians(300, 3));
    slot.draw(&mut renderer, &[camera], false)
        .expect("a picture from a new slot");
    let from_slot = renderer.read_back(0).expect("a view");
    assert_eq!(before, from_slot, "slots are there again as well");
    assert_eq!(before, after, "the background is there again too");
    assert_silent(&again);
}

fn posed(
    renderer: &mut SplatRenderer,
    camera: Camera,
    state: StateId,
) -> Result<Image, RenderError> {
    let foreground = Foreground::Posed {
        from: state,
        to: state,
        share: 1.0,
        level: 0,
    };
    renderer.draw_with(&Drawing::new(&[camera], &[Part::here(foreground)]))?;
    renderer.read_back(0)
}

#[test]
fn a_person_who_is_posed_on_the_device_comes_back_after_it_is_lost() {
    let Some(gpu) = or_skip(open_gpu()) else {
        return;
    };
    let puppet = Puppet::small();
    let mesh = bound_mesh(
        &puppet.template,
        &puppet.gaussians,
        &puppet.controllers,
        &puppet.attributes.bases,
    );
    let options = RendererOptions {
        mesh: Some(Arc::new(mesh)),
        back_end: Some(BackEnd::Tiles),
        ..RendererOptions::new(0, 128, 96, 1)
    };
    let planes: Vec<f32> = (0..3)
        .flat_map(|axis| puppet.template.vertices().iter().map(move |v| v[axis]))
        .collect();
    let rest = spmm3::SkinningTransforms::default();
    let bases = puppet.attributes.bases.bases();
    let potentials = vec![0.5; puppet.controllers.vertices().len() * bases];
    let input = PosedInput {
        deformation: Deformation::Computed {
            canonical_vertices: &planes,
            potentials: &potentials,
        },
        skinning: &rest.0,
        root: [0.0, -0.9, 0.0],
    };
    let camera = front_camera(128, 96);
    let mut renderer = SplatRenderer::new(gpu.clone(), &options).expect("a renderer");
    let state = renderer.push_state(&input).expect("a pose");
    let before = posed(&mut renderer, camera, state).expect("a picture");
    let drawn = before.pixels().iter().any(|pixel| pixel[3] > 0.5);
    assert!(drawn, "a person is in the picture");
    gpu.declare_lost();
    let lost = posed(&mut renderer, camera, state).map(drop);
    assert!(
        matches!(&lost, Err(error) if error.is_device_lost()),
        "{lost:?}"
    );
    let again = renderer.recover().expect("another device");
    let gone = posed(&mut renderer, camera, state).map(drop);
    assert!(matches!(gone, Err(RenderError::NoState)), "{gone:?}");
    let new = renderer.push_state(&input).expect("a pose");
    let after = posed(&mut renderer, camera, new).expect("a picture again");
    assert_eq!(before, after, "the mesh is there again");
    let gone = posed(&mut renderer, camera, state).map(drop);
    assert!(
        matches!(gone, Err(RenderError::NoState)),
        "no name is given twice: {gone:?}"
    );
    assert_silent(&again);
}
