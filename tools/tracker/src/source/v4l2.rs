//! Video4Linux 2: a camera's modes, its buffers mapped into memory, and its clock.

mod abi;
mod devices;

use std::fs::{File, OpenOptions};
use std::io;
use std::os::fd::AsFd;
use std::os::unix::fs::{FileTypeExt, OpenOptionsExt};
use std::path::Path;
use std::ptr::null_mut;
use std::slice::from_raw_parts;
use std::time::{Duration, Instant};

use rustix::event::{PollFd, PollFlags, Timespec, poll};
use rustix::fs::OFlags;
use rustix::io::Errno;
use rustix::ioctl::{Getter, Opcode, Setter, Updater, ioctl};
use rustix::mm::{MapFlags, ProtFlags, mmap, munmap};
use rustix::time::{ClockId, clock_gettime};

use super::colour::{Matrix, Range};
use super::driver::{Driver, Filled, FourCc, Layout, Mode};
use super::error::SourceError;
use abi::{
    Buffer, CAN_CAPTURE, CAN_CAPTURE_IN_PLANES, CAN_SET_RATE, CAN_STREAM, CLOCK_MASK,
    CLOCK_MONOTONIC, COLOURS_709, COLOURS_JPEG, Capability, DAMAGED, DEQUEUE, DISCRETE,
    ENCODING_709, FULL_RANGE, Format, FormatDescription, FrameInterval, FrameSize, GET_PARAMETERS,
    HAS_DEVICE_CAPABILITIES, LIST_FORMATS, LIST_INTERVALS, LIST_SIZES, MAPPED, PixelFormat,
    QUERY_BUFFER, QUERY_CAPABILITIES, QUEUE, REQUEST_BUFFERS, RequestBuffers, SET_FORMAT,
    SET_PARAMETERS, START, STOP, StreamParameters, VIDEO_CAPTURE, empty,
};
use devices::{present, refusal};

/// More than drivers give, and few enough that a hostile one cannot fill the memory.
const MOST_LISTED: u32 = 256;
/// Two pictures wait while one is converted and one is filled.
const BUFFERS: u32 = 4;

/// One of the driver's buffers, in this process's memory.
#[derive(Debug)]
struct Mapping {
    start: *mut core::ffi::c_void,
    length: usize,
}

// SAFETY: the mapping belongs to this value alone, and memory is no thread's.
unsafe impl Send for Mapping {}

impl Drop for Mapping {
    fn drop(&mut self) {
        // SAFETY: it was mapped with this length, and no slice of it outlives `&self`.
        if let Err(why) = unsafe { munmap(self.start, self.length) } {
            log::debug!("a camera's buffer stays mapped: {why}");
        }
    }
}

/// An open camera.
#[derive(Debug)]
pub(super) struct Device {
    file: File,
    card: String,
    mappings: Vec<Mapping>,
    started: bool,
}

