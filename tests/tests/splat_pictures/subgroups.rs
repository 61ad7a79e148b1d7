//! Every subgroup size that the software driver can be asked for.

use mon3tr_tests::picture_check::assert_drawn_as_reference;
use mon3tr_tests::splat_reference::World;
use mon3tr_tests::splat_scenes::{eyes, front_camera, random_gaussians, random_scene};
use mon3tr_tests::vulkan::{gpu, rerun_with_other_subgroups};

use crate::{CROWDED, PACKED};

#[test]
fn foreground_and_background_look_as_the_reference_says_at_this_subgroup_size() {
    let Some(gpu) = gpu() else { return };
    let (gaussians, scene) = (random_gaussians(20_000, 7), random_scene(10_000, 3, 91));
    let world = World {
        background: Some(&scene),
        ..World::of(&gaussians)
    };
    assert_drawn_as_reference(&gpu, "subgroups", &world, &eyes(500, 460), PACKED);
    let camera = [front_camera(640, 600)];
    assert_drawn_as_reference(
        &gpu,
        "subgroups-mono",
        &World::of(&gaussians),
        &camera,
        CROWDED,
    );
}

#[test]
fn the_picture_is_right_for_every_subgroup_size_of_the_software_driver() {
    let Some(gpu) = gpu() else { return };
    for (size, text) in rerun_with_other_subgroups(&gpu, &["_at_this_subgroup_size"]) {
        let expected = format!("subgroups of {size}");
        let views = text.matches(&expected).count();
        assert_eq!(
            views, 6,
            "three views by two back ends, {expected}:\n{text}"
        );
    }
}
