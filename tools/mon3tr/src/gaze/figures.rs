//! What a gaze did to the camera, for reports.

use serde::Serialize;

/// How far the camera went around the person.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
pub(crate) struct GazeFigures {
    /// The mouse, or the file.
    source: String,
    /// Pictures whose camera it moved or held.
    pictures: u64,
    /// Furthest to the left (negative) and to the right, degrees.
    yaw_degrees: [f32; 2],
    /// Furthest down (negative) and up, degrees.
    pitch_degrees: [f32; 2],
}

impl GazeFigures {
    /// Of this source, before the first picture.
    pub(super) fn of(source: String) -> Self {
        Self {
            source,
            ..Self::default()
        }
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
