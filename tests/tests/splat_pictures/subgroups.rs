//! Every subgroup size that the software driver can be asked for.

use renderer_splat::options::BackEnd;
use test_support::picture_check::assert_drawn_by;
use test_support::splat_reference::World;
use test_support::splat_scenes::{eyes, front_camera, random_gaussians, random_scene};
use test_support::vulkan::{gpu, rerun_with_other_subgroups};

use crate::{CROWDED, PACKED};

#[test]
fn foreground_and_background_look_as_the_reference_says_at_this_subgroup_size() {
    let Some(gpu) = gpu() else { return };
    let (gaussians, scene) = (random_gaussians(20_000, 7), random_scene(10_000, 3, 91));
    let world = World {
        background: Some(&scene),
        ..World::of(&gaussians)
    };
    let (eyes, camera) = (eyes(500, 460), [front_camera(640, 600)]);
    let front = World::of(&gaussians);
    let tiles = [BackEnd::Tiles];
    assert_drawn_by(&gpu, tiles, "subgroups", &world, &eyes, PACKED);
    assert_drawn_by(&gpu, tiles, "subgroups-mono", &front, &camera, CROWDED);
    if BackEnd::Quads.runs_on(&gpu) {
        let quads = [BackEnd::Quads];
        assert_drawn_by(&gpu, quads, "subgroups", &world, &eyes, PACKED);
        assert_drawn_by(&gpu, quads, "subgroups-mono", &front, &camera, CROWDED);
    } else {
        println!("skipped: quads with subgroups of {}", gpu.subgroup_size());
    }
}

#[test]
fn the_picture_is_right_for_every_subgroup_size_of_the_software_driver() {
    let Some(gpu) = gpu() else { return };
    for (size, text) in rerun_with_other_subgroups(&gpu, &["_at_this_subgroup_size"]) {
        let expected = format!("subgroups of {size}");
        let views = text.matches(&expected).count();
        // Three views by each back end; with 16, those of the tiles and the line that says so.
        let wanted = if size > 8 { 4 } else { 6 };
        assert_eq!(views, wanted, "lines with {expected}:\n{text}");
    }
}