impl Device {
    /// Opens a camera; what is none is refused.
    pub(super) fn open(path: &Path) -> Result<Self, SourceError> {
        let device = path.display().to_string();
        let none = |why: &str| SourceError::NotACamera {
            device: device.clone(),
            why: why.to_owned(),
            present: present(),
        };
        let failed = |source| refusal(&device, source);
        // Before it is opened: opening a pipe or a tape has effects.
        if !path
            .metadata()
            .map_err(failed)?
            .file_type()
            .is_char_device()
        {
            return Err(none("it is no device"));
        }
        #[allow(
            clippy::cast_possible_wrap,
            reason = "the flags are those that the system takes as an int"
        )]
        let flags = (OFlags::NONBLOCK | OFlags::CLOEXEC).bits() as i32;
        let file = OpenOptions::new()
            .read(true)
            .write(true)
            .custom_flags(flags)
            .open(path)
            .map_err(failed)?;
        // SAFETY: the code is that of the structure, which is plain numbers and which the driver fills.
        let capability =
            match unsafe { ioctl(&file, Getter::<QUERY_CAPABILITIES, Capability>::new()) } {
                Ok(capability) => capability,
                Err(Errno::NOTTY | Errno::INVAL) => return Err(none("it is no video device")),
                Err(why) => return Err(failed(why.into())),
            };
        let can = if capability.capabilities & HAS_DEVICE_CAPABILITIES != 0 {
            capability.device_capabilities
        } else {
            capability.capabilities
        };
        if can & CAN_CAPTURE == 0 {
            return Err(none(if can & CAN_CAPTURE_IN_PLANES != 0 {
                "it gives pictures in several planes only: use a pipe of y4m, as from libcamera or ffmpeg"
            } else {
                "it gives no pictures (a camera often has a second device, of numbers only)"
            }));
        }
        if can & CAN_STREAM == 0 {
            return Err(none("its driver cannot stream"));
        }
        Ok(Self {
            file,
            card: text(&capability.card),
            mappings: Vec::new(),
            started: false,
        })
    }

    /// For messages.
    pub(super) fn name(&self, path: &Path) -> String {
        if self.card.is_empty() {
            path.display().to_string()
        } else {
            format!("{} ({})", path.display(), self.card)
        }
    }

    /// An ioctl that reads and writes a structure.
    fn update<const CODE: Opcode, T: Copy>(&self, value: &mut T) -> Result<(), Errno> {
        // The size is a part of the code.
        const {
            assert!(
                (CODE >> 16) as usize & 0x3fff == size_of::<T>(),
                "another structure's code"
            );
        };
        loop {
            // SAFETY: the structure has the size that the driver writes, and is made of numbers, which may have any value.
            match unsafe { ioctl(&self.file, Updater::<CODE, T>::new(value)) } {
                Err(Errno::INTR) => {}
                other => return other,
            }
        }
    }

    fn sizes(&self, format: u32, wanted: (u32, u32)) -> Vec<(u32, u32)> {
        let mut sizes = Vec::new();
        for index in 0..MOST_LISTED {
            let mut size = FrameSize {
                index,
                pixel_format: format,
                ..FrameSize::default()
            };
            if self.update::<LIST_SIZES, _>(&mut size).is_err() {
                break;
            }
            let [a, b, c, d, e, f] = size.sizes;
            if size.kind == DISCRETE {
                sizes.push((a, b));
            } else {
                sizes.push((nearest(wanted.0, a, b, c), nearest(wanted.1, d, e, f)));
                break;
            }
        }
        if sizes.is_empty() {
            // Not all drivers list them: they make of what they are asked for what they can.
            sizes.push(wanted);
        }
        sizes
    }

    fn fastest_hz(&self, format: u32, (width, height): (u32, u32)) -> Option<f64> {
        let mut fastest: Option<f64> = None;
        for index in 0..MOST_LISTED {
            let mut interval = FrameInterval {
                index,
                pixel_format: format,
                width,
                height,
                ..FrameInterval::default()
            };
            if self.update::<LIST_INTERVALS, _>(&mut interval).is_err() {
                break;
            }
            let [num, den, ..] = interval.fractions;
            fastest = [fastest, rate(num, den)]
                .into_iter()
                .flatten()
                .reduce(f64::max);
            if interval.kind != DISCRETE {
                break;
            }
        }
        fastest
    }

    /// Where the driver lets it be set.
    fn set_rate(&self, rate_hz: f64) -> Option<f64> {
        let mut parameters = StreamParameters {
            kind: VIDEO_CAPTURE,
            capability: 0,
            mode: 0,
            interval: [0; 2],
            rest: [0; 184],
        };
        self.update::<GET_PARAMETERS, _>(&mut parameters).ok()?;
        if parameters.capability & CAN_SET_RATE != 0 {
            let before = parameters;
            #[allow(
                clippy::cast_possible_truncation,
                clippy::cast_sign_loss,
                reason = "clamped"
            )]
            let thousandths = (rate_hz * 1000.0).clamp(1.0, 1e9) as u32;
            parameters.interval = [1000, thousandths];
            if self.update::<SET_PARAMETERS, _>(&mut parameters).is_err() {
                parameters = before;
            }
        }
        rate(parameters.interval[0], parameters.interval[1])
    }

    fn map(&mut self) -> io::Result<()> {
        let mut request = RequestBuffers {
            count: BUFFERS,
            kind: VIDEO_CAPTURE,
            memory: MAPPED,
            ..RequestBuffers::default()
        };
        self.update::<REQUEST_BUFFERS, _>(&mut request)?;
        for index in 0..request.count.min(MOST_LISTED) {
            let mut buffer = empty(index);
            self.update::<QUERY_BUFFER, _>(&mut buffer)?;
            let length = buffer.length as usize;
            // SAFETY: a new mapping, where the system puts it, of what the driver says the buffer is.
            let start = unsafe {
                mmap(
                    null_mut(),
                    length,
                    ProtFlags::READ | ProtFlags::WRITE,
                    MapFlags::SHARED,
                    &self.file,
                    u64::from(buffer.offset),
                )
            }?;
            self.mappings.push(Mapping { start, length });
            self.update::<QUEUE, _>(&mut empty(index))?;
        }
        if self.mappings.is_empty() {
            return Err(io::Error::from(Errno::NOMEM));
        }
        Ok(())
    }
}

