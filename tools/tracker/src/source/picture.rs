//! What a source gives, and what may be asked of it.

use std::fmt;
use std::time::Instant;

use super::error::SourceError;
use crate::TrackerError;
use crate::picture::PictureView;

/// The longest side of a picture that a source accepts, in pixels.
pub const LARGEST_SIDE: u32 = 8192;

/// One picture: RGB, 8 bits a channel, rows from the top without padding.
#[derive(Clone, PartialEq)]
pub struct Picture {
    /// In pixels.
    pub width: u32,
    /// In pixels.
    pub height: u32,
    /// `3 * width * height` bytes.
    pub rgb: Vec<u8>,
    /// When the light fell: the driver's time of capture where there is one, else the time at which the picture was read. For
    /// a recording that is played in real time, when the picture was due.
    pub at: Instant,
    /// Seconds since the source's first picture, on the source's own clock. Never falls.
    pub seconds: f64,
    /// Counts the source's pictures from 0, those that were dropped too.
    pub number: u64,
}

impl Picture {
    /// A picture without pixels, for [`Source::next`] to fill.
    #[must_use]
    pub fn empty() -> Self {
        Self {
            width: 0,
            height: 0,
            rgb: Vec::new(),
            at: Instant::now(),
            seconds: 0.0,
            number: 0,
        }
    }

    /// Its pixels.
    ///
    /// # Errors
    /// As [`PictureView::new`].
    pub fn view(&self) -> Result<PictureView<'_>, TrackerError> {
        PictureView::new(self.width as usize, self.height as usize, &self.rgb)
    }

    /// Gives it a size, which [`within_limits`] has passed, and as many bytes.
    pub(super) fn resize(&mut self, width: u32, height: u32) {
        self.width = width;
        self.height = height;
        self.rgb.resize(bytes_of(width, height), 0);
    }
}

impl Default for Picture {
    fn default() -> Self {
        Self::empty()
    }
}

/// Without the pixels.
impl fmt::Debug for Picture {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Picture")
            .field("width", &self.width)
            .field("height", &self.height)
            .field("seconds", &self.seconds)
            .field("number", &self.number)
            .finish_non_exhaustive()
    }
}

/// The bytes of an RGB picture of a size that [`within_limits`] has passed.
pub(super) fn bytes_of(width: u32, height: u32) -> usize {
    width as usize * height as usize * 3
}

/// Refuses pictures without pixels and those of more than [`LARGEST_SIDE`] a side.
pub(super) fn within_limits(name: &str, width: u32, height: u32) -> Result<(), SourceError> {
    if width == 0 || height == 0 {
        return Err(SourceError::Malformed {
            name: name.to_owned(),
            why: format!("its pictures are {width} x {height}"),
        });
    }
    if width.max(height) > LARGEST_SIDE {
        return Err(SourceError::TooLarge {
            name: name.to_owned(),
            width,
            height,
            largest: LARGEST_SIDE,
        });
    }
    Ok(())
}

/// Damaged pictures that are passed over, one after another: some cameras begin with a few.
pub(super) const MOST_DAMAGED: u32 = 60;

/// What a source says of itself.
#[derive(Debug, Clone, PartialEq)]
pub struct SourceInfo {
    /// For messages: a device's name, a file's path, an address without its password.
    pub name: String,
    /// Of every picture, or of the first one where sizes change, in pixels.
    pub width: u32,
    /// As the width, in pixels.
    pub height: u32,
    /// Pictures a second, where the source says so. A recording's rate may vary: [`Picture::seconds`] is what counts.
    pub rate_hz: Option<f64>,
    /// How many pictures there are, where that is known before they are read.
    pub frames: Option<u64>,
}

/// Pictures a second of a recording that does not say its own rate, and of a camera, where it has that rate.
pub(super) const RATE_HZ: f64 = 30.0;

/// A sequence of pictures.
pub trait Source: Send {
    /// What it is.
    fn info(&self) -> &SourceInfo;

    /// Fills `into` with the next picture and returns true, or returns false at the end. The picture's size is that of [`Source::info`],
    /// but that of a camera or a live stream may change. The buffer of `into` is used again: it may be exchanged for another of the
    /// source's.
    ///
    /// # Errors
    /// Where the source fails. After an error or the end it gives no more pictures.
    fn next(&mut self, into: &mut Picture) -> Result<bool, SourceError>;
}
