//! A camera: the mode nearest to what is wanted, its newest picture, and the driver's time of capture. What the system offers is
//! behind [`Driver`].

use std::path::Path;
use std::time::{Duration, Instant};

use super::colour::Conversion;
use super::driver::{Driver, Filled, JPEG, Layout, MJPG, Mode, NV12, RGB3, YUYV};
use super::error::SourceError;
use super::jpeg::JpegPictures;
use super::picture::{MOST_DAMAGED, Picture, RATE_HZ, Source, SourceInfo, within_limits};

/// Without a picture: cameras begin within two seconds.
const LONGEST_SILENCE: Duration = Duration::from_secs(5);

/// Width and height in pixels, to which the mode that is taken is nearest.
const SIZE: (u32, u32) = (1280, 720);

/// Opens and starts the camera at a path.
pub(super) fn open(device: &Path) -> Result<Box<dyn Source>, SourceError> {
    #[cfg(all(target_os = "linux", target_pointer_width = "64"))]
    {
        let driver = super::v4l2::Device::open(device)?;
        let name = driver.name(device);
        Ok(Box::new(Camera::start(
            &device.display().to_string(),
            name,
            driver,
        )?))
    }
    #[cfg(not(all(target_os = "linux", target_pointer_width = "64")))]
    {
        Err(SourceError::NoCameras {
            device: device.display().to_string(),
        })
    }
}

/// A started camera.
#[derive(Debug)]
pub(super) struct Camera<D> {
    device: String,
    info: SourceInfo,
    driver: D,
    layout: Layout,
    conversion: Conversion,
    jpeg: JpegPictures,
    first_at: Option<Instant>,
    seconds: f64,
    last_sequence: Option<u32>,
    /// Of the last picture taken from the driver.
    number: u64,
}

impl<D: Driver> Camera<D> {
    /// Chooses the mode and starts the driver.
    pub(super) fn start(device: &str, name: String, mut driver: D) -> Result<Self, SourceError> {
        let modes = driver
            .modes(SIZE)
            .map_err(|why| SourceError::of_camera(device, "to list its formats", why))?;
        let Some(mode) = choose(&modes, SIZE, RATE_HZ) else {
            let mut has: Vec<String> = modes
                .iter()
                .map(|mode| mode.format.escape_ascii().to_string())
                .collect();
            has.sort();
            has.dedup();
            return Err(SourceError::NoFormat {
                device: device.to_owned(),
                has: if has.is_empty() {
                    "no format at all".to_owned()
                } else {
                    has.join(", ")
                },
            });
        };
        let layout = driver
            .start(mode, RATE_HZ)
            .map_err(|why| SourceError::of_camera(device, "to start", why))?;
        within_limits(device, layout.width, layout.height)?;
        let row = layout.width as usize
            * match layout.format {
                YUYV => 2,
                RGB3 => 3,
                NV12 => 1,
                MJPG | JPEG => 0,
                other => {
                    return Err(SourceError::NoFormat {
                        device: device.to_owned(),
                        has: other.escape_ascii().to_string(),
                    });
                }
            };
        if layout.stride < row {
            return Err(SourceError::Malformed {
                name: device.to_owned(),
                why: format!(
                    "its driver gives rows of {} bytes to pictures that are {} wide",
                    layout.stride, layout.width
                ),
            });
        }
        let format = layout.format.escape_ascii();
        log::info!(
            "{name}: {} x {} {format}, {} Hz",
            layout.width,
            layout.height,
            layout.rate_hz.unwrap_or(RATE_HZ)
        );
        Ok(Self {
            device: device.to_owned(),
            info: SourceInfo {
                name,
                width: layout.width,
                height: layout.height,
                rate_hz: layout.rate_hz,
                frames: None,
            },
            driver,
            conversion: Conversion::new(layout.matrix, layout.range, 8),
            layout,
            jpeg: JpegPictures::default(),
            first_at: None,
            seconds: 0.0,
            last_sequence: None,
            number: 0,
        })
    }

    /// The newest buffer that is not damaged. Older ones go back to the driver.
    fn newest(&mut self) -> Result<Filled, SourceError> {
        let deadline = Instant::now() + LONGEST_SILENCE;
        let mut held: Option<Filled> = None;
        let mut taken = 0;
        let mut waited = false;
        loop {
            let left = deadline.saturating_duration_since(Instant::now());
            let patience = if held.is_some() { Duration::ZERO } else { left };
            let filled = self
                .driver
                .dequeue(patience)
                .map_err(|why| SourceError::of_camera(&self.device, "to give a picture", why))?;
            let Some(filled) = filled else {
                match held {
                    Some(held) => return Ok(held),
                    None => return Err(self.silent()),
                }
            };
            taken += 1;
            self.count(filled.sequence);
            if let Some(old) = held.take() {
                self.give_back(old)?;
            }
            if filled.damaged {
                self.give_back(filled)?;
                if left.is_zero() {
                    return Err(self.silent());
                }
                continue;
            }
            if waited {
                return Ok(filled);
            }
            if taken >= self.driver.buffers() {
                // All were full, so newer pictures were lost: even the last of them may be old. The next one is not.
                self.give_back(filled)?;
                waited = true;
                continue;
            }
            held = Some(filled);
        }
    }

