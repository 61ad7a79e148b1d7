//! A figure that is not known exactly.

use serde::Serialize;
use std::fmt;
use std::ops::{Add, Div, Mul};

/// The least, the likely and the most that something may be: times in milliseconds, or rates.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Estimate {
    /// Where everything that is doubtful is for the best; of a rate, the slowest.
    pub least: f64,
    /// What is expected.
    pub likely: f64,
    /// Where everything is for the worst; of a rate, the fastest.
    pub most: f64,
}

impl Estimate {
    /// Nothing.
    pub const NONE: Self = Self::new(0.0, 0.0, 0.0);

    /// Of these three, in ascending order.
    #[must_use]
    pub const fn new(least: f64, likely: f64, most: f64) -> Self {
        Self {
            least,
            likely,
            most,
        }
    }

    /// Something that is known.
    #[must_use]
    pub const fn exactly(value: f64) -> Self {
        Self::new(value, value, value)
    }

    /// The greater one in each case: two things that a device does at once.
    #[must_use]
    pub fn or_longer(self, other: Self) -> Self {
        Self::new(
            self.least.max(other.least),
            self.likely.max(other.likely),
            self.most.max(other.most),
        )
    }
}

impl From<f64> for Estimate {
    fn from(value: f64) -> Self {
        Self::exactly(value)
    }
}

impl Add for Estimate {
    type Output = Self;

    fn add(self, other: Self) -> Self {
        Self::new(
            self.least + other.least,
            self.likely + other.likely,
            self.most + other.most,
        )
    }
}

impl std::iter::Sum for Estimate {
    fn sum<I: Iterator<Item = Self>>(all: I) -> Self {
        all.fold(Self::NONE, Add::add)
    }
}

impl Mul<f64> for Estimate {
    type Output = Self;

    fn mul(self, factor: f64) -> Self {
        Self::new(
            self.least * factor,
            self.likely * factor,
            self.most * factor,
        )
    }
}

/// An amount of work by a rate is a time: the least at the fastest rate.
impl Div for Estimate {
    type Output = Self;

    fn div(self, rate: Self) -> Self {
        Self::new(
            self.least / rate.most,
            self.likely / rate.likely,
            self.most / rate.least,
        )
    }
}

/// The likely value, and from where to where.
impl fmt::Display for Estimate {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(
            f,
            "{:.1} ({:.1} to {:.1})",
            self.likely, self.least, self.most
        )
    }
}
