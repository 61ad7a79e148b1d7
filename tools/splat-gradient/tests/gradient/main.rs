//! The splatter against f64 references and the renderer, its derivatives against finite differences, and what a trainer relies on.

mod attributes;
mod broken;
mod losses;
mod opaque;
mod overfit;
mod pictures;
mod reference;
mod scenes;
mod threads;
