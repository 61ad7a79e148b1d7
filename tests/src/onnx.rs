//! ONNX Runtime in a test: opened, or skipped for a stated reason.

use npu_runtime::Runtime;

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
