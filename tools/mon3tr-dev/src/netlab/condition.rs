//! What the network is like, from the options or from the standard list.

use anyhow::Context;
use netlab::{BitRate, Impairment, Jitter, Loss, Probability, Rate, Reordering, Trace};
use std::path::PathBuf;
use std::time::Duration;

/// Delay each way of the standard conditions that are not plain loopback.
const DELAY: Duration = Duration::from_millis(20);

/// How long a packet that is reordered is held back.
const HOLD: Duration = Duration::from_millis(30);

/// When an outage begins, and how long a call goes on after it at least.
pub(super) const OUTAGE_AT: Duration = Duration::from_secs(4);
const COMING_BACK: Duration = Duration::from_secs(8);

/// Options that shape the network. Without any, a list of conditions is gone through.
#[derive(Debug, Clone, clap::Args)]
pub(crate) struct Shape {
    /// Delay each way
    #[arg(long, value_name = "MS")]
    delay: Option<f64>,
    /// Delay varies by up to this, evenly
    #[arg(long, value_name = "MS")]
    jitter: Option<f64>,
    /// Share of packets lost, each way: 0.05 is 5 %
    #[arg(long, value_name = "SHARE")]
    loss: Option<f64>,
    /// Share of packets that come late, after those sent behind them
    #[arg(long, value_name = "SHARE")]
    reorder: Option<f64>,
    /// Share of packets that come twice
    #[arg(long, value_name = "SHARE")]
    duplicate: Option<f64>,
    /// Bottleneck from the sender to the viewer, kbit/s
    #[arg(long, value_name = "KBIT/S", conflicts_with = "trace")]
    limit: Option<f64>,
    /// The same, varying: a CSV of `ms,kbit/s`, gone through again and again
    #[arg(long, value_name = "FILE")]
    trace: Option<PathBuf>,
    /// Nothing passes for so many seconds, from 4 s into the call
    #[arg(long, value_name = "SECONDS")]
    outage: Option<f64>,
}

/// One condition.
#[derive(Debug, Clone)]
pub(super) struct Condition {
    pub(super) name: String,
    /// From the sender to the viewer.
    pub(super) down: Impairment,
    /// From the viewer to the sender.
    pub(super) up: Impairment,
    /// Taken away for so long, in mid-call.
    pub(super) outage: Option<Duration>,
}

impl Condition {
    /// How long a call of so long takes under it: long enough to come back from an outage.
    pub(super) fn seconds(&self, asked: Duration) -> Duration {
        let least = self
            .outage
            .map_or(Duration::ZERO, |outage| OUTAGE_AT + outage + COMING_BACK);
        asked.max(least)
    }
}

impl Shape {
    /// What was asked for, or the standard list.
    pub(super) fn conditions(&self) -> anyhow::Result<Vec<Condition>> {
        let asked = [
            self.delay,
            self.jitter,
            self.loss,
            self.reorder,
            self.duplicate,
            self.limit,
            self.outage,
        ];
        if asked.iter().all(Option::is_none) && self.trace.is_none() {
            return standard();
        }
        self.asked().map(|condition| vec![condition])
    }

    fn asked(&self) -> anyhow::Result<Condition> {
        let mut said = Vec::new();
        let ms = |value: f64| {
            Duration::try_from_secs_f64(value / 1e3)
                .ok()
                .filter(|time| *time <= Duration::from_secs(60))
                .with_context(|| format!("{value} ms is not a time of up to a minute"))
        };
        let mut both = Impairment::default();
        if let Some(delay) = self.delay {
            both.delay = ms(delay)?;
            said.push(format!("{delay} ms"));
        }
        if let Some(jitter) = self.jitter {
            both.jitter = Jitter::Uniform(ms(jitter)?);
            said.push(format!("±{jitter} ms"));
        }
        if let Some(loss) = self.loss {
            both.loss = Loss::Independent(Probability::new(loss)?);
            said.push(format!("{} % lost", loss * 100.0));
        }
        if let Some(reorder) = self.reorder {
            both.reordering = Reordering {
                probability: Probability::new(reorder)?,
                hold: HOLD,
            };
            said.push(format!("{} % late", reorder * 100.0));
        }
        if let Some(duplicate) = self.duplicate {
            both.duplication = Probability::new(duplicate)?;
            said.push(format!("{} % twice", duplicate * 100.0));
        }
        let mut down = both.clone();
        if let Some(limit) = self.limit {
            down.rate = Some(Rate::Steady(BitRate::from_kbit_s(limit)?));
            said.push(format!("{limit} kbit/s"));
        }
        if let Some(file) = &self.trace {
            let trace = Trace::read(file)?;
            said.push(format!("trace {}", trace.name()));
            down.rate = Some(Rate::Trace(trace.into()));
        }
        let outage = self.outage.map(|seconds| ms(seconds * 1e3)).transpose()?;
        if let Some(outage) = outage {
            said.push(format!("out for {} s", outage.as_secs_f64()));
        }
        Ok(Condition {
            name: said.join(", "),
            down,
            up: both,
            outage,
        })
    }
}

/// Loopback as it is, a good line, two bad ones and a thin one.
fn standard() -> anyhow::Result<Vec<Condition>> {
    let line = Impairment {
        delay: DELAY,
        ..Impairment::default()
    };
    let lossy = |share: f64| -> anyhow::Result<Condition> {
        let line = Impairment {
            loss: Loss::Independent(Probability::new(share)?),
            ..line.clone()
        };
        Ok(Condition {
            name: format!("20 ms, {} % lost", share * 100.0),
            down: line.clone(),
            up: line,
            outage: None,
        })
    };
    Ok(vec![
        Condition {
            name: "loopback, clean".into(),
            down: Impairment::default(),
            up: Impairment::default(),
            outage: None,
        },
        Condition {
            name: "20 ms, clean".into(),
            down: line.clone(),
            up: line.clone(),
            outage: None,
        },
        lossy(0.01)?,
        lossy(0.05)?,
        Condition {
            name: "20 ms, 0.2 Mbit/s".into(),
            down: Impairment {
                rate: Some(Rate::Steady(BitRate::from_kbit_s(200.0)?)),
                ..line.clone()
            },
            up: line,
            outage: None,
        },
    ])
}
