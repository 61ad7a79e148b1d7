//! What a lens hides is not drawn, and what it shows is drawn as ever.

use std::sync::Arc;

use ash::vk;
use glam::{Affine3A, Quat, Vec2, Vec3};
use renderer_splat::camera::Camera;
use renderer_splat::drawing::{Drawing, Foreground, Part};
use renderer_splat::error::RenderError;
use renderer_splat::external_images::{BackEndSet, ExternalImages};
use renderer_splat::gaussian::{Gaussian, PackedGaussian};
use renderer_splat::lists::TileLists;
use renderer_splat::options::{BackEnd, RendererOptions};
use renderer_splat::picture::Image;
use renderer_splat::quad_pass::QuadPass;
use renderer_splat::renderer::SplatRenderer;
use renderer_splat::target::Target;
use renderer_splat::visible_tiles::VisibleTiles;
use renderer_vulkan::choice::GpuChoice;
use renderer_vulkan::gpu::Gpu;

/// Not a multiple of a tile's side.
const SIZE: [u32; 2] = [250, 234];

/// Images that take no picture: it stays in the renderer, for the test to read back.
struct BehindLenses(Option<[VisibleTiles; 2]>);

impl ExternalImages for BehindLenses {
    fn prepare(&mut self, _: &Arc<Gpu>, _: &Target, _: BackEndSet) -> Result<(), RenderError> {
        Ok(())
    }

    fn visible_tiles(&self) -> Option<&[VisibleTiles; 2]> {
        self.0.as_ref()
    }

    fn pass(&self) -> Option<&Arc<QuadPass>> {
        None
    }

    fn record_direct(&self, _: vk::CommandBuffer, _: &dyn Fn(vk::Rect2D)) {}

    fn record_copied(&self, _: vk::CommandBuffer) {}

    fn finished(&mut self, _: bool) {}
}

fn open_gpu() -> Option<Arc<Gpu>> {
    let name = std::env::var("MON3TR_GPU").unwrap_or_default();
    let choice: GpuChoice = name.parse().expect("any text is a choice");
    match Gpu::open(&choice, true) {
        Ok(gpu) => Some(gpu),
        Err(why) => {
            let demanded = std::env::var("CI").as_deref() == Ok("true");
            assert!(!demanded, "no Vulkan device: {why}");
            println!("skipped: no Vulkan device: {why}");
            None
        }
    }
}

fn eyes() -> [Camera; 2] {
    [-0.03, 0.03].map(|x| {
        let eye = Vec3::new(x, 0.0, 3.0);
        Camera::look_at(eye, eye + Vec3::NEG_Z, Vec3::Y, 0.8, SIZE[0], SIZE[1])
    })
}

/// All but a regular octagon around the camera's axis, somewhat smaller than the picture, is hidden by a ring.
fn octagon(camera: &Camera) -> VisibleTiles {
    let corner = |index: u8| Vec2::from_angle(f32::from(index) * std::f32::consts::FRAC_PI_4) * 0.4;
    let ring = (0..8).flat_map(|index| {
        let [from, to] = [corner(index), corner(index + 1)];
        [[from, to, from * 3.0], [to, to * 3.0, from * 3.0]]
    });
    VisibleTiles::behind(camera, ring)
}

/// Gaussians all over the picture and beyond its edges, small and large.
fn cloud() -> Vec<PackedGaussian> {
    let mut state = 1u32;
    let mut random = move || {
        state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        f32::from(u16::try_from(state >> 16).expect("16 bits")) / 65_536.0
    };
    let gaussians = (0..3_000).map(|index| {
        let place = Vec3::from_array(std::array::from_fn(|_| random() - 0.5));
        let large = if index % 50 == 0 { 0.3 } else { 0.02 };
        Gaussian {
            position: (place * Vec3::new(3.0, 3.0, 1.0)).to_array(),
            rotation: Quat::from_rotation_z(6.0 * random()).to_array(),
            scale: std::array::from_fn(|_| 0.005 + large * random()),
            opacity: 0.1 + 0.85 * random(),
            colour: std::array::from_fn(|_| random()),
        }
    });
    gaussians.map(|one| PackedGaussian::from(&one)).collect()
}

/// Both views, their lists, and the pairs that the parts were counted to have.
struct Drawn {
    views: [Image; 2],
    lists: Option<TileLists>,
    pairs: u64,
}

fn draw(gpu: &Arc<Gpu>, back_end: BackEnd, visible: Option<[VisibleTiles; 2]>) -> Drawn {
    let cloud = cloud();
    let options = RendererOptions {
        back_end: Some(back_end),
        ..RendererOptions::new(3_000, SIZE[0], SIZE[1], 2)
    };
    let mut renderer = SplatRenderer::new(Arc::clone(gpu), &options).expect("a renderer");
    renderer.set_foreground(&cloud).expect("they fit");
    let parts = [Part {
        gaussians: Foreground::Set,
        world_from_part: Affine3A::IDENTITY,
    }];
    let cameras = eyes();
    let drawing = Drawing::new(&cameras, &parts);
    let mut images = BehindLenses(visible);
    renderer.draw_onto(&drawing, &mut images).expect("drawn");
    let views = [0, 1].map(|view| renderer.read_back(view).expect("a view"));
    let lists = renderer.read_back_lists().expect("lists");
    let pairs = renderer.part_pairs().iter().sum();
    Drawn {
        views,
        lists,
        pairs,
    }
}

