//! The splatter against f64 references and the renderer, its derivatives against finite differences, and what a trainer relies on.

mod attributes;
mod broken;
mod device;
mod losses;
mod opaque;
mod overfit;
mod pictures;
mod reference;
mod repeated;
mod scenes;
mod threads;
