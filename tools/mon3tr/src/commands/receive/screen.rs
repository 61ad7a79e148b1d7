//! The display that was chosen, and a session on it.

use super::album::Album;
use super::offscreen::Pictures;
use super::people::Person;
use super::samples::Samples;
use super::{Display, ShowOptions, undrawn};
use crate::controls::Others;
use crate::device_options::{DeviceOptions, compiled, inference_backends, make_folder};
use crate::flat;
use crate::gaze::{Gaze, GazeFigures, GazeToFigures, Sight};
use crate::scenery::Scenery;
use crate::size::{DEFAULT_SIZE, Size};
use crate::until::Until;
use crate::window::{self, WindowDisplay};
use anyhow::{Context, bail};
use app_pipeline::control::Control;
use app_pipeline::quality::QualityMode;
use app_session::call::CallEnd;
use app_session::display::{self, OffscreenDisplay};
use app_session::headset::{
    GazeListener, HeadsetDisplay, HeadsetFigures, HeadsetHandle, PresentOptions, PrivacySwitch,
    WearerSlot,
};
use app_session::participant::{CallReport, NetworkContext, Participant};
use app_session::presence::DISTANCE;
use app_session::session::{Session, SessionReport};
use call_member::{GazeFeed, PrivacyButtons};
use glam::{Quat, Vec3};
use link_protocol::Announcement;
use npu_runtime::Runtime;
use renderer_openxr::headset::HeadsetOptions;
use renderer_vulkan::gpu::Gpu;
use std::iter;
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;
use std::time::{Duration, Instant};
use winit::event_loop::EventLoop;

/// What `--display none` does.
pub(super) const NO_PICTURES: &str = "draws no pictures";

/// Pictures a second of a flat display, as most are.
const HERTZ: f64 = 60.0;

/// Where the first person will stand in a headset, and a scene is put around: before the viewer.
const BEFORE: Vec3 = Vec3::new(0.0, 0.0, -DISTANCE);

/// What shows people here.
pub(crate) enum Screen {
    Headset {
        /// Until it is shown.
        headset: Option<Box<HeadsetHandle>>,
        runtime: Runtime,
        /// Where the wearer's head and hands go, if they are captured.
        wearer: Option<WearerSlot>,
        /// Where it is sent where the wearer looks.
        gaze: Option<Arc<GazeFeed>>,
    },
    Window {
        /// Until it is shown.
        events: Option<Box<EventLoop<()>>>,
        gaze: Option<Gaze>,
        flat: Flat,
    },
    Offscreen {
        gaze: Option<Gaze>,
        flat: Flat,
    },
    Undrawn,
}

/// What flat displays draw with.
pub(crate) struct Flat {
    gpu: Arc<Gpu>,
    runtime: Runtime,
}

impl Flat {
    fn open(device: &DeviceOptions) -> anyhow::Result<Self> {
        Ok(Self {
            gpu: device.gpu()?,
            runtime: device.runtime()?,
        })
    }
}

/// What a session on a display left.
pub(crate) enum Shown {
    Drawn(Box<Drawn>),
    /// The calls, in the order in which they were joined.
    Undrawn(Vec<CallReport>),
}

/// What a session that was drawn left.
pub(crate) struct Drawn {
    pub(super) session: SessionReport,
    pub(super) views: u32,
    pub(super) size: Size,
    pub(super) display_period: Duration,
    /// When the first picture with people in it was begun; nothing where there was none.
    pub(super) first: Option<Instant>,
    pub(super) gaze: Option<GazeFigures>,
    pub(super) gaze_to: Option<GazeToFigures>,
    pub(super) headset: Option<HeadsetFigures>,
    pub(super) pictures: Vec<PathBuf>,
}

impl Screen {
    /// Opens what was asked for; with `auto` the first of a headset, a window and pictures on disk that there is.
    pub(crate) fn open(options: &ShowOptions, device: &DeviceOptions) -> anyhow::Result<Self> {
        match options.display {
            Display::Auto => match open_headset(options) {
                Ok(headset) => Self::headset(options, device, headset),
                Err(why) => {
                    if options.gaze_to.is_some() {
                        return Err(why.context("--gaze-to is a headset's, and there is none"));
                    }
                    if options.gaze.is_none() {
                        log::warn!("no headset: {why:#}");
                    }
                    let flat = Flat::open(device)?;
                    match open_events() {
                        Ok(events) => Self::window(options, flat, events),
                        Err(why) => {
                            log::warn!("no window: {why:#}");
                            Self::offscreen(options, flat)
                        }
                    }
                }
            },
            Display::Xr => Self::headset(options, device, open_headset(options)?),
            Display::Window => Self::window(options, Flat::open(device)?, open_events()?),
            Display::Offscreen => Self::offscreen(options, Flat::open(device)?),
            Display::None => {
                if options.seat {
                    bail!(
                        "--display none {NO_PICTURES}, and --seat is for pictures: leave one of them out"
                    );
                }
                open_gaze(options, Sight::Nothing)?;
                Ok(Self::Undrawn)
            }
        }
    }

