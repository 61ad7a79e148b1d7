//! A camera as a source of motion: its pictures, the networks that look at them, and the fit to the avatar.

mod figures;
mod options;

pub(crate) use figures::CameraFigures;
pub(crate) use options::{CameraOptions, CaptureOptions};

use crate::calibrate::Calibrating;
use crate::device_options::DeviceOptions;
use crate::notice::Notices;
use crate::preview::{HandOver, PaceMeter, Shot};
use figures::{PictureTimes, Record};
use glam::Vec2;
use motion_fit::landmarks::{Camera, Observation};
use motion_fit::{Fitted, MotionFit, Subject, Unsmoothed};
use sender::{Capture, Captured, SendError};
use spmm3::Avatar;
use std::sync::Arc;
use std::time::{Duration, Instant};
use tracker::Tracker;
use tracker::mediapipe::BodyBy;
use tracker::source::{self, Picture, Source, SourceChoice};

/// One picture and what it showed: of a call [`Fitted`], of a recording [`Unsmoothed`].
#[derive(Debug)]
pub(crate) struct Tracked<T> {
    /// When it fell into the camera.
    pub(crate) at: Instant,
    /// Its time in the source, seconds.
    pub(crate) seconds: f64,
    pub(crate) observation: Observation,
    pub(crate) pose: T,
}

/// Tracks the person before a camera.
pub(crate) struct CameraCapture {
    source: Box<dyn Source>,
    tracker: Tracker,
    fit: MotionFit,
    camera: Camera,
    view_degrees: f32,
    picture: Arc<Picture>,
    notices: Notices,
    record: Record,
    is_live: bool,
    /// Until it is done.
    calibrating: Option<Calibrating>,
    pace: PaceMeter,
    /// Where what was seen is shown, if it is.
    shots: Option<Arc<HandOver<Shot>>>,
    /// For how long it captures motion for a call, from its first one on.
    length: Option<Duration>,
    began: Option<Instant>,
}

/// A camera or recording that is open, with the networks to look at it, before it is known whom it drives.
pub(crate) struct OpenCamera {
    source: Box<dyn Source>,
    tracker: Tracker,
    camera: Camera,
    view_degrees: f32,
    calibrate: bool,
    /// Whether its pictures come in their own time.
    is_live: bool,
}

impl OpenCamera {
    /// Opens a camera for a call: of what it gives, the newest.
    pub(crate) fn live(
        choice: &SourceChoice,
        options: &CaptureOptions,
        device: &DeviceOptions,
    ) -> anyhow::Result<Self> {
        let source = source::open_live(choice, true)?;
        // The larger network is too slow for a call.
        Self::new(source, true, options, BodyBy::Full, device)
    }

    /// Opens a recording: every picture of it, its body looked at by the networks `body`.
    pub(crate) fn recorded(
        choice: &SourceChoice,
        options: &CaptureOptions,
        body: BodyBy,
        device: &DeviceOptions,
    ) -> anyhow::Result<Self> {
        Self::new(source::open(choice)?, false, options, body, device)
    }

    fn new(
        source: Box<dyn Source>,
        is_live: bool,
        options: &CaptureOptions,
        body: BodyBy,
        device: &DeviceOptions,
    ) -> anyhow::Result<Self> {
        let runtime = device.runtime()?;
        let models = options.load(body, &runtime)?;
        let info = source.info();
        Ok(Self {
            camera: options.camera(info.width, info.height),
            view_degrees: options.fov,
            calibrate: options.calibrate,
            is_live,
            source,
            tracker: Tracker::new(models)?,
        })
    }
}

impl CameraCapture {
    /// Has the camera drive `avatar`; for a call of `length`, if there is one.
    pub(crate) fn new(open: OpenCamera, avatar: &Avatar, length: Option<Duration>) -> Self {
        let OpenCamera {
            source,
            tracker,
            camera,
            view_degrees,
            calibrate,
            is_live,
        } = open;
        Self {
            source,
            tracker,
            fit: MotionFit::new(&Subject::from(avatar), camera),
            camera,
            view_degrees,
            picture: Arc::default(),
            notices: Notices::default(),
            record: Record::default(),
            is_live,
            calibrating: calibrate.then(|| Calibrating::new(&avatar.skeleton, camera)),
            pace: PaceMeter::default(),
            shots: None,
            length,
            began: None,
        }
    }

    /// The camera as the fit knows it.
    pub(crate) fn camera(&self) -> Camera {
        self.camera
    }

    /// Whether a calibration is wanted that is not done yet.
    pub(crate) fn is_calibrating(&self) -> bool {
        self.calibrating.is_some()
    }

