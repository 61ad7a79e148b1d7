//! `--gaze`: a viewpoint that follows the viewer's eyes on a PC, as the paper's eye-tracking module moves the camera.
//!
//! A source of gaze (the mouse in place of a tracker, or a tracker's export) and a rule that turns it into a place of the camera.
//! In a headset the head moves the camera, and this has no part in it.

mod figures;
mod rule;
mod track;

pub(crate) use figures::GazeFigures;

use crate::viewpoint::Viewpoint;
use anyhow::bail;
use rule::GazeCamera;
use std::fmt;
use std::path::PathBuf;
use std::str::FromStr;
use std::sync::Arc;
use std::time::{Duration, Instant};
use track::Track;

/// How long the last gaze stands in for a missing one. A blink takes 0.1 to 0.4 s; who is gone for longer is not looking.
const BLINK: Duration = Duration::from_millis(400);

/// A place in the picture that the viewer looks at: x to the right and y down, 0 to 1 each.
type Place = [f32; 2];

/// What `--gaze` says.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) enum GazeChoice {
    /// The mouse in the window.
    Mouse,
    /// Samples of an eye tracker.
    File(PathBuf),
}

impl FromStr for GazeChoice {
    type Err = std::convert::Infallible;

    fn from_str(text: &str) -> Result<Self, Self::Err> {
        Ok(match text {
            "mouse" => Self::Mouse,
            file => Self::File(file.into()),
        })
    }
}

impl fmt::Display for GazeChoice {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Mouse => f.write_str("mouse"),
            Self::File(file) => write!(f, "{}", file.display()),
        }
    }
}

/// Where there is a mouse to follow, and where pictures are made at all.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Sight {
    Window,
    Offscreen,
    Nothing,
}

impl GazeChoice {
    /// The gaze that was chosen, before anybody is kept waiting.
    ///
    /// # Errors
    /// If there can be none where the call is shown, or the file holds none.
    pub(crate) fn open(&self, sight: Sight) -> anyhow::Result<Gaze> {
        let source = match (self, sight) {
            (_, Sight::Nothing) => {
                bail!("--gaze moves the camera, and nothing is drawn here: leave one of them out")
            }
            (Self::Mouse, Sight::Offscreen) => bail!(
                "--gaze mouse follows the mouse in a window, and pictures on disk have none: show a window, or give a file of \
                 gaze samples"
            ),
            (Self::Mouse, Sight::Window) => Source::Mouse {
                at: None,
                left: None,
            },
            (Self::File(file), _) => Source::File(Arc::new(Track::read(file)?)),
        };
        Ok(Gaze {
            source,
            camera: GazeCamera::default(),
            figures: GazeFigures::of(self.to_string()),
            began: None,
            last: None,
        })
    }
}

/// The viewer's gaze, and the camera that follows it.
#[derive(Debug, Clone)]
pub(crate) struct Gaze {
    source: Source,
    camera: GazeCamera,
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
}

impl Gaze {
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

    /// Where the picture that is begun `now` is seen from, if it were seen from `viewpoint` without a gaze.
    pub(crate) fn follow(&mut self, viewpoint: Viewpoint, now: Instant) -> Viewpoint {
        let began = *self.began.get_or_insert(now);
        let elapsed = now.saturating_duration_since(self.last.replace(now).unwrap_or(now));
        let place = match &self.source {
            Source::Mouse { at, left } => {
                at.filter(|_| left.is_none_or(|left| now.saturating_duration_since(left) <= BLINK))
            }
            Source::File(track) => track.at(now.saturating_duration_since(began)),
        };
        let [yaw, pitch] = self.camera.follow(place, elapsed);
        self.figures.note(yaw, pitch);
        let mut viewpoint = viewpoint;
        viewpoint.orbit(yaw, pitch);
        viewpoint
    }

