//! A line of gaze, as an eye tracker or a headset tells it.
//!
//! Either `seconds,x,y` (CSV) or `{"seconds": 0.5, "x": 0.4, "y": 0.6}` (JSON, which may say more): x goes to the right and y down, 0 to 1 over the
//! picture. Trackers also see eyes a little beyond the picture, which counts as its edge. Or
//! `{"seconds": 0.5, "eye": [0, 1.6, 1.6], "towards": [0, 1.5, 0]}`, a headset's: where its wearer's eyes are and a point that they look at, metres, in
//! the motion space of the first person (y up, the floor at 0, +z to their front at rest). While the eyes are shut there are no lines, or lines
//! without x and y (empty, or null).

use super::{BLINK, Place};
use anyhow::{Context, bail, ensure};
use glam::{Affine3A, DVec3, Vec3};
use serde::{Deserialize, Deserializer};
use std::time::Duration;

/// How far beyond the picture a gaze may lie, in its widths: further out it is something else than a share of the picture.
const BEYOND: f64 = 1.0;

/// How far from the person a headset may be, and what it looks at, metres: further off it is measured in something else.
const FURTHEST: f64 = 1000.0;

/// How long the last view of a headset stands in for a missing one: the network may stumble, and its wearer stay where they are.
pub(super) const STUMBLE: Duration = Duration::from_secs(2);

/// What a line says of where is looked.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Sample {
    /// At a place of the picture.
    At(Place),
    /// From a place of the room.
    From(LineOfSight),
}

/// A line of sight, in the motion space of the first person, metres.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct LineOfSight {
    pub(super) eye: Vec3,
    /// Of length 1.
    pub(super) direction: Vec3,
}

impl LineOfSight {
    /// The same line of sight in the space that the rigid `space_from_motion` leads to.
    pub(super) fn placed(&self, space_from_motion: &Affine3A) -> Self {
        Self {
            eye: space_from_motion.transform_point3(self.eye),
            direction: space_from_motion.transform_vector3(self.direction),
        }
    }

    /// So much of the way to another one, 0 to 1.
    pub(super) fn towards(&self, other: &Self, share: f32) -> Self {
        Self {
            eye: self.eye.lerp(other.eye, share),
            direction: (self.direction.lerp(other.direction, share)).normalize_or(other.direction),
        }
    }
}

impl Sample {
    /// How long it holds where none comes after it.
    pub(super) fn lasts(&self) -> Duration {
        match self {
            Self::At(_) => BLINK,
            Self::From(_) => STUMBLE,
        }
    }
}

/// A line as it is read.
enum Line {
    At(Looked),
    From(Seen),
}

#[derive(Debug, Deserialize)]
struct Looked {
    seconds: f64,
    // Not there at all is a mistake; null is an eye that is shut.
    #[serde(deserialize_with = "nullable")]
    x: Option<f64>,
    #[serde(deserialize_with = "nullable")]
    y: Option<f64>,
}

#[derive(Debug, Deserialize)]
struct Seen {
    seconds: f64,
    eye: [f64; 3],
    towards: [f64; 3],
}

fn nullable<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Option<f64>, D::Error> {
    Option::deserialize(deserializer)
}

/// A line's time, and what it says, which is nothing while the eyes are shut; nothing at all for an empty line and for one that begins with #.
///
/// # Errors
/// If it is no line of gaze.
pub(super) fn read(line: &[u8]) -> anyhow::Result<Option<(f64, Option<Sample>)>> {
    let line = text(line)?;
    if line.is_empty() || line.starts_with('#') {
        return Ok(None);
    }
    let (seconds, sample) = match parse(line)? {
        Line::At(Looked { seconds, x, y }) => (seconds, place(x, y)?.map(Sample::At)),
        Line::From(Seen {
            seconds,
            eye,
            towards,
        }) => (seconds, Some(Sample::From(view(eye, towards)?))),
    };
    ensure!(
        seconds.is_finite() && seconds >= 0.0,
        "{seconds} is no time: give seconds, from 0 on"
    );
    Ok(Some((seconds, sample)))
}

/// Whether a line is the heading of a table.
pub(super) fn is_heading(line: &[u8]) -> bool {
    let Ok(line) = text(line) else {
        return false;
    };
    let names = line.split(',').map(|name| name.trim().trim_matches('"'));
    names
        .map(str::to_ascii_lowercase)
        .eq(["seconds", "x", "y"].map(str::to_owned))
}

fn text(line: &[u8]) -> anyhow::Result<&str> {
    Ok(std::str::from_utf8(line).context("it is no text")?.trim())
}

/// A line, whatever its numbers are.
fn parse(line: &str) -> anyhow::Result<Line> {
    if line.starts_with('{') {
        return if line.contains("\"eye\"") {
            let seen = serde_json::from_str(line).map(Line::From);
            seen.context("it is no {\"seconds\": S, \"eye\": [X,Y,Z], \"towards\": [X,Y,Z]}")
        } else {
            let looked = serde_json::from_str(line).map(Line::At);
            looked.context("it is no {\"seconds\": S, \"x\": X, \"y\": Y}")
        };
    }
    let fields: Vec<&str> = line.splitn(4, ',').map(str::trim).collect();
    let [seconds, x, y] = fields[..] else {
        bail!("{} is not seconds,x,y", shortened(line));
    };
    let number = |text: &str| -> anyhow::Result<f64> {
        text.parse()
            .with_context(|| format!("{} is no number", shortened(text)))
    };
    let nullable = |text: &str| match text {
        "" => Ok(None),
        text => number(text).map(Some),
    };
    Ok(Line::At(Looked {
        seconds: number(seconds)?,
        x: nullable(x)?,
        y: nullable(y)?,
    }))
}

/// Nothing if the eyes are shut.
fn place(x: Option<f64>, y: Option<f64>) -> anyhow::Result<Option<Place>> {
    let (x, y) = match (x, y) {
        (Some(x), Some(y)) => (x, y),
        (None, None) => return Ok(None),
        _ => bail!("x and y are there or missing together"),
    };
    for (name, value) in [("x", x), ("y", y)] {
        ensure!(
            value.is_finite(),
            "{name} is {value}: leave x and y empty while the eyes are shut"
        );
        ensure!(
            (-BEYOND..=1.0 + BEYOND).contains(&value),
            "{name} is {value}, far from the picture: x and y go from 0 to 1, not in pixels"
        );
    }
    #[expect(clippy::cast_possible_truncation, reason = "0 to 1")]
    let share = |value: f64| value.clamp(0.0, 1.0) as f32;
    Ok(Some([share(x), share(y)]))
}

fn view(eye: [f64; 3], towards: [f64; 3]) -> anyhow::Result<LineOfSight> {
    for (name, place) in [("eye", eye), ("towards", towards)] {
        ensure!(
            place.iter().all(|metres| metres.abs() <= FURTHEST),
            "{name} is {place:?}, further than {FURTHEST} m from the person: give metres"
        );
    }
    let [eye, towards] = [eye, towards].map(DVec3::from_array);
    let direction = (towards - eye).try_normalize();
    Ok(LineOfSight {
        eye: eye.as_vec3(),
        direction: (direction.context("eye and towards are one place: nothing is looked at")?)
            .as_vec3(),
    })
}

/// As much of a text as an error may repeat.
fn shortened(text: &str) -> String {
    let most = 40;
    let mut short: String = text.chars().take(most).collect();
    if text.chars().nth(most).is_some() {
        short.push('\u{2026}');
    }
    short.escape_debug().to_string()
}
