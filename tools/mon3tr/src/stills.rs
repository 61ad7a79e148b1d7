//! Stills of an avatar: the receiver on one thread, its cameras and the studio around it.

use crate::backdrop::{DUSK, Shadow, compose};
use crate::device_options::DeviceOptions;
use crate::report::{Splatting, StageTable};
use crate::scenery::is_scene;
use crate::size::{Size, Views};
use anyhow::{Context, anyhow, ensure};
use app_pipeline::deform::Deformer;
use app_pipeline::error::ReceiverError;
use app_pipeline::inference::Inference;
use app_pipeline::plan::Plan;
use app_pipeline::receiver::Receiver;
use glam::Vec3;
use image::RgbImage;
use npu_runtime::{Provider, Runtime};
use profile_report::AvatarFigures;
use renderer_splat::background::Background;
use renderer_splat::camera::Camera;
use renderer_splat::error::RenderError;
use renderer_splat::options::{Filter, RendererOptions};
use renderer_splat::picture::Image;
use renderer_splat::renderer::SplatRenderer;
use renderer_vulkan::gpu::Gpu;
use spmm3::{Avatar, MotionParams, Skeleton};
use std::path::Path;
use std::sync::Arc;

/// What pictures are made: their size, their number of views, and what they show beside a person.
#[derive(Debug, Clone)]
pub struct RenderSettings {
    /// Of each view, in pixels.
    pub size: Size,
    /// How many views.
    pub views: Views,
    /// The scene around the person.
    pub background: Option<Arc<Background>>,
    /// Against aliasing.
    pub filter: Filter,
}

impl RenderSettings {
    /// What a renderer for them and for that many Gaussians of a person is made for.
    pub fn renderer(&self, max_foreground: usize) -> anyhow::Result<RendererOptions> {
        let gaussians = u32::try_from(max_foreground).context("too many Gaussians")?;
        let Size { width, height } = self.size;
        Ok(RendererOptions {
            background: self.background.clone(),
            filter: self.filter,
            ..RendererOptions::new(gaussians, width, height, self.views.count())
        })
    }
}

/// Stills need no lanes: stages run one after the other, each where it is fastest without a GPU's help.
const PLAN: Plan = Plan::CpuTail;

/// Joints before the jaw, the eyes and the fingers.
const BODY_JOINTS: usize = 22;

/// A receiver with its runtime and device, for pictures of one size.
#[derive(Debug)]
pub(crate) struct StillRenderer {
    receiver: Receiver,
    setting: RenderSettings,
}

/// Loads a package and tells its sizes.
pub fn load_avatar(path: &Path) -> anyhow::Result<(Arc<Avatar>, AvatarFigures)> {
    ensure!(
        !is_scene(path),
        "{} looks like a Gaussian scene, not an avatar package: give it with --background",
        path.display()
    );
    let avatar = Avatar::load(path)
        .with_context(|| format!("cannot use the avatar package {}", path.display()))?;
    let figures = AvatarFigures::of(&avatar, path)
        .with_context(|| format!("cannot read {}", path.display()))?;
    Ok((Arc::new(avatar), figures))
}

impl StillRenderer {
    /// Prepares the receiver for `avatar`.
    pub(crate) fn new(
        gpu: &Arc<Gpu>,
        runtime: &Runtime,
        avatar: &Arc<Avatar>,
        setting: RenderSettings,
    ) -> anyhow::Result<Self> {
        let provider = Provider::Cpu {
            threads: DeviceOptions::threads(),
        };
        let inference = Inference::open(runtime, avatar, PLAN.graph(), &[provider], None)?;
        let deformer = Deformer::new(avatar, inference, PLAN)?;
        let options = setting.renderer(deformer.gaussians())?;
        let renderer =
            SplatRenderer::new(Arc::clone(gpu), &options).context("cannot prepare the renderer")?;
        Ok(Self {
            receiver: Receiver::new(deformer, renderer)?,
            setting,
        })
    }

    /// Draws one frame and returns its pictures, one for each camera, before the studio, or within the scene.
    pub(crate) fn picture(
        &mut self,
        motion: &MotionParams,
        cameras: &[Camera],
    ) -> anyhow::Result<Vec<RgbImage>> {
        let splatted = match self.splat(motion, cameras) {
            Err(ReceiverError::Render(error)) if error.is_device_lost() => {
                log::warn!("{error}; this is done once");
                self.receiver.recover()?;
                self.splat(motion, cameras)?
            }
            splatted => splatted?,
        };
        compose_views(
            &splatted,
            cameras,
            self.receiver.deformer().skeleton(),
            motion,
            &self.setting,
        )
    }

