//! Scenes and cameras read from files: written by other programs, by the writers here, and damaged in every way.

mod cameras;
mod damage;
mod expected;
mod harmonics;
mod mutations;
mod real_scene;
mod round_trips;
mod third_party;
mod writers;
