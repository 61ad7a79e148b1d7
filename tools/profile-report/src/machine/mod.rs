//! How hot the machine is and how fast it runs while something is measured: temperatures, clocks, levels, at regular times.
//!
//! A [`Sampler`] is a place to read them from ([`Sysfs`] on Linux and Android; a headset's runtime may be another). A [`Watch`] asks
//! samplers from a thread of its own and leaves [`MachineFigures`]. What cannot be read is listed with the reason.

mod figures;
mod sysfs;
mod watch;

pub use figures::{Absent, Channel, MachineFigures, Quantity, Series};
pub use sysfs::Sysfs;
pub use watch::{EVERY, Watch};

/// A place that tells of the machine's state. What it can tell is settled when it is made.
pub trait Sampler: Send {
    /// What it tells.
    fn channels(&self) -> &[Channel];

    /// What it would tell but cannot, and why.
    fn absent(&self) -> &[Absent];

    /// Now, for each of the channels in their order; nothing for what cannot be read this time.
    fn sample(&mut self, values: &mut Vec<Option<f64>>);
}
