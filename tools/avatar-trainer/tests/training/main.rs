//! Small people learnt from small captures.

mod broken;
mod fuzzed;
mod overfit;
mod perceptual;
mod repeated;
mod studio;
mod vulkan;
