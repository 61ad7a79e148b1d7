//! The loop: a headset's frames, each with all people in it, until the session is over.
//!
//! When the runtime goes away (its service is restarted, the headset unplugged) the people stay: the headset is opened again, as
//! often as it takes, and the calls go on meanwhile.

use super::figures::HeadsetFigures;
use super::gaze::GazeWatch;
use super::handle::open_again;
use super::observer::{FrameCapture, FrameObserver};
use super::options::PresentOptions;
use super::pace::Pace;
use super::panel::RoomPanel;
use super::surroundings::{Places, name};
use super::wearer::WearerSlot;
use crate::display::{LiveSession, SessionError};
use crate::overlay::OverlayWatch;
use crate::presence::Viewer;
use android_power::System;
use android_power::hints::PictureHints;
use android_power::threads;
use app_pipeline::error::ReceiverError;
use app_pipeline::lanes::Drawn;
use app_pipeline::profile::Percentiles;
use renderer_openxr::eyes::Surround;
use renderer_openxr::frame::{Eyes, Frame};
use renderer_openxr::headset::{Headset, HeadsetOptions};
use renderer_openxr::input::Controls;
use renderer_openxr::runtime::Runtime;
use renderer_openxr::session::{Session, SessionEnd, SessionOptions};
use renderer_splat::options::RendererOptions;
use renderer_splat::renderer::SplatRenderer;
use renderer_splat::times::PictureTime;
use std::sync::Arc;
use std::time::{Duration, Instant};

/// Between two looks for the runtime's events while the session does not run.
pub(super) const IDLE: Duration = Duration::from_millis(10);
/// How long a runtime may take to end the session when it is asked to.
const FAREWELL: Duration = Duration::from_secs(3);
/// The beginnings of the names of threads that pictures wait for: this loop's, and the lanes'.
const THREADS: [&str; 3] = ["headset frames", "cpu lane", "npu lane"];
/// As many samples as percentiles are made of: ten minutes at 90 Hz.
const MOST_SAMPLES: usize = 54_000;

/// The loop's state, which outlives sessions of OpenXR.
pub(super) struct Frames<'a> {
    people: LiveSession<'a>,
    observer: &'a mut dyn FrameObserver,
    session_options: SessionOptions,
    wearer: Option<WearerSlot>,
    gaze: GazeWatch,
    places: Places,
    panel: RoomPanel,
    figures: HeadsetFigures,
    pace: Pace,
    hints: PictureHints,
    /// How many people were there at the last frame.
    attending: usize,
    /// Milliseconds.
    intervals: Vec<f64>,
    periods: Vec<f64>,
    predicted: Option<Instant>,
}

impl<'a> Frames<'a> {
    pub(super) fn new(
        people: LiveSession<'a>,
        session_options: SessionOptions,
        options: &PresentOptions,
        observer: &'a mut dyn FrameObserver,
    ) -> Result<Self, SessionError> {
        let first = people.people.first().ok_or(SessionError::NoParticipants)?;
        let overlay = OverlayWatch::new(first.placement.clone(), first.watch.clone());
        Ok(Self {
            people,
            observer,
            session_options,
            wearer: options.wearer.clone(),
            gaze: GazeWatch::new(options.gaze.clone()),
            places: Places::default(),
            panel: RoomPanel::new(overlay, options.privacy.clone()),
            figures: HeadsetFigures::default(),
            pace: Pace::new(None),
            hints: PictureHints::new(System::here()),
            attending: 0,
            intervals: Vec::new(),
            periods: Vec::new(),
            predicted: None,
        })
    }

