//! The model against f64 references and the receiver, its derivatives against finite differences, and what a trainer relies on.

mod broken;
mod derivatives;
mod exchange;
mod forward;
mod losses;
mod people;
mod reference;
mod step;
mod threads;