fn is_visible(tiles: &VisibleTiles, x: usize, y: usize) -> bool {
    let columns = tiles.columns_of(y / 16);
    columns.is_some_and(|columns| columns.contains(&u32::try_from(x / 16).expect("a column")))
}

#[test]
fn hidden_tiles_cost_no_list_entries_and_stay_clear_and_all_others_are_drawn_as_without_a_lens() {
    let Some(gpu) = open_gpu() else { return };
    let visible = eyes().each_ref().map(octagon);
    let share = visible[0].share();
    assert!((0.5..0.9).contains(&share), "the lens shows {share}");
    let open = draw(&gpu, BackEnd::Tiles, None);
    let behind = draw(&gpu, BackEnd::Tiles, Some(visible.clone()));
    let [all, left] = [&open, &behind].map(|drawn| drawn.lists.as_ref().expect("lists"));
    assert_eq!(all.order, left.order, "one order");
    let columns = SIZE[0].div_ceil(16) as usize;
    for (view, tiles) in visible.iter().enumerate() {
        let (all, left) = (&all.views[view].lists, &left.views[view].lists);
        for (index, (all, left)) in all.iter().zip(left).enumerate() {
            let seen = is_visible(tiles, index % columns * 16, index / columns * 16);
            let expected: &[u32] = if seen { all } else { &[] };
            assert_eq!(left, expected, "tile {index} of view {view}");
        }
        let skipped: usize =
            all.iter().map(Vec::len).sum::<usize>() - left.iter().map(Vec::len).sum::<usize>();
        println!(
            "view {view}: {:.1} % of the tiles are seen, {skipped} pairs of {} are saved",
            tiles.share() * 100.0,
            all.iter().map(Vec::len).sum::<usize>()
        );
        let pixels = |drawn: &Drawn| drawn.views[view].pixels().to_vec();
        let (open, behind) = (pixels(&open), pixels(&behind));
        let mut hidden_colour = 0;
        for (place, (open, behind)) in open.iter().zip(&behind).enumerate() {
            let (x, y) = (place % SIZE[0] as usize, place / SIZE[0] as usize);
            if is_visible(tiles, x, y) {
                assert_eq!(open, behind, "pixel {x}, {y} of view {view}");
            } else {
                assert_eq!(*behind, [0.0; 4], "pixel {x}, {y} of view {view}");
                hidden_colour += usize::from(open[3] > 0.0);
            }
        }
        assert!(hidden_colour > 1_000, "there was something to hide");
    }
    assert!(
        behind.pairs < open.pairs,
        "{} of {}",
        behind.pairs,
        open.pairs
    );
    assert_eq!(gpu.validation_messages(), 0, "validation messages");
}

#[test]
fn quads_that_nobody_sees_are_left_out_and_what_is_seen_is_the_same() {
    let Some(gpu) = open_gpu() else { return };
    if !BackEnd::Quads.runs_on(&gpu) {
        println!("skipped: no quads on this device");
        return;
    }
    let visible = eyes().each_ref().map(octagon);
    let open = draw(&gpu, BackEnd::Quads, None);
    let behind = draw(&gpu, BackEnd::Quads, Some(visible.clone()));
    let mut saved = 0;
    for (view, tiles) in visible.iter().enumerate() {
        let pixels = open.views[view]
            .pixels()
            .iter()
            .zip(behind.views[view].pixels());
        for (place, (open, behind)) in pixels.enumerate() {
            let (x, y) = (place % SIZE[0] as usize, place / SIZE[0] as usize);
            if is_visible(tiles, x, y) {
                assert_eq!(open, behind, "pixel {x}, {y} of view {view}");
            } else {
                saved += usize::from(open != behind);
            }
        }
    }
    assert!(saved > 1_000, "quads were left out of {saved} pixels alone");
    assert_eq!(gpu.validation_messages(), 0, "validation messages");
}

#[test]
fn a_lens_for_pictures_of_another_size_hides_nothing() {
    let Some(gpu) = open_gpu() else { return };
    let everything = [[-9.0, -9.0], [20.0, -9.0], [-9.0, 20.0]].map(Vec2::from_array);
    let other = VisibleTiles::behind(&eyes()[0].resized(SIZE[0], SIZE[1] - 1), [everything]);
    let open = draw(&gpu, BackEnd::Tiles, None);
    let behind = draw(&gpu, BackEnd::Tiles, Some([other.clone(), other]));
    assert!(open.views == behind.views, "all is drawn");
}
