//! Posing on the device against f64 references, and against the CPU's way to the same picture.

mod binding;
mod interpolation;
mod networks;
mod person;
mod pictures;
mod ring;
