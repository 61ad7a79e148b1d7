//! The errors of drawing, each with what to do about it.

use renderer_vulkan::error::VulkanError;

use crate::limits::MOST_PARTS;

/// Why the renderer could not draw.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum RenderError {
    /// The device failed, or lacks something.
    #[error(transparent)]
    Vulkan(#[from] VulkanError),
    /// More Gaussians than the renderer was made for, or than any on this device can take.
    #[error(
        "{count} Gaussians are more than the {limit} that this renderer can take: use fewer Gaussians"
    )]
    TooManyGaussians {
        /// How many were given.
        count: usize,
        /// How many fit.
        limit: u32,
    },
    /// The parts of a mesh with Gaussians do not fit together.
    #[error("Gaussians cannot be posed with this mesh: {0}; give arrays of one avatar")]
    BoundMesh(String),
    /// A pose is not of the mesh it was given for.
    #[error(
        "a pose has {got} {what}, but its mesh needs {expected}: give the outputs of the same avatar's networks"
    )]
    PosedInput {
        /// What there are too few or too many of.
        what: &'static str,
        /// How many were given.
        got: usize,
        /// How many the mesh needs.
        expected: usize,
    },
    /// A state was asked for that is not on the device.
    #[error(
        "the state is not on the device: push a pose, draw before four more are pushed, and push anew after `recover`"
    )]
    NoState,
    /// A posed foreground was asked of a renderer that has no mesh.
    #[error("the renderer has no mesh to pose: make it with `RendererOptions::mesh` set")]
    NoMesh,
    /// A pose came as parameters to a mesh without networks.
    #[error(
        "the mesh has no networks to compute a pose from parameters: add them with `BoundMesh::with_networks`, or give what they computed"
    )]
    NoNetworks,
    /// A slot's memory is another device's than the renderer's.
    #[error(
        "the foreground slot belongs to another device than the renderer: make slots with `foreground_slot` of the renderer that draws them, and new ones after `recover`"
    )]
    ForeignSlot,
    /// A foreground of more parts than can be drawn at once.
    #[error(
        "a foreground of {parts} parts cannot be drawn, at most {MOST_PARTS}: put Gaussians that move together into one slot"
    )]
    TooManyParts {
        /// How many were given.
        parts: usize,
    },
    /// A part's transform is not rigid.
    #[error(
        "part {part} of the foreground cannot be drawn: its `world_from_part` is not rigid or not finite; give a turn and a shift alone, and bake sizes into the Gaussians"
    )]
    PartNotRigid {
        /// Which one, from 0.
        part: usize,
    },
    /// Two parts show the mesh.
    #[error(
        "two parts of the foreground are posed on the device, which holds one mesh: write all people but one to slots"
    )]
    PosedTwice,
    /// The picture was drawn into a headset's images only.
    #[error(
        "the picture was drawn straight into the headset's images, not the renderer's own: read it back from the session"
    )]
    NotKept,
    /// A part of the foreground covers so many tiles that no device draws it in time; or all parts do, and this one most of them.
    /// Nothing was drawn.
    #[error(
        "part {part} of the foreground covers {pairs} screen tiles, where {limit} can be drawn: leave it out, move it away from the camera, or use fewer or smaller Gaussians"
    )]
    CostlyPart {
        /// Which one, from 0.
        part: usize,
        /// Tiles of its Gaussians' rectangles in all views: at least as many as are listed.
        pairs: u64,
        /// How many one part, or all together, may make.
        limit: u32,
    },
    /// The Gaussians cover too many tiles together.
    #[error(
        "the Gaussians cover {pairs} screen tiles together, more than the {limit} that fit: use fewer or smaller Gaussians, or a smaller picture"
    )]
    TooManyPairs {
        /// (Gaussian, tile) pairs in the picture; `u32::MAX` stands for that or more.
        pairs: u32,
        /// How many the device's largest buffer holds.
        limit: u32,
    },
    /// The picture's size or number of views cannot be drawn.
    #[error(
        "cannot draw {views} view(s) of {width}x{height} pixels: 1 or 2 views of 1x1 to 4096x4096 can be drawn"
    )]
    PictureSize {
        /// Width in pixels.
        width: u32,
        /// Height in pixels.
        height: u32,
        /// Views.
        views: u32,
    },
    /// A camera does not fit the picture or is no camera.
    #[error(
        "camera {view} cannot be drawn with: {problem}; give each view of the renderer one rigid camera with finite numbers and a size that fits"
    )]
    Camera {
        /// Which view's camera.
        view: usize,
        /// What is wrong with it.
        problem: String,
    },
    /// The quad back end was asked for where its shaders crash the driver.
    #[error(
        "llvmpipe crashes on the quads' shaders with vectors of 512 bits: draw by tiles, or set LP_NATIVE_VECTOR_WIDTH=256"
    )]
    NoQuads,
    /// Depth was asked for but not drawn.
    #[error("the renderer draws no depth: make it with `RendererOptions::depth` set")]
    NoDepth,
    /// There is no such view to read.
    #[error("view {view} does not exist: the renderer has {views}")]
    NoSuchView {
        /// What was asked for.
        view: u32,
        /// How many there are.
        views: u32,
    },
}

impl RenderError {
    /// The part of the foreground without which a picture that covers too many tiles may be drawn.
    #[must_use]
    pub fn costly_part(&self) -> Option<usize> {
        match self {
            Self::CostlyPart { part, .. } => Some(*part),
            _ => None,
        }
    }

    /// Whether the device was lost: open it again.
    #[must_use]
    pub fn is_device_lost(&self) -> bool {
        matches!(self, Self::Vulkan(VulkanError::DeviceLost(_)))
    }
}
