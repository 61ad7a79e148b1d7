//! What the networks see in drawn and in decoded pictures, kept in a folder if there is one.

use super::kept::{self, Kept, KeptFile};
use super::renders::{self, RATE, Take};
use super::table::StageSamples;
use anyhow::{Context, bail};
use app_session::display::Still;
use mon3tr::device_options::{DeviceOptions, networks};
use mon3tr::progress;
use mon3tr::size::{Size, Views};
use mon3tr::stills::{RenderSettings, StillRenderer};
use motion_fit::landmarks::Observation;
use renderer_splat::options::Filter;
use spmm3::Avatar;
use std::path::Path;
use std::sync::Arc;
use std::time::Instant;
use tracker::Tracker;
use tracker::mediapipe::{BodyBy, Options};
use tracker::source::{self, Picture, SourceChoice};

/// Looks at pictures, or reads what was seen in them before.
pub(super) struct Keeper<'a> {
    folder: Option<&'a Path>,
    /// Which avatar is drawn.
    avatar: String,
    /// The networks that look.
    models: Options,
    device: &'a DeviceOptions,
    times: StageSamples,
}

impl<'a> Keeper<'a> {
    pub(super) fn new(
        folder: Option<&'a Path>,
        avatar: &str,
        body: BodyBy,
        device: &'a DeviceOptions,
    ) -> Self {
        Self {
            folder,
            avatar: avatar.to_owned(),
            models: Options {
                body,
                ..Options::default()
            },
            device,
            times: StageSamples::default(),
        }
    }

    /// What the networks took so far.
    pub(super) fn times(&self) -> &StageSamples {
        &self.times
    }

    /// An avatar's renders.
    pub(super) fn take(
        &mut self,
        take: &Take,
        avatar: &Arc<Avatar>,
    ) -> anyhow::Result<Vec<Observation>> {
        let motion = kept::motion(&take.frames);
        let name = format!("{}-{}-{motion}", take.motion, take.camera_name);
        let of = format!("the avatar {} in the motion {motion}", self.avatar);
        self.kept(&name, &of, |keeper| keeper.draw(take, avatar))
    }

    /// A video's frames.
    pub(super) fn video(&mut self, name: &str, file: &Path) -> anyhow::Result<Vec<Observation>> {
        self.kept(name, "a video", |keeper| keeper.decode(file))
    }

    fn kept(
        &mut self,
        name: &str,
        of: &str,
        look: impl FnOnce(&mut Self) -> anyhow::Result<Vec<Observation>>,
    ) -> anyhow::Result<Vec<Observation>> {
        let Some(folder) = self.folder else {
            return look(self);
        };
        let file = folder.join(format!("{name}.json"));
        let by = kept::networks(&networks()?, &self.models.names())?;
        if file.is_file() {
            let text =
                std::fs::read(&file).with_context(|| format!("cannot read {}", file.display()))?;
            let kept: KeptFile = serde_json::from_slice(&text)
                .with_context(|| format!("{} holds no observations", file.display()))?;
            if kept.of != of {
                bail!(
                    "{} was kept of {}, and this is {}: choose another folder",
                    file.display(),
                    kept.of,
                    of
                );
            }
            if kept.networks != by {
                bail!(
                    "{} was kept of what the networks {} saw, and these are {by}: choose another folder",
                    file.display(),
                    if kept.networks.is_empty() {
                        "of an unnamed set"
                    } else {
                        &kept.networks
                    },
                );
            }
            return Ok(kept.frames.iter().map(Observation::from).collect());
        }
        let seen = look(self)?;
        let kept = KeptFile {
            of: of.to_owned(),
            networks: by,
            frames: seen.iter().map(Kept::from).collect(),
        };
        std::fs::write(&file, serde_json::to_vec(&kept)?)
            .with_context(|| format!("cannot write {}", file.display()))?;
        Ok(seen)
    }

    fn draw(&mut self, take: &Take, avatar: &Arc<Avatar>) -> anyhow::Result<Vec<Observation>> {
        let runtime = self.device.runtime()?;
        let gpu = self.device.gpu()?;
        let renderer = StillRenderer {
            gpu: &gpu,
            runtime: &runtime,
            avatar,
        };
        let setting = RenderSettings {
            size: Size {
                width: renders::WIDTH,
                height: renders::HEIGHT,
            },
            views: Views::Mono,
            background: None,
            filter: Filter::Dilation,
        };
        let stills = (take.frames.iter()).map(|motion| Still {
            motion: motion.clone(),
            cameras: vec![take.camera],
        });
        let label = format!("{} from {}", take.motion, take.camera_name);
        let bar = progress::bar(&label, take.frames.len());
        let mut seen = Vec::new();
        let mut tracker = self.tracker()?;
        renderer.draw(&setting, stills, |k, views| {
            let picture = views.first().context("the renderer returned no picture")?;
            let picture = Picture {
                width: picture.width(),
                height: picture.height(),
                rgb: picture.as_raw().clone(),
                at: Instant::now(),
                seconds: k as f64 / RATE,
                number: k as u64,
            };
            seen.push(self.look(&mut tracker, picture)?);
            bar.inc(1);
            Ok(())
        })?;
        bar.finish_and_clear();
        Ok(seen)
    }

    fn decode(&mut self, file: &Path) -> anyhow::Result<Vec<Observation>> {
        let choice = SourceChoice::File(file.to_owned());
        let mut source = source::open(&choice)?;
        let mut seen = Vec::new();
        let mut tracker = self.tracker()?;
        loop {
            let mut picture = Picture::empty();
            if !source.next(&mut picture)? {
                return Ok(seen);
            }
            seen.push(self.look(&mut tracker, picture)?);
        }
    }

    fn look(&mut self, tracker: &mut Tracker, picture: Picture) -> anyhow::Result<Observation> {
        let seen = tracker.observe(&Arc::new(picture))?;
        self.times.add(&seen.times);
        Ok(seen.into_observation())
    }

    /// A tracker that has seen nothing: each motion begins with one.
    fn tracker(&self) -> anyhow::Result<Tracker> {
        let models = self.models.load(&networks()?, &self.device.runtime()?)?;
        Ok(Tracker::new(models)?)
    }
}
