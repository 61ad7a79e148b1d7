//! The loop: a headset's frames, each with everybody in it, until the call or the session is over.
//!
//! When the runtime goes away (its service is restarted, the headset unplugged) the people stay: the headset is opened again, as
//! often as it takes, and the call goes on meanwhile.

use super::figures::HeadsetFigures;
use super::pace::Pace;
use super::panel::FiguresPanel;
use super::surroundings::{Places, name};
use crate::overlay::OverlayWatch;
use crate::presence::Viewer;
use app_pipeline::control::Control;
use app_pipeline::error::ReceiverError;
use app_pipeline::lanes::{Drawn, Lanes, MotionSource};
use app_pipeline::profile::Percentiles;
use renderer_openxr::error::XrError;
use renderer_openxr::eyes::{EyePicture, Surround};
use renderer_openxr::frame::{Eyes, Frame};
use renderer_openxr::headset::{Headset, HeadsetOptions};
use renderer_openxr::input::Controls;
use renderer_openxr::runtime::Runtime;
use renderer_openxr::session::{Session, SessionEnd, SessionOptions};
use renderer_splat::options::RendererOptions;
use renderer_splat::renderer::SplatRenderer;
use spmm3::Skeleton;
use std::sync::Arc;
use std::time::{Duration, Instant};

/// Between two looks for the runtime's events while the session does not run.
pub(super) const IDLE: Duration = Duration::from_millis(10);
/// Between two attempts to open the headset again.
const AGAIN: Duration = Duration::from_millis(500);
/// How long a runtime may take to end the session when it is asked to.
const FAREWELL: Duration = Duration::from_secs(3);
/// As many samples as percentiles are made of: ten minutes at 90 Hz.
const MOST_SAMPLES: usize = 54_000;

/// What ended the showing.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum HeadsetError {
    /// The headset cannot be shown anything.
    #[error(transparent)]
    Headset(#[from] XrError),
    /// Nothing can be drawn any longer.
    #[error(transparent)]
    Receiver(ReceiverError),
    /// No avatars were given.
    #[error("there is nobody to show")]
    Nobody,
    /// It was over before it began.
    #[error("left before anything was shown")]
    Left,
    /// There is no thread for the frames.
    #[error("cannot start the thread of the headset's frames")]
    Thread(#[source] std::io::Error),
    /// The thread of the frames panicked, which it says itself.
    #[error("the thread of the headset's frames panicked")]
    Panicked,
}

impl From<ReceiverError> for HeadsetError {
    fn from(error: ReceiverError) -> Self {
        match error {
            ReceiverError::Left => Self::Left,
            error => Self::Receiver(error),
        }
    }
}

/// What is shown, and how.
#[derive(Debug)]
pub struct PresentConfig {
    /// To open the headset again.
    pub runtime: Runtime,
    /// As the headset was opened.
    pub options: HeadsetOptions,
    /// What sessions are made for.
    pub session: SessionOptions,
    /// Of the people, in the order in which they joined.
    pub skeletons: Vec<Skeleton>,
    /// What the panel of figures tells.
    pub overlay: OverlayWatch,
    /// Pauses it, and ends it.
    pub control: Control,
}

/// Who looks on, beside the one who wears the headset.
pub trait FrameObserver: Send {
    /// Whether it is time to leave. `shown` frames were shown so far.
    fn is_over(&self, shown: u64) -> bool;

    /// Whether both eyes' pictures of the frame after `shown` others are wanted; `somebody` is in it.
    fn wants(&mut self, shown: u64, somebody: bool) -> bool;

    /// A frame that was wanted.
    fn seen(&mut self, seen: Seen<'_>);
}

/// What the eyes got.
#[derive(Debug)]
pub struct Seen<'a> {
    /// So many frames were shown before.
    pub number: u64,
    /// Where the eyes were.
    pub eyes: &'a Eyes,
    /// Left and right.
    pub pictures: [EyePicture; 2],
}

/// Shows everybody in the headset until the call is over, the viewer leaves, or the watcher says so. Waits for that.
///
/// # Errors
/// What keeps it from going on. That the runtime or the device goes away does not.
pub fn show<S: MotionSource>(
    lanes: &mut Lanes<S>,
    headset: Headset,
    showing: PresentConfig,
    watcher: &mut dyn FrameObserver,
) -> Result<HeadsetFigures, HeadsetError> {
    let PresentConfig {
        runtime,
        options,
        session,
        skeletons,
        overlay,
        control,
    } = showing;
    let mut frames = Frames {
        lanes,
        skeletons,
        watcher,
        session_options: session,
        places: Places::default(),
        panel: FiguresPanel::new(overlay),
        figures: HeadsetFigures::default(),
        pace: Pace::new(None),
        intervals: Vec::new(),
        periods: Vec::new(),
        predicted: None,
        control,
    };
    std::thread::scope(|scope| {
        let thread = std::thread::Builder::new()
            .name("headset frames".to_owned())
            .spawn_scoped(scope, move || -> Result<HeadsetFigures, HeadsetError> {
                let shown = frames.run(headset, &runtime, options);
                frames.control.end_work();
                shown.map(|()| frames.into_figures())
            })
            .map_err(HeadsetError::Thread)?;
        thread.join().map_err(|_| HeadsetError::Panicked)?
    })
}

/// Opens the headset again, as often as it takes; nothing if it is time to leave before.
pub(super) fn open_again(
    runtime: &Runtime,
    options: HeadsetOptions,
    control: &Control,
    is_over: &dyn Fn() -> bool,
) -> Option<Headset> {
    let mut told = None;
    while !is_over() && control.begin_work() {
        match Headset::open(runtime, options) {
            Ok(headset) => return Some(headset),
            Err(error) => {
                let text = error.to_string();
                if told.as_ref() != Some(&text) {
                    log::info!("not yet: {text}");
                    told = Some(text);
                }
            }
        }
        control.end_work();
        control.sleep(AGAIN);
    }
    None
}

/// The loop's state, which outlives sessions.
struct Frames<'a, S: MotionSource> {
    lanes: &'a mut Lanes<S>,
    skeletons: Vec<Skeleton>,
    watcher: &'a mut dyn FrameObserver,
    session_options: SessionOptions,
    places: Places,
    panel: FiguresPanel,
    figures: HeadsetFigures,
    pace: Pace,
    /// Milliseconds.
    intervals: Vec<f64>,
    periods: Vec<f64>,
    predicted: Option<Instant>,
    control: Control,
}

