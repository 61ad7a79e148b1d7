//! One file per sub-command.

pub mod bake;
pub(crate) mod budget;
pub(crate) mod call;
pub(crate) mod demo;
pub(crate) mod doctor;
pub(crate) mod inspect;
pub(crate) mod keys;
pub(crate) mod licences;
pub(crate) mod profile;
pub(crate) mod receive;
pub(crate) mod render;
pub(crate) mod rig;
pub mod send;
mod send_memory;
pub mod serve;
pub(crate) mod track;

use crate::device_options::DeviceOptions;

/// A sub-command and its options.
#[derive(Debug, clap::Subcommand)]
pub enum Command {
    /// Hold a call on this machine with the demo avatar, baked if needed; leaves pictures and times
    Demo(demo::Options),
    /// Build the demo avatar's package from MakeHuman's data
    Bake(bake::Options),
    /// Make an avatar of one splat scan of a person
    Rig(rig::Options),
    /// Show what is in an avatar package or a Gaussian scene
    Inspect(inspect::Options),
    /// Predict what pictures of avatars will take on a headset
    Budget(budget::Options),
    /// Draw an avatar that follows a motion, a Gaussian scene, or both together
    Render(render::Options),
    /// Run the server that introduces callers and keeps avatars
    Serve(serve::Options),
    /// Talk with someone: both are seen and heard
    Call(Box<call::Options>),
    /// Say what this machine has for calls, and whether and by which way others can reach it
    Doctor(doctor::Options),
    /// Show your key, and say who may drive your avatars
    Keys(keys::Options),
    /// Say what this program is made of, and under which licences
    Licences,
    /// Send what a camera sees a person do, or a motion from a file, to everyone who joins
    Send(Box<send::Options>),
    /// Join a call and show who is there
    Receive(receive::Options),
    /// Show where a call's milliseconds go: what each unit does, and each picture's way from capture to display
    Profile(profile::Options),
    /// Write the motion of the person in a video into a file
    Track(track::Options),
}

impl Command {
    /// Runs it.
    ///
    /// # Errors
    /// What failed, why, and what to do.
    pub fn run(&self, device: &DeviceOptions) -> anyhow::Result<()> {
        match self {
            Self::Demo(options) => demo::run(options, device),
            Self::Bake(options) => bake::run(options, device),
            Self::Rig(options) => rig::run(options, device),
            Self::Inspect(options) => inspect::run(options),
            Self::Budget(options) => budget::run(options, device),
            Self::Render(options) => render::run(options, device),
            Self::Serve(options) => serve::run(options),
            Self::Call(options) => call::run(options, device),
            Self::Doctor(options) => doctor::run(options, device),
            Self::Keys(options) => keys::run(options),
            Self::Licences => {
                licences::run();
                Ok(())
            }
            Self::Send(options) => send::run(options, device),
            Self::Receive(options) => receive::run(options, device),
            Self::Profile(options) => profile::run(options, device),
            Self::Track(options) => track::run(options, device),
        }
    }
}
