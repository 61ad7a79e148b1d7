//! The program ffmpeg as a child: where it is, what it is told, what it says, and its end.

use std::ffi::{OsStr, OsString};
use std::io::{BufRead, BufReader, Read};
use std::path::PathBuf;
use std::process::{Child, ChildStdout, Command, ExitStatus, Stdio};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::thread::{Builder, JoinHandle, sleep};
use std::time::{Duration, Instant};

use super::super::ahead::join_within;
use super::super::error::SourceError;
use super::super::picture::LARGEST_SIDE;
use super::Input;

/// From the end of its output to its own.
const LONGEST_END: Duration = Duration::from_secs(2);
/// From its end to that of its words: a process that it started may hold them open.
const LONGEST_WORDS: Duration = Duration::from_secs(1);
/// Of a picture.
const MOST_PIXELS: u32 = LARGEST_SIDE * LARGEST_SIDE;
/// Of what it says, a line.
const LONGEST_LINE: u64 = 4096;
/// Of the pipe, in bytes: the system's 64 KiB are a hundredth of a picture.
#[cfg(target_os = "linux")]
const PIPE: usize = 1 << 20;

/// The program that videos are read with.
///
/// # Errors
/// [`SourceError::NoFfmpeg`], with what to do.
pub fn find_ffmpeg() -> Result<PathBuf, SourceError> {
    program("a video")
}

/// `MON3TR_FFMPEG`, or else `ffmpeg` on the `PATH`.
fn program(name: &str) -> Result<PathBuf, SourceError> {
    find(std::env::var_os("MON3TR_FFMPEG"), std::env::var_os("PATH")).map_err(|looked| {
        SourceError::NoFfmpeg {
            name: name.to_owned(),
            looked,
        }
    })
}

fn find(named: Option<OsString>, path: Option<OsString>) -> Result<PathBuf, String> {
    if let Some(named) = named.filter(|named| !named.is_empty()) {
        let named = PathBuf::from(named);
        return if named.is_file() {
            Ok(named)
        } else {
            Err(format!(
                "MON3TR_FFMPEG is {}, which is no file",
                named.display()
            ))
        };
    }
    let file = format!("ffmpeg{}", std::env::consts::EXE_SUFFIX);
    std::env::split_paths(&path.unwrap_or_default())
        .map(|folder| folder.join(&file))
        .find(|path| path.is_file())
        .ok_or_else(|| "there is none on the PATH".to_owned())
}

/// What matters of ffmpeg's words.
#[derive(Debug, Default)]
pub(super) struct Words {
    /// Of the video, where it says so.
    pub(super) rate_hz: Option<f64>,
    /// The input has been described, and the output comes.
    described: bool,
    /// The file ends before what it announces.
    cut_off: bool,
    /// The first error, which mostly is the cause of the others, and the last one.
    first: Option<String>,
    last: Option<String>,
    /// What must not be shown, and what is shown in its place.
    hidden: Vec<(String, String)>,
}

/// ffmpeg as a child: killed and waited for when it is dropped.
#[derive(Debug)]
pub(super) struct Running {
    child: Child,
    program: PathBuf,
    reads_file: bool,
    words: Arc<Mutex<Words>>,
    listener: Option<JoinHandle<()>>,
}