    /// Shows frames until the session is over.
    pub(super) fn run(
        &mut self,
        headset: Headset,
        runtime: &Runtime,
        options: HeadsetOptions,
    ) -> Result<(), SessionError> {
        let mut headset = Some(headset);
        loop {
            if !self.people.control.begin_work() {
                return Ok(());
            }
            let present = match headset.take() {
                Some(headset) => headset,
                None => match open_again(runtime, options, self.people.control, &|| self.is_over())
                {
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
                Err(SessionError::Headset(error)) if error.is_loss() => {
                    log::warn!("{error}; the call goes on and waits for it");
                }
                Err(error) => return Err(error),
            }
        }
    }

    fn is_over(&self) -> bool {
        self.people.control.is_leaving()
            || self.people.lanes.is_over()
            || self.observer.is_over(self.figures.frames.shown)
    }

    /// One session, from its making to its end.
    fn stay(&mut self, headset: &Headset) -> Result<SessionEnd, SessionError> {
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
        self.figures.lenses_show = session.lenses_show().or(self.figures.lenses_show);
        let passed = session.lifecycle().passed();
        (self.figures.states).extend(passed.iter().map(ToString::to_string));
        self.figures.frames.late += self.pace.late();
        outcome
    }

    /// Has the renderer draw on the headset's device, pictures of its eyes' size.
    fn draw_on(&mut self, headset: &Headset) -> Result<(), SessionError> {
        let gpu = headset.gpu();
        if !Arc::ptr_eq(self.people.lanes.renderer().gpu(), gpu) {
            self.people.lanes.move_to(Arc::clone(gpu))?;
        }
        let [width, height] = headset.info().eye_size;
        let present = self.people.lanes.renderer().options();
        if (present.width, present.height, present.views) != (width, height, 2) {
            let options = RendererOptions {
                width,
                height,
                views: 2,
                ..present.clone()
            };
            let renderer =
                SplatRenderer::new(Arc::clone(gpu), &options).map_err(ReceiverError::from)?;
            self.people.lanes.replace_renderer(renderer)?;
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
        figures.foveation_follows_gaze = session.tracks().foveation_follows_gaze;
        figures.granted = names(headset.extensions().granted());
        figures.missing = names(headset.extensions().missing());
        figures.display_hz = session.refresh_hz();
        let options = self.people.lanes.renderer().options();
        figures.depth = session.takes_depth() && options.depth;
        figures.surround = name(surround(session, options)).to_owned();
    }

    fn until_over(&mut self, session: &mut Session) -> Result<SessionEnd, SessionError> {
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
    fn rests(&self, session: &Session) -> Result<bool, SessionError> {
        if self.people.control.may_work() {
            return Ok(false);
        }
        session.wait_idle()?;
        self.people.control.end_work();
        Ok(true)
    }

    /// One frame. Says so if the device was lost in it.
    fn frame(
        &mut self,
        session: &mut Session,
        leaving: bool,
    ) -> Result<Option<SessionEnd>, SessionError> {
        self.people.observe();
        for newcomer in self.people.admit()? {
            self.places.forget(&self.people, newcomer);
        }
        let attending = self.people.lanes.attending().filter(|there| *there).count();
        if std::mem::replace(&mut self.attending, attending) != attending {
            self.hints.threads_changed();
        }
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
        if let Some(slot) = &self.wearer {
            slot.put(session.wearer(&frame)?);
        }
        // Of the frame before: who is seen now is not known yet.
        self.gaze.look(session, &frame, self.places.of_first());
        self.note(&frame);
        let tick = self.pace.tick(&frame, begun);
        let has_people = match self.people.lanes.begin(tick) {
            Ok(pose) => pose.is_some(),
            Err(error) => {
                session.skip(frame)?;
                return Err(error.into());
            }
        };
        let shown = self.figures.frames.shown;
        let reads = self.observer.wants_pictures(shown, has_people);
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
        self.people.lanes.displayed_before(seen, next);
        session.frame_completed(&frame, in_time, done.saturating_duration_since(begun));
        let drawn = self.people.lanes.renderer().picture_time();
        let worked = worked(begun, done, drawn);
        let period = self.pace.period(&frame);
        (self.hints).picture(period, worked, || threads::named(&THREADS));
        if let Some(pictures) = pictures {
            self.observer.captured(FrameCapture {
                number: shown,
                eyes: &eyes,
                pictures,
            });
        }
        self.figures.frames.shown += 1;
        self.figures.frames.empty += u64::from(!has_people);
        Ok(None)
    }

    /// Puts all people in their places and draws them into the headset's next images, which may be read back.
    fn draw(
        &mut self,
        session: &mut Session,
        eyes: &Eyes,
        controls: &Controls,
        reads: bool,
    ) -> Result<Drawn, SessionError> {
        let viewer = Viewer {
            floor_from_head: Some(eyes.floor_from_head),
            hands: controls.hands,
        };
        self.places.update(&mut self.people, &viewer)?;
        (self.gaze).tell(eyes.floor_from_head, self.places.of_first());
        self.panel.press(controls);
        if controls.overlay_toggled {
            self.panel.toggle(session, eyes.floor_from_head)?;
        }
        let period = Duration::from_secs_f32(1.0 / session.refresh_hz().unwrap_or(60.0).max(1.0));
        let head = eyes.floor_from_head;
        (self.panel).update(session, self.people.lanes, head, period)?;
        let behind = surround(session, self.people.lanes.renderer().options());
        let mut canvas = session.canvas(eyes, behind, reads)?;
        Ok(self.people.lanes.draw_onto(&eyes.cameras, &mut canvas)?)
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

    pub(super) fn into_figures(mut self) -> HeadsetFigures {
        self.figures.frames.interval = Percentiles::of(&self.intervals);
        self.figures.frames.period = Percentiles::of(&self.periods);
        self.figures
    }
}

/// How long the processor had to do with a frame: from its beginning to its end, but for the time in which the device drew it, which no
/// faster processor would shorten. What it waits for the compositor's next image is not known apart, and counts.
fn worked(begun: Instant, done: Instant, drawn: Option<PictureTime>) -> Duration {
    let drawn = drawn.filter(|drawn| drawn.submitted >= begun);
    let waited = drawn.map(|drawn| drawn.finished.saturating_duration_since(drawn.submitted));
    let all = done.saturating_duration_since(begun);
    all.saturating_sub(waited.unwrap_or_default())
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_time_in_which_the_device_draws_a_frame_is_no_work_of_the_processors() {
        let begun = Instant::now();
        let at = |ms| begun + Duration::from_millis(ms);
        let drawn = |submitted, finished| {
            Some(PictureTime {
                submitted,
                finished,
                stages: None,
            })
        };
        let ms = Duration::from_millis;
        assert_eq!(
            worked(begun, at(9), drawn(at(2), at(7))),
            ms(4),
            "beside it"
        );
        assert_eq!(worked(begun, at(9), None), ms(9), "nothing was drawn");
        let begun = at(5);
        assert_eq!(worked(begun, at(9), drawn(at(2), at(4))), ms(4), "another");
    }
}
