//! Blinks of eyes that no camera sees, at human rates.

/// The median pause between two blinks, seconds, and the deviation of its logarithm: 15 to 20 blinks a minute in conversation (Bentivoglio et al. 1997,
/// "Analysis of blink rate patterns in normal subjects"), and sometimes two soon after one another.
const PAUSE: f64 = 3.0;
const SPREAD: f64 = 0.5;
/// The shortest and the longest pause, seconds.
const PAUSES: [f64; 2] = [0.6, 12.0];
/// How long lids take to shut, stay shut, and take to open again, seconds.
const SHUTS: f64 = 0.06;
const STAYS: f64 = 0.05;
const OPENS: f64 = 0.13;

/// When eyes blink.
#[derive(Debug)]
pub struct Blinks {
    random: fastrand::Rng,
    /// When the next one begins, seconds, or the one that is under way began.
    next: f64,
}

impl Blinks {
    /// Blinks from the moment 0 on, others for each seed.
    #[must_use]
    pub fn new(seed: u64) -> Self {
        let mut blinks = Self {
            random: fastrand::Rng::with_seed(seed),
            next: 0.0,
        };
        blinks.next = blinks.pause();
        blinks
    }

    /// How shut the lids are `seconds` after the beginning, 0 to 1. Times may not go back; after a long gap no blink is made up for.
    pub fn at(&mut self, seconds: f64) -> f32 {
        let over = self.next + SHUTS + STAYS + OPENS;
        if seconds >= over {
            self.next = over.max(seconds - PAUSE) + self.pause();
            self.next = self.next.max(seconds);
        }
        let since = seconds - self.next;
        let shut = if since < 0.0 {
            0.0
        } else if since < SHUTS {
            since / SHUTS
        } else if since < SHUTS + STAYS {
            1.0
        } else {
            1.0 - (since - SHUTS - STAYS) / OPENS
        };
        #[allow(clippy::cast_possible_truncation, reason = "0 to 1")]
        let shut = shut.clamp(0.0, 1.0) as f32;
        shut * shut * (3.0 - 2.0 * shut)
    }

    /// A log-normal pause, by Box and Muller's transform.
    fn pause(&mut self) -> f64 {
        let radius = (-2.0 * (1.0 - self.random.f64()).ln()).sqrt();
        let normal = radius * (std::f64::consts::TAU * self.random.f64()).cos();
        (PAUSE * (SPREAD * normal).exp()).clamp(PAUSES[0], PAUSES[1])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn eyes_blink_15_to_20_times_a_minute_and_are_shut_for_a_tenth_of_a_second() {
        let mut blinks = Blinks::new(3);
        let (mut count, mut half_shut, mut was) = (0, 0, 0.0);
        let mut pauses: Vec<f64> = Vec::new();
        let mut last = 0.0;
        for k in 0..60 * 60 * 100 {
            let seconds = f64::from(k) / 100.0;
            let shut = blinks.at(seconds);
            if was < 0.5 && shut >= 0.5 {
                count += 1;
                pauses.push(seconds - last);
                last = seconds;
            }
            half_shut += i32::from(shut >= 0.5);
            was = shut;
        }
        let a_minute = f64::from(count) / 60.0;
        assert!((15.0..=20.0).contains(&a_minute), "{a_minute} a minute");
        let shut_ms = f64::from(half_shut) * 10.0 / f64::from(count);
        assert!((100.0..=150.0).contains(&shut_ms), "shut for {shut_ms} ms");
        pauses.sort_by(f64::total_cmp);
        let (early, late) = (pauses[count as usize / 10], pauses[count as usize * 9 / 10]);
        assert!(
            late > 2.0 * early,
            "not by the clock: {early} s and {late} s"
        );
    }

    #[test]
    fn after_a_long_gap_eyes_blink_as_before() {
        let mut blinks = Blinks::new(1);
        blinks.at(0.0);
        assert_eq!(blinks.at(5000.0), 0.0, "nothing is made up for");
        let shut = (0..1500).any(|k| blinks.at(5000.0 + f64::from(k) / 100.0) > 0.9);
        assert!(shut, "a blink within 15 s");
    }
}