impl Running {
    pub(super) fn start(input: &Input) -> Result<(Self, ChildStdout), SourceError> {
        let program = program(&input.name)?;
        let mut command = Command::new(&program);
        command.args([
            "-nostdin",
            "-hide_banner",
            "-nostats",
            "-loglevel",
            "level+info",
        ]);
        // It refuses larger ones before it takes memory for them.
        command
            .args(["-max_pixels", &MOST_PIXELS.to_string()])
            .args(input.before)
            .args([OsStr::new("-i"), &input.argument]);
        // Only the first video stream, each of its pictures once, at its own time.
        command.args(["-map", "0:v:0", "-fps_mode", "passthrough"]);
        // In microseconds: without it, times are rounded to the video's mean rate.
        command.args(["-enc_time_base", "1:1000000"]);
        command.args([
            "-sws_flags",
            "bicubic+accurate_rnd+full_chroma_int",
            "-pix_fmt",
            "rgb24",
            "-c:v",
            "rawvideo",
        ]);
        command.args(["-f", "nut", "-flush_packets", "1", "pipe:1"]);
        // What it says is read by us: not in the user's language.
        command
            .env("LC_ALL", "C")
            .env_remove("FFREPORT")
            .env_remove("AV_LOG_FORCE_COLOR");
        let failed = |why: String| SourceError::Ffmpeg {
            name: input.name.clone(),
            why,
        };
        // What the terminal sends to its programs is for us: we end ffmpeg, and what it has started, by their group.
        #[cfg(unix)]
        std::os::unix::process::CommandExt::process_group(&mut command, 0);
        let mut child = command
            .stdin(Stdio::null())
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn()
            .map_err(|why| failed(format!("{} cannot be started: {why}", program.display())))?;
        let (pictures, lines) = (child.stdout.take(), child.stderr.take());
        let mut running = Self {
            child,
            program,
            reads_file: input.is_file,
            words: Arc::new(Mutex::new(Words {
                hidden: input.hidden.clone(),
                ..Words::default()
            })),
            listener: None,
        };
        let (Some(pictures), Some(lines)) = (pictures, lines) else {
            return Err(failed("its output cannot be read".to_owned()));
        };
        #[cfg(target_os = "linux")]
        if let Err(why) = rustix::pipe::fcntl_setpipe_size(&pictures, PIPE) {
            log::debug!("ffmpeg's pipe stays small: {why}");
        }
        let words = Arc::clone(&running.words);
        running.listener = Some(
            Builder::new()
                .name("ffmpeg's words".to_owned())
                .spawn(move || listen(BufReader::new(lines), &words))
                .map_err(|source| SourceError::Thread {
                    name: input.name.clone(),
                    source,
                })?,
        );
        Ok((running, pictures))
    }

    pub(super) fn words(&self) -> MutexGuard<'_, Words> {
        self.words.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// After the end of its pictures: how it ended, and all of its words. Where it does not end it is killed.
    pub(super) fn end(&mut self) -> Option<ExitStatus> {
        let begun = Instant::now();
        let mut status = self.child.try_wait().ok().flatten();
        while status.is_none() && begun.elapsed() < LONGEST_END {
            sleep(Duration::from_millis(2));
            status = self.child.try_wait().ok().flatten();
        }
        self.kill();
        status
    }

    pub(super) fn kill(&mut self) {
        // Once it was waited for, its number may be another's.
        #[cfg(unix)]
        if let Ok(None) = self.child.try_wait() {
            let group = i32::try_from(self.child.id())
                .ok()
                .and_then(rustix::process::Pid::from_raw);
            if let Some(group) = group {
                // Fails only where all of it has ended.
                let _ = rustix::process::kill_process_group(group, rustix::process::Signal::KILL);
            }
        }
        // Fails only where it has ended.
        let _ = self.child.kill();
        let _ = self.child.wait();
        if let Some(listener) = self.listener.take() {
            join_within(listener, LONGEST_WORDS);
        }
    }

    /// Why there is no picture.
    pub(super) fn failure(&mut self, name: &str) -> SourceError {
        let status = self.end();
        let words = self.words();
        if let Some(why) = words.first.as_deref().and_then(too_old) {
            return SourceError::NoFfmpeg {
                name: name.to_owned(),
                looked: format!("{} is older: {why}", self.program.display()),
            };
        }
        let name = name.to_owned();
        match words.fault() {
            Some(why) if self.reads_file => SourceError::NotAVideo { name, why },
            Some(why) => SourceError::Ffmpeg { name, why },
            None => SourceError::NoPicture {
                name,
                why: match status {
                    Some(status) if status.success() => "its video stream is empty".to_owned(),
                    // Statically linked ones crash as they look up an address.
                    Some(status) => {
                        format!(
                            "ffmpeg crashed ({status}): set MON3TR_FFMPEG to another build of it"
                        )
                    }
                    None => "ffmpeg does not end".to_owned(),
                },
            },
        }
    }
}

impl Drop for Running {
    fn drop(&mut self) {
        self.kill();
    }
}

/// What an ffmpeg says that does not know an option of ours: all of them are in 5.1.
fn too_old(words: &str) -> Option<&str> {
    (words.starts_with("Unrecognized option") || words.starts_with("Option not found"))
        .then_some(words.trim_end_matches('.'))
}

/// Keeps what matters of ffmpeg's words, until it ends.
fn listen(mut lines: impl BufRead, words: &Mutex<Words>) {
    let mut line = Vec::new();
    loop {
        line.clear();
        match (&mut lines).take(LONGEST_LINE).read_until(b'\n', &mut line) {
            Ok(0) | Err(_) => return,
            Ok(_) => words
                .lock()
                .unwrap_or_else(PoisonError::into_inner)
                .hear(&String::from_utf8_lossy(&line)),
        }
    }
}

