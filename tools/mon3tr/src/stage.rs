//! An avatar on stage: the receiver, its cameras and the studio around it.

use crate::backdrop::{Shadow, compose};
use crate::report::{AvatarFigures, StageTable};
use crate::surroundings::Surroundings;
use crate::viewpoint::Viewpoint;
use anyhow::{Context, anyhow};
use app::{Deformer, Receiver};
use clap::ValueEnum;
use glam::{Quat, Vec3};
use image::RgbImage;
use npu_runtime::Runtime;
use spmm3::{Avatar, MotionParams};
use std::path::Path;
use std::sync::Arc;
use xr_renderer::{Camera, Gpu, RendererOptions, SplatRenderer};

/// Width and height in pixels, written WxH.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Size {
    pub(crate) width: u32,
    pub(crate) height: u32,
}

impl std::str::FromStr for Size {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let number = |text: &str| text.parse::<u32>().ok().filter(|n| (16..=4096).contains(n));
        text.split_once('x')
            .and_then(|(w, h)| {
                Some(Self {
                    width: number(w)?,
                    height: number(h)?,
                })
            })
            .ok_or_else(|| {
                format!("{text} is not WIDTHxHEIGHT with sides of 16..4096 pixels, e.g. 1024x1024")
            })
    }
}

/// One eye or two.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum Views {
    Mono,
    Stereo,
}

/// Joints before the jaw, the eyes and the fingers.
const BODY_JOINTS: usize = 22;

/// A receiver with its runtime and device, for pictures of one size.
#[derive(Debug)]
pub(crate) struct Stage {
    receiver: Receiver,
    size: Size,
    views: Views,
}

/// Loads a package and tells its sizes.
pub(crate) fn load_avatar(path: &Path) -> anyhow::Result<(Avatar, AvatarFigures)> {
    let avatar = Avatar::load(path)
        .with_context(|| format!("cannot use the avatar package {}", path.display()))?;
    let package_bytes = std::fs::metadata(path)
        .with_context(|| format!("cannot read {}", path.display()))?
        .len();
    let figures = AvatarFigures {
        name: avatar.name.clone(),
        package: path.to_path_buf(),
        package_bytes,
        vertices: avatar.template.vertices().len(),
        triangles: avatar.template.faces().len(),
        gaussians: avatar.gaussians.len(),
        controllers: avatar.controllers.vertices().len(),
    };
    Ok((avatar, figures))
}

impl Stage {
    /// Prepares the receiver for `avatar`.
    pub(crate) fn new(
        gpu: &Arc<Gpu>,
        runtime: &Runtime,
        avatar: &Avatar,
        size: Size,
        views: Views,
    ) -> anyhow::Result<Self> {
        let deformer = Deformer::new(runtime, avatar, Surroundings::provider())?;
        let count = if views == Views::Stereo { 2 } else { 1 };
        let gaussians = u32::try_from(avatar.gaussians.len()).context("too many Gaussians")?;
        let options = RendererOptions::new(gaussians, size.width, size.height, count);
        let renderer =
            SplatRenderer::new(Arc::clone(gpu), &options).context("cannot prepare the renderer")?;
        Ok(Self {
            receiver: Receiver::new(deformer, renderer),
            size,
            views,
        })
    }

    /// Draws one frame and returns its pictures before the studio: one, or left and right.
    pub(crate) fn picture(
        &mut self,
        motion: &MotionParams,
        viewpoint: &Viewpoint,
        floor: Vec3,
        heading: Quat,
    ) -> anyhow::Result<Vec<RgbImage>> {
        let Size { width, height } = self.size;
        let cameras: Vec<Camera> = match self.views {
            Views::Mono => vec![viewpoint.camera(floor, heading, width, height)],
            Views::Stereo => viewpoint.stereo(floor, heading, width, height).to_vec(),
        };
        self.receiver.frame(motion, &cameras)?;
        let skeleton = self.receiver.deformer().skeleton();
        let joints = skeleton.pose(motion);
        // Without the 30 finger joints, which would make hands cast most of the shadow.
        let body: Vec<Vec3> = spmm3::Joint::ALL
            .into_iter()
            .take(BODY_JOINTS)
            .map(|j| joints.position(j) + motion.root_translation)
            .collect();
        let shadow = Shadow::of(&body);
        let mut pictures = Vec::with_capacity(cameras.len());
        for (view, camera) in (0..).zip(&cameras) {
            let splatted = self.receiver.renderer().read_back(view)?;
            let rgb = compose(&splatted, camera, &shadow);
            let picture = RgbImage::from_raw(width, height, rgb);
            pictures.push(
                picture
                    .ok_or_else(|| anyhow!("the renderer returned a picture of another size"))?,
            );
        }
        Ok(pictures)
    }

    /// Stage times of all frames so far.
    pub(crate) fn times(&self) -> StageTable {
        let views = if self.views == Views::Stereo { 2 } else { 1 };
        StageTable::new(
            views,
            self.size.width,
            self.size.height,
            self.receiver.stage_times(),
        )
    }
}
