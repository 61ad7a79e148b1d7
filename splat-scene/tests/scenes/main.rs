//! Scenes and cameras read from files: written by other programs, by the writers here, and damaged in every way.

mod expected;
mod harmonics;
mod real_scene;
mod third_party;
mod writers;
