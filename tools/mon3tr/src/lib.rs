//! What the `mon3tr` command is made of: its sub-commands, the start that its programs share, and what `mon3tr-dev` builds on for
//! developers' and operators' own.

// First, for its macros take the place of the standard library's in all that follows.
#[macro_use]
pub mod terminal;

mod backdrop;
mod calibrate;
mod camera;
pub mod children;
pub mod commands;
mod composed;
mod controls;
pub mod device_options;
mod doorkeeper;
mod ending;
pub mod film;
mod flat;
mod gaze;
mod ground;
mod heap;
pub mod keys;
mod lanes;
mod moments;
pub mod monado;
pub mod network;
mod notice;
pub mod owner_token;
pub mod performance;
mod place;
mod preview;
pub mod program;
pub mod progress;
mod recording;
mod remembered;
pub mod report;
pub mod scenery;
pub mod secret_argument;
mod side_by_side;
pub mod size;
mod sound;
pub mod stills;
mod typed;
mod until;
pub mod up;
pub mod viewpoint;
mod voice_options;
mod window;
