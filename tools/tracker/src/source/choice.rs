//! What the user named, as one of the kinds of sources.

use std::convert::Infallible;
use std::ffi::OsString;
use std::fmt;
use std::path::{Path, PathBuf};
use std::str::FromStr;

/// Which source to open.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum SourceChoice {
    /// A camera: `0`, `/dev/video0` or another path below `/dev`.
    Device(PathBuf),
    /// Standard input, `-`: y4m or motion JPEG.
    Stdin,
    /// A folder of PNG and JPEG pictures.
    Folder(PathBuf),
    /// A `.y4m` file.
    Y4m(PathBuf),
    /// A `.mjpeg` or `.mjpg` file: JPEG pictures one after another.
    MotionJpeg(PathBuf),
    /// Another file, which ffmpeg decodes.
    File(PathBuf),
    /// An address, which ffmpeg reads.
    Url(String),
}

/// Endings of addresses that are recordings.
const RECORDINGS: [&str; 9] = [
    "mp4", "m4v", "mov", "mkv", "webm", "avi", "ogv", "gif", "y4m",
];

impl SourceChoice {
    /// Whether its pictures come in their own time: cameras do, and addresses whose scheme is one of streaming, or that are
    /// fetched over HTTP and do not end as a recording's do. Standard input is taken for a recording.
    #[must_use]
    pub fn is_live(&self) -> bool {
        match self {
            Self::Device(_) => true,
            Self::Url(url) => url_is_live(url),
            Self::Stdin | Self::Folder(_) | Self::Y4m(_) | Self::MotionJpeg(_) | Self::File(_) => {
                false
            }
        }
    }
}

/// See [`SourceChoice::is_live`].
pub(super) fn url_is_live(url: &str) -> bool {
    let (scheme, rest) = url.split_once("://").unwrap_or(("file", url));
    match scheme.to_ascii_lowercase().as_str() {
        "http" | "https" => {
            let path = rest.split(['?', '#']).next().unwrap_or(rest);
            let ending = path
                .rsplit_once('/')
                .map_or("", |(_, last)| last)
                .rsplit_once('.');
            !ending.is_some_and(|(_, ending)| {
                RECORDINGS.contains(&ending.to_ascii_lowercase().as_str())
            })
        }
        "file" | "ftp" | "sftp" => false,
        _ => true,
    }
}

/// An address without the user's name and password.
pub(super) fn without_password(url: &str) -> String {
    match user_of(url) {
        Some(user) => url.replacen(&format!("{user}@"), "", 1),
        None => url.to_owned(),
    }
}

/// The user's name and password in an address, as they are written there.
pub(super) fn user_of(url: &str) -> Option<&str> {
    let (_, rest) = url.split_once("://")?;
    let end = rest.find(['/', '?', '#']).unwrap_or(rest.len());
    let (user, _) = rest.get(..end)?.rsplit_once('@')?;
    Some(user)
}

impl SourceChoice {
    /// The choice as an argument for another program, from which it is parsed again: with a password, where an address has one.
    #[must_use]
    pub fn to_argument(&self) -> OsString {
        match self {
            Self::Stdin => "-".into(),
            Self::Url(url) => url.into(),
            // A file's name might be a number or a dash.
            Self::Folder(path) | Self::Y4m(path) | Self::MotionJpeg(path) | Self::File(path)
                if path.is_relative() && !path.starts_with(".") =>
            {
                Path::new(".").join(path).into()
            }
            Self::Device(path)
            | Self::Folder(path)
            | Self::Y4m(path)
            | Self::MotionJpeg(path)
            | Self::File(path) => path.into(),
        }
    }
}

impl FromStr for SourceChoice {
    type Err = Infallible;

