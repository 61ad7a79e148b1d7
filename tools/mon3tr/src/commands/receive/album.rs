//! Pictures of what both eyes got, kept while the session is shown in a headset.

use crate::film::write_png;
use crate::moments::Moments;
use crate::until::Until;
use app_session::headset::{FrameCapture, FrameObserver};
use image::{RgbImage, imageops};
use renderer_openxr::eyes::EyePicture;
use std::path::{Path, PathBuf};

/// Frames from one that is looked at to the next, at most.
const APART: u64 = 20;

/// Frames that are looked at where so few are shown that this needs them closer together: as many as the sheet of moments has room for.
const LOOKED_AT: u64 = 8;

/// What is behind the transparent parts of pictures that the viewer's own room shows through.
const GREY: f32 = 0.45;

/// Decides when to leave, and keeps some of the pictures.
#[derive(Debug)]
pub(super) struct Album<'a> {
    until: &'a Until,
    /// Whether pictures are kept at all.
    keeps: bool,
    /// Frames from one that is looked at to the next.
    apart: u64,
    moments: Moments,
    last: Option<[RgbImage; 2]>,
}

impl<'a> Album<'a> {
    pub(super) fn new(until: &'a Until, keeps: bool) -> Self {
        Self {
            until,
            keeps,
            apart: (until.frames).map_or(APART, |all| (all / LOOKED_AT).clamp(1, APART)),
            moments: Moments::default(),
            last: None,
        }
    }

    /// Writes the last pair, by themselves and side by side, and moments of the left eye.
    pub(super) fn write(self, folder: &Path) -> anyhow::Result<Vec<PathBuf>> {
        let Some([left, right]) = self.last else {
            return Ok(Vec::new());
        };
        let mut both = RgbImage::new(left.width() + right.width(), left.height());
        imageops::replace(&mut both, &left, 0, 0);
        imageops::replace(&mut both, &right, left.width().into(), 0);
        let sheet = self.moments.sheet();
        let mut written = Vec::new();
        for (name, picture) in [
            ("left.png", &left),
            ("right.png", &right),
            ("stereo.png", &both),
            ("moments.png", &sheet),
        ] {
            let file = folder.join(name);
            write_png(&file, picture)?;
            written.push(file);
        }
        Ok(written)
    }
}

impl FrameObserver for Album<'_> {
    fn is_over(&self, shown: u64) -> bool {
        self.until.is_over(shown)
    }

    fn wants_pictures(&mut self, shown: u64, has_people: bool) -> bool {
        let is_last = self.until.frames == Some(shown + 1);
        self.keeps
            && has_people
            && (is_last || self.last.is_none() || shown.is_multiple_of(self.apart))
    }

    fn captured(&mut self, frame: FrameCapture<'_>) {
        let [Some(left), Some(right)] = frame.pictures.map(opaque) else {
            return;
        };
        self.moments.offer(&left);
        self.last = Some([left, right]);
    }
}

/// A picture as it is seen before something grey.
fn opaque(picture: EyePicture) -> Option<RgbImage> {
    let behind = GREY * 255.0;
    let rgb = (picture.rgba.as_chunks::<4>().0.iter())
        .flat_map(|[red, green, blue, alpha]| {
            let through = 1.0 - f32::from(*alpha) / 255.0;
            [*red, *green, *blue].map(|colour| mixed(colour, behind * through))
        })
        .collect();
    RgbImage::from_raw(picture.width, picture.height, rgb)
}

#[expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "held within a byte before"
)]
fn mixed(colour: u8, added: f32) -> u8 {
    (f32::from(colour) + added).clamp(0.0, 255.0) as u8
}