/// How ffmpeg says that a file is not whole: of MP4, whose index stands before or after the pictures, and of Matroska and WebM.
const CUT_OFF: [&str; 3] = [
    "partial file",
    "moov atom not found",
    "File ended prematurely",
];

/// What ffmpeg puts before the cause, which it names more than once.
const BEFORE_CAUSE: [&str; 3] = [
    "Error opening input: ",
    "Error opening input files: ",
    "Error opening output files: ",
];

impl Words {
    /// What is wrong with the video as a whole, where ffmpeg says so, whether or not it read pictures.
    pub(super) fn fault(&self) -> Option<String> {
        let cause = self.cause()?;
        Some(if self.cut_off {
            format!("the file is cut off: copy or record it anew ({cause})")
        } else {
            cause
        })
    }

    /// The first and the last error; the first alone where the other says no more.
    fn cause(&self) -> Option<String> {
        let plain = |words: &str| {
            let cause = BEFORE_CAUSE
                .iter()
                .find_map(|start| words.strip_prefix(start));
            cause.unwrap_or(words).trim_end_matches('.').to_owned()
        };
        let first = plain(self.first.as_deref()?);
        match self.last.as_deref().map(plain) {
            Some(last) if !first.ends_with(&last) => Some(format!("{first}; {last}")),
            _ => Some(first),
        }
    }

    fn hear(&mut self, line: &str) {
        let line = line.trim();
        self.cut_off |= CUT_OFF.iter().any(|words| line.ends_with(words));
        let words = ["[error] ", "[fatal] ", "[panic] "]
            .iter()
            .find_map(|level| line.split_once(level));
        if let Some((_, words)) = words {
            let words = words.trim();
            if !words.is_empty() {
                let words = self
                    .hidden
                    .iter()
                    .fold(words.to_owned(), |words, (hidden, shown)| {
                        words.replace(hidden, shown)
                    });
                self.first.get_or_insert_with(|| words.clone());
                self.last = Some(words);
            }
        } else if line.contains("Output #0") || line.contains("Stream mapping:") {
            self.described = true;
        } else if !self.described && self.rate_hz.is_none() && line.contains(" Video: ") {
            self.rate_hz = line
                .split(", ")
                .find_map(|part| part.trim().strip_suffix(" fps")?.parse().ok())
                .filter(|rate: &f64| rate.is_finite() && *rate > 0.0);
        }
    }
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;

    #[test]
    fn the_program_is_the_named_one_or_the_paths() {
        let folder = tempfile::tempdir().expect("a folder");
        let there = folder
            .path()
            .join(format!("ffmpeg{}", std::env::consts::EXE_SUFFIX));
        std::fs::write(&there, "").expect("a file");
        let path = std::env::join_paths([Path::new("/nowhere"), folder.path()]).expect("a path");
        assert_eq!(
            find(None, Some(path.clone())),
            Ok(there.clone()),
            "the path's"
        );
        assert_eq!(
            find(Some("".into()), Some(path)),
            Ok(there.clone()),
            "an empty name is none"
        );
        assert_eq!(
            find(Some(there.clone().into()), None),
            Ok(there),
            "the named one"
        );
        let absent = find(Some("/nowhere/ffmpeg".into()), None).expect_err("it is not there");
        assert!(
            absent.contains("MON3TR_FFMPEG") && absent.contains("/nowhere/ffmpeg"),
            "{absent}"
        );
        let message = SourceError::NoFfmpeg {
            name: "clip.mp4".to_owned(),
            looked: find(None, None).expect_err("no path"),
        }
        .to_string();
        assert!(
            message.contains("clip.mp4") && message.contains("install"),
            "{message}"
        );
    }

    #[test]
    fn its_words_are_kept_without_the_password_of_an_address() {
        let url = "rtsp://me:pa@ss@host:554/a@b";
        let mut words = Words {
            hidden: Input::url(url).hidden,
            ..Words::default()
        };
        words.hear(&format!(
            "[in#0 @ 0x2] [error] Error opening input file {url}."
        ));
        words.hear("[tcp @ 0x3] [error] Connection to tcp://me:pa@ss@host:80?timeout=0 failed");
        assert_eq!(
            (words.first.as_deref(), words.last.as_deref()),
            (
                Some("Error opening input file rtsp://host:554/a@b."),
                Some("Connection to tcp://host:80?timeout=0 failed")
            ),
            "words"
        );
        assert!(Input::url("udp://@:5000").hidden.is_empty(), "no user");
    }

