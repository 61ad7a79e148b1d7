//! Stills of an avatar: a session that waits for each, and the studio around it.

use crate::backdrop::{DUSK, Shadow, compose};
use crate::device_options::DeviceOptions;
use crate::flat::display_error;
use crate::report::{Splatting, StageTable};
use crate::scenery::is_scene;
use crate::size::{Size, Views};
use anyhow::{Context, anyhow, ensure};
use app_pipeline::compiled_sources::CompiledSources;
use app_pipeline::control::Control;
use app_pipeline::placement::InferenceBackends;
use app_pipeline::plan::{PlacementRequest, Plan};
use app_pipeline::profile::{Profile, Recording};
use app_pipeline::quality::QualityMode;
use app_pipeline::stage::Stage;
use app_pipeline::timeline::LatencyMode;
use app_session::display::{DisplayNeeds, DrawnPicture, Still, StillsDisplay};
use app_session::participant::Participant;
use app_session::session::{Session, SessionConfig};
use glam::{Affine3A, Vec3};
use image::RgbImage;
use npu_runtime::{ProviderKind, Runtime};
use profile_report::AvatarFigures;
use renderer_splat::background::Background;
use renderer_splat::camera::Camera;
use renderer_splat::error::RenderError;
use renderer_splat::options::{Filter, RendererOptions};
use renderer_splat::picture::Image;
use renderer_splat::renderer::SplatRenderer;
use renderer_vulkan::gpu::Gpu;
use spmm3::package::PackageLimits;
use spmm3::{Avatar, MotionParams, Skeleton};
use std::collections::HashSet;
use std::path::Path;
use std::sync::Arc;
use std::time::Duration;

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

/// What stills run on: with one pose after the other, each stage where it is fastest without a GPU's help.
const PLACEMENT: PlacementRequest = PlacementRequest {
    plan: Some(Plan::CpuTail),
    provider: Some(ProviderKind::Cpu),
    for_several: false,
};

/// Joints before the jaw, the eyes and the fingers.
const BODY_JOINTS: usize = 22;

/// What stills are drawn with.
#[derive(Debug, Clone, Copy)]
pub struct StillRenderer<'a> {
    /// Draws.
    pub gpu: &'a Arc<Gpu>,
    /// Deforms.
    pub runtime: &'a Runtime,
    /// Is drawn.
    pub avatar: &'a Arc<Avatar>,
}

/// What drawing stills came to.
#[derive(Debug)]
pub struct StillsReport {
    /// What each stage took.
    pub(crate) times: StageTable,
    /// The device that drew the last one: another than at first after a loss.
    pub gpu: Arc<Gpu>,
}

/// Loads a package of one's own and tells its sizes.
pub fn load_avatar(path: &Path) -> anyhow::Result<(Arc<Avatar>, AvatarFigures)> {
    load_within(path, &PackageLimits::OWN)
}

/// The same of another person's, who may be anyone.
pub(crate) fn load_others_avatar(path: &Path) -> anyhow::Result<(Arc<Avatar>, AvatarFigures)> {
    load_within(path, &PackageLimits::OTHERS)
}

fn load_within(
    path: &Path,
    limits: &PackageLimits,
) -> anyhow::Result<(Arc<Avatar>, AvatarFigures)> {
    ensure!(
        !is_scene(path),
        "{} looks like a Gaussian scene, not an avatar package: give it with --background",
        path.display()
    );
    let avatar = Avatar::load_within(path, limits)
        .with_context(|| format!("cannot use the avatar package {}", path.display()))?;
    let figures = AvatarFigures::of(&avatar, path)
        .with_context(|| format!("cannot read {}", path.display()))?;
    Ok((Arc::new(avatar), figures))
}