    /// What became of the camera.
    pub(crate) fn figures(self) -> GazeFigures {
        self.figures
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::{Quat, Vec3};

    /// Where the camera stands after the viewer has looked at one place for three seconds, and which way it looks.
    fn looked(x: f64, y: f64) -> (Vec3, Vec3) {
        let mut gaze = GazeChoice::Mouse.open(Sight::Window).expect("a window");
        let viewpoint: Viewpoint = "front".parse().expect("a name");
        let zero = Instant::now();
        gaze.pointed([x * 640.0, y * 480.0], (640, 480));
        let mut seen = viewpoint;
        for picture in 0..180 {
            seen = gaze.follow(viewpoint, zero + Duration::from_millis(picture * 1000 / 60));
        }
        let camera = seen.camera(Vec3::ZERO, Quat::IDENTITY, 640, 480);
        (camera.position(), seen.direction())
    }

    #[test]
    fn looking_to_a_side_takes_the_camera_there_and_keeps_the_person_in_the_middle() {
        let target = Vec3::new(0.0, 0.92, 0.0);
        let (front, _) = looked(0.5, 0.5);
        let [left, right, up, down] =
            [(0.0, 0.5), (1.0, 0.5), (0.5, 0.0), (0.5, 1.0)].map(|(x, y)| looked(x, y));
        // The front camera looks along -z with +x to its right.
        assert!(right.0.x > front.x + 1.0, "right: {} from {front}", right.0);
        assert!(left.0.x < front.x - 1.0, "left: {} from {front}", left.0);
        assert!(up.0.y > front.y + 0.5, "up: {} from {front}", up.0);
        assert!(down.0.y < front.y - 0.5, "down: {} from {front}", down.0);
        for (eye, direction) in [left, right, up, down] {
            let towards = (target - eye).normalize();
            assert!(towards.abs_diff_eq(direction, 1e-4), "from {eye}");
            let distance = eye.distance(target);
            assert!(
                (distance - front.distance(target)).abs() < 1e-3,
                "from {eye}: {distance}"
            );
        }
    }

    #[test]
    fn a_mouse_that_leaves_the_window_is_looked_at_for_a_blink_and_then_forgotten() {
        let mut gaze = GazeChoice::Mouse.open(Sight::Window).expect("a window");
        let viewpoint: Viewpoint = "front".parse().expect("a name");
        let zero = Instant::now();
        let at = |seconds: f64| zero + Duration::from_secs_f64(seconds);
        gaze.pointed([640.0, 240.0], (640, 480));
        let turned = |gaze: &mut Gaze, from: f64, to: f64| {
            let mut angle = 0.0;
            for step in 0..=60 {
                let time = from + (to - from) * f64::from(step) / 60.0;
                let seen = gaze.follow(viewpoint, at(time)).direction();
                angle = (-seen.x).atan2(-seen.z).to_degrees();
            }
            angle
        };
        let before = turned(&mut gaze, 0.0, 4.0);
        gaze.left(at(4.0));
        let held = turned(&mut gaze, 4.0, 4.39);
        let after = turned(&mut gaze, 4.41, 9.0);
        assert!((before - 25.0).abs() < 0.01, "as far as it goes: {before}");
        assert!((held - before).abs() < 0.01, "held: {held}");
        assert!(after.abs() < 0.01, "back in the middle: {after}");
    }

    #[test]
    fn a_gaze_that_cannot_be_is_refused_with_what_to_do() {
        let refused = |choice: &str, sight: Sight| {
            let choice: GazeChoice = choice.parse().expect("any text");
            choice.open(sight).expect_err("refused").to_string()
        };
        let mouse = refused("mouse", Sight::Offscreen);
        assert!(mouse.contains("give a file"), "{mouse}");
        let nothing = refused("mouse", Sight::Nothing);
        assert!(nothing.contains("nothing is drawn"), "{nothing}");
        let file = refused("no/such/gaze.csv", Sight::Offscreen);
        assert!(file.contains("no/such/gaze.csv"), "{file}");
        assert!(!file.contains('\n'), "one line: {file}");
    }
}
