//! Speech with marks, as `speech.py` writes it.

use lip_sync::CLASSES;
use lip_sync::front_end::RATE;
use std::f32::consts::PI;

/// Zero crossings on each side of the resampler's sinc.
const CROSSINGS: f32 = 10.0;

/// One sentence.
#[derive(Debug)]
pub(crate) struct Utterance {
    rate: u32,
    samples: Vec<f32>,
    /// At which sample each class begins.
    marks: Vec<(usize, usize)>,
}

impl Utterance {
    /// Sound and marks at 16 kHz, as a speaker would say it whose mouth and throat are `shrink` times as long.
    pub(crate) fn at_16_khz(&self, shrink: f32) -> (Vec<f32>, Vec<(usize, usize)>) {
        let step = self.rate as f32 / RATE as f32 * shrink;
        let cut = (1.0 / step).min(1.0) * 0.95;
        let reach = CROSSINGS / cut;
        let count = (self.samples.len() as f32 / step) as usize;
        let sound = (0..count).map(|k| {
            let at = k as f32 * step;
            let from = (at - reach).max(0.0) as usize;
            let to = ((at + reach) as usize + 1).min(self.samples.len());
            let part = self.samples[from..to].iter().enumerate();
            part.map(|(j, sample)| {
                let x = (from + j) as f32 - at;
                let (turn, place) = (PI * x * cut, (x / reach).clamp(-1.0, 1.0));
                let sinc = if turn.abs() < 1e-4 {
                    1.0
                } else {
                    turn.sin() / turn
                };
                sample * cut * sinc * (0.5 + 0.5 * (PI * place).cos())
            })
            .sum()
        });
        let sound = sound.collect();
        let marks = self
            .marks
            .iter()
            .map(|(at, class)| ((*at as f32 / step) as usize, *class));
        (sound, marks.collect())
    }
}

/// The class at a sample.
pub(crate) fn class_at(marks: &[(usize, usize)], sample: usize) -> usize {
    let after = marks.partition_point(|(at, _)| *at <= sample);
    after.checked_sub(1).map_or(0, |k| marks[k].1)
}

/// Reads a corpus.
pub(crate) fn read(path: &str) -> Result<Vec<Utterance>, Box<dyn std::error::Error>> {
    let bytes = std::fs::read(path)?;
    let mut rest = bytes.as_slice();
    let mut all = Vec::new();
    while !rest.is_empty() {
        let (rate, count) = (number(&mut rest)?, number(&mut rest)? as usize);
        let samples = take(&mut rest, 2 * count)?.chunks_exact(2);
        let samples = samples.map(|s| f32::from(i16::from_le_bytes([s[0], s[1]])) / 32_768.0);
        let samples = samples.collect();
        let mut marks = Vec::new();
        for _ in 0..number(&mut rest)? {
            let at = number(&mut rest)? as usize;
            let class = usize::from(take(&mut rest, 1)?[0]);
            if class >= CLASSES.len() {
                return Err("a class that there is not".into());
            }
            marks.push((at, class));
        }
        all.push(Utterance {
            rate,
            samples,
            marks,
        });
    }
    Ok(all)
}

fn take<'a>(rest: &mut &'a [u8], count: usize) -> Result<&'a [u8], &'static str> {
    let (part, after) = rest
        .split_at_checked(count)
        .ok_or("a corpus that is cut short")?;
    *rest = after;
    Ok(part)
}

fn number(rest: &mut &[u8]) -> Result<u32, &'static str> {
    let part = take(rest, 4)?;
    Ok(u32::from_le_bytes([part[0], part[1], part[2], part[3]]))
}

/// The tests' file: per utterance u32 samples, samples of 16 kHz by the mu-law (ITU-T G.711) as u8, u32 marks, and marks as `speech.py` has them.
pub(crate) fn fixture(corpus: &[Utterance]) -> Vec<u8> {
    let mut out = Vec::new();
    for utterance in corpus {
        let (sound, marks) = utterance.at_16_khz(1.0);
        out.extend((sound.len() as u32).to_le_bytes());
        out.extend(sound.iter().map(|sample| {
            let curve = (1.0 + 255.0 * sample.abs().min(1.0)).ln() / 256f32.ln();
            (128.0 + 127.0 * curve.copysign(*sample)).round() as u8
        }));
        out.extend((marks.len() as u32).to_le_bytes());
        for (at, class) in marks {
            out.extend((at as u32).to_le_bytes());
            out.push(class as u8);
        }
    }
    out
}
