//! The machine's state while something is measured: temperatures, clocks, levels, at regular times.
//!
//! A [`Sampler`] is a place to read them from ([`Sysfs`] on Linux and Android, [`Heat`] on Android). A [`Watch`] reads
//! samplers from a thread of its own and leaves [`MachineFigures`]. What cannot be read is listed with the reason.

mod figures;
mod heat;
mod sysfs;
mod watch;

pub use figures::{Absent, Channel, MachineFigures, Quantity, Series};
pub use heat::Heat;
pub use sysfs::Sysfs;
pub use watch::{EVERY, Watch};

/// A source of the machine's state. Its channels are fixed when it is made.
pub trait Sampler: Send {
    /// Its channels.
    fn channels(&self) -> &[Channel];

    /// What it cannot read, and why.
    fn absent(&self) -> &[Absent];

    /// The present values, for each of the channels in their order; nothing for what cannot be read this time.
    fn sample(&mut self, values: &mut Vec<Option<f64>>);
}
