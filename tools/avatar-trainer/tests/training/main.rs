//! Small people learnt from small captures.

mod broken;
mod exported;
mod far;
mod overfit;
mod repeated;
mod studio;
