//! What the end-to-end tests share: slow references in f64, written apart from the code under test.

pub mod allocations;
pub mod bound_person;
pub mod headset_reference;
pub mod load;
pub mod monado;
pub mod onnx;
pub mod person_reference;
pub mod picture_check;
pub mod program;
pub mod real_files;
pub mod service;
pub mod splat_reference;
pub mod splat_scenes;
pub mod synthetic;
pub mod vulkan;
pub mod walking;

/// Prints a line that `./run test` counts, but for this crate's own tests, which try such lines where nothing is the matter.
fn tell(line: &str) {
    let whose = if cfg!(test) { "tried: " } else { "" };
    println!("{whose}{line}");
}