impl<S: MotionSource> Frames<'_, S> {
    fn run(
        &mut self,
        headset: Headset,
        runtime: &Runtime,
        options: HeadsetOptions,
    ) -> Result<(), HeadsetError> {
        let mut headset = Some(headset);
        loop {
            if !self.control.begin_work() {
                return Ok(());
            }
            let present = match headset.take() {
                Some(headset) => headset,
                None => match open_again(runtime, options, &self.control, &|| self.is_over()) {
                    Some(headset) => headset,
                    None => return Ok(()),
                },
            };
            self.figures.opened += 1;
            match self.stay(&present) {
                Ok(SessionEnd::Exited) => return Ok(()),
                Ok(SessionEnd::Lost) => {
                    log::warn!("the headset is gone; the call goes on and waits for it");
                }
                Err(HeadsetError::Headset(error)) if error.is_loss() => {
                    log::warn!("{error}; the call goes on and waits for it");
                }
                Err(error) => return Err(error),
            }
        }
    }

    fn is_over(&self) -> bool {
        self.control.is_leaving()
            || self.lanes.is_over()
            || self.watcher.is_over(self.figures.frames.shown)
    }

    /// One session, from its making to its end.
    fn stay(&mut self, headset: &Headset) -> Result<SessionEnd, HeadsetError> {
        self.draw_on(headset)?;
        let mut session = Session::new(headset, self.session_options)?;
        self.pace = Pace::new(session.refresh_hz());
        self.panel.renewed();
        self.predicted = None;
        self.describe(headset, &session);
        let outcome = self.until_over(&mut session);
        self.figures.floor = session.floor().to_string();
        if let Some(way) = session.render_path() {
            self.figures.way = Some(way.to_string());
        }
        let passed = session.lifecycle().passed();
        (self.figures.states).extend(passed.iter().map(ToString::to_string));
        self.figures.frames.late += self.pace.late();
        outcome
    }

    /// Has the renderer draw on the headset's device, pictures of its eyes' size.
    fn draw_on(&mut self, headset: &Headset) -> Result<(), HeadsetError> {
        let gpu = headset.gpu();
        if !Arc::ptr_eq(self.lanes.renderer().gpu(), gpu) {
            self.lanes.move_to(Arc::clone(gpu))?;
        }
        let [width, height] = headset.info().eye_size;
        let present = self.lanes.renderer().options();
        if (present.width, present.height, present.views) != (width, height, 2) {
            let options = RendererOptions {
                width,
                height,
                views: 2,
                ..present.clone()
            };
            let renderer =
                SplatRenderer::new(Arc::clone(gpu), &options).map_err(ReceiverError::from)?;
            self.lanes.replace_renderer(renderer)?;
        }
        Ok(())
    }

    fn describe(&mut self, headset: &Headset, session: &Session) {
        let names = |names: &[&'static str]| names.iter().map(|name| (*name).to_owned()).collect();
        let figures = &mut self.figures;
        figures.runtime.clone_from(&headset.info().runtime);
        figures.headset.clone_from(&headset.info().name);
        figures.device.clone_from(&headset.gpu().info().name);
        figures.eye_size = headset.info().eye_size;
        figures.hands = session.tracks().hands;
        figures.gaze = session.tracks().foveation_follows_gaze;
        figures.granted = names(headset.extensions().granted());
        figures.missing = names(headset.extensions().missing());
        figures.display_hz = session.refresh_hz();
        let options = self.lanes.renderer().options();
        figures.depth = session.takes_depth() && options.depth;
        figures.surround = name(surround(session, options)).to_owned();
    }

    fn until_over(&mut self, session: &mut Session) -> Result<SessionEnd, HeadsetError> {
        let mut leaving = None;
        loop {
            let happened = session.poll()?;
            if happened.recentred {
                self.places.recentre();
            }
            if let Some(over) = happened.end {
                return Ok(if leaving.is_some() {
                    SessionEnd::Exited
                } else {
                    over
                });
            }
            match leaving {
                None if self.is_over() => {
                    if !session.lifecycle().is_running() {
                        return Ok(SessionEnd::Exited);
                    }
                    session.request_exit()?;
                    leaving = Some(Instant::now());
                }
                Some(since) if since.elapsed() > FAREWELL => {
                    log::warn!("the OpenXR runtime does not end the session; leaving it");
                    return Ok(SessionEnd::Exited);
                }
                _ => {}
            }
            // The runtime's events go on in a pause: it ends the session, and begins it again.
            if self.rests(session)? || !session.lifecycle().is_running() {
                self.pace.pause();
                self.predicted = None;
                std::thread::sleep(IDLE);
                continue;
            }
            if let Some(lost) = self.frame(session, leaving.is_some())? {
                return Ok(lost);
            }
        }
    }

    /// Whether a pause was asked for; the GPU is at rest then.
    fn rests(&self, session: &Session) -> Result<bool, HeadsetError> {
        if self.control.may_work() {
            return Ok(false);
        }
        session.wait_idle()?;
        self.control.end_work();
        Ok(true)
    }

    /// One frame. Says so if the device was lost in it.
    fn frame(
        &mut self,
        session: &mut Session,
        leaving: bool,
    ) -> Result<Option<SessionEnd>, HeadsetError> {
        let frame = session.wait()?;
        let begun = Instant::now();
        let controls = session.controls(&frame)?;
        let eyes = if frame.should_render && !leaving {
            session.locate_views(&frame)?
        } else {
            None
        };
        let Some(eyes) = eyes else {
            self.figures.frames.unseen += 1;
            self.pace.pause();
            self.predicted = None;
            session.skip(frame)?;
            return Ok(None);
        };
        self.note(&frame);
        let tick = self.pace.tick(&frame, begun);
        let somebody = match self.lanes.begin(tick) {
            Ok(pose) => pose.is_some(),
            Err(error) => {
                session.skip(frame)?;
                return Err(error.into());
            }
        };
        let shown = self.figures.frames.shown;
        let reads = self.watcher.wants(shown, somebody);
        match self.draw(session, &eyes, &controls, reads) {
            Ok(Drawn::Picture) => {}
            Ok(Drawn::Renewed(_) | Drawn::Lost) => {
                session.skip(frame)?;
                return Ok(Some(SessionEnd::Lost));
            }
            Err(error) => {
                session.skip(frame)?;
                return Err(error);
            }
        }
        let pictures = session.show(frame)?;
        let done = Instant::now();
        let (seen, in_time) = self.pace.shown(&frame, done);
        let next = self.pace.next(&frame, begun, done);
        self.lanes.displayed_before(seen, next);
        session.frame_completed(&frame, in_time, done.saturating_duration_since(begun));
        if let Some(pictures) = pictures {
            self.watcher.seen(Seen {
                number: shown,
                eyes: &eyes,
                pictures,
            });
        }
        self.figures.frames.shown += 1;
        self.figures.frames.empty += u64::from(!somebody);
        Ok(None)
    }

    /// Puts everybody in their places and draws them into the headset's next images, which may be read back.
    fn draw(
        &mut self,
        session: &mut Session,
        eyes: &Eyes,
        controls: &Controls,
        reads: bool,
    ) -> Result<Drawn, HeadsetError> {
        let viewer = Viewer {
            floor_from_head: Some(eyes.floor_from_head),
            hands: controls.hands,
        };
        self.places.update(self.lanes, &self.skeletons, &viewer)?;
        if controls.overlay_toggled {
            self.panel.toggle(session, eyes.floor_from_head)?;
        }
        let period = Duration::from_secs_f32(1.0 / session.refresh_hz().unwrap_or(60.0).max(1.0));
        self.panel.update(session, self.lanes, period)?;
        let behind = surround(session, self.lanes.renderer().options());
        let mut canvas = session.canvas(eyes, behind, reads)?;
        Ok(self.lanes.draw_onto(&eyes.cameras, &mut canvas)?)
    }

    fn note(&mut self, frame: &Frame) {
        if let Some(last) = self.predicted.replace(frame.predicted)
            && self.intervals.len() < MOST_SAMPLES
        {
            let apart = frame.predicted.saturating_duration_since(last);
            self.intervals.push(apart.as_secs_f64() * 1e3);
            self.periods.push(frame.period.as_secs_f64() * 1e3);
        }
    }

    fn into_figures(mut self) -> HeadsetFigures {
        self.figures.frames.interval = Percentiles::of(&self.intervals);
        self.figures.frames.period = Percentiles::of(&self.periods);
        self.figures
    }
}

/// What is behind the people.
fn surround(session: &Session, renderer: &RendererOptions) -> Surround {
    if renderer.background.is_some() {
        Surround::Scene
    } else if session.shows_room() {
        Surround::Room
    } else {
        Surround::Studio
    }
}
