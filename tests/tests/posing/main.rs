//! Posing on the device against f64 references, and against the same picture posed on the CPU.

mod binding;
mod interpolation;
mod networks;
mod person;
mod pictures;
mod ring;