    fn headset(
        options: &ShowOptions,
        device: &DeviceOptions,
        headset: HeadsetHandle,
    ) -> anyhow::Result<Self> {
        if let Some(folder) = &options.out {
            make_folder(folder)?;
        }
        let feed = options.gaze_to.map(GazeFeed::new).transpose()?;
        if let Some(screen) = options.gaze_to {
            println!(
                "where you are and look is sent to {screen}, unencrypted, while there is a person"
            );
        }
        Ok(Self::Headset {
            headset: Some(Box::new(headset)),
            runtime: device.runtime()?,
            wearer: None,
            gaze: feed.map(Arc::new),
        })
    }

    fn window(options: &ShowOptions, flat: Flat, events: EventLoop<()>) -> anyhow::Result<Self> {
        Ok(Self::Window {
            events: Some(Box::new(events)),
            gaze: open_gaze(options, Sight::Window)?,
            flat,
        })
    }

    fn offscreen(options: &ShowOptions, flat: Flat) -> anyhow::Result<Self> {
        make_folder(&options.folder())?;
        Ok(Self::Offscreen {
            gaze: open_gaze(options, Sight::Offscreen)?,
            flat,
        })
    }

    /// Has the wearer's head and hands put somewhere, and says where; nothing where this is no headset.
    pub(crate) fn watch_wearer(&mut self) -> Option<WearerSlot> {
        let Self::Headset { wearer, .. } = self else {
            return None;
        };
        Some(wearer.get_or_insert_default().clone())
    }

    /// Whether another session can be shown after this one.
    pub(super) fn can_go_on(&self) -> bool {
        matches!(self, Self::Offscreen { .. } | Self::Undrawn)
    }

    /// Shows `people` until it is over.
    pub(super) fn show(
        &mut self,
        options: &ShowOptions,
        people: &[Person],
        network: &NetworkContext,
        samples: Option<&mut Samples>,
        until: &Until,
    ) -> anyhow::Result<Shown> {
        if let Self::Undrawn = self {
            let person = people.first().context("there is no link")?;
            let person = person.participant(false, network);
            return Ok(Shown::Undrawn(undrawn::run(iter::once(person), until)));
        }
        let participants = (people.iter())
            .map(|person| person.participant(options.seat, network))
            .collect();
        let shown = self.draw(options, participants, None, samples, until)?;
        Ok(Shown::Drawn(Box::new(shown)))
    }

    /// Shows the people of a call as they come, and oneself, who is `own`, on demand, until it is over.
    ///
    /// # Errors
    /// If nothing can be shown.
    pub(crate) fn show_call(
        mut self,
        options: &ShowOptions,
        own: Participant,
        others: Others,
        stop: &Arc<AtomicBool>,
    ) -> anyhow::Result<Shown> {
        let until = Until::new(stop, None, None);
        if let Self::Undrawn = self {
            let newcomers = others.newcomers;
            let next = iter::from_fn(|| undrawn::next(&newcomers, &until));
            return Ok(Shown::Undrawn(undrawn::run(next, &until)));
        }
        let mut drawn = self.draw(options, vec![own], Some(others), None, &until)?;
        // Only oneself is in no call.
        drawn.session.people.retain(|person| person.watch.is_some());
        Ok(Shown::Drawn(Box::new(drawn)))
    }

