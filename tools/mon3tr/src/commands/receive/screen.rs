//! The display that was chosen, and a session on it.

use super::album::Album;
use super::offscreen::Pictures;
use super::people::Person;
use super::{Display, Options, undrawn};
use crate::device_options::{DeviceOptions, compiled, inference_backends, make_folder};
use crate::flat;
use crate::gaze::{Gaze, GazeFigures, Sight};
use crate::scenery::Scenery;
use crate::size::{DEFAULT_SIZE, Size};
use crate::until::Until;
use crate::window::{self, WindowDisplay};
use anyhow::{Context, bail, ensure};
use app_pipeline::control::Control;
use app_pipeline::quality::QualityMode;
use app_session::call::CallEnd;
use app_session::display::{self, OffscreenDisplay};
use app_session::headset::{HeadsetDisplay, HeadsetFigures, HeadsetHandle, PresentOptions};
use app_session::participant::{CallReport, NetworkContext};
use app_session::session::{Session, SessionReport};
use glam::{Quat, Vec3};
use link_protocol::Announcement;
use npu_runtime::Runtime;
use renderer_openxr::headset::HeadsetOptions;
use renderer_vulkan::gpu::Gpu;
use std::path::PathBuf;
use std::sync::Arc;
use std::time::{Duration, Instant};
use winit::event_loop::EventLoop;

/// Pictures a second of a flat display, as most are.
const HERTZ: f64 = 60.0;

/// Where the first person will stand in a headset, and a scene is put around: before the viewer.
const BEFORE: Vec3 = Vec3::new(0.0, 0.0, -1.6);

/// What shows people here.
pub(super) enum Screen {
    Headset {
        /// Until it is shown.
        headset: Option<Box<HeadsetHandle>>,
        runtime: Runtime,
    },
    Window {
        /// Until it is shown.
        events: Option<Box<EventLoop<()>>>,
        gaze: Option<Gaze>,
        gpu: Arc<Gpu>,
        runtime: Runtime,
    },
    Offscreen {
        gaze: Option<Gaze>,
        gpu: Arc<Gpu>,
        runtime: Runtime,
    },
    Undrawn,
}

/// What a session on a display left.
pub(super) enum Shown {
    Drawn(Box<Drawn>),
    Undrawn(Box<CallReport>),
}

/// What a session that was drawn left.
pub(super) struct Drawn {
    pub(super) session: SessionReport,
    pub(super) views: u32,
    pub(super) size: Size,
    pub(super) display_period: Duration,
    /// When the first picture with people in it was begun; nothing where there was none.
    pub(super) first: Option<Instant>,
    pub(super) gaze: Option<GazeFigures>,
    pub(super) headset: Option<HeadsetFigures>,
    pub(super) pictures: Vec<PathBuf>,
}

impl Screen {
    /// Opens what was asked for; with `auto` the first of what there is.
    pub(super) fn open(options: &Options, device: &DeviceOptions) -> anyhow::Result<Self> {
        match options.display {
            Display::Auto => match Self::open_headset(options, device) {
                Ok(headset) => Ok(headset),
                Err(why) => {
                    log::warn!("no headset: {why:#}");
                    Self::open_window(options, device).or_else(|why| {
                        log::warn!("no window: {why:#}");
                        Self::open_offscreen(options, device)
                    })
                }
            },
            Display::Xr => Self::open_headset(options, device),
            Display::Window => Self::open_window(options, device),
            Display::Offscreen => Self::open_offscreen(options, device),
            Display::None => {
                ensure!(
                    options.rooms.len() == 1,
                    "--display none measures one call: give one link"
                );
                open_gaze(options, Sight::Nothing)?;
                Ok(Self::Undrawn)
            }
        }
    }

    fn open_headset(options: &Options, device: &DeviceOptions) -> anyhow::Result<Self> {
        if options.gaze.is_some() {
            bail!("--gaze moves a camera, and in a headset the head does: leave it out");
        }
        let headset = HeadsetOptions {
            eye_size: options.size.map(|size| [size.width, size.height]),
            validation: false,
        };
        let headset = HeadsetHandle::open(renderer_openxr::runtime::Runtime::load()?, headset)?;
        if let Some(folder) = &options.out {
            make_folder(folder)?;
        }
        Ok(Self::Headset {
            headset: Some(Box::new(headset)),
            runtime: device.runtime()?,
        })
    }

    fn open_window(options: &Options, device: &DeviceOptions) -> anyhow::Result<Self> {
        let (gpu, runtime) = (device.gpu()?, device.runtime()?);
        let events = window::events("give --display offscreen for pictures on disk")?;
        Ok(Self::Window {
            events: Some(Box::new(events)),
            gaze: open_gaze(options, Sight::Window)?,
            gpu,
            runtime,
        })
    }

