//! A camera as a source of motion: pictures, networks for body, hands and face, and the fit of what they saw.

pub mod source;