    #[test]
    fn a_file_that_is_cut_off_is_told_from_one_with_faults() {
        let fault = |lines: &[&str]| {
            let mut words = Words::default();
            lines.iter().for_each(|line| words.hear(line));
            words.fault()
        };
        assert_eq!(
            fault(&["[info] Output #0, nut, to 'pipe:1':"]),
            None,
            "sound"
        );
        let packet = "[h264 @ 0x1] [error] Invalid NAL unit size (3622 > 2392).";
        let faults = fault(&[packet]).expect("a fault");
        assert!(!faults.contains("cut off"), "{faults}");
        for end in [
            "[in#0/mov,mp4 @ 0x2] [error] stream 0, offset 0x482da: partial file",
            "[in#0/matroska,webm @ 0x2] [error] File ended prematurely",
        ] {
            let faults = fault(&[packet, end]).expect("a fault");
            assert!(faults.starts_with("the file is cut off"), "{faults}");
        }
    }

    #[cfg(unix)]
    #[test]
    fn an_older_ffmpeg_is_told_which_is_needed() {
        let line = "[fatal] Unrecognized option 'fps_mode'.";
        let mut running = Running {
            child: Command::new("false")
                .spawn()
                .expect("every Unix has that program"),
            program: "/usr/bin/ffmpeg".into(),
            reads_file: true,
            words: Arc::default(),
            listener: None,
        };
        running.words().hear(line);
        let message = running.failure("clip.mp4").to_string();
        assert!(
            message.contains("5.1 or newer")
                && message.contains("/usr/bin/ffmpeg is older: Unrecognized option 'fps_mode'"),
            "{message}"
        );
    }

    #[cfg(unix)]
    #[test]
    fn what_ffmpeg_has_started_ends_with_it() {
        let mut command = Command::new("sh");
        command.args(["-c", "sleep 1000 & echo '[error] started' >&2; wait"]);
        std::os::unix::process::CommandExt::process_group(&mut command, 0);
        let mut child = command
            .stdout(Stdio::null())
            .stderr(Stdio::piped())
            .spawn()
            .expect("every Unix has a shell");
        let lines = child.stderr.take().expect("its words");
        let words = Arc::<Mutex<Words>>::default();
        let heard = Arc::clone(&words);
        let (tell, told) = std::sync::mpsc::channel();
        let mut running = Running {
            child,
            program: "sh".into(),
            reads_file: true,
            words,
            listener: Some(std::thread::spawn(move || {
                listen(BufReader::new(lines), &heard);
                let _ = tell.send(());
            })),
        };
        while running.words().last.is_none() {
            sleep(Duration::from_millis(1));
        }
        running.kill();
        // The pipe of its words ends when nothing holds it any more.
        told.recv_timeout(Duration::from_secs(60))
            .expect("the sleeper has ended");
    }

    #[test]
    fn its_words_give_the_rate_and_the_errors() {
        let mut words = Words::default();
        for line in [
            "[info]   Stream #0:1[0x2](eng): Audio: aac (LC) (mp4a / 0x6134706D), 44100 Hz, stereo, fltp, 127 kb/s (default)",
            "[info]   Stream #0:0[0x1](und): Video: h264 (High) (avc1 / 0x31), yuv420p, 176x144, 588 kb/s, 29.97 fps, 29.97 tbr, 30k tbn (default)",
            "[h264 @ 0x1] [error] first",
            "[error]  ",
            "[info] Output #0, nut, to 'pipe:1':",
            "[info]   Stream #0:0: Video: rawvideo, 25 fps, 25 tbn",
            "[out#0/nut @ 0x2] [fatal] last",
        ] {
            words.hear(line);
        }
        assert_eq!(words.rate_hz, Some(29.97), "rate");
        assert_eq!(words.cause().as_deref(), Some("first; last"), "errors");
    }

    #[test]
    fn a_cause_that_ffmpeg_names_twice_is_told_once() {
        let mut words = Words::default();
        assert_eq!(words.cause(), None, "no words");
        for line in [
            "[in#0 @ 0x1] [error] Error opening input: Invalid data found when processing input",
            "[error] Error opening input file file:notes.txt.",
            "[fatal] Error opening input files: Invalid data found when processing input",
        ] {
            words.hear(line);
        }
        assert_eq!(
            words.cause().as_deref(),
            Some("Invalid data found when processing input"),
            "the cause"
        );
    }
}
