//! What a gaze did to the camera, for reports.

use super::sample::LineOfSight;
use call_member::{GazeFeed, Sent};
use serde::Serialize;
use std::net::SocketAddr;

/// How far the camera went around the person.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
pub(crate) struct GazeFigures {
    /// The mouse, the file, or where live samples come from.
    source: String,
    /// Pictures whose camera it moved or held.
    pictures: u64,
    /// Furthest to the left (negative) and to the right, degrees.
    yaw_degrees: [f32; 2],
    /// Furthest down (negative) and up, degrees.
    pitch_degrees: [f32; 2],
    /// Of a live source: samples that were taken, lines that were none, and samples that were passed over: late, or another sender's.
    #[serde(skip_serializing_if = "Option::is_none")]
    live: Option<LiveFigures>,
    /// Where the camera stood last, if it stood where a headset's wearer did.
    #[serde(skip_serializing_if = "Option::is_none")]
    view: Option<ViewFigures>,
}

/// What a headset sent to a second screen.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(crate) struct GazeToFigures {
    /// The screen's address.
    to: SocketAddr,
    /// Lines, a frame each.
    sent: u64,
    /// Of these followed the wearer's eyes, and not the head alone.
    by_eyes: u64,
}

impl GazeToFigures {
    /// At the end of what was sent.
    pub(crate) fn of(feed: &GazeFeed) -> Self {
        let Sent { lines, by_eyes } = feed.sent();
        Self {
            to: feed.address(),
            sent: lines,
            by_eyes,
        }
    }

    /// A line for the summary.
    pub(crate) fn line(&self) -> String {
        format!(
            "gaze       {} lines sent to {}, {} by the eyes",
            self.sent, self.to, self.by_eyes
        )
    }
}

/// Of a live source.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
struct LiveFigures {
    samples: u64,
    refused: u64,
    passed_over: u64,
}

/// A camera of a headset's wearer, as it was last, metres in the motion space of the first person.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
struct ViewFigures {
    /// Pictures whose camera was nearer to the wearer's than to the one without a gaze.
    pictures: u64,
    eye: [f32; 3],
    /// Of length 1.
    direction: [f32; 3],
}

impl GazeFigures {
    /// Of this source, before the first picture.
    pub(super) fn of(source: String) -> Self {
        Self {
            source,
            ..Self::default()
        }
    }

    /// A picture's camera was nearly a wearer's.
    pub(super) fn note_view(&mut self, view: &LineOfSight) {
        self.view = Some(ViewFigures {
            pictures: self.view.map_or(0, |view| view.pictures) + 1,
            eye: view.eye.to_array(),
            direction: view.direction.to_array(),
        });
    }

    /// A line for the summary.
    pub(crate) fn line(&self) -> String {
        let Self {
            source, pictures, ..
        } = self;
        let live = self.live.map_or_else(String::new, |live| {
            format!(
                ": {} samples, {} lines refused, {} samples passed over",
                live.samples, live.refused, live.passed_over
            )
        });
        let view = self.view.map_or_else(String::new, |view| {
            format!(
                "; {} of {pictures} pictures from a wearer's place",
                view.pictures
            )
        });
        format!("gaze       {source}{live}{view}")
    }

    /// At the end: what came of a live source.
    pub(super) fn note_live(&mut self, [samples, refused, passed_over]: [u64; 3]) {
        self.live = Some(LiveFigures {
            samples,
            refused,
            passed_over,
        });
    }

    /// One picture's camera was turned so far, radians.
    pub(super) fn note(&mut self, yaw: f32, pitch: f32) {
        self.pictures += 1;
        for (range, angle) in [
            (&mut self.yaw_degrees, yaw.to_degrees()),
            (&mut self.pitch_degrees, pitch.to_degrees()),
        ] {
            *range = [range[0].min(angle), range[1].max(angle)];
        }
    }
}
