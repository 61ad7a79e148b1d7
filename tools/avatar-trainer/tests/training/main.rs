//! Small people learnt from small captures.

mod broken;
mod exported;
mod overfit;
mod repeated;
mod studio;
