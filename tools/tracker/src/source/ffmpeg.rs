//! Videos and addresses, decoded by the program ffmpeg: it writes RGB with times, as NUT, to a pipe. It turns pictures
//! upright where the video says how.

mod program;

use std::ffi::OsString;
use std::io::BufReader;
use std::mem::take;
use std::path::Path;
use std::sync::mpsc::{RecvTimeoutError, sync_channel};
use std::time::Instant;

use super::ahead::{Keep, Queue};
use super::choice::{url_is_live, user_of, without_password};
use super::error::SourceError;
use super::nut::Nut;
use super::picture::{Picture, Source, SourceInfo, within_limits};
use super::{LONGEST_SILENCE, LONGEST_START, READ_AHEAD};
use program::Running;
pub use program::find_ffmpeg;

/// What ffmpeg is to read.
#[derive(Debug)]
pub(super) struct Input {
    name: String,
    argument: OsString,
    is_file: bool,
    live: bool,
    before: &'static [&'static str],
    /// What must not be shown, and what is shown in its place.
    hidden: Vec<(String, String)>,
}

impl Input {
    /// A file, whatever its name looks like.
    pub(super) fn file(path: &Path) -> Self {
        let mut argument = OsString::from("file:");
        argument.push(path);
        Self {
            name: path.display().to_string(),
            argument,
            is_file: true,
            live: false,
            before: &[],
            hidden: Vec::new(),
        }
    }

    /// An address, whose scheme says whether it is live.
    pub(super) fn url(url: &str) -> Self {
        let live = url_is_live(url);
        Self {
            name: without_password(url),
            argument: url.into(),
            is_file: false,
            live,
            before: match (live, url.starts_with("rtsp")) {
                // UDP loses packets, which smear pictures for seconds.
                (true, true) => &[
                    "-fflags",
                    "nobuffer",
                    "-flags",
                    "low_delay",
                    "-rtsp_transport",
                    "tcp",
                ],
                (true, false) => &["-fflags", "nobuffer", "-flags", "low_delay"],
                (false, _) => &[],
            },
            // ffmpeg writes addresses out, also those that it derives from this one.
            hidden: user_of(url)
                .filter(|user| !user.is_empty())
                .map(|user| {
                    vec![
                        (url.to_owned(), without_password(url)),
                        (format!("{user}@"), String::new()),
                    ]
                })
                .unwrap_or_default(),
        }
    }
}

/// A video, decoded.
#[derive(Debug)]
pub(super) struct Decoded {
    info: SourceInfo,
    running: Running,
    queue: Queue,
    given: u64,
    ended: bool,
}

impl Decoded {
    /// Starts ffmpeg, and waits for the size of its pictures.
    pub(super) fn open(input: Input) -> Result<Self, SourceError> {
        let Input { name, live, .. } = &input;
        let (mut running, pictures) = Running::start(&input)?;
        let (tell, told) = sync_channel(1);
        let keep = if *live {
            Keep::Newest
        } else {
            Keep::Every(READ_AHEAD)
        };
        let mut begin = Some((pictures, tell));
        let mut pictures = None;
        let named = name.clone();
        let mut number = 0;
        let mut times = Times::default();
        let next = move |into: &mut Picture| {
            if let Some((pipe, tell)) = take(&mut begin) {
                let opened = Nut::open(BufReader::new(pipe));
                let size = opened
                    .as_ref()
                    .map(|nut| (nut.width, nut.height))
                    .map_err(|why| why.kind());
                // The other side may have given up.
                let _ = tell.send(size);
                pictures = opened.ok();
            }
            let Some(nut) = pictures.as_mut() else {
                return Ok(false);
            };
            within_limits(&named, nut.width, nut.height)?;
            into.resize(nut.width, nut.height);
            match nut.frame(&mut into.rgb) {
                Ok(None) => Ok(false),
                Err(why) if why.kind() == std::io::ErrorKind::UnexpectedEof => Ok(false),
                Ok(Some(seconds)) => {
                    into.at = Instant::now();
                    into.seconds = times.since_first(seconds);
                    into.number = number;
                    number += 1;
                    Ok(true)
                }
                Err(source) => Err(SourceError::Read {
                    name: named.clone(),
                    source,
                }),
            }
        };
        let queue = Queue::start(name, keep, Box::new(next))?;
        let size = told.recv_timeout(LONGEST_START);
        let (width, height) = match size {
            Ok(Ok(size)) => size,
            Ok(Err(_)) | Err(RecvTimeoutError::Disconnected) => return Err(running.failure(name)),
            Err(RecvTimeoutError::Timeout) => {
                return Err(SourceError::Silent {
                    name: name.clone(),
                    seconds: LONGEST_START.as_secs(),
                });
            }
        };
        within_limits(name, width, height)?;
        let rate_hz = running.words().rate_hz;
        Ok(Self {
            info: SourceInfo {
                name: name.clone(),
                width,
                height,
                rate_hz,
                frames: None,
            },
            running,
            queue,
            given: 0,
            ended: false,
        })
    }
}

/// The first time is 0, and none is before the one before it.
#[derive(Debug, Default)]
struct Times {
    first: Option<f64>,
    last: f64,
}

impl Times {
    fn since_first(&mut self, seconds: f64) -> f64 {
        let first = *self.first.get_or_insert(seconds);
        self.last = self.last.max(seconds - first);
        self.last
    }
}

impl Source for Decoded {
    fn info(&self) -> &SourceInfo {
        &self.info
    }

    fn next(&mut self, into: &mut Picture) -> Result<bool, SourceError> {
        if self.ended {
            return Ok(false);
        }
        self.ended = true;
        match self.queue.next(into, Some(LONGEST_SILENCE)) {
            Some(Ok(true)) => {
                self.given += 1;
                self.ended = false;
                Ok(true)
            }
            Some(Ok(false)) if self.given == 0 => Err(self.running.failure(&self.info.name)),
            Some(Ok(false)) => {
                let ended = self.running.end().is_some_and(|status| status.success());
                match (ended, self.running.words().fault()) {
                    (true, None) => {}
                    (true, Some(why)) => log::warn!(
                        "{} gave {} pictures, and has faults: {why}",
                        self.info.name,
                        self.given
                    ),
                    (false, why) => log::warn!(
                        "{} breaks off after {} pictures: {}",
                        self.info.name,
                        self.given,
                        why.as_deref().unwrap_or("ffmpeg does not say why")
                    ),
                }
                Ok(false)
            }
            Some(Err(why)) => Err(why),
            None => Err(SourceError::Silent {
                name: self.info.name.clone(),
                seconds: LONGEST_SILENCE.as_secs(),
            }),
        }
    }
}

impl Drop for Decoded {
    fn drop(&mut self) {
        self.queue.stop();
        // Its pipe ends, and with it the thread that reads it.
        self.running.kill();
        self.queue.join();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn times_start_at_zero_and_never_fall() {
        let mut times = Times::default();
        let got: Vec<f64> = [5.0, 5.5, 5.25, 6.0]
            .into_iter()
            .map(|seconds| times.since_first(seconds))
            .collect();
        assert_eq!(got, [0.0, 0.5, 0.5, 1.0], "times");
    }
}
