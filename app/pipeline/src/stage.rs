//! Units, lanes and stages: the one table of what a frame's way is made of and where each step may run.

use serde::Serialize;

/// What a stage runs on.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize)]
pub enum Unit {
    /// The neural processor.
    #[serde(rename = "NPU")]
    Npu,
    /// The graphics processor (lavapipe counts as one: it is the Vulkan device).
    #[serde(rename = "GPU")]
    Gpu,
    /// The central processor.
    #[serde(rename = "CPU")]
    Cpu,
}

impl Unit {
    /// All three.
    pub const ALL: [Self; 3] = [Self::Npu, Self::Gpu, Self::Cpu];

    /// The unit's name in tables.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Npu => "NPU",
            Self::Gpu => "GPU",
            Self::Cpu => "CPU",
        }
    }
}

/// A thread that feeds one unit; the CPU has two, because motion comes when the network likes and pictures are due when the
/// display likes.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Lane {
    /// Frames from the network, what to show in their absence, kinematics.
    Motion,
    /// The deform graph.
    Npu,
    /// States of Gaussians, and their interpolation for the display.
    Cpu,
    /// Pictures.
    Gpu,
}

impl Lane {
    /// All four, in the order of a frame's way.
    pub const ALL: [Self; 4] = [Self::Motion, Self::Npu, Self::Cpu, Self::Gpu];

    /// The lane's name in traces and tables.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Motion => "motion (CPU)",
            Self::Npu => "NPU",
            Self::Cpu => "CPU",
            Self::Gpu => "GPU",
        }
    }
}

/// A named step of a frame's way, in the order of that way.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Stage {
    /// Forward kinematics: 55 joint transforms.
    Kinematics,
    /// The deform graph, or what of it a placement leaves to ONNX Runtime.
    Inference,
    /// Linear blend skinning, where it is not part of the graph.
    Skin,
    /// F_attr's tail where it is not part of the graph, and F_m2g: one state of Gaussians.
    Bind,
    /// Between two states, at the display's predicted time, packed for the renderer.
    Interpolate,
    /// Copy to the GPU.
    Upload,
    /// Projection, culling, depth keys.
    Project,
    /// The 16-bit depth sort.
    Sort,
    /// Per-tile lists.
    Bin,
    /// Rasterisation.
    Raster,
}

impl Stage {
    /// All stages in order.
    pub const ALL: [Self; 10] = [
        Self::Kinematics,
        Self::Inference,
        Self::Skin,
        Self::Bind,
        Self::Interpolate,
        Self::Upload,
        Self::Project,
        Self::Sort,
        Self::Bin,
        Self::Raster,
    ];

    /// The stage's name in tables and JSON.
    #[must_use]
    pub fn name(self) -> &'static str {
        self.row().0
    }

    /// The units it may run on, the paper's choice first.
    #[must_use]
    pub fn legal_units(self) -> &'static [Unit] {
        self.row().1
    }

    /// Whether it runs once for every picture; else once for every motion frame.
    #[must_use]
    pub fn is_per_picture(self) -> bool {
        self >= Self::Interpolate
    }

    fn row(self) -> (&'static str, &'static [Unit]) {
        use Unit::{Cpu, Gpu, Npu};
        match self {
            Self::Kinematics => ("kinematics", &[Cpu]),
            Self::Inference => ("inference", &[Npu, Cpu, Gpu]),
            Self::Skin => ("skin (LBS)", &[Npu, Cpu, Gpu]),
            Self::Bind => ("bind (F_attr, F_m2g)", &[Cpu, Gpu]),
            Self::Interpolate => ("interpolate", &[Cpu, Gpu]),
            Self::Upload => ("upload", &[Gpu]),
            Self::Project => ("project", &[Gpu]),
            Self::Sort => ("sort", &[Gpu]),
            Self::Bin => ("bin", &[Gpu]),
            Self::Raster => ("raster", &[Gpu]),
        }
    }
}

impl Serialize for Stage {
    fn serialize<S: serde::Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.serialize_str(self.name())
    }
}