    /// Has what is seen in each picture put there, too.
    pub(crate) fn show_in(&mut self, shots: Arc<HandOver<Shot>>) {
        self.shots = Some(shots);
    }

    pub(crate) fn source(&self) -> &dyn Source {
        &*self.source
    }

    /// Waits for the next picture and tracks it, smoothed by the pictures before it; nothing at the end.
    pub(crate) fn track(&mut self) -> anyhow::Result<Option<Tracked<Fitted>>> {
        let tracked = self.next_picture(MotionFit::smooth)?;
        if let (Some(tracked), Some(shots)) = (&tracked, &self.shots) {
            shots.put(Shot {
                picture: Arc::clone(&self.picture),
                observation: tracked.observation.clone(),
                fitted: tracked.pose.clone(),
                camera: self.camera,
                pace: self.pace.pace(),
                notice: self.notices.now(),
                calibrating: self.calibrating.as_ref().map(Calibrating::state),
            });
        }
        Ok(tracked)
    }

    /// As [`Self::track`] of a recording, which [`Self::smooth_recording`] smooths when all of it is there.
    pub(crate) fn look(&mut self) -> anyhow::Result<Option<Tracked<Unsmoothed>>> {
        self.next_picture(|_, look| look)
    }

    fn next_picture<T>(
        &mut self,
        finish: impl FnOnce(&mut MotionFit, Unsmoothed) -> T,
    ) -> anyhow::Result<Option<Tracked<T>>> {
        // The networks' threads have let go of the last picture as a rule; else it is theirs.
        if Arc::get_mut(&mut self.picture).is_none() {
            self.picture = Arc::default();
        }
        let buffer = Arc::make_mut(&mut self.picture);
        if !self.source.next(buffer)? {
            return Ok(None);
        }
        let size = Vec2::new(buffer.width as f32, buffer.height as f32);
        if size != self.camera.size {
            // Its lens is the same.
            self.camera = Camera::of_view(size, self.view_degrees);
            self.fit.set_camera(self.camera);
            if let Some(calibrating) = &mut self.calibrating {
                calibrating.set_camera(self.camera);
            }
            log::info!(
                "{}: pictures are {} x {} from now on",
                self.source.info().name,
                size.x,
                size.y
            );
        }
        let picture = &self.picture;
        self.record.count(picture.number);
        let seen = self.tracker.observe(&self.picture)?;
        let (times, people) = (seen.times, seen.people);
        let observation = seen.into_observation();
        let began = Instant::now();
        if let Some(calibrating) = &mut self.calibrating {
            let body = observation.body_landmarks();
            if calibrating.see(observation.seconds, body, &mut self.fit) {
                self.calibrating = None;
            }
        }
        let look = self.fit.look(&observation);
        let sees_person = look.sees_person();
        let pose = finish(&mut self.fit, look);
        let ended = Instant::now();
        let ms = |from: Instant| ended.saturating_duration_since(from).as_secs_f64() * 1e3;
        self.pace.count(ended, ms(picture.at));
        self.record.add(PictureTimes {
            networks: times,
            fit_ms: ms(began),
            latency_ms: ms(picture.at),
        });
        let notice = (self.notices).after(&self.picture, sees_person, people);
        if let Some(notice) = notice {
            log::warn!("{}: {notice}", self.source.info().name);
        }
        Ok(Some(Tracked {
            at: picture.at,
            seconds: picture.seconds,
            observation,
            pose,
        }))
    }

    /// The motion of a whole recording, of what [`Self::look`] gave of it.
    pub(crate) fn smooth_recording(&mut self, looks: Vec<Unsmoothed>) -> Vec<Fitted> {
        if let Some(calibrating) = self.calibrating.take() {
            calibrating.end();
        }
        let (began, pictures) = (Instant::now(), looks.len());
        let motion = self.fit.smooth_recording(looks);
        self.record.add_smoothing(began.elapsed(), pictures);
        motion
    }

    /// What the stages took.
    pub(crate) fn figures(&self) -> CameraFigures {
        self.record.figures(self.is_live)
    }
}

impl Capture for CameraCapture {
    fn next(&mut self) -> Result<Option<Captured>, SendError> {
        let began = *self.began.get_or_insert_with(|| {
            // What came while the call waited for a viewer is no loss, and was not timed in a call.
            self.record.begin_anew();
            Instant::now()
        });
        if self.length.is_some_and(|length| began.elapsed() >= length) {
            return Ok(None);
        }
        let tracked = (self.track()).map_err(|error| SendError::Capture(error.into()))?;
        Ok(tracked.map(|tracked| Captured {
            at: tracked.at,
            face: Some(tracked.pose.face),
            motion: tracked.pose.motion,
        }))
    }
}
