//! Calls in a headset: Monado's, a real runtime, in a runtime directory of each test's own, with a head that the test moves.

mod activity;
mod auto;
mod demo;
mod gaze;
mod life;
mod losses;
mod people;
mod sight;
mod viewer;
mod wearer;
