//! Things timed by turns, and the memory traffic they are held against.

use super::super::median;
use rayon::prelude::*;
use serde::Serialize;
use std::time::Instant;

/// What the CPU's kernels are meant to take at most, in times that their bytes take.
pub(super) const GOAL: f64 = 2.0;

/// Bytes that a thread copies or reads at a time.
const PIECE: usize = 1 << 18;

/// Ours against a yardstick for the same.
#[derive(Debug, Serialize)]
pub(super) struct Comparison {
    pub(super) what: String,
    /// Bytes that the yardstick reads and writes; 0 where it is not of bytes.
    pub(super) bytes: usize,
    pub(super) ours_ms: Vec<f64>,
    pub(super) yardstick: String,
    pub(super) yardstick_ms: Vec<f64>,
    pub(super) ours_median_ms: f64,
    pub(super) yardstick_median_ms: f64,
    /// Median of ours by the yardstick's ...
    pub(super) ratio: f64,
    /// ... and the most that it is meant to be.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) goal: Option<f64>,
}

impl Comparison {
    pub(super) fn new(
        (what, ours_ms): (String, Vec<f64>),
        (yardstick, yardstick_ms): (String, Vec<f64>),
        bytes: usize,
    ) -> Self {
        let (ours, its) = (median(&ours_ms), median(&yardstick_ms));
        Self {
            what,
            bytes,
            ours_ms,
            yardstick,
            yardstick_ms,
            ours_median_ms: ours,
            yardstick_median_ms: its,
            ratio: ours / its,
            goal: None,
        }
    }

    /// With the most that the ratio is meant to be.
    pub(super) fn aiming_at(self, goal: f64) -> Self {
        Self {
            goal: Some(goal),
            ..self
        }
    }

    pub(super) fn row(&self) -> Vec<String> {
        let megabytes = match self.bytes {
            0 => "-".into(),
            bytes => format!("{:.1}", bytes as f64 / 1e6),
        };
        vec![
            self.what.clone(),
            megabytes,
            format!("{:.3}", self.ours_median_ms),
            self.yardstick.clone(),
            format!("{:.3}", self.yardstick_median_ms),
            format!("{:.2}", self.ratio),
            (self.goal).map_or_else(|| "-".into(), |goal| format!("{goal:.2}")),
        ]
    }
}

/// Something to time.
pub(super) type Work<'a> = &'a mut dyn FnMut() -> anyhow::Result<()>;

/// Milliseconds of `runs` runs of each of `works`, one after the other in turns, after two that are not counted.
pub(super) fn by_turns<const N: usize>(
    runs: u32,
    mut works: [Work<'_>; N],
) -> anyhow::Result<[Vec<f64>; N]> {
    let mut samples = [const { Vec::new() }; N];
    for run in 0..runs + 2 {
        for (work, samples) in works.iter_mut().zip(&mut samples) {
            let started = Instant::now();
            work()?;
            if run >= 2 {
                samples.push(started.elapsed().as_secs_f64() * 1e3);
            }
        }
    }
    Ok(samples)
}

/// The differences of two series that were taken by turns.
pub(super) fn differences(more: &[f64], less: &[f64]) -> Vec<f64> {
    more.iter()
        .zip(less)
        .map(|(more, less)| more - less)
        .collect()
}

/// Memory to copy within: half of `bytes` is read, half written.
pub(super) struct Copying(Vec<u64>, Vec<u64>);

impl Copying {
    pub(super) fn new(bytes: usize) -> Self {
        let words = bytes / 2 / size_of::<u64>();
        Self(vec![0x3D65; words], vec![1; words])
    }

    /// As `memcpy` does it, on all of rayon's threads.
    pub(super) fn copy(&mut self) {
        let piece = PIECE / size_of::<u64>();
        self.0
            .par_chunks(piece)
            .zip(self.1.par_chunks_mut(piece))
            .for_each(|(from, to)| to.copy_from_slice(from));
        std::hint::black_box(&mut self.1);
    }
}

/// Memory to read once and, some of it, to write.
pub(super) struct Touching {
    read: Vec<u64>,
    written: Vec<u64>,
}

impl Touching {
    pub(super) fn new(read: usize, written: usize) -> Self {
        Self {
            read: vec![0x3D65; read / size_of::<u64>()],
            written: vec![1; written / size_of::<u64>()],
        }
    }

    pub(super) fn bytes(&self) -> usize {
        size_of_val(&self.read[..]) + size_of_val(&self.written[..])
    }

    /// Adds up what is read and fills what is written, on all of rayon's threads.
    pub(super) fn touch(&mut self) {
        let piece = PIECE / size_of::<u64>();
        let sum: u64 = self
            .read
            .par_chunks(piece)
            .map(|words| words.iter().fold(0u64, |sum, word| sum.wrapping_add(*word)))
            .reduce(|| 0, u64::wrapping_add);
        self.written
            .par_chunks_mut(piece)
            .for_each(|words| words.fill(sum));
        std::hint::black_box(&mut self.written);
    }
}
