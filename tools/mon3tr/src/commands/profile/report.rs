//! What was measured and on what, as a table for people and as JSON for programs.

use super::memory::Memory;
use crate::measured::Measured;
use crate::report::AvatarFigures;
use app::CallFigures;
use serde::Serialize;
use serde_json::Value;

/// Everything `profile` prints and writes.
#[derive(Debug, Serialize)]
pub(super) struct Report {
    pub(super) avatar: AvatarFigures,
    pub(super) conditions: Conditions,
    #[serde(flatten)]
    pub(super) shown: Measured,
    pub(super) memory: Memory,
    /// What the receiver's end of the call measured, and the sender's.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) call: Option<CallFigures>,
    pub(super) sent: Value,
}

/// What was measured on.
#[derive(Debug, Serialize)]
pub(super) struct Conditions {
    pub(super) motion: String,
    pub(super) vulkan_device: String,
    pub(super) vulkan_driver: String,
    pub(super) onnx_runtime: String,
    /// What computed the deform graph.
    pub(super) provider: String,
    pub(super) width: u32,
    pub(super) height: u32,
    pub(super) views: u32,
    /// How pictures between two states are made: interpolate or extrapolate.
    pub(super) latency: String,
    /// Threads this machine runs at once.
    pub(super) cores: usize,
}

impl Conditions {
    /// "2 x 1680 x 1760".
    pub(super) fn picture(&self) -> String {
        let eyes = if self.views == 2 { "2 x " } else { "" };
        format!("{eyes}{} x {}", self.width, self.height)
    }
}

impl Report {
    pub(super) fn print(&self) {
        print!("{}", self.table());
    }

    /// The figures in at most 110 columns.
    pub(super) fn table(&self) -> String {
        let (a, on, of) = (&self.avatar, &self.conditions, &self.shown.measured);
        let period_ms = 1e3 / of.display_hz;
        let mut lines = vec![
            String::new(),
            format!(
                "avatar     {}: {} Gaussians, {} vertices, {} controllers",
                a.name, a.gaussians, a.vertices, a.controllers
            ),
            format!(
                "call       {:.1} s of {} at {:.0} Hz, sender and server on this machine",
                of.seconds, on.motion, of.motion_hz
            ),
            format!(
                "pictures   {} pixels, {}d, for a display of {:.0} Hz ({period_ms:.1} ms)",
                on.picture(),
                on.latency,
                of.display_hz
            ),
            format!("GPU        {} ({})", on.vulkan_device, on.vulkan_driver),
            format!("ORT        {} on {}", on.onnx_runtime, on.provider),
        ];
        lines.extend(self.shown.tables());
        lines.push(String::new());
        lines.extend(self.shown.totals());
        lines.push(self.memory.line());
        lines.join("\n") + "\n"
    }
}