impl StillRenderer<'_> {
    /// Draws stills, before the studio or within the scene, and hands each one's views to `drawn` with its number. The next still is
    /// asked for when one has been drawn, so they may be live.
    pub fn draw(
        &self,
        setting: &RenderSettings,
        stills: impl IntoIterator<Item = Still>,
        mut drawn: impl FnMut(usize, Vec<RgbImage>) -> anyhow::Result<()>,
    ) -> anyhow::Result<StillsReport> {
        let has_scene = setting.background.is_some();
        self.show(setting, stills, |number, splatted, picture| {
            let people = (picture.people.iter())
                .map(|(avatar, motion, place)| (&avatar.skeleton, motion, *place));
            drawn(
                number,
                compose_views(&splatted, picture.cameras, people, has_scene)?,
            )
        })
    }

    /// Draws stills as [`Self::draw`] does, and hands each one's views as the renderer made them: premultiplied, with nothing behind the
    /// person but the scene, if there is one.
    pub fn splat(
        &self,
        setting: &RenderSettings,
        stills: impl IntoIterator<Item = Still>,
        mut drawn: impl FnMut(usize, Vec<Image>) -> anyhow::Result<()>,
    ) -> anyhow::Result<StillsReport> {
        self.show(setting, stills, |number, splatted, _| {
            drawn(number, splatted)
        })
    }

    /// Draws stills and hands each one's views with its number.
    fn show(
        &self,
        setting: &RenderSettings,
        stills: impl IntoIterator<Item = Still>,
        mut drawn: impl FnMut(usize, Vec<Image>, &DrawnPicture<'_>) -> anyhow::Result<()>,
    ) -> anyhow::Result<StillsReport> {
        let compiled = CompiledSources::default();
        let backends = InferenceBackends {
            runtime: self.runtime,
            threads: DeviceOptions::threads(),
            compiled: &compiled,
        };
        let config = SessionConfig {
            backends,
            placement: PLACEMENT,
            latency: LatencyMode::Newest,
            quality: QualityMode::Fixed(0),
        };
        let mut stills = stills.into_iter().peekable();
        let needs = DisplayNeeds {
            gpu: Arc::clone(self.gpu),
            renderer: setting.renderer(0)?,
            cameras: (stills.peek()).map_or_else(Vec::new, |still| still.cameras.clone()),
            // There is no rate to hold.
            period: Duration::from_secs(1),
        };
        let mut gpu = Arc::clone(self.gpu);
        let mut show = |number: usize, picture: DrawnPicture<'_>| -> anyhow::Result<bool> {
            gpu = Arc::clone(picture.renderer.gpu());
            let splatted = match read_views(picture.renderer) {
                Err(error) if error.is_device_lost() => return Ok(false),
                views => views?,
            };
            drawn(number, splatted, &picture)?;
            Ok(true)
        };
        let mut display = StillsDisplay::new(needs, stills, |number, picture| {
            show(number, picture).map_err(display_error)
        });
        let participant = Participant {
            avatar: Arc::clone(self.avatar),
            sits: false,
            origin: display.origin(),
        };
        let session = Session::new(config, vec![participant], Control::default());
        let report = session.run(&mut display)?;
        drop(display);
        let person = report.people.first().context("there was no person")?;
        let mut recording = Recording::new(&person.collector, report.began, report.ended);
        // While a still is waited for, the CPU interpolates for pictures that are never drawn.
        let drawn: HashSet<u64> = (recording.pictures.iter())
            .map(|picture| picture.interpolated_for)
            .collect();
        (recording.spans)
            .retain(|span| span.stage != Stage::Interpolate || drawn.contains(&span.frame));
        let units = person.placement.units();
        let stages = Profile::of(&recording).summary(|stage| units[stage as usize]);
        let RenderSettings { size, views, .. } = *setting;
        let splatting = Splatting::new(report.back_end, report.back_end_trial);
        Ok(StillsReport {
            times: StageTable::new(views, size, stages, splatting),
            gpu,
        })
    }
}

/// Views as pictures: within their scene, if they have one, else in the studio with the shadows of `people`, each with a rigid place in
/// the world.
pub(crate) fn compose_views<'a>(
    splatted: &[Image],
    cameras: &[Camera],
    people: impl IntoIterator<Item = (&'a Skeleton, &'a MotionParams, Affine3A)>,
    has_scene: bool,
) -> anyhow::Result<Vec<RgbImage>> {
    if has_scene {
        return splatted
            .iter()
            .map(|picture| to_rgb(picture, picture.over(DUSK)))
            .collect();
    }
    let bodies = people.into_iter().flat_map(|(skeleton, motion, place)| {
        let joints = skeleton.pose(motion);
        // Without the 30 finger joints, which would make hands cast most of the shadow.
        let body = spmm3::Joint::ALL.into_iter().take(BODY_JOINTS);
        body.map(move |j| place.transform_point3(joints.position(j) + motion.root_translation))
    });
    let body: Vec<Vec3> = bodies.collect();
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
        let (eye, target) = (Vec3::new(0.0, 1.0, 4.0), Vec3::Y * 0.9);
        let camera = Camera::look_at(eye, target, Vec3::Y, 0.6, 96, 96);
        let still = Still {
            motion: MotionParams::default(),
            cameras: vec![camera],
        };
        let renderer = StillRenderer {
            gpu: &gpu,
            runtime: &runtime,
            avatar: &avatar,
        };
        let mut pictures = Vec::new();
        let report = renderer.draw(&setting, vec![still.clone(), still], |number, picture| {
            pictures.push(picture);
            if number == 0 {
                gpu.declare_lost();
            }
            Ok(())
        });
        let report = report.expect("stills");
        assert!(!Arc::ptr_eq(&report.gpu, &gpu), "another device");
        let [before, after] = &pictures[..] else {
            panic!("{} pictures", pictures.len());
        };
        let row = before[0]
            .rows()
            .nth(48)
            .map(|row| row.copied().collect::<Vec<_>>());
        assert!(
            row.is_some_and(|row| row.iter().any(|pixel| *pixel != row[0])),
            "there is someone in the picture"
        );
        assert_eq!(before, after, "the same picture from another device");
    }
}
