//! The measured state of the machine, with the names of the JSON.

use super::Sampler;
use serde::Serialize;

/// The quantity of a channel.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Quantity {
    /// Degrees Celsius.
    Temperature,
    /// A CPU's clock, MHz.
    CpuClock,
    /// The GPU's clock, MHz.
    GpuClock,
    /// Share of the time the GPU is busy, percent.
    GpuBusy,
    /// Heat as a share of what makes the system throttle the device severely, percent.
    Headroom,
    /// A level on its driver's own scale: of throttling, of power, of a thermal warning.
    Level,
}

impl Quantity {
    /// The unit of its numbers.
    #[must_use]
    pub fn unit(self) -> &'static str {
        match self {
            Self::Temperature => "°C",
            Self::CpuClock | Self::GpuClock => "MHz",
            Self::GpuBusy | Self::Headroom => "%",
            Self::Level => "",
        }
    }
}

/// One quantity that a sampler reads.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Channel {
    /// Unlike any other's of the sampler.
    pub name: String,
    /// Its quantity.
    pub quantity: Quantity,
}

/// A quantity that cannot be read on this machine.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Absent {
    /// The quantity.
    pub what: String,
    /// Why there is none.
    pub why: String,
}

/// A channel's numbers through the measured time.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Series {
    /// Which channel.
    #[serde(flatten)]
    pub channel: Channel,
    /// The unit.
    pub unit: &'static str,
    /// At each of [`MachineFigures::at_s`]; nothing where it could not be read.
    pub values: Vec<Option<f64>>,
    /// The least, mean and most of them.
    pub least: f64,
    /// See [`Self::least`].
    pub mean: f64,
    /// See [`Self::least`].
    pub most: f64,
}

/// The machine's state through the measured time.
#[derive(Debug, Clone, PartialEq, Default, Serialize)]
pub struct MachineFigures {
    /// Seconds since the measuring began.
    pub at_s: Vec<f64>,
    /// What was read at these times.
    pub series: Vec<Series>,
    /// The quantities that cannot be read.
    pub absent: Vec<Absent>,
}

impl MachineFigures {
    /// Of samples taken by `samplers`: seconds, and all their channels' values one after the other.
    pub(super) fn new(samplers: &[Box<dyn Sampler>], samples: &[(f64, Vec<Option<f64>>)]) -> Self {
        let mut absent: Vec<Absent> = samplers
            .iter()
            .flat_map(|one| one.absent().iter().cloned())
            .collect();
        let mut series = Vec::new();
        let channels = samplers.iter().flat_map(|one| one.channels());
        for (k, channel) in channels.enumerate() {
            let values: Vec<Option<f64>> = samples
                .iter()
                .map(|(_, values)| values.get(k).copied().flatten())
                .collect();
            let read: Vec<f64> = values.iter().flatten().copied().collect();
            if read.is_empty() {
                absent.push(Absent {
                    what: channel.name.clone(),
                    why: "it could not be read during the measuring".to_owned(),
                });
                continue;
            }
            series.push(Series {
                unit: channel.quantity.unit(),
                channel: channel.clone(),
                least: read.iter().copied().fold(f64::INFINITY, f64::min),
                mean: read.iter().sum::<f64>() / read.len() as f64,
                most: read.iter().copied().fold(f64::NEG_INFINITY, f64::max),
                values,
            });
        }
        Self {
            at_s: samples.iter().map(|(at, _)| *at).collect(),
            series,
            absent,
        }
    }

    /// In lines of at most 110 columns: of each quantity the range, and the channel with the most; and what cannot be read.
    pub(crate) fn lines(&self) -> Vec<String> {
        let mut said = Vec::new();
        for (quantity, what) in [
            (Quantity::Temperature, "hottest"),
            (Quantity::CpuClock, "CPU clocks"),
            (Quantity::GpuClock, "GPU clock"),
            (Quantity::GpuBusy, "GPU busy"),
            (Quantity::Headroom, "heat"),
            (Quantity::Level, "levels"),
        ] {
            let its = || {
                self.series
                    .iter()
                    .filter(|one| one.channel.quantity == quantity)
            };
            let Some(top) = its().max_by(|a, b| a.most.total_cmp(&b.most)) else {
                continue;
            };
            let unit = quantity.unit();
            said.push(match quantity {
                Quantity::Headroom => format!(
                    "{what} {:.0} to {:.0} {unit} of severe throttling's",
                    top.least, top.most
                ),
                Quantity::Temperature => format!(
                    "{what} {}, {:.0} to {:.0} {unit}",
                    top.channel.name, top.least, top.most
                ),
                Quantity::Level => {
                    let levels: Vec<String> = its()
                        .map(|one| format!("{} {} to {}", one.channel.name, one.least, one.most))
                        .collect();
                    format!("{what}: {}", levels.join(", "))
                }
                _ => {
                    let least = its().map(|one| one.least).fold(f64::INFINITY, f64::min);
                    format!("{what} {least:.0} to {:.0} {unit}", top.most)
                }
            });
        }
        if !self.absent.is_empty() {
            let names: Vec<&str> = self.absent.iter().map(|one| one.what.as_str()).collect();
            said.push(format!("not readable: {}", names.join(", ")));
        }
        if said.is_empty() {
            return Vec::new();
        }
        crate::measured::headed("machine", &said.join("; "))
    }
}