    fn draw(
        &mut self,
        options: &ShowOptions,
        participants: Vec<Participant>,
        others: Option<Others>,
        samples: Option<&mut Samples>,
        until: &Until,
    ) -> anyhow::Result<Drawn> {
        let compiled = compiled()?;
        let (newcomers, controls) = match others {
            Some(Others {
                newcomers,
                controls,
            }) => (Some(newcomers), Some(controls)),
            None => (None, None),
        };
        let session = |runtime: &Runtime, quality, display: &mut dyn display::Display| {
            let backends = inference_backends(runtime, &compiled);
            let config = options.lanes.session(backends, quality);
            let mut session = Session::new(config, participants, Control::default());
            if let Some(newcomers) = newcomers {
                session = session.with_newcomers(newcomers);
            }
            if let Some(samples) = samples {
                session = session.observed(samples);
            }
            session.run(display)
        };
        let size = options.size.unwrap_or(DEFAULT_SIZE);
        let views = options.views();
        let background = || flat::background(&options.scenery);
        Ok(match self {
            Self::Undrawn => bail!("--display none {NO_PICTURES}"),
            Self::Offscreen { gaze, flat } => {
                let folder = options.folder();
                let mut pictures = Pictures::new(options, size, &folder, gaze.clone(), until);
                let needs = flat::needs(&flat.gpu, size, views, &options.viewpoint(), HERTZ);
                let mut display = OffscreenDisplay::new(needs, background(), &mut pictures);
                // Pictures on disk are as good as they can be.
                let session = session(&flat.runtime, QualityMode::Fixed(0), &mut display)?;
                let first = display.first_picture();
                Drawn {
                    session,
                    views: views.count(),
                    size,
                    display_period: Duration::from_secs_f64(HERTZ.recip()),
                    first,
                    gaze: pictures.gaze.take().map(Gaze::figures),
                    gaze_to: None,
                    headset: None,
                    pictures: pictures.write(&folder)?,
                }
            }
            Self::Window { events, gaze, flat } => {
                let mut display = WindowDisplay {
                    events: events.take().map(|events| *events),
                    needs: flat::needs(&flat.gpu, size, views, &options.viewpoint(), HERTZ),
                    background: background(),
                    views,
                    viewpoint: options.viewpoint(),
                    gaze: gaze.take(),
                    until,
                    size,
                    first: None,
                    controls,
                };
                let session = session(&flat.runtime, QualityMode::Adapt, &mut display)?;
                Drawn {
                    session,
                    views: views.count(),
                    size: display.size,
                    display_period: Duration::from_secs_f64(HERTZ.recip()),
                    first: display.first,
                    gaze: display.gaze.map(Gaze::figures),
                    gaze_to: None,
                    headset: None,
                    pictures: Vec::new(),
                }
            }
            Self::Headset {
                headset,
                runtime,
                wearer,
                gaze,
            } => {
                let headset = headset.take().context("the headset was shown a session")?;
                let scenery = options.scenery.around(None, BEFORE, Quat::IDENTITY)?;
                let present = PresentOptions {
                    scene: (scenery.as_ref())
                        .map(|scenery| (Arc::clone(&scenery.background), Scenery::filter(scenery))),
                    read_back: options.out.is_some(),
                    display_hz: None,
                    wearer: wearer.clone(),
                    gaze: (gaze.as_ref()).map(|feed| -> Arc<dyn GazeListener> { feed.clone() }),
                    privacy: controls.map(|controls| -> Arc<dyn PrivacySwitch> {
                        Arc::new(PrivacyButtons::new(controls.privacy))
                    }),
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
                    gaze_to: (gaze.as_ref()).map(|feed| GazeToFigures::of(feed)),
                    headset: Some(figures),
                    pictures: match &options.out {
                        Some(folder) => album.write(folder)?,
                        None => Vec::new(),
                    },
                }
            }
        })
    }
}

fn open_headset(options: &ShowOptions) -> anyhow::Result<HeadsetHandle> {
    if options.gaze.is_some() {
        bail!("--gaze moves a camera, and in a headset the head does: leave it out");
    }
    let headset = HeadsetOptions {
        eye_size: options.size.map(|size| [size.width, size.height]),
        validation: false,
    };
    let runtime = renderer_openxr::runtime::Runtime::load()?;
    Ok(HeadsetHandle::open(runtime, headset)?)
}

fn open_events() -> anyhow::Result<EventLoop<()>> {
    window::events("give --display offscreen for pictures on disk")
}

fn open_gaze(options: &ShowOptions, sight: Sight) -> anyhow::Result<Option<Gaze>> {
    let gaze = options.gaze.as_ref();
    gaze.map(|gaze| gaze.open(sight)).transpose()
}

impl Shown {
    /// When the first picture with people in it was begun, if there was one.
    pub(crate) fn first_picture(&self) -> Option<Instant> {
        match self {
            Self::Undrawn(_) => None,
            Self::Drawn(drawn) => drawn.first,
        }
    }

    /// What the sender announced who has come back with another avatar, if it is the only one.
    pub(super) fn came_back(&self) -> Option<Announcement> {
        let call = match self {
            Self::Undrawn(calls) => match &calls[..] {
                [call] => call,
                _ => return None,
            },
            Self::Drawn(drawn) => match &drawn.session.people[..] {
                [person] => person.call.as_ref()?,
                _ => return None,
            },
        };
        match call.end {
            Some(CallEnd::AnotherAvatar(announced)) => Some(announced),
            _ => None,
        }
    }
}
