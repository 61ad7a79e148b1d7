//! The program's options.

use std::path::PathBuf;

use renderer_openxr::eyes::Surround;
use renderer_splat::gaussian::Gaussian;
use renderer_splat::options::BackEnd;
use test_support::splat_scenes::{figure_ahead, markers};

/// The scene before the viewer.
#[derive(Debug, Clone, Copy)]
pub(crate) enum Figure {
    Person,
    Markers,
    None,
}

impl Figure {
    pub(crate) fn gaussians(self) -> Vec<Gaussian> {
        match self {
            Self::Person => figure_ahead(),
            Self::Markers => markers().to_vec(),
            Self::None => Vec::new(),
        }
    }
}

/// `--figure=person|markers|none`, `--surround=room|studio`, `--back-end=tiles|quads`, `--eye=WIDTHxHEIGHT`, `--read-to=FOLDER`,
/// `--steered`, `--reopens`.
#[derive(Debug)]
pub(crate) struct Options {
    /// To be shown, at most.
    pub(crate) frames: u64,
    pub(crate) figure: Figure,
    pub(crate) surround: Surround,
    pub(crate) back_end: Option<BackEnd>,
    /// Instead of what the runtime recommends.
    pub(crate) eye_size: Option<[u32; 2]>,
    /// Where pictures that are read are put; without it none can be read.
    pub(crate) folder: Option<PathBuf>,
    pub(crate) steered: bool,
    /// Whether the headset is opened again after it was lost.
    pub(crate) reopens: bool,
}

impl Options {
    pub(crate) fn parse(mut arguments: impl Iterator<Item = String>) -> Result<Self, String> {
        let frames = arguments.next().and_then(|frames| frames.parse().ok());
        let mut options = Self {
            frames: frames.ok_or("how many frames?")?,
            figure: Figure::Person,
            surround: Surround::Room,
            back_end: None,
            eye_size: None,
            folder: None,
            steered: false,
            reopens: false,
        };
        for argument in arguments {
            match argument.split_once('=').unwrap_or((&argument, "")) {
                ("--figure", "person") => options.figure = Figure::Person,
                ("--figure", "markers") => options.figure = Figure::Markers,
                ("--figure", "none") => options.figure = Figure::None,
                ("--surround", "room") => options.surround = Surround::Room,
                ("--surround", "studio") => options.surround = Surround::Studio,
                ("--back-end", "tiles") => options.back_end = Some(BackEnd::Tiles),
                ("--back-end", "quads") => options.back_end = Some(BackEnd::Quads),
                ("--eye", size) => options.eye_size = Some(parse_size(size)?),
                ("--read-to", folder) => options.folder = Some(folder.into()),
                ("--steered", "") => options.steered = true,
                ("--reopens", "") => options.reopens = true,
                _ => return Err(format!("what is {argument}?")),
            }
        }
        Ok(options)
    }
}

fn parse_size(size: &str) -> Result<[u32; 2], String> {
    let sides = size.split_once('x');
    let sides = sides.and_then(|(wide, high)| Some([wide.parse().ok()?, high.parse().ok()?]));
    sides.ok_or_else(|| format!("{size} is no WIDTHxHEIGHT"))
}
