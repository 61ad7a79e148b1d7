//! Resources: a folder `res/` as Android developers lay it out, and the table (`resources.arsc`) by which they are found.

mod config;
mod folder;
mod table;
mod values;

pub(crate) use folder::Resources;
pub(crate) use table::PACKAGE_NAME_UNITS;