fn rate(seconds_num: u32, seconds_den: u32) -> Option<f64> {
    (seconds_num > 0 && seconds_den > 0).then(|| f64::from(seconds_den) / f64::from(seconds_num))
}

fn nearest(wanted: u32, least: u32, most: u32, step: u32) -> u32 {
    let within = wanted.clamp(least.min(most), most);
    within - (within - least.min(within)) % step.max(1)
}

fn text(bytes: &[u8]) -> String {
    let end = bytes
        .iter()
        .position(|byte| *byte == 0)
        .unwrap_or(bytes.len());
    String::from_utf8_lossy(&bytes[..end]).trim().to_owned()
}

impl Driver for Device {
    fn modes(&mut self, size: (u32, u32)) -> io::Result<Vec<Mode>> {
        let mut modes = Vec::new();
        for index in 0..MOST_LISTED {
            let mut format = FormatDescription {
                index,
                kind: VIDEO_CAPTURE,
                ..FormatDescription::default()
            };
            match self.update::<LIST_FORMATS, _>(&mut format) {
                Ok(()) => {}
                Err(Errno::INVAL | Errno::NOTTY) => break,
                Err(why) => return Err(why.into()),
            }
            for (width, height) in self.sizes(format.pixel_format, size) {
                modes.push(Mode {
                    format: format.pixel_format.to_le_bytes(),
                    width,
                    height,
                    fastest_hz: self.fastest_hz(format.pixel_format, (width, height)),
                });
            }
        }
        Ok(modes)
    }

    fn start(&mut self, mode: Mode, rate_hz: f64) -> io::Result<Layout> {
        let mut format = Format {
            kind: VIDEO_CAPTURE,
            padding: 0,
            pixels: PixelFormat {
                width: mode.width,
                height: mode.height,
                pixel_format: u32::from_le_bytes(mode.format),
                ..PixelFormat::default()
            },
            rest: [0; 152],
        };
        self.update::<SET_FORMAT, _>(&mut format)?;
        let rate_hz = self.set_rate(rate_hz);
        self.map()?;
        // SAFETY: the code is that of a number, the kind of buffers.
        unsafe { ioctl(&self.file, Setter::<START, u32>::new(VIDEO_CAPTURE)) }?;
        self.started = true;
        Ok(layout(&format.pixels, rate_hz))
    }

    fn buffers(&self) -> usize {
        self.mappings.len()
    }

