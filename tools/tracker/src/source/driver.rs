//! What a camera is to its user: modes, and buffers that a driver fills.

use std::io;
use std::time::{Duration, Instant};

use super::colour::{Matrix, Range};

/// A four-letter code of a pixel format.
pub(super) type FourCc = [u8; 4];

pub(super) const YUYV: FourCc = *b"YUYV";
pub(super) const NV12: FourCc = *b"NV12";
pub(super) const RGB3: FourCc = *b"RGB3";
pub(super) const MJPG: FourCc = *b"MJPG";
/// Some drivers call motion JPEG so.
pub(super) const JPEG: FourCc = *b"JPEG";

/// What a camera can be set to.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Mode {
    pub(super) format: FourCc,
    pub(super) width: u32,
    pub(super) height: u32,
    /// Its highest rate, where the driver says it.
    pub(super) fastest_hz: Option<f64>,
}

/// What a camera has been set to.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Layout {
    pub(super) format: FourCc,
    pub(super) width: u32,
    pub(super) height: u32,
    /// Bytes from one row of luma, or of packed pixels, to the next.
    pub(super) stride: usize,
    pub(super) matrix: Matrix,
    pub(super) range: Range,
    pub(super) rate_hz: Option<f64>,
}

/// A buffer that the driver has filled, and does not write to until this is given back: there is one of it.
#[derive(Debug)]
pub(super) struct Filled {
    pub(super) index: usize,
    pub(super) bytes: usize,
    /// When the light fell, where the driver's clock is known.
    pub(super) at: Option<Instant>,
    /// The driver's count of pictures, those that it lost too.
    pub(super) sequence: u32,
    pub(super) damaged: bool,
}

/// What the system offers of a camera.
pub(super) trait Driver: Send {
    /// Its modes; of a range of sizes, the one nearest to `size`.
    fn modes(&mut self, size: (u32, u32)) -> io::Result<Vec<Mode>>;
    /// Sets it to the mode, or to what the driver makes of it, and starts it.
    fn start(&mut self, mode: Mode, rate_hz: f64) -> io::Result<Layout>;
    /// How many buffers it fills.
    fn buffers(&self) -> usize;
    /// Takes the oldest filled buffer; waits `patience` for it, and gives nothing where none comes.
    fn dequeue(&mut self, patience: Duration) -> io::Result<Option<Filled>>;
    /// A buffer's bytes, between its being taken and given back.
    fn bytes(&self, filled: &Filled) -> &[u8];
    /// Gives a buffer back.
    fn requeue(&mut self, filled: Filled) -> io::Result<()>;
}
