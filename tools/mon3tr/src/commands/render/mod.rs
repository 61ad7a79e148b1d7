//! `mon3tr render`: an avatar follows a motion, alone or in a scene, every frame a PNG and one animation; or one picture
//! of a scene without anyone in it.

mod person;
mod scene;

use crate::device_options::{DeviceOptions, make_folder};
use crate::performance::MotionOptions;
use crate::report::check_writable;
use crate::scenery::{SceneryOptions, load_camera};
use crate::size::{DEFAULT_SIZE, Size, Views};
use crate::viewpoint::CameraChoice;
use anyhow::{anyhow, bail};
use clap::ValueEnum;
use image::RgbImage;
use renderer_splat::options::Filter;
use splat_scene::cameras::SceneCamera;
use std::path::{Path, PathBuf};

/// Options of `render`.
#[derive(Debug, clap::Args)]
pub struct Options {
    /// Avatar package (.m3a), as `bake` writes it; may be left out where there is a --background
    #[arg(value_name = "PACKAGE")]
    package: Option<PathBuf>,
    #[command(flatten)]
    motion: MotionOptions,
    #[command(flatten)]
    scenery: SceneryOptions,
    /// Folder for the pictures; made if missing
    #[arg(long, value_name = "FOLDER", default_value = "out/render")]
    out: PathBuf,
    /// Size of one picture in pixels [default: the cameras.json's, else 1024x1024]
    #[arg(long, value_name = "WxH")]
    size: Option<Size>,
    /// Draw both eyes (files end in _left and _right)
    #[arg(long)]
    stereo: bool,
    /// front, three-quarter, side, back, waist-up, face, hands; or EYE:TARGET:FOV in metres and degrees relative to the
    /// person, e.g. 0,1.6,2:0,1.4,0:30; or the scene's cameras.json. Without a PACKAGE a name shows the whole scene from
    /// that side, and EYE:TARGET:FOV is in the scene's coordinates, y up
    #[arg(
        long,
        value_name = "VIEW",
        default_value = "three-quarter",
        allow_hyphen_values = true
    )]
    view: CameraChoice,
    /// Which camera of the cameras.json [default: its first]
    #[arg(long, value_name = "N", allow_hyphen_values = true)]
    id: Option<i64>,
    /// Against aliasing: dilation as 3DGS trains, mip as Mip-Splatting does [default: as the scene's file says]
    #[arg(long, value_name = "FILTER")]
    filter: Option<FilterChoice>,
    /// Write every figure as JSON
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
}

/// A filter by its name.
#[derive(Debug, Clone, Copy, ValueEnum)]
enum FilterChoice {
    Dilation,
    Mip,
}

impl From<FilterChoice> for Filter {
    fn from(choice: FilterChoice) -> Self {
        match choice {
            FilterChoice::Dilation => Self::Dilation,
            FilterChoice::Mip => Self::Mip,
        }
    }
}

/// Runs `render`.
pub(crate) fn run(options: &Options, device: &DeviceOptions) -> anyhow::Result<()> {
    let of_a_file = matches!(options.view, CameraChoice::File(_));
    if options.id.is_some() && !of_a_file {
        bail!("--id names a camera of a file: give the file too, as --view cameras.json");
    }
    options.scenery.check()?;
    match (&options.package, &options.scenery.background) {
        (Some(_), None) if of_a_file => {
            bail!("a cameras.json belongs to a scene: give the scene too, with --background");
        }
        (Some(package), _) => person::run(options, package, device),
        (None, Some(file)) => scene::run(options, file, device),
        (None, None) => {
            bail!("nothing to draw: give an avatar package, or a scene with --background")
        }
    }
}

impl Options {
    /// The scene's own camera, if one was chosen.
    fn scene_camera(&self) -> anyhow::Result<Option<SceneCamera>> {
        self.camera_file()
            .map(|file| load_camera(file, self.id))
            .transpose()
    }

    /// The scene's cameras, if one of them was chosen.
    fn camera_file(&self) -> Option<&Path> {
        match &self.view {
            CameraChoice::File(file) => Some(file),
            CameraChoice::Named(_) | CameraChoice::Exact(_) => None,
        }
    }

    /// The pictures' size: as asked for, else the camera's own.
    fn size(&self, camera: Option<&SceneCamera>) -> anyhow::Result<Size> {
        match (self.size, camera) {
            (Some(size), _) => Ok(size),
            (None, Some(camera)) => format!("{}x{}", camera.width, camera.height)
                .parse()
                .map_err(|why| {
                    anyhow!("the camera's size cannot be drawn ({why}): choose one with --size")
                }),
            (None, None) => Ok(DEFAULT_SIZE),
        }
    }

    fn views(&self) -> Views {
        if self.stereo {
            Views::Stereo
        } else {
            Views::Mono
        }
    }

    /// Makes the folder for the pictures, and sure that the figures can be written.
    fn prepare_output(&self) -> anyhow::Result<()> {
        make_folder(&self.out)?;
        self.json.as_deref().map_or(Ok(()), check_writable)
    }
}

/// Writes the pictures of one frame, one for each eye, and returns their files.
fn write_frame(out: &Path, k: usize, drawn: &[RgbImage]) -> anyhow::Result<Vec<PathBuf>> {
    let sides: &[&str] = match drawn {
        [_, _] => &["_left", "_right"],
        _ => &[""],
    };
    drawn
        .iter()
        .zip(sides)
        .map(|(picture, side)| {
            let file = out.join(format!("frame_{k:05}{side}.png"));
            crate::film::write_png(&file, picture)?;
            Ok(file)
        })
        .collect()
}
