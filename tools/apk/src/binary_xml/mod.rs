//! Binary XML: what a manifest's or an icon's text becomes.

mod attribute;
mod compile;
mod table;
mod value;

pub(crate) use attribute::{BOOLEAN, COLOR, INTEGER};
pub(crate) use compile::compile;
pub(crate) use value::{Resolve, Typed, Value, parse_plain, reference};
