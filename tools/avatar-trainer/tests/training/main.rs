//! Small people learnt from small captures.

mod broken;
mod fuzzed;
mod overfit;
mod repeated;
mod studio;
mod vulkan;
