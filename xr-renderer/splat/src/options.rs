//! A renderer's options.

use std::sync::Arc;

use renderer_vulkan::gpu::Gpu;

use crate::background::Background;
use crate::interrupt::Interrupt;
use crate::posing::BoundMesh;

/// The low-pass filter that keeps splats from falling between pixels.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub enum Filter {
    /// As 3DGS trains: 0.3 px^2 on the covariance's diagonal. Small splats grow heavier with distance.
    #[default]
    Dilation,
    /// As Mip-Splatting trains (Yu et al., 2024): 0.1 px^2, and the opacity lowered so that a splat's sum over the
    /// picture stays what it was.
    Mip,
}

impl Filter {
    /// As the shaders' constant.
    pub(crate) fn is_mip(self) -> u32 {
        u32::from(self == Self::Mip)
    }
}

/// How projected splats become pixels.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum BackEnd {
    /// Compute: lists of each tile's splats, blended front to back in registers until nothing more shows.
    Tiles,
    /// Rasterised quads, blended back to front by fixed function.
    Quads,
}

impl BackEnd {
    /// Whether it can draw on this device: LLVM 19, below Mesa's llvmpipe, crashes on the quads' shaders with vectors of 512
    /// bits, 16 to a subgroup.
    #[must_use]
    pub fn runs_on(self, gpu: &Gpu) -> bool {
        self == Self::Tiles || !(gpu.info().is_cpu && gpu.subgroup_size() > 8)
    }
}

impl std::fmt::Display for BackEnd {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(match self {
            Self::Tiles => "tiles",
            Self::Quads => "quads",
        })
    }
}

/// What a [`crate::renderer::SplatRenderer`] is made for. Kept by its owner, it makes the same renderer again on another device
/// after the first was lost.
#[derive(Debug, Clone)]
pub struct RendererOptions {
    /// The most Gaussians that change from frame to frame, of all slots that are drawn together; the mesh's come on top.
    pub max_foreground: u32,
    /// Gaussians on a skinned mesh, which the device poses itself: see [`crate::drawing::Foreground::Posed`].
    pub mesh: Option<Arc<BoundMesh>>,
    /// The scene behind and around them.
    pub background: Option<Arc<Background>>,
    /// Width of the largest picture in pixels, at most 4096.
    pub width: u32,
    /// Height of the largest picture in pixels, at most 4096.
    pub height: u32,
    /// 1, or 2 for stereo.
    pub views: u32,
    /// Whether depth is drawn as well, as a compositor's reprojection wants it: a seventh of the drawing's time.
    pub depth: bool,
    /// Against aliasing.
    pub filter: Filter,
    /// The back end to use; without one, both draw the first picture a few times and the faster goes on.
    pub back_end: Option<BackEnd>,
    /// Raised to make the renderer return early; without one it is never interrupted.
    pub interrupt: Option<Interrupt>,
}

impl RendererOptions {
    /// Pictures up to a size of a foreground alone, by whichever back end is faster.
    #[must_use]
    pub const fn new(max_foreground: u32, width: u32, height: u32, views: u32) -> Self {
        Self {
            max_foreground,
            mesh: None,
            background: None,
            width,
            height,
            views,
            depth: false,
            filter: Filter::Dilation,
            back_end: None,
            interrupt: None,
        }
    }
}
