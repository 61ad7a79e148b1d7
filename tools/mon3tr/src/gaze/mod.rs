//! `--gaze`: a viewpoint that follows the viewer's eyes on a PC, as the paper's eye-tracking module moves the camera.
//!
//! A source of gaze (the mouse in place of a tracker, a tracker's export, samples as they come from a tracker or a headset) and rules that turn it into
//! a place of the camera: around the person by where a picture is looked at ([`rule`]), or where a headset's wearer stands ([`view`]). In the headset
//! itself the head moves the camera, and this has no part in it.

mod choice;
mod figures;
mod live;
mod rule;
mod sample;
mod spring;
mod track;
mod view;

pub(crate) use choice::{GazeChoice, Sight};
pub(crate) use figures::{GazeFigures, GazeToFigures};

use crate::size::Size;
use crate::viewpoint::Viewpoint;
use app_session::display::Standpoint;
use glam::Vec3;
use live::Live;
use renderer_splat::camera::Camera;
use rule::GazeCamera;
use sample::{LineOfSight, Sample};
use std::sync::Arc;
use std::time::{Duration, Instant};
use track::Track;
use view::{FOV_DEGREES, ViewCamera};

/// How long the last gaze stands in for a missing one. A blink takes 0.1 to 0.4 s; who is gone for longer is not looking.
const BLINK: Duration = Duration::from_millis(400);

/// A place in the picture that the viewer looks at: x to the right and y down, 0 to 1 each.
type Place = [f32; 2];

/// The viewer's gaze, and the camera that follows it.
#[derive(Debug, Clone)]
pub(crate) struct Gaze {
    source: Source,
    orbit: GazeCamera,
    wearer: ViewCamera,
    figures: GazeFigures,
    /// When the first picture was begun, from which a file's seconds count.
    began: Option<Instant>,
    last: Option<Instant>,
}

#[derive(Debug, Clone)]
enum Source {
    Mouse {
        at: Option<Place>,
        /// When it left the window, if it is outside.
        left: Option<Instant>,
    },
    File(Arc<Track>),
    Live(Live),
}

impl Gaze {
    /// From this source, which is called so.
    fn of(source: Source, name: String) -> Self {
        Self {
            source,
            orbit: GazeCamera::default(),
            wearer: ViewCamera::default(),
            figures: GazeFigures::of(name),
            began: None,
            last: None,
        }
    }

    /// The mouse is there in a window of that size, pixels; nothing to a gaze from a file.
    pub(crate) fn pointed(&mut self, [x, y]: [f64; 2], (width, height): (u32, u32)) {
        if let Source::Mouse { at, left } = &mut self.source {
            #[expect(clippy::cast_possible_truncation, reason = "0 to 1")]
            let share = |pixels: f64, all: u32| (pixels / f64::from(all.max(1))) as f32;
            *at = Some([share(x, width), share(y, height)]);
            *left = None;
        }
    }

    /// The mouse has left the window.
    pub(crate) fn left(&mut self, now: Instant) {
        if let Source::Mouse { left, .. } = &mut self.source {
            left.get_or_insert(now);
        }
    }

    /// The camera of the picture of that size that is begun `now`, if it were seen from `viewpoint` of `people` without a gaze.
    pub(crate) fn camera(
        &mut self,
        viewpoint: Viewpoint,
        people: &Standpoint,
        Size { width, height }: Size,
        now: Instant,
    ) -> Camera {
        let began = *self.began.get_or_insert(now);
        let elapsed = now.saturating_duration_since(self.last.replace(now).unwrap_or(now));
        let sample = match &self.source {
            Source::Mouse { at, left } => at
                .filter(|_| left.is_none_or(|left| now.saturating_duration_since(left) <= BLINK))
                .map(Sample::At),
            Source::File(track) => track.at(now.saturating_duration_since(began)),
            Source::Live(live) => live.at(now),
        };
        let (place, view) = match sample {
            Some(Sample::At(place)) => (Some(place), None),
            Some(Sample::From(view)) => (None, Some(view)),
            None => (None, None),
        };
        let [yaw, pitch] = self.orbit.follow(place, elapsed);
        self.figures.note(yaw, pitch);
        let mut viewpoint = viewpoint;
        viewpoint.orbit(yaw, pitch);
        let camera = viewpoint.camera(people.floor, people.heading, width, height);
        let Some((share, view)) = self.wearer.follow(view, elapsed) else {
            return camera;
        };
        if share > 0.5 {
            self.figures.note_view(&view);
        }
        let without = LineOfSight {
            eye: camera.position(),
            direction: people.heading * viewpoint.direction(),
        };
        let view = without.towards(&view.placed(&people.first), share);
        let fov = viewpoint.fov_degrees() * (1.0 - share) + FOV_DEGREES * share;
        Camera::look_at(
            view.eye,
            view.eye + view.direction,
            Vec3::Y,
            fov.to_radians(),
            width,
            height,
        )
    }

    /// What became of the camera.
    pub(crate) fn figures(mut self) -> GazeFigures {
        if let Source::Live(live) = &self.source {
            self.figures.note_live(live.counts());
        }
        self.figures
    }
}

#[cfg(test)]
mod tests;