    fn splat(
        &mut self,
        motion: &MotionParams,
        cameras: &[Camera],
    ) -> Result<Vec<Image>, ReceiverError> {
        self.receiver.frame(motion, cameras)?;
        Ok(read_views(self.receiver.renderer())?)
    }

    /// The device that draws: another than at first after a loss.
    pub(crate) fn gpu(&mut self) -> Arc<Gpu> {
        Arc::clone(self.receiver.renderer().gpu())
    }

    /// StillRenderer times of all frames so far.
    pub(crate) fn times(&self) -> StageTable {
        let RenderSettings { size, views, .. } = self.setting;
        let splatting = Splatting::new(self.receiver.back_end(), self.receiver.back_end_trial());
        StageTable::new(views, size, self.receiver.stage_times(), splatting)
    }
}

/// Views as pictures: within the scene, if they have one, else in the studio.
pub(crate) fn compose_views(
    splatted: &[Image],
    cameras: &[Camera],
    skeleton: &Skeleton,
    motion: &MotionParams,
    setting: &RenderSettings,
) -> anyhow::Result<Vec<RgbImage>> {
    if setting.background.is_some() {
        return splatted
            .iter()
            .map(|picture| to_rgb(picture, picture.over(DUSK)))
            .collect();
    }
    let joints = skeleton.pose(motion);
    // Without the 30 finger joints, which would make hands cast most of the shadow.
    let body: Vec<Vec3> = spmm3::Joint::ALL
        .into_iter()
        .take(BODY_JOINTS)
        .map(|j| joints.position(j) + motion.root_translation)
        .collect();
    let shadow = Shadow::of(&body);
    splatted
        .iter()
        .zip(cameras)
        .map(|(picture, camera)| to_rgb(picture, compose(picture, camera, &shadow)))
        .collect()
}

/// All views of a renderer's last picture.
pub(crate) fn read_views(renderer: &mut SplatRenderer) -> Result<Vec<Image>, RenderError> {
    (0..renderer.views())
        .map(|view| renderer.read_back(view))
        .collect()
}

/// The rows of a picture as an image.
pub(crate) fn to_rgb(picture: &Image, rgb: Vec<u8>) -> anyhow::Result<RgbImage> {
    RgbImage::from_raw(picture.width(), picture.height(), rgb)
        .ok_or_else(|| anyhow!("the renderer returned a picture of another size"))
}

#[cfg(test)]
mod tests {
    use super::*;
    use renderer_vulkan::choice::GpuChoice;
    use synthetic_person::Puppet;
    use test_support::{onnx, vulkan};

    /// As from a package, so that its networks can be read back.
    fn puppet() -> Avatar {
        let bytes = Puppet::small().avatar().to_bytes().expect("a package");
        Avatar::read(std::io::Cursor::new(bytes)).expect("the package is sound")
    }

    #[test]
    fn a_lost_device_is_opened_again_and_the_frame_drawn_as_if_nothing_had_happened() {
        let (Some(_), Some(runtime)) = (vulkan::gpu(), onnx::runtime()) else {
            return;
        };
        // Of its own: other tests go on with theirs.
        let name = std::env::var("MON3TR_GPU").unwrap_or_default();
        let choice: GpuChoice = name.parse().expect("any text is a choice");
        let gpu = Gpu::open(&choice, false).expect("a device");
        let setting = RenderSettings {
            size: Size {
                width: 96,
                height: 96,
            },
            views: Views::Mono,
            background: None,
            filter: Filter::Dilation,
        };
        let avatar = Arc::new(puppet());
        let mut stage = StillRenderer::new(&gpu, &runtime, &avatar, setting).expect("a stage");
        let (eye, target) = (Vec3::new(0.0, 1.0, 4.0), Vec3::Y * 0.9);
        let camera = Camera::look_at(eye, target, Vec3::Y, 0.6, 96, 96);
        let motion = MotionParams::default();
        let before = stage.picture(&motion, &[camera]).expect("a picture");
        let row = before[0]
            .rows()
            .nth(48)
            .map(|row| row.copied().collect::<Vec<_>>());
        assert!(
            row.is_some_and(|row| row.iter().any(|pixel| *pixel != row[0])),
            "there is someone in the picture"
        );
        gpu.declare_lost();
        let after = stage.picture(&motion, &[camera]).expect("a picture again");
        assert_eq!(before, after, "the same picture from another device");
    }
}
