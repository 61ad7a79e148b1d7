//! The line that says how a training goes.

use super::length::Clock;
use avatar_trainer::StepReport;
use std::io::{IsTerminal, Write};
use std::time::{Duration, Instant};

/// Steps' figures are means over about so many.
const MEMORY: f64 = 200.0;

/// One line, written over on a terminal, said again every ten seconds elsewhere.
#[derive(Debug)]
pub(super) struct ProgressLine {
    terminal: bool,
    told: Option<Instant>,
    loss: Option<f64>,
    psnr: f64,
    validated: Option<f64>,
    in_package: Option<f64>,
    steps_here: u64,
}

impl ProgressLine {
    pub(super) fn new() -> Self {
        Self {
            terminal: std::io::stderr().is_terminal(),
            told: None,
            loss: None,
            psnr: 0.0,
            validated: None,
            in_package: None,
            steps_here: 0,
        }
    }

    /// A step was made.
    pub(super) fn stepped(&mut self, report: &StepReport, clock: &Clock, steps: u64) {
        self.steps_here += 1;
        let share = 1.0 / MEMORY;
        match &mut self.loss {
            Some(loss) => {
                *loss += share * (report.loss - *loss);
                self.psnr += share * (report.psnr - self.psnr);
            }
            None => (self.loss, self.psnr) = (Some(report.loss), report.psnr),
        }
        let every = Duration::from_secs(if self.terminal { 1 } else { 10 });
        if self.told.is_some_and(|told| told.elapsed() < every) {
            return;
        }
        self.told = Some(Instant::now());
        let left = clock
            .left(steps, self.steps_here)
            .map_or_else(String::new, |seconds| format!(", {} left", spoken(seconds)));
        let held_back = match (self.validated, self.in_package) {
            (Some(now), Some(package)) => {
                format!(", held back {now:.2} dB (in the package {package:.2})")
            }
            _ => String::new(),
        };
        let text = format!(
            "step {steps}: loss {:.4}, {:.2} dB{held_back}, {} Gaussians, {:.1} steps/s{left}",
            self.loss.unwrap_or_default(),
            self.psnr,
            report.gaussians,
            self.rate(clock)
        );
        self.say(&text);
    }

    #[expect(clippy::cast_precision_loss, reason = "counts of steps")]
    fn rate(&self, clock: &Clock) -> f64 {
        self.steps_here as f64 / clock.used_here().max(1e-3)
    }

    /// Pictures that were held back were looked at; how well the package meets them, if that is known.
    pub(super) fn validated(&mut self, psnr: f64, in_package: Option<f64>) {
        self.validated = Some(psnr);
        self.in_package = in_package;
    }

    fn say(&self, text: &str) {
        if self.terminal {
            eprint!("\r\x1b[2K{text}");
            // A line that cannot be flushed is shown later.
            let _ = std::io::stderr().flush();
        } else {
            eprintln!("{text}");
        }
    }

    /// Ends the line.
    pub(super) fn finish(&self) {
        if self.terminal {
            eprintln!();
        }
    }
}

/// Seconds as people say them.
fn spoken(seconds: f64) -> String {
    if seconds < 90.0 {
        format!("{seconds:.0} s")
    } else {
        format!("{:.0} min", seconds / 60.0)
    }
}