    /// Never fails: what is nothing else is a file, and opening it says whether it is there. A file whose name is a number or
    /// `-` is named with its folder: `./0`.
    fn from_str(text: &str) -> Result<Self, Infallible> {
        if !text.is_empty() && text.bytes().all(|one| one.is_ascii_digit()) {
            return Ok(Self::Device(PathBuf::from(format!("/dev/video{text}"))));
        }
        if text == "-" {
            return Ok(Self::Stdin);
        }
        if text.contains("://") {
            return Ok(Self::Url(text.to_owned()));
        }
        let path = PathBuf::from(text);
        if is_device(&path) {
            return Ok(Self::Device(path));
        }
        if path.is_dir() {
            return Ok(Self::Folder(path));
        }
        let ending = path
            .extension()
            .map(|ending| ending.to_string_lossy().to_ascii_lowercase());
        Ok(match ending.as_deref() {
            Some("y4m") => Self::Y4m(path),
            Some("mjpeg" | "mjpg") => Self::MotionJpeg(path),
            _ => Self::File(path),
        })
    }
}

/// Links such as `/dev/v4l/by-id/...` too.
fn is_device(path: &Path) -> bool {
    path.strip_prefix("/dev").is_ok_and(|below| {
        let first = below
            .components()
            .next()
            .map(|one| one.as_os_str().to_string_lossy());
        first.is_some_and(|first| first.starts_with("video") || first == "v4l")
    })
}

impl fmt::Display for SourceChoice {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Stdin => write!(f, "standard input"),
            Self::Url(url) => write!(f, "{}", without_password(url)),
            Self::Device(path)
            | Self::Folder(path)
            | Self::Y4m(path)
            | Self::MotionJpeg(path)
            | Self::File(path) => {
                write!(f, "{}", path.display())
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn parsed(text: &str) -> SourceChoice {
        let Ok(choice) = text.parse();
        choice
    }

    #[test]
    fn text_names_each_kind_of_source() {
        let folder = std::env::temp_dir();
        for (text, expected) in [
            ("0", SourceChoice::Device("/dev/video0".into())),
            ("12", SourceChoice::Device("/dev/video12".into())),
            ("/dev/video3", SourceChoice::Device("/dev/video3".into())),
            (
                "/dev/v4l/by-id/usb-x",
                SourceChoice::Device("/dev/v4l/by-id/usb-x".into()),
            ),
            (
                "/dev/shm/clip.mp4",
                SourceChoice::File("/dev/shm/clip.mp4".into()),
            ),
            ("-", SourceChoice::Stdin),
            ("./0", SourceChoice::File("./0".into())),
            ("", SourceChoice::File("".into())),
            ("a.Y4M", SourceChoice::Y4m("a.Y4M".into())),
            ("b.mjpeg", SourceChoice::MotionJpeg("b.mjpeg".into())),
            ("c d.mp4", SourceChoice::File("c d.mp4".into())),
            ("rtsp://x/y", SourceChoice::Url("rtsp://x/y".to_owned())),
            (
                &folder.display().to_string(),
                SourceChoice::Folder(folder.clone()),
            ),
        ] {
            assert_eq!(parsed(text), expected, "{text}");
        }
    }

    #[test]
    fn a_choice_is_itself_again_from_its_argument() {
        for text in [
            "0",
            "-",
            "./0",
            "./-",
            "a.y4m",
            "b.mjpeg",
            "rtsp://me:secret@x/y",
            "/tmp",
        ] {
            let choice = parsed(text);
            let argument = choice.to_argument();
            let again = parsed(argument.to_str().expect("UTF-8")).to_argument();
            assert_eq!(again, argument, "{text}");
            let kind = std::mem::discriminant(&parsed(argument.to_str().expect("UTF-8")));
            assert_eq!(kind, std::mem::discriminant(&choice), "{text}");
        }
    }

    #[test]
    fn an_address_is_live_by_its_scheme_and_ending() {
        for (url, live) in [
            ("rtsp://10.0.0.7/stream", true),
            ("udp://@:5000", true),
            ("http://camera/video", true),
            ("http://camera/live.m3u8", true),
            ("https://site/clip.MP4?key=1", false),
            ("https://site.mp4/", true),
            ("file:///clip.mp4", false),
            ("0", true),
            ("clip.mp4", false),
        ] {
            assert_eq!(parsed(url).is_live(), live, "{url}");
        }
    }

    #[test]
    fn an_address_is_shown_without_its_password() {
        assert_eq!(
            parsed("rtsp://me:secret@host:554/a@b").to_string(),
            "rtsp://host:554/a@b"
        );
        assert_eq!(parsed("http://host?x=y@z").to_string(), "http://host?x=y@z");
    }
}
