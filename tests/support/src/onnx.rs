//! ONNX Runtime in a test: opened, or skipped for a stated reason.

use npu_runtime::{ProviderKind, Runtime, TensorSpec};
use spmm3::networks::{input, output};
use spmm3::{ATTRIBUTES, JOINTS, PARAMS};

/// The runtime, or nothing after a line that says why; on CI that is a failure.
pub fn runtime() -> Option<Runtime> {
    Runtime::open(None)
        .map_err(|why| {
            assert!(
                std::env::var("CI").as_deref() != Ok("true"),
                "no ONNX Runtime: {why}"
            );
            println!("skipped: no ONNX Runtime: {why}");
        })
        .ok()
}

/// The runtime with QNN's emulator of the Hexagon NPU, or nothing after a line that says why; on an x86-64 CI that is a
/// failure. Other machines have no emulator.
pub fn runtime_with_qnn() -> Option<Runtime> {
    let runtime = runtime()?;
    let found = runtime.probe();
    let qnn = found.iter().find(|one| one.provider == ProviderKind::Qnn)?;
    if let Some(why) = &qnn.lacking {
        assert!(
            std::env::var("CI").as_deref() != Ok("true") || !cfg!(target_arch = "x86_64"),
            "no QNN: {why}"
        );
        println!("skipped: no QNN: {why}");
        return None;
    }
    Some(runtime)
}

/// Inputs and outputs of the whole deform graph of a person of N_v vertices and N_g Gaussians.
#[must_use]
pub fn whole_graph(vertices: usize, gaussians: usize) -> ([TensorSpec; 2], [TensorSpec; 2]) {
    (
        [
            TensorSpec::new(input::MOTION, &[1, PARAMS]),
            TensorSpec::new(input::SKINNING, &[12, JOINTS]),
        ],
        [
            TensorSpec::new(output::VERTICES, &[3, vertices]),
            TensorSpec::new(output::RESIDUALS, &[ATTRIBUTES, gaussians]),
        ],
    )
}

/// One protobuf field of bytes: ONNX models that this workspace's writer would not write are written by hand.
#[must_use]
pub fn field(number: u8, content: &[u8]) -> Vec<u8> {
    let mut out = vec![number << 3 | 2];
    let mut length = content.len();
    while length > 0x7f {
        out.push(length.to_le_bytes()[0] | 0x80);
        length >>= 7;
    }
    out.push(length.to_le_bytes()[0]);
    out.extend(content);
    out
}
