//! A recording tracked from its first picture to its last, and the motion of it.

use crate::camera::{CameraCapture, CameraFigures};
use crate::progress;
use anyhow::{Context, bail};
use motion_fit::Fitted;
use motion_fit::landmarks::{Camera, Observation};
use spmm3::{Avatar, MotionClip};
use std::sync::atomic::{AtomicBool, Ordering::Relaxed};
use tracker::source::SourceInfo;

/// Pictures of a recording that are drawn beside the avatar, at most: as many as an animation has.
pub(crate) const DRAWN: usize = 600;

/// One picture of a recording and what it showed.
#[derive(Debug)]
pub(crate) struct Seen {
    pub(crate) seconds: f64,
    /// Of the pictures that are drawn beside the avatar: it is large.
    pub(crate) observation: Option<Observation>,
    pub(crate) fitted: Fitted,
}

/// A tracked recording.
#[derive(Debug)]
pub(crate) struct TrackedRecording {
    pub(crate) info: SourceInfo,
    /// At least one.
    pub(crate) seen: Vec<Seen>,
    pub(crate) camera: Camera,
    pub(crate) figures: CameraFigures,
}

impl TrackedRecording {
    /// Tracks the first `most` pictures of a recording that was opened, or those until `stop` becomes true.
    ///
    /// # Errors
    /// If it cannot be read, the networks fail, or there is no person in it.
    pub(crate) fn track(
        mut capture: CameraCapture,
        most: usize,
        stop: &AtomicBool,
    ) -> anyhow::Result<Self> {
        let info = capture.source().info().clone();
        let known = info.frames.and_then(|frames| usize::try_from(frames).ok());
        let bar = progress::bar("tracking", known.map_or(0, |known| known.min(most)));
        let (mut pictures, mut looks) = (Vec::new(), Vec::new());
        while looks.len() < most
            && !stop.load(Relaxed)
            && let Some(tracked) = capture.look()?
        {
            let observation = (looks.len() < DRAWN).then_some(tracked.observation);
            pictures.push((tracked.seconds, observation));
            looks.push(tracked.pose);
            bar.inc(1);
        }
        bar.finish_and_clear();
        let seen = pictures.into_iter().zip(capture.smooth_recording(looks));
        let seen: Vec<Seen> = seen
            .map(|((seconds, observation), fitted)| Seen {
                seconds,
                observation,
                fitted,
            })
            .collect();
        let recording = Self {
            camera: capture.camera(),
            info,
            seen,
            figures: capture.figures(),
        };
        if recording.with_person() == 0 {
            if stop.load(Relaxed) {
                bail!("stopped before a person was seen");
            }
            bail!(
                "there is no person in any of the {} pictures of {}: head and shoulders have to be seen",
                recording.seen.len(),
                recording.info.name
            );
        }
        Ok(recording)
    }

    /// Pictures with a person in them.
    pub(crate) fn with_person(&self) -> usize {
        let seen = self.seen.iter();
        seen.filter(|seen| seen.fitted.sees_person).count()
    }

    /// The motions at an even rate: the mean of what the pictures' times say, else that of the video.
    pub(crate) fn clip(&self, avatar: &Avatar) -> anyhow::Result<MotionClip> {
        let timed: Vec<_> = (self.seen.iter())
            .map(|seen| (seen.seconds, seen.fitted.motion.clone()))
            .collect();
        let (first, last) = (timed.first().zip(timed.last())).context("there were no pictures")?;
        let rate = match timed.len() {
            1 => self.info.rate_hz.unwrap_or(30.0),
            count if last.0 > first.0 => (count - 1) as f64 / (last.0 - first.0),
            _ => bail!("all pictures of {} have the same time", self.info.name),
        };
        let clip = MotionClip::evenly(&self.info.name, &timed, rate)?;
        Ok(MotionClip {
            expression_basis: Some(avatar.expression_basis.clone()),
            ..clip
        })
    }
}
