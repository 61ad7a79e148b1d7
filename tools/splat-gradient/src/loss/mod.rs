//! Photometric losses with their derivatives: the L1 and SSIM terms of the paper's section IV-C, and the interface of its LPIPS term.
//!
//! Pictures are compared premultiplied, as if both stood before black: so the background of a capture is nothing but alpha 0. Each
//! returns its loss as a mean over pixels and adds `share` times its derivatives by the drawn picture's numbers to
//! `by_pixel`; so terms are summed by calling one after the other.

mod l1;
mod perceptual;
mod ssim;
mod target;

pub use l1::{alpha_l1, colour_l1};
pub use perceptual::PerceptualLoss;
pub use ssim::Ssim;
pub use target::Target;
