//! The duration of each stage of a picture on the device, and its time.

use std::time::{Duration, Instant};

/// Milliseconds each stage of the last picture took; 0 for device stages where the queue has no clock, and for those of
/// posing where the foreground is uploaded.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct StageTimes {
    /// Writing the Gaussians to memory that the device reads (host) and copying them there (device).
    pub upload: f64,
    /// The networks of new poses, where the device runs them.
    pub networks: f64,
    /// Skinning the meshes of new poses.
    pub skin: f64,
    /// Their Gaussians: attributes, and where those are on the mesh.
    pub attributes: f64,
    /// Gaussians between two states.
    pub interpolate: f64,
    /// Culling, projection into each view, depth keys.
    pub project: f64,
    /// The sort, once for all views.
    pub sort: f64,
    /// Listing the splats of each tile; nothing for quads.
    pub bin: f64,
    /// Blending.
    pub raster: f64,
}

impl StageTimes {
    /// What depends on posing on the device, together.
    pub fn posing(&self) -> f64 {
        self.networks + self.skin + self.attributes + self.interpolate
    }

    /// All stages together.
    pub fn total(&self) -> f64 {
        self.upload + self.posing() + self.project + self.sort + self.bin + self.raster
    }
}

/// When a picture was drawn, on the host's clock.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PictureTime {
    /// It was handed to the device.
    pub submitted: Instant,
    /// The host knew that it was done.
    pub finished: Instant,
    /// When the device worked on it; nothing where its queue has no clock.
    pub stages: Option<StageSpans>,
}

/// When the device began each stage of a picture and ended it, on the host's clock; each begins as the last one ends.
///
/// Lengths are as exact as the device's clock, a microsecond or better. Where all of it lies is known to within
/// [`Self::within`]: some microseconds where the driver compares clocks (`VK_KHR_calibrated_timestamps`); elsewhere half
/// of what is left between submission and first stamp, last stamp and fence, in the pictures so far where that was
/// least. All of it lies between [`PictureTime::submitted`] and [`PictureTime::finished`] in any case.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct StageSpans {
    /// Copying the foreground to the device's memory.
    pub upload: [Instant; 2],
    /// The networks of new poses; of no length where the device does not run them.
    pub networks: [Instant; 2],
    /// Skinning new poses' meshes; of no length where the foreground is uploaded, as are the next two.
    pub skin: [Instant; 2],
    /// Making states of them.
    pub attributes: [Instant; 2],
    /// The picture's Gaussians between two states.
    pub interpolate: [Instant; 2],
    /// Culling, projection into each view, depth keys.
    pub project: [Instant; 2],
    /// The sort; of no length where the order was kept.
    pub sort: [Instant; 2],
    /// Listing the splats of each tile.
    pub bin: [Instant; 2],
    /// Blending.
    pub raster: [Instant; 2],
    /// How much earlier or later all of it may have been.
    pub within: Duration,
}
