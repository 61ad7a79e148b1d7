//! Readings that Android gives of its own accord: what it does about the heat, and how near the device is to being throttled severely.

use super::{Absent, Channel, Quantity, Sampler};
use android_power::System;
use android_power::thermal::Thermal;
use std::time::Instant;

/// How far ahead the headroom is asked for, seconds.
const AHEAD: u8 = 10;

/// What Android says of the heat.
#[derive(Debug)]
pub struct Heat<T = Thermal> {
    source: Option<T>,
    channels: Vec<Channel>,
    absent: Vec<Absent>,
}

/// Where it is read.
trait Source: Send {
    /// 0 for none to 6 for a device that switches itself off.
    fn status(&mut self) -> Option<f64>;

    /// A share of what makes Android throttle severely.
    fn headroom(&mut self) -> Option<f64>;
}

impl Source for Thermal {
    fn status(&mut self) -> Option<f64> {
        Self::status(self).map(|status| status.level().into())
    }

    fn headroom(&mut self) -> Option<f64> {
        // It holds answers for a second, which is longer than from sample to sample.
        Self::headroom(self, AHEAD, Instant::now()).map(f64::from)
    }
}

impl Heat {
    /// Of the system that this program runs on.
    #[must_use]
    pub fn new(system: System) -> Self {
        Self::of(Thermal::open(system))
    }
}

impl<T> Heat<T> {
    fn of(source: Option<T>) -> Self {
        let channel = |name: String, quantity| Channel { name, quantity };
        let channels = vec![
            channel("thermal status".to_owned(), Quantity::Level),
            channel(
                format!("heat in {AHEAD} s, of severe throttling's"),
                Quantity::Headroom,
            ),
        ];
        let absent = |what: &Channel| Absent {
            what: what.name.clone(),
            why: "Android tells from version 11 on, and this is an older one or another system"
                .to_owned(),
        };
        Self {
            absent: match source {
                Some(_) => Vec::new(),
                None => channels.iter().map(absent).collect(),
            },
            channels: if source.is_some() {
                channels
            } else {
                Vec::new()
            },
            source,
        }
    }
}

impl<T: Source> Sampler for Heat<T> {
    fn channels(&self) -> &[Channel] {
        &self.channels
    }

    fn absent(&self) -> &[Absent] {
        &self.absent
    }

    fn sample(&mut self, values: &mut Vec<Option<f64>>) {
        if let Some(source) = &mut self.source {
            let percent = source.headroom().map(|share| share * 100.0);
            values.extend([source.status(), percent]);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    struct Warm(Option<f64>);

    impl Source for Warm {
        fn status(&mut self) -> Option<f64> {
            Some(2.0)
        }

        fn headroom(&mut self) -> Option<f64> {
            self.0
        }
    }

    #[test]
    fn status_and_headroom_are_samples_and_an_unknown_headroom_is_a_gap() {
        for (share, percent) in [(Some(0.75), Some(75.0)), (None, None)] {
            let mut heat = Heat::of(Some(Warm(share)));
            let mut values = Vec::new();
            heat.sample(&mut values);
            assert_eq!(values, [Some(2.0), percent], "{share:?}");
            assert_eq!(heat.channels().len(), values.len(), "one value each");
            assert!(heat.absent().is_empty(), "both are there");
        }
    }

    #[test]
    fn a_system_that_does_not_tell_is_reported_as_such() {
        let mut heat = Heat::new(System::default());
        let mut values = Vec::new();
        heat.sample(&mut values);
        assert!(values.is_empty() && heat.channels().is_empty(), "nothing");
        let absent: Vec<&str> = heat.absent().iter().map(|one| one.what.as_str()).collect();
        assert_eq!(
            absent,
            ["thermal status", "heat in 10 s, of severe throttling's"],
            "both"
        );
    }
}