    fn dequeue(&mut self, patience: Duration) -> io::Result<Option<Filled>> {
        let deadline = Instant::now() + patience;
        loop {
            let mut buffer = empty(0);
            match self.update::<DEQUEUE, _>(&mut buffer) {
                Ok(()) => return Ok(Some(filled(&buffer))),
                Err(Errno::AGAIN) => {}
                // The driver lost a picture, and goes on.
                Err(Errno::IO) if patience.is_zero() => return Ok(None),
                Err(Errno::IO) => {}
                Err(why) => return Err(why.into()),
            }
            let left = deadline.saturating_duration_since(Instant::now());
            if left.is_zero() {
                return Ok(None);
            }
            let left = Timespec {
                tv_sec: i64::try_from(left.as_secs()).unwrap_or(i64::MAX),
                tv_nsec: left.subsec_nanos().into(),
            };
            let mut ready = [PollFd::from_borrowed_fd(self.file.as_fd(), PollFlags::IN)];
            match poll(&mut ready, Some(&left)) {
                Ok(0) => return Ok(None),
                Ok(_) if ready[0].revents().contains(PollFlags::IN) => {}
                // It has been unplugged, or stopped.
                Ok(_) => return Err(Errno::NODEV.into()),
                Err(Errno::INTR) => {}
                Err(why) => return Err(why.into()),
            }
        }
    }

    fn bytes(&self, filled: &Filled) -> &[u8] {
        let Some(mapping) = self.mappings.get(filled.index) else {
            return &[];
        };
        // SAFETY: mapped for as long as `self` is. The driver does not write to it while there is a `Filled` of it, which cannot be
        // copied, and which `requeue` takes together with `&mut self`, so that the slice is gone by then.
        unsafe { from_raw_parts(mapping.start.cast::<u8>().cast_const(), mapping.length) }
    }

    fn requeue(&mut self, filled: Filled) -> io::Result<()> {
        let index = u32::try_from(filled.index).map_err(|_| io::ErrorKind::InvalidInput)?;
        Ok(self.update::<QUEUE, _>(&mut empty(index))?)
    }
}

fn filled(buffer: &Buffer) -> Filled {
    let monotonic = buffer.flags & CLOCK_MASK == CLOCK_MONOTONIC;
    Filled {
        index: buffer.index as usize,
        bytes: buffer.bytes_used as usize,
        at: monotonic
            .then(|| instant_of(buffer.seconds, buffer.microseconds))
            .flatten(),
        sequence: buffer.sequence,
        damaged: buffer.flags & DAMAGED != 0,
    }
}

/// A time of the system's monotonic clock, which is not after now.
fn instant_of(seconds: i64, microseconds: i64) -> Option<Instant> {
    let clock = clock_gettime(ClockId::Monotonic);
    let now = Instant::now();
    let then = Duration::from_secs(u64::try_from(seconds).ok()?)
        .checked_add(Duration::from_micros(u64::try_from(microseconds).ok()?))?;
    let clock = Duration::new(
        u64::try_from(clock.tv_sec).ok()?,
        u32::try_from(clock.tv_nsec).ok()?,
    );
    now.checked_sub(clock.saturating_sub(then))
}

/// As `V4L2_MAP_YCBCR_ENC_DEFAULT` and `V4L2_MAP_QUANTIZATION_DEFAULT` have it for formats that are not RGB.
fn layout(pixels: &PixelFormat, rate_hz: Option<f64>) -> Layout {
    let format: FourCc = pixels.pixel_format.to_le_bytes();
    Layout {
        format,
        width: pixels.width,
        height: pixels.height,
        stride: pixels.bytes_per_line as usize,
        matrix: match (pixels.encoding, pixels.colours) {
            (ENCODING_709, _) | (0, COLOURS_709) => Matrix::Bt709,
            _ => Matrix::Bt601,
        },
        range: match (pixels.quantization, pixels.colours) {
            (FULL_RANGE, _) | (0, COLOURS_JPEG) => Range::Full,
            _ => Range::Limited,
        },
        rate_hz,
    }
}

impl Drop for Device {
    fn drop(&mut self) {
        if self.started {
            // SAFETY: the code is that of a number, the kind of buffers.
            if let Err(why) = unsafe { ioctl(&self.file, Setter::<STOP, u32>::new(VIDEO_CAPTURE)) }
            {
                log::debug!("a camera does not stop: {why}");
            }
        }
    }
}

#[cfg(test)]
mod tests;
