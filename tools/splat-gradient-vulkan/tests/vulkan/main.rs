//! The tests of `splat-gradient` on a Vulkan device: references and finite differences in f64, the renderer, what a trainer relies on. Then the
//! CPU's splatter, and what a device alone may do wrong.

#[path = "../../../splat-gradient/tests/gradient/attributes.rs"]
mod attributes;
#[path = "../../../splat-gradient/tests/gradient/broken.rs"]
mod broken;
mod cpu;
mod device;
#[path = "../../../splat-gradient/tests/gradient/opaque.rs"]
mod opaque;
#[path = "../../../splat-gradient/tests/gradient/overfit.rs"]
mod overfit;
#[path = "../../../splat-gradient/tests/gradient/pictures.rs"]
mod pictures;
#[path = "../../../splat-gradient/tests/gradient/reference.rs"]
mod reference;
#[path = "../../../splat-gradient/tests/gradient/repeated.rs"]
mod repeated;
mod room;
#[path = "../../../splat-gradient/tests/gradient/scenes.rs"]
mod scenes;
