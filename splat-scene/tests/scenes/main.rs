//! Scenes and cameras read from files: written by other programs, by the writers here, and damaged ones.

mod cameras;
mod damage;
mod expected;
mod harmonics;
mod mutations;
mod real_scene;
mod round_trips;
mod sog_damage;
mod sog_writer;
mod spz4_damage;
mod spz4_writer;
mod third_party;
mod up;
mod writers;
