//! The lines below the preview: how fast, how late, and what is not seen.

use crate::notice::Notice;
use motion_fit::Fitted;
use std::collections::VecDeque;
use std::time::Instant;

/// Below this, what the fit knows of a hand or a face is from a while ago.
const LOST: f32 = 0.2;
/// Pictures that the figures are of.
const RECENT: usize = 30;

/// Of the last pictures.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub(crate) struct Pace {
    /// Motions a second.
    pub(crate) rate_hz: f64,
    /// From the light to the motion, the median, milliseconds.
    pub(crate) latency_ms: f64,
}

/// Measures the last pictures.
#[derive(Debug, Default)]
pub(crate) struct PaceMeter {
    recent: VecDeque<(Instant, f64)>,
}

impl PaceMeter {
    /// Takes a picture whose motion was there at `done`, so many milliseconds after its light.
    pub(crate) fn count(&mut self, done: Instant, latency_ms: f64) {
        if self.recent.len() == RECENT {
            self.recent.pop_front();
        }
        self.recent.push_back((done, latency_ms));
    }

    /// The figures; zeros before two pictures.
    pub(crate) fn pace(&self) -> Pace {
        let (Some(first), Some(last)) = (self.recent.front(), self.recent.back()) else {
            return Pace::default();
        };
        let seconds = last.0.saturating_duration_since(first.0).as_secs_f64();
        let mut latencies: Vec<f64> = self.recent.iter().map(|(_, ms)| *ms).collect();
        latencies.sort_by(f64::total_cmp);
        Pace {
            rate_hz: if seconds > 0.0 {
                (self.recent.len() - 1) as f64 / seconds
            } else {
                0.0
            },
            latency_ms: latencies.get(latencies.len() / 2).copied().unwrap_or(0.0),
        }
    }
}

/// The figures, when the preview has left out so many pictures.
pub(crate) fn figures(pace: Pace, dropped: u64) -> String {
    let Pace {
        rate_hz,
        latency_ms,
    } = pace;
    let mut line = format!("{rate_hz:.0} Hz | {latency_ms:.0} ms to motion");
    if dropped > 0 {
        line += &format!(" | {dropped} not shown");
    }
    line
}

/// What is not seen; empty where all is.
pub(crate) fn lacking(fitted: &Fitted, notice: Option<Notice>) -> String {
    unseen(fitted, notice).join(" | ")
}

fn unseen(fitted: &Fitted, notice: Option<Notice>) -> Vec<String> {
    match notice {
        Some(notice @ Notice::Several(_)) => {
            let mut all = vec![notice.short()];
            all.extend(unseen(fitted, None));
            all
        }
        Some(notice) => vec![notice.short()],
        None if !fitted.sees_person => vec!["no person".to_owned()],
        None => {
            let hands = match fitted.hands.map(|sure| sure < LOST) {
                [true, true] => Some("no hands"),
                [true, false] => Some("no left hand"),
                [false, true] => Some("no right hand"),
                [false, false] => None,
            };
            let face = (fitted.face < LOST).then_some("no face");
            [hands, face]
                .into_iter()
                .flatten()
                .map(str::to_owned)
                .collect()
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::Affine3A;
    use spmm3::MotionParams;
    use std::time::Duration;

    fn fitted(sees_person: bool, hands: [f32; 2], face: f32) -> Fitted {
        Fitted {
            motion: MotionParams::default(),
            camera_from_room: Affine3A::IDENTITY,
            sees_person,
            limbs: [1.0; 6],
            hands,
            face,
            reprojection_px: 0.0,
            swapped: false,
        }
    }

    #[test]
    fn the_lines_name_what_is_not_seen_and_only_that() {
        assert_eq!(
            lacking(&fitted(true, [0.9; 2], 0.9), None),
            "",
            "all is seen"
        );
        for (seen, notice, named) in [
            (fitted(true, [0.0; 2], 0.9), None, "no hands"),
            (
                fitted(true, [0.9, 0.1], 0.0),
                None,
                "no right hand | no face",
            ),
            (fitted(false, [0.0; 2], 0.0), None, "no person"),
            (fitted(false, [0.0; 2], 0.0), Some(Notice::Dark), "dark"),
            (
                fitted(true, [0.0, 0.9], 0.9),
                Some(Notice::Several(2)),
                "2 people | no left hand",
            ),
        ] {
            assert_eq!(lacking(&seen, notice), named);
        }
        let pace = Pace {
            rate_hz: 29.6,
            latency_ms: 33.7,
        };
        assert_eq!(figures(pace, 0), "30 Hz | 34 ms to motion");
        assert_eq!(figures(pace, 7), "30 Hz | 34 ms to motion | 7 not shown");
    }

    #[test]
    fn the_pace_is_of_the_last_second_or_so() {
        let mut meter = PaceMeter::default();
        assert_eq!(meter.pace(), Pace::default(), "nothing yet");
        let begun = Instant::now();
        // A slow start is forgotten.
        for k in 0..10u32 {
            meter.count(begun + Duration::from_millis(500) * k, 400.0);
        }
        for k in 0..40u32 {
            meter.count(
                begun + Duration::from_secs(5) + Duration::from_millis(40) * k,
                20.0,
            );
        }
        let Pace {
            rate_hz,
            latency_ms,
        } = meter.pace();
        assert!(
            (rate_hz - 25.0).abs() < 1e-6 && latency_ms == 20.0,
            "{rate_hz} {latency_ms}"
        );
    }
}
