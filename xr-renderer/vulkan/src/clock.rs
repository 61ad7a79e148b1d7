//! Converts the device's timestamps to the host's clock.
//!
//! Where the driver reads the device's clock on request (`VK_KHR_calibrated_timestamps`), two readings of the host's clock
//! enclose it. Everywhere, a picture's first stamp is not earlier than its submission and its last not later than its
//! fence. Each such fact is a window that the offset of the clocks lies in; they are intersected, picture after picture.

use std::sync::Arc;
use std::time::{Duration, Instant};

use crate::calibration::Calibration;
use crate::error::VulkanError;
use crate::gpu::Gpu;

/// How far two clocks run apart, as a share of the time passed: crystals are within 0.01 % of what they say.
const DRIFT: f64 = 1e-4;

/// A timestamp of the device, and what is known of its time on the host's clock.
#[derive(Debug, Clone, Copy)]
struct Sample {
    tick: u64,
    earliest: Instant,
    latest: Instant,
}

impl Sample {
    /// The device's time now, between two readings of the host's clock.
    fn now(calibration: Calibration, gpu: &Gpu) -> Result<Self, VulkanError> {
        let earliest = Instant::now();
        let tick = calibration.device_ticks(gpu.device())?;
        Ok(Self {
            tick,
            earliest,
            latest: Instant::now(),
        })
    }

    /// The same window around another moment `after` (nanoseconds) this one, earlier if negative; wider by the drift.
    fn moved(self, tick: u64, after: f64) -> Option<Self> {
        let way = Duration::from_secs_f64(after.abs() * 1e-9);
        let drift = Duration::from_secs_f64(after.abs() * 1e-9 * DRIFT);
        let [earliest, latest] = if after < 0.0 {
            [
                self.earliest.checked_sub(way)?,
                self.latest.checked_sub(way)?,
            ]
        } else {
            [
                self.earliest.checked_add(way)?,
                self.latest.checked_add(way)?,
            ]
        };
        Some(Self {
            tick,
            earliest: earliest.checked_sub(drift)?,
            latest: latest.checked_add(drift)?,
        })
    }

    /// The intersection of two windows of one moment; `newer` where they contradict one another.
    fn and(self, newer: Self) -> Self {
        let both = Self {
            tick: newer.tick,
            earliest: self.earliest.max(newer.earliest),
            latest: self.latest.min(newer.latest),
        };
        if both.earliest <= both.latest {
            both
        } else {
            newer
        }
    }
}

/// What is known of the device's clock so far.
#[derive(Debug)]
pub struct HostClock {
    gpu: Arc<Gpu>,
    calibration: Option<Calibration>,
    /// The first stamp of the last picture.
    known: Option<Sample>,
}

/// The device's timestamps on the host's clock.
#[derive(Debug, Clone, Copy)]
pub struct HostTimes<const POINTS: usize> {
    /// When the device passed each point.
    pub at: [Instant; POINTS],
    /// How far off all of them may be.
    pub within: Duration,
}

impl HostClock {
    /// Nothing is known yet.
    pub fn new(gpu: &Arc<Gpu>) -> Self {
        Self {
            gpu: Arc::clone(gpu),
            calibration: gpu.calibration,
            known: None,
        }
    }

    /// Places a picture's stamps, which lie between its submission and the moment its fence was seen.
    ///
    /// # Errors
    /// A device that fails.
    pub fn to_host<const POINTS: usize>(
        &mut self,
        ticks: [u64; POINTS],
        [submitted, finished]: [Instant; 2],
    ) -> Result<HostTimes<POINTS>, VulkanError> {
        let gpu = &self.gpu;
        let first = ticks.first().copied().unwrap_or_default();
        let last = ticks.last().copied().unwrap_or_default();
        let length = Duration::from_secs_f64(gpu.nanoseconds(first, last) * 1e-9);
        let mut now = Sample {
            tick: first,
            earliest: submitted,
            // A device that counts more time than passed is taken to have begun at the submission.
            latest: finished
                .checked_sub(length)
                .unwrap_or(submitted)
                .max(submitted),
        };
        if let Some(calibration) = self.calibration {
            let sample = Sample::now(calibration, gpu)?;
            let since = gpu.nanoseconds(first, sample.tick);
            if let Some(sample) = sample.moved(first, -since) {
                now = sample.and(now);
            }
        }
        let known = self
            .known
            .and_then(|then| then.moved(first, gpu.nanoseconds(then.tick, first)));
        let known = known.map_or(now, |known| known.and(now));
        self.known = Some(known);
        let half = (known.latest - known.earliest) / 2;
        let begin = known.earliest + half;
        let at = ticks.map(|tick| {
            let after = Duration::from_secs_f64(gpu.nanoseconds(first, tick) * 1e-9);
            (begin + after).min(finished)
        });
        Ok(HostTimes { at, within: half })
    }
}

