//! What `bench render` can be told.

use clap::ValueEnum;
use mon3tr::size::Size;
use mon3tr::up::UpChoice;
use renderer_splat::options::BackEnd;
use std::path::PathBuf;

/// Options of `bench render`.
#[derive(Debug, clap::Args)]
pub(crate) struct Options {
    /// Time this scene (.ply, .splat, .spz, .sog) instead of the made-up person
    #[arg(long, value_name = "FILE")]
    pub(crate) scene: Option<PathBuf>,
    /// The scene's cameras, in the cameras.json that 3DGS writes [default: one that sees the whole scene from the front]
    #[arg(long, value_name = "FILE", requires = "scene")]
    pub(crate) view: Option<PathBuf>,
    /// The axis of the scene's file that points up, as for `render`
    #[arg(
        long,
        value_name = "AXIS",
        default_value_t = UpChoice::Auto,
        requires = "scene",
        allow_hyphen_values = true
    )]
    pub(crate) up: UpChoice,
    /// Which of the cameras [default: the first]
    #[arg(long, value_name = "N", requires = "view", allow_hyphen_values = true)]
    pub(crate) id: Option<i64>,
    /// Size of one picture in pixels [default: the standard table's three, or 1024x1024 for a scene]
    #[arg(long, value_name = "WxH")]
    pub(crate) size: Option<Size>,
    /// Frames to take the median of
    #[arg(long, value_name = "K", default_value_t = 15, value_parser = clap::value_parser!(u32).range(1..=10_000))]
    pub(crate) frames: u32,
    /// Draw the scene with both eyes
    #[arg(long, requires = "scene")]
    pub(crate) stereo: bool,
    /// Draw with this back end [default: the one that is faster at the start]
    #[arg(long, value_name = "BACK_END")]
    pub(crate) back_end: Option<BackEndChoice>,
    /// Write the scene's picture over black (the left eye's)
    #[arg(long, value_name = "FILE", requires = "scene")]
    pub(crate) png: Option<PathBuf>,
    /// Write every sample as JSON
    #[arg(long, value_name = "FILE")]
    pub(crate) json: Option<PathBuf>,
}

/// A back end by its name.
#[derive(Debug, Clone, Copy, ValueEnum)]
pub(crate) enum BackEndChoice {
    /// Compute: lists of each tile's splats
    Tiles,
    /// Rasterised quads, blended by fixed function
    Quads,
}

impl From<BackEndChoice> for BackEnd {
    fn from(choice: BackEndChoice) -> Self {
        match choice {
            BackEndChoice::Tiles => Self::Tiles,
            BackEndChoice::Quads => Self::Quads,
        }
    }
}
