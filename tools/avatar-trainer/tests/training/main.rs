//! Small people learnt from small captures.

mod broken;
mod far;
mod fuzzed;
mod overfit;
mod repeated;
mod studio;