#[cfg(test)]
mod tests {
    use ash::vk;

    use super::*;
    use crate::buffer::Buffer;
    use crate::commands::Commands;
    use crate::testing::open_gpu;
    use crate::timestamps::Timestamps;

    const MICROSECOND: Duration = Duration::from_micros(1);

    #[test]
    fn windows_intersect_widen_with_time_and_restart_on_a_contradiction() {
        let start = Instant::now() + Duration::from_secs(10);
        let window = |tick, from: u32, to: u32| Sample {
            tick,
            earliest: start + from * MICROSECOND,
            latest: start + to * MICROSECOND,
        };
        let both = window(0, 10, 50).and(window(0, 30, 90));
        assert_eq!(
            [both.earliest, both.latest],
            [start + 30 * MICROSECOND, start + 50 * MICROSECOND],
            "what both allow"
        );
        // 0.1 s on, two clocks may be 10 microseconds apart.
        let later = both.moved(7, 1e8).expect("within reach");
        assert_eq!(later.tick, 7, "the other moment");
        let past = Duration::from_millis(100);
        assert_eq!(later.earliest, start + past + 20 * MICROSECOND, "earliest");
        assert_eq!(later.latest, start + past + 60 * MICROSECOND, "latest");
        let back = both.moved(7, -1e8).expect("within reach");
        assert_eq!(back.latest + past, start + 60 * MICROSECOND, "backwards");
        let anew = both.and(window(0, 70, 80));
        assert_eq!(anew.earliest, start + 70 * MICROSECOND, "the newer one");
    }

    #[test]
    fn timestamps_agree_with_and_without_calibrated_timestamps() {
        let Some(gpu) = open_gpu() else { return };
        let mut compared = HostClock::new(&gpu);
        let mut enclosed = HostClock::new(&gpu);
        enclosed.calibration = None;
        println!("compares clocks: {}", compared.calibration.is_some());
        let buffer = Buffer::storage(&gpu, "something to fill", 1 << 20).expect("memory");
        let mut commands = Commands::new(&gpu).expect("commands");
        let Some(timestamps) = Timestamps::<2>::new(&gpu).expect("queries") else {
            println!("skipped: the device has no clock");
            return;
        };
        for _ in 0..100 {
            commands
                .run("filling", |commands| {
                    timestamps.record_reset(commands);
                    timestamps.record_point(commands, 0);
                    // SAFETY: the command buffer is being recorded; the buffer can be a copy's target.
                    unsafe {
                        let device = gpu.device();
                        device.cmd_fill_buffer(commands, buffer.handle(), 0, vk::WHOLE_SIZE, 0);
                    }
                    timestamps.record_point(commands, 1);
                })
                .expect("a filled buffer");
            let ticks = timestamps.read().expect("two stamps");
            let run = commands.last_run();
            let [one, other] = [&mut compared, &mut enclosed].map(|clock| {
                let placed = clock.to_host(ticks, run).expect("a placed picture");
                let [begin, end] = placed.at;
                assert!(
                    run[0] <= begin && begin <= end && end <= run[1],
                    "{placed:?}"
                );
                placed
            });
            let apart = one.at[0].max(other.at[0]) - one.at[0].min(other.at[0]);
            assert!(
                apart <= one.within + other.within,
                "{apart:?} apart: {one:?}, {other:?}"
            );
        }
        let within = [&compared, &enclosed].map(|clock| {
            let known = clock.known.expect("pictures were placed");
            (known.latest - known.earliest) / 2
        });
        println!("within {within:?}");
        assert_eq!(gpu.validation_messages(), 0, "validation messages");
    }
}
