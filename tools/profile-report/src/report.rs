//! The measurements, and what they were made on, as a table for people and as JSON for programs.

use crate::machine::MachineFigures;
use crate::{Measured, Memory};
use app_session::call::CallFigures;
use serde::Serialize;
use serde_json::Value;
use spmm3::Avatar;
use std::io;
use std::path::{Path, PathBuf};

/// All results of a profile.
#[derive(Debug, Serialize)]
pub struct Report {
    /// The avatar that was shown.
    pub avatar: AvatarFigures,
    /// The machine and the call.
    pub conditions: Conditions,
    /// What the lanes measured.
    #[serde(flatten)]
    pub shown: Measured,
    /// The memory it took.
    pub memory: Memory,
    /// Heat and clocks meanwhile.
    pub machine: MachineFigures,
    /// What the receiver's end of the call measured.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub call: Option<CallFigures>,
    /// What the sender measured; null where there was none.
    pub sent: Value,
}

/// Sizes of the avatar that was shown.
#[derive(Debug, Clone, Serialize)]
pub struct AvatarFigures {
    /// The name that its package gives it.
    pub name: String,
    /// The package's file.
    pub package: PathBuf,
    /// The package's size.
    pub package_bytes: u64,
    /// Vertices of the template N_v.
    pub vertices: usize,
    /// Triangles of the template.
    pub triangles: usize,
    /// Gaussians N_g.
    pub gaussians: usize,
    /// Controllers N_c.
    pub controllers: usize,
}

impl AvatarFigures {
    /// Of an avatar that was read from the file `package`.
    ///
    /// # Errors
    /// If the file is gone.
    pub fn of(avatar: &Avatar, package: &Path) -> io::Result<Self> {
        Ok(Self {
            name: avatar.name.clone(),
            package: package.to_path_buf(),
            package_bytes: std::fs::metadata(package)?.len(),
            vertices: avatar.template.vertices().len(),
            triangles: avatar.template.faces().len(),
            gaussians: avatar.gaussians.len(),
            controllers: avatar.controllers.vertices().len(),
        })
    }
}

/// The machine and the call of a measurement.
#[derive(Debug, Serialize)]
pub struct Conditions {
    /// The source of motion.
    pub motion: String,
    /// The Vulkan device's name.
    pub vulkan_device: String,
    /// Its driver.
    pub vulkan_driver: String,
    /// ONNX Runtime's version.
    pub onnx_runtime: String,
    /// The provider of the deform graph; nothing where the GPU runs the networks.
    pub provider: Option<String>,
    /// One eye's picture, pixels.
    pub width: u32,
    /// See [`Self::width`].
    pub height: u32,
    /// One eye's picture, or both eyes'.
    pub views: u32,
    /// How pictures between two states are made: interpolate or extrapolate.
    pub latency: String,
    /// Threads this machine runs at once.
    pub cores: usize,
}

impl Conditions {
    /// "2 x 1680 x 1760".
    fn picture(&self) -> String {
        let eyes = if self.views == 2 { "2 x " } else { "" };
        format!("{eyes}{} x {}", self.width, self.height)
    }
}

impl Report {
    /// The figures in at most 110 columns.
    #[must_use]
    pub fn table(&self) -> String {
        let (a, on, of) = (&self.avatar, &self.conditions, &self.shown.measured);
        let period_ms = 1e3 / of.display_hz;
        let mut lines = vec![
            String::new(),
            format!(
                "avatar     {}: {} Gaussians, {} vertices, {} controllers",
                a.name, a.gaussians, a.vertices, a.controllers
            ),
            format!(
                "call       {:.1} s of {} at {:.0} Hz, {}",
                of.seconds,
                on.motion,
                of.motion_hz,
                if self.sent.is_null() {
                    "made on this machine"
                } else {
                    "sender and server on this machine"
                }
            ),
            format!(
                "pictures   {} pixels, {}d, for a display of {:.0} Hz ({period_ms:.1} ms)",
                on.picture(),
                on.latency,
                of.display_hz
            ),
            format!("GPU        {} ({})", on.vulkan_device, on.vulkan_driver),
            match &on.provider {
                Some(provider) => format!("ORT        {} on {provider}", on.onnx_runtime),
                None => "networks   compute shaders of the GPU".to_owned(),
            },
        ];
        lines.extend(self.shown.tables());
        lines.push(String::new());
        lines.extend(self.shown.totals());
        lines.push(self.memory.line());
        lines.extend(self.machine.lines());
        lines.join("\n") + "\n"
    }
}
