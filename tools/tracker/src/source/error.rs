//! What can go wrong with a source, and what its user can do about it. A text does not repeat the cause that it carries: the
//! programs print the chain of causes.

use std::io;

/// Why there are no pictures.
#[derive(Debug, thiserror::Error)]
pub enum SourceError {
    /// No such camera.
    #[error("there is no camera {device}: {present}")]
    NoDevice {
        /// The device's path.
        device: String,
        /// Which there are.
        present: String,
    },
    /// The camera is in use.
    #[error(
        "the camera {device} is in use: close the program that shows its pictures (`fuser {device}` names it)"
    )]
    Busy {
        /// The device's path.
        device: String,
    },
    /// The user may not open the camera.
    #[error(
        "the camera {device} may not be opened by this user: add the user to the group that owns it, on most systems \
         `sudo usermod -aG video $USER`, and log in again"
    )]
    NoPermission {
        /// The device's path.
        device: String,
    },
    /// Something else than a camera.
    #[error("{device} is not a camera: {why}; {present}")]
    NotACamera {
        /// The device's path.
        device: String,
        /// What it lacks.
        why: String,
        /// Which cameras there are.
        present: String,
    },
    /// The camera gives pictures in formats that are not read here.
    #[error(
        "the camera {device} gives none of YUYV, NV12, RGB3 and MJPG: it has {has}; use `ffmpeg` to convert, and a pipe of y4m"
    )]
    NoFormat {
        /// The device's path.
        device: String,
        /// The four-letter codes of its formats.
        has: String,
    },
    /// The driver refused something.
    #[error(
        "the camera {device} failed {doing}: unplug it and plug it in again, or try another size"
    )]
    Device {
        /// The device's path.
        device: String,
        /// What was tried.
        doing: &'static str,
        /// The system's answer.
        source: io::Error,
    },
    /// Cameras are read on Linux only.
    #[error(
        "the camera {device} cannot be read: only Linux's are; use a video file, or ffmpeg and a pipe of y4m"
    )]
    NoCameras {
        /// What was asked for.
        device: String,
    },
    /// No picture came for long.
    #[error(
        "{name} gave no picture for {seconds} seconds: is it unplugged, in use by another program, or the network down?"
    )]
    Silent {
        /// The source's name.
        name: String,
        /// How long it was waited for.
        seconds: u64,
    },
    /// ffmpeg is needed and not there.
    #[error(
        "{name} needs the program ffmpeg (5.1 or newer), and {looked}: install it (`apt-get install ffmpeg`, \
         `brew install ffmpeg`), or set MON3TR_FFMPEG to its path"
    )]
    NoFfmpeg {
        /// The source's name.
        name: String,
        /// Where it was looked for.
        looked: String,
    },
    /// A file in which ffmpeg finds no video.
    #[error(
        "{name} is no video that ffmpeg reads ({why}): give a video file, or a folder of PNG or JPEG pictures"
    )]
    NotAVideo {
        /// The source's name.
        name: String,
        /// What ffmpeg said.
        why: String,
    },
    /// ffmpeg could not read an address, or could not be started.
    #[error("ffmpeg cannot read {name}: {why}")]
    Ffmpeg {
        /// The source's name.
        name: String,
        /// What ffmpeg said.
        why: String,
    },
    /// No such file or folder.
    #[error(
        "there is no file or folder {name}: give a video file, or a folder of PNG or JPEG pictures"
    )]
    NotThere {
        /// The source's name.
        name: String,
    },
    /// The file, folder or pipe could not be read.
    #[error("cannot read {name}")]
    Read {
        /// The source's name.
        name: String,
        /// The system's answer.
        source: io::Error,
    },
    /// The contents are not what they should be.
    #[error("{name} cannot be used: {why}")]
    Malformed {
        /// The source's name.
        name: String,
        /// What is wrong.
        why: String,
    },
    /// Too many pixels.
    #[error(
        "{name} has pictures of {width} x {height}: at most {largest} a side are read; make it smaller"
    )]
    TooLarge {
        /// The source's name.
        name: String,
        /// In pixels.
        width: u32,
        /// In pixels.
        height: u32,
        /// The longest side that is read, in pixels.
        largest: u32,
    },
    /// A picture's size differs from the first one's.
    #[error(
        "picture {number} of {name} is {width} x {height}, the first is {first_width} x {first_height}: all must be of one size"
    )]
    SizeChanged {
        /// The source's name.
        name: String,
        /// Counted from 0.
        number: u64,
        /// In pixels.
        width: u32,
        /// In pixels.
        height: u32,
        /// In pixels.
        first_width: u32,
        /// In pixels.
        first_height: u32,
    },
    /// Nothing to see.
    #[error("there is no picture in {name}: {why}")]
    NoPicture {
        /// The source's name.
        name: String,
        /// What there is instead.
        why: String,
    },
    /// The thread that reads it panicked.
    #[error(
        "the thread that reads {name} failed, so no more pictures come: start anew, and report its message"
    )]
    Stopped {
        /// The source's name.
        name: String,
    },
    /// The system gave no thread.
    #[error("cannot start a thread to read {name}")]
    Thread {
        /// The source's name.
        name: String,
        /// The system's answer.
        source: io::Error,
    },
}

impl SourceError {
    /// Of what the system answers about the camera `device`, while doing `doing`.
    pub(super) fn of_camera(device: &str, doing: &'static str, source: io::Error) -> Self {
        let device = device.to_owned();
        match source.kind() {
            io::ErrorKind::ResourceBusy => Self::Busy { device },
            io::ErrorKind::PermissionDenied => Self::NoPermission { device },
            _ => Self::Device {
                device,
                doing,
                source,
            },
        }
    }
}
