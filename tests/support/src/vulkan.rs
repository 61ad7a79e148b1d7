//! Opening a Vulkan device in a test: with the validation layer on, or skipped for a stated reason.

use std::process::Command;
use std::sync::atomic::{AtomicU32, Ordering};
use std::sync::{Arc, OnceLock};

use renderer_vulkan::error::VulkanError;
use renderer_vulkan::gpu::Gpu;

/// Counts what the renderer logs of validation, also when no `Gpu` is left to ask.
struct CountingLogger;

/// Warnings and errors logged since the first device was opened.
pub static LOGGED_MESSAGES: AtomicU32 = AtomicU32::new(0);

impl log::Log for CountingLogger {
    fn enabled(&self, metadata: &log::Metadata<'_>) -> bool {
        metadata.level() <= log::Level::Warn
    }

    fn log(&self, record: &log::Record<'_>) {
        if self.enabled(record.metadata()) {
            LOGGED_MESSAGES.fetch_add(1, Ordering::SeqCst);
            eprintln!("{}: {}", record.level(), record.args());
        }
    }

    fn flush(&self) {}
}

/// Prints warnings and errors, and counts them.
pub fn log_warnings() {
    static LOGGER: OnceLock<()> = OnceLock::new();
    LOGGER.get_or_init(|| {
        log::set_logger(&CountingLogger).expect("the only logger");
        log::set_max_level(log::LevelFilter::Warn);
    });
}

/// Opens the device that `MON3TR_GPU` names (`auto` without it); the reason where Vulkan is missing.
pub fn open_gpu() -> Result<Arc<Gpu>, String> {
    log_warnings();
    let choice = std::env::var("MON3TR_GPU").unwrap_or_default();
    match Gpu::open(&choice.parse().expect("any text is a choice"), true) {
        Ok(gpu) => Ok(gpu),
        Err(
            why @ (VulkanError::NoLoader(_)
            | VulkanError::NoDevice
            | VulkanError::NoValidationLayer),
        ) => Err(why.to_string()),
        Err(why) => panic!("{why}"),
    }
}

/// The device, or nothing after a line that says why; on CI that is a failure.
pub fn or_skip(opened: Result<Arc<Gpu>, String>) -> Option<Arc<Gpu>> {
    opened
        .map_err(|why| {
            assert!(
                std::env::var("CI").as_deref() != Ok("true"),
                "no Vulkan device: {why}"
            );
            println!("skipped: no Vulkan device: {why}");
        })
        .ok()
}

/// One device for all tests of this file.
pub fn gpu() -> Option<Arc<Gpu>> {
    static GPU: OnceLock<Result<Arc<Gpu>, String>> = OnceLock::new();
    or_skip(GPU.get_or_init(open_gpu).clone())
}

/// Demands that the validation layer has had nothing to say.
pub fn assert_silent(gpu: &Gpu) {
    assert_eq!(
        gpu.validation_messages(),
        0,
        "validation messages (logged above)"
    );
}

/// Runs tests of the calling program again on Mesa's software driver with subgroups of 4 and of 16, where
/// it has 8 as a rule; demands that they pass and returns what they printed, each with its subgroup size.
/// Nothing, after a line that says so, on a device with one subgroup size.
pub fn rerun_with_other_subgroups(gpu: &Gpu, tests: &[&str]) -> Vec<(u32, String)> {
    if !gpu.info().name.contains("llvmpipe") {
        let size = gpu.subgroup_size();
        println!("skipped: {} has only subgroups of {size}", gpu.info().name);
        return Vec::new();
    }
    [("128", 4), ("512", 16)]
        .map(|(bits, size)| {
            let this = std::env::args().next().expect("a program's name");
            // Where Vulkan lives in a prefix, programs are started through a runner.
            let mut command = match std::env::var("MON3TR_RUNNER") {
                Ok(runner) => {
                    let mut command = Command::new(runner);
                    command.arg(&this);
                    command
                }
                Err(_) => Command::new(&this),
            };
            command
                .args(["--nocapture", "--test-threads=1"])
                .args(tests)
                .env("LP_NATIVE_VECTOR_WIDTH", bits);
            let output = crate::service::finish(&mut command);
            let text = String::from_utf8_lossy(&output.stdout).into_owned();
            let errors = String::from_utf8_lossy(&output.stderr);
            assert!(output.status.success(), "{bits} bits:\n{text}{errors}");
            (size, text)
        })
        .into()
}