    fn open_offscreen(options: &Options, device: &DeviceOptions) -> anyhow::Result<Self> {
        let (gpu, runtime) = (device.gpu()?, device.runtime()?);
        make_folder(&options.folder())?;
        Ok(Self::Offscreen {
            gaze: open_gaze(options, Sight::Offscreen)?,
            gpu,
            runtime,
        })
    }

    /// Whether another session can be shown after this one.
    pub(super) fn can_go_on(&self) -> bool {
        matches!(self, Self::Offscreen { .. } | Self::Undrawn)
    }

    /// Shows `people` until it is over.
    pub(super) fn show(
        &mut self,
        options: &Options,
        people: &[Person],
        network: &NetworkContext,
        until: &Until,
    ) -> anyhow::Result<Shown> {
        let compiled = compiled()?;
        let session = |runtime: &Runtime, quality, display: &mut dyn display::Display| {
            let backends = inference_backends(runtime, &compiled);
            let participants = (people.iter())
                .map(|person| person.participant(options.seat, network))
                .collect();
            let config = options.lanes.session(backends, quality);
            Session::new(config, participants, Control::default()).run(display)
        };
        let size = options.size.unwrap_or(DEFAULT_SIZE);
        let views = options.views();
        let background = || flat::background(&options.scenery);
        let drawn = match self {
            Self::Undrawn => {
                let person = people.first().context("there is no link")?;
                return Ok(Shown::Undrawn(Box::new(undrawn::run(
                    person, network, until,
                ))));
            }
            Self::Offscreen { gaze, gpu, runtime } => {
                let folder = options.folder();
                let mut pictures = Pictures::new(options, size, &folder, gaze.clone(), until);
                let needs = flat::needs(gpu, size, views, &options.camera, HERTZ);
                let mut display = OffscreenDisplay::new(needs, background(), &mut pictures);
                // Pictures on disk are as good as they can be.
                let session = session(runtime, QualityMode::Fixed(0), &mut display)?;
                let first = display.finish();
                Drawn {
                    session,
                    views: views.count(),
                    size,
                    display_period: Duration::from_secs_f64(HERTZ.recip()),
                    first,
                    gaze: pictures.gaze.take().map(Gaze::figures),
                    headset: None,
                    pictures: pictures.write(&folder)?,
                }
            }
            Self::Window {
                events,
                gaze,
                gpu,
                runtime,
            } => {
                let mut display = WindowDisplay {
                    events: events.take().map(|events| *events),
                    needs: flat::needs(gpu, size, views, &options.camera, HERTZ),
                    background: background(),
                    views,
                    viewpoint: options.camera,
                    gaze: gaze.take(),
                    until,
                    size,
                    first: None,
                };
                let session = session(runtime, QualityMode::Adapt, &mut display)?;
                Drawn {
                    session,
                    views: views.count(),
                    size: display.size,
                    display_period: Duration::from_secs_f64(HERTZ.recip()),
                    first: display.first,
                    gaze: display.gaze.map(Gaze::figures),
                    headset: None,
                    pictures: Vec::new(),
                }
            }
            Self::Headset { headset, runtime } => {
                let headset = headset.take().context("the headset was shown a session")?;
                let scenery = options.scenery.around(None, BEFORE, Quat::IDENTITY)?;
                let present = PresentOptions {
                    scene: (scenery.as_ref())
                        .map(|scenery| (Arc::clone(&scenery.background), Scenery::filter(scenery))),
                    read_back: options.out.is_some(),
                    display_hz: None,
                };
                // Pictures on disk are as good as they can be; the eyes' are to come in time.
                let quality = if options.out.is_some() {
                    QualityMode::Fixed(0)
                } else {
                    QualityMode::Adapt
                };
                let mut album = Album::new(until, options.out.is_some());
                let mut display = HeadsetDisplay::new(*headset, present, &mut album);
                let session = session(runtime, quality, &mut display)?;
                let figures = display.into_figures();
                let [width, height] = figures.eye_size;
                Drawn {
                    first: Some(session.began),
                    session,
                    views: 2,
                    size: Size { width, height },
                    display_period: figures.display_period(),
                    gaze: None,
                    headset: Some(figures),
                    pictures: match &options.out {
                        Some(folder) => album.write(folder)?,
                        None => Vec::new(),
                    },
                }
            }
        };
        Ok(Shown::Drawn(Box::new(drawn)))
    }
}

fn open_gaze(options: &Options, sight: Sight) -> anyhow::Result<Option<Gaze>> {
    let gaze = options.gaze.as_ref();
    gaze.map(|gaze| gaze.open(sight)).transpose()
}

impl Shown {
    /// What the sender announced who has come back with another avatar, if it is the only one.
    pub(super) fn came_back(&self) -> Option<Announcement> {
        let call = match self {
            Self::Undrawn(call) => call,
            Self::Drawn(drawn) => match &drawn.session.people[..] {
                [person] => person.call.as_ref().ok()?.as_ref()?,
                _ => return None,
            },
        };
        match call.end {
            Some(CallEnd::AnotherAvatar(announced)) => Some(announced),
            _ => None,
        }
    }
}
