//! Where pictures come from: a camera, a video file or an address, a folder of pictures, or standard input, behind one trait.
//!
//! [`open`] gives every picture of a recording, and the newest one of a camera or a live address. [`open_live`] makes any of
//! them behave as a camera does: a recording plays at its own rate, and what the caller is too late for is left out:
//! [`Picture::number`] counts it.
//!
//! A recording that breaks off in the middle ends there, with a warning in the log; one without a whole picture is an error.

mod ahead;
mod camera;
mod choice;
mod colour;
mod driver;
mod error;
mod ffmpeg;
mod folder;
mod jpeg;
mod nut;
mod paced;
mod picture;
#[cfg(all(target_os = "linux", target_pointer_width = "64"))]
mod v4l2;
mod y4m;

use std::fs::File;
use std::io::{self, BufRead, BufReader, stdin};
use std::path::Path;
use std::sync::mpsc::sync_channel;
use std::thread::Builder;
use std::time::Duration;

pub use choice::SourceChoice;
pub use error::SourceError;
pub use ffmpeg::find_ffmpeg;
pub use picture::{LARGEST_SIDE, Picture, Source, SourceInfo};

use ahead::{Ahead, Keep};

/// Pictures that are read ahead of the one being worked on.
const READ_AHEAD: usize = 2;

/// From the start of ffmpeg, or of what is piped to us, to the first picture's size: an address has to answer, and a large file may
/// have its index at its end.
const LONGEST_START: Duration = Duration::from_secs(30);
/// Without a picture of an address, a pipe or a recording that is read ahead.
const LONGEST_SILENCE: Duration = Duration::from_secs(20);

/// Why there is no picture in a file or a pipe of no bytes.
const EMPTY: &str = "it is empty";

/// The start of a y4m file.
const Y4M_SIGNATURE: &[u8] = b"YUV4MPEG2";

/// Opens what was chosen. Recordings give every picture, as fast as they are asked for; cameras and live addresses the newest.
///
/// # Errors
/// Where there is nothing to open, or no picture in it; the message says what to do.
pub fn open(choice: &SourceChoice) -> Result<Box<dyn Source>, SourceError> {
    opened(choice, false)
}

/// `changing_size` says whether a stream of pictures may change their size: live, it goes on with the new one; of a recording that is an
/// error.
fn opened(choice: &SourceChoice, changing_size: bool) -> Result<Box<dyn Source>, SourceError> {
    Ok(match choice {
        SourceChoice::Device(device) => camera::open(device)?,
        SourceChoice::Stdin => standard_input(changing_size)?,
        SourceChoice::Folder(folder) => Box::new(folder::Folder::open(folder)?),
        SourceChoice::Y4m(path) => Box::new(y4m::Y4m::open(name_of(path), reader(path)?)?),
        SourceChoice::MotionJpeg(path) => Box::new(jpeg::MotionJpeg::open(
            name_of(path),
            reader(path)?,
            changing_size,
        )?),
        SourceChoice::File(path) => {
            // Says what is wrong with the file in our words, before another program is looked for.
            reader(path)?;
            Box::new(ffmpeg::Decoded::open(ffmpeg::Input::file(path))?)
        }
        SourceChoice::Url(url) => Box::new(ffmpeg::Decoded::open(ffmpeg::Input::url(url))?),
    })
}

/// Opens what was chosen as if it were a camera: a recording plays at its own rate, over and over where `repeat` is set, and
/// of standard input only the newest picture is kept.
///
/// # Errors
/// As [`open`].
pub fn open_live(choice: &SourceChoice, repeat: bool) -> Result<Box<dyn Source>, SourceError> {
    if choice.is_live() {
        return opened(choice, true);
    }
    if *choice == SourceChoice::Stdin {
        return Ok(Box::new(Ahead::over(
            opened_in_time("standard input", LONGEST_START, || standard_input(true))?,
            Keep::Newest,
        )?));
    }
    let choice = choice.clone();
    let again = move || -> Result<Box<dyn Source>, SourceError> {
        let source = opened(&choice, true)?;
        Ok(match choice {
            // These have a thread of their own already.
            SourceChoice::File(_) | SourceChoice::Url(_) => source,
            _ => Box::new(Ahead::over(source, Keep::Every(READ_AHEAD))?),
        })
    };
    Ok(Box::new(paced::Paced::open(Box::new(again), repeat)?))
}

/// Opens in a thread of its own what may wait for ever. A thread that does is left to itself.
fn opened_in_time(
    name: &str,
    patience: Duration,
    open: impl FnOnce() -> Result<Box<dyn Source>, SourceError> + Send + 'static,
) -> Result<Box<dyn Source>, SourceError> {
    let (tell, told) = sync_channel(1);
    Builder::new()
        .name("opening".to_owned())
        .spawn(move || {
            // The other side may have given up.
            let _ = tell.send(open());
        })
        .map_err(|source| SourceError::Thread {
            name: name.to_owned(),
            source,
        })?;
    told.recv_timeout(patience).unwrap_or_else(|_| {
        Err(SourceError::Silent {
            name: name.to_owned(),
            seconds: patience.as_secs(),
        })
    })
}

/// y4m or motion JPEG, told apart by its first bytes.
fn standard_input(changing_size: bool) -> Result<Box<dyn Source>, SourceError> {
    let name = "standard input".to_owned();
    let mut input = BufReader::new(stdin());
    let start = input.fill_buf().map_err(|source| SourceError::Read {
        name: name.clone(),
        source,
    })?;
    // A pipe's first piece may be short.
    let compared = start.len().min(Y4M_SIGNATURE.len());
    if compared > 0 && start[..compared] == Y4M_SIGNATURE[..compared] {
        Ok(Box::new(y4m::Y4m::open(name, input)?))
    } else if start.first() == Some(&0xff) {
        Ok(Box::new(jpeg::MotionJpeg::open(
            name,
            input,
            changing_size,
        )?))
    } else if start.is_empty() {
        Err(SourceError::NoPicture {
            name,
            why: EMPTY.to_owned(),
        })
    } else {
        Err(SourceError::Malformed {
            name,
            why: "it is neither y4m nor motion JPEG: convert it, as with `ffmpeg -i VIDEO -f yuv4mpegpipe - | ...`".to_owned(),
        })
    }
}

fn name_of(path: &Path) -> String {
    path.display().to_string()
}

fn reader(path: &Path) -> Result<BufReader<File>, SourceError> {
    let refused = |source: io::Error| match source.kind() {
        io::ErrorKind::NotFound => SourceError::NotThere {
            name: name_of(path),
        },
        _ => SourceError::Read {
            name: name_of(path),
            source,
        },
    };
    let file = File::open(path).map_err(refused)?;
    let found = file.metadata().map_err(refused)?;
    if found.is_dir() {
        return Err(refused(io::ErrorKind::IsADirectory.into()));
    }
    // A pipe's length is not known.
    if found.is_file() && found.len() == 0 {
        return Err(SourceError::NoPicture {
            name: name_of(path),
            why: EMPTY.to_owned(),
        });
    }
    Ok(BufReader::with_capacity(1 << 16, file))
}
