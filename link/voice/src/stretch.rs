//! Speech made a little shorter or longer without a change of its pitch: one period is faded into its neighbour, or repeated
//! (overlap and add, as in WebRTC's NetEq).

/// Periods that are looked for, samples: 400 to 80 Hz.
const SHORTEST: usize = 120;
const LONGEST: usize = 600;
/// Samples that are compared: every other one is enough to find a period.
const STRIDE: usize = 2;

/// Removes one period from the start of `samples`; returns its length, 0 where there are too few.
pub(crate) fn shorten(samples: &mut Vec<f32>) -> usize {
    let Some(period) = period(samples) else {
        return 0;
    };
    for k in 0..period {
        let share = weight(k, period);
        samples[k] += (samples[k + period] - samples[k]) * share;
    }
    samples.drain(period..2 * period);
    period
}

/// Repeats one period at the start of `samples`; returns its length, 0 where there are too few. Allocates only where `samples` has no room
/// for it.
pub(crate) fn lengthen(samples: &mut Vec<f32>) -> usize {
    let Some(period) = period(samples) else {
        return 0;
    };
    let length = samples.len();
    samples.resize(length + period, 0.0);
    samples.copy_within(period..length, 2 * period);
    // From the end of the first period into the second, and back into its end, from where the second follows.
    for k in 0..period {
        let (first, second) = (samples[k], samples[k + 2 * period]);
        samples[k + period] = second + (first - second) * weight(k, period);
    }
    period
}

fn weight(k: usize, period: usize) -> f32 {
    (k as f32 + 0.5) / period as f32
}

/// The lag at which the start of `samples` is most like what follows it. There are twice as many samples.
fn period(samples: &[f32]) -> Option<usize> {
    let longest = LONGEST.min(samples.len() / 2);
    let alike = (SHORTEST..=longest).map(|lag| (lag, likeness(samples, lag)));
    let (best, _) = alike.max_by(|a, b| a.1.total_cmp(&b.1))?;
    Some(best)
}

/// Normalised correlation of the first half of `samples` with what is `lag` after it; 0 in silence. Windows of one length for all lags: in a
/// short one, half a period may look like the other half.
fn likeness(samples: &[f32], lag: usize) -> f32 {
    let first = samples.iter().take(samples.len() / 2);
    let after = samples.iter().skip(lag);
    let (mut cross, mut here, mut there) = (0.0f32, 0.0f32, 0.0f32);
    for (a, b) in first.zip(after).step_by(STRIDE) {
        cross += a * b;
        here += a * a;
        there += b * b;
    }
    cross / (here * there).sqrt().max(1e-9)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn voiced(hertz: f32, count: usize) -> Vec<f32> {
        // A pulse train through a resonance, as a voice is.
        let at = |k: usize| (k as f32 * hertz / 48_000.0).fract();
        (0..count)
            .map(|k| (-8.0 * at(k)).exp() * (at(k) * 40.0).sin())
            .collect()
    }

    /// The largest step between neighbours.
    fn roughest(samples: &[f32]) -> f32 {
        samples
            .windows(2)
            .map(|pair| (pair[1] - pair[0]).abs())
            .fold(0.0, f32::max)
    }

    #[test]
    fn whole_periods_are_removed_and_repeated_without_a_seam() {
        for hertz in [95.0, 140.0, 220.0, 330.0] {
            let spoken = voiced(hertz, 1_920);
            for change in [shorten, lengthen] {
                let mut changed = spoken.clone();
                let by = change(&mut changed);
                let periods = by as f32 * hertz / 48_000.0;
                assert!(
                    (periods - periods.round()).abs() < 0.04 && by > 0,
                    "{hertz} Hz: {by} samples are {periods} periods"
                );
                assert_eq!(
                    changed.len().abs_diff(spoken.len()),
                    by,
                    "{hertz} Hz: length"
                );
                assert!(
                    roughest(&changed) <= roughest(&spoken) * 1.05,
                    "{hertz} Hz: a seam"
                );
                assert_eq!(changed.last(), spoken.last(), "{hertz} Hz: the end stays");
            }
        }
    }

    #[test]
    fn too_few_samples_and_silence_are_no_trouble() {
        for count in [0, 1, 239] {
            let mut few = vec![0.5; count];
            assert_eq!(
                (shorten(&mut few), lengthen(&mut few)),
                (0, 0),
                "{count} samples"
            );
        }
        let mut silence = vec![0.0; 960];
        let by = shorten(&mut silence);
        assert!(
            by > 0 && silence.iter().all(|s| *s == 0.0),
            "{by} samples of silence"
        );
    }
}