    fn silent(&self) -> SourceError {
        SourceError::Silent {
            name: self.info.name.clone(),
            seconds: LONGEST_SILENCE.as_secs(),
        }
    }

    /// Counts a picture, and those that the driver lost before it. Some drivers do not count.
    fn count(&mut self, sequence: u32) {
        if let Some(last) = self.last_sequence {
            let step = sequence.wrapping_sub(last);
            self.number += if step < 1 << 31 {
                u64::from(step.max(1))
            } else {
                1
            };
        }
        self.last_sequence = Some(sequence);
    }

    fn give_back(&mut self, filled: Filled) -> Result<(), SourceError> {
        self.driver
            .requeue(filled)
            .map_err(|why| SourceError::of_camera(&self.device, "to take a buffer back", why))
    }

    fn convert(&mut self, filled: &Filled, into: &mut Picture) -> Result<(), SourceError> {
        let Layout {
            width,
            height,
            stride,
            format,
            ..
        } = self.layout;
        let buffer = self.driver.bytes(filled);
        let bytes = buffer.get(..filled.bytes).unwrap_or(buffer);
        if matches!(format, MJPG | JPEG) {
            self.jpeg.decode(&self.info.name, bytes, into)?;
            // Of another size where the driver changed it: live, that is no error.
            return Ok(());
        }
        let (columns, rows) = (width as usize, height as usize);
        let short = || SourceError::Malformed {
            name: self.info.name.clone(),
            why: format!(
                "a picture of {width} x {height} comes in {} bytes",
                bytes.len()
            ),
        };
        into.resize(width, height);
        let row_of = |row: usize, length: usize| {
            bytes
                .get(row * stride..row * stride + length)
                .ok_or_else(short)
        };
        for (row, rgb) in into.rgb.chunks_exact_mut(3 * columns).enumerate() {
            match format {
                YUYV => {
                    // The last of an odd number of pixels has its colour in the pair's other half.
                    self.conversion.row_yuyv(
                        row_of(row, (2 * columns).next_multiple_of(4).min(stride))?,
                        rgb,
                    );
                }
                NV12 => {
                    let chroma = row_of(rows + row / 2, columns.next_multiple_of(2).min(stride))?;
                    self.conversion.row_nv12(row_of(row, columns)?, chroma, rgb);
                }
                _ => rgb.copy_from_slice(row_of(row, 3 * columns)?),
            }
        }
        Ok(())
    }
}

/// The mode that costs least: a picture of the wrong size is worth less, a low rate is worth still less, and among equals those
/// formats are taken that are converted quickest.
fn choose(modes: &[Mode], (width, height): (u32, u32), rate_hz: f64) -> Option<Mode> {
    let cost = |mode: &Mode| {
        let work = match mode.format {
            NV12 => 0.0,
            YUYV => 0.001,
            RGB3 => 0.002,
            MJPG | JPEG => 0.05,
            _ => return None,
        };
        let ratio = |a: u32, b: u32| (f64::from(a.max(1)) / f64::from(b.max(1))).ln().abs();
        let slow = (rate_hz / mode.fastest_hz.unwrap_or(rate_hz).max(0.1))
            .ln()
            .max(0.0);
        // A camera's 29.97 Hz are 30.
        let slow = if slow < 0.01 { 0.0 } else { 2.0 * slow };
        Some(work + ratio(mode.width, width) + ratio(mode.height, height) + slow)
    };
    let costs = modes.iter().filter_map(|mode| Some((cost(mode)?, mode)));
    costs
        .min_by(|(a, _), (b, _)| a.total_cmp(b))
        .map(|(_, mode)| *mode)
}

impl<D: Driver> Source for Camera<D> {
    fn info(&self) -> &SourceInfo {
        &self.info
    }

    fn next(&mut self, into: &mut Picture) -> Result<bool, SourceError> {
        let mut damaged = 0;
        loop {
            let filled = self.newest()?;
            let read = Instant::now();
            let converted = self.convert(&filled, into);
            let at = filled.at.unwrap_or(read);
            self.give_back(filled)?;
            if let Err(why) = converted {
                damaged += 1;
                if damaged == MOST_DAMAGED {
                    return Err(why);
                }
                log::debug!("{why}");
                continue;
            }
            into.at = at;
            let first = *self.first_at.get_or_insert(into.at);
            self.seconds = self
                .seconds
                .max(into.at.saturating_duration_since(first).as_secs_f64());
            into.seconds = self.seconds;
            into.number = self.number;
            return Ok(true);
        }
    }
}

#[cfg(test)]
mod tests;
