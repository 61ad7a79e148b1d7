//! Shared by tests of pictures, headsets and processes: slow references in f64, independent of the code under test, and the
//! third-party programs that tests start. What they need of a person is in `synthetic-person`.

pub mod allocations;
pub mod bound_person;
pub mod errors;
pub mod headset_reference;
pub mod internet;
pub mod load;
pub mod lpips;
pub mod monado;
pub mod network;
pub mod onnx;
pub mod picture_check;
pub mod program;
pub mod pulse;
pub mod service;
pub mod speech;
pub mod splat_reference;
pub mod splat_scenes;
pub mod vulkan;
pub mod walking;

/// Prints a line that `./run test` counts, but for this crate's own tests, which print such lines without a cause.
fn tell(line: &str) {
    let whose = if cfg!(test) { "tried: " } else { "" };
    println!("{whose}{line}");
}
