//! What moves or was never seen: face, hands, and the places that no view showed.

mod harmonic;
mod lines;
