//! Values of one word, read.

use super::{Key, Origin, Problem, plain};
use app_pipeline::plan::PlacementRequest;
use app_pipeline::timeline::LatencyMode;
use link_protocol::PersonName;
use log::LevelFilter;
use std::fmt;
use std::net::SocketAddr;
use std::time::Duration;

/// A value, and its source.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Sourced<T> {
    /// The value.
    pub value: T,
    /// Its source.
    pub origin: Origin,
}

/// A rate that Quest displays have and interactive apps may run at.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum DisplayRate {
    /// 72 Hz.
    Hz72,
    /// 80 Hz.
    Hz80,
    /// 90 Hz.
    Hz90,
    /// 120 Hz.
    Hz120,
}

impl DisplayRate {
    /// All of them.
    pub const ALL: [Self; 4] = [Self::Hz72, Self::Hz80, Self::Hz90, Self::Hz120];

    /// In hertz.
    #[must_use]
    pub fn hz(self) -> u16 {
        match self {
            Self::Hz72 => 72,
            Self::Hz80 => 80,
            Self::Hz90 => 90,
            Self::Hz120 => 120,
        }
    }
}

impl fmt::Display for DisplayRate {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} Hz", self.hz())
    }
}

/// The name of a package in the app's folder that adb can reach: no path, so that what any app may ask for stays within that folder.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct AvatarFile(String);

impl AvatarFile {
    /// The name.
    #[must_use]
    pub fn as_str(&self) -> &str {
        &self.0
    }
}

impl Default for AvatarFile {
    /// `avatar.m3a`.
    fn default() -> Self {
        Self("avatar.m3a".to_owned())
    }
}

/// The name of a file of certificates (PEM) in the same folder.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct CertificateFile(String);

impl CertificateFile {
    /// The name.
    #[must_use]
    pub fn as_str(&self) -> &str {
        &self.0
    }
}

/// The value of one setting, or the given default where no source has one.
pub(super) fn read<T>(
    key: Key,
    given: Option<(Origin, &str)>,
    default: T,
    reader: impl FnOnce(&str) -> Result<T, String>,
) -> Result<Sourced<T>, Problem> {
    let Some((origin, text)) = given else {
        return Ok(Sourced {
            value: default,
            origin: Origin::Default,
        });
    };
    plain::check(text, key.longest())
        .and_then(|()| reader(text))
        .map(|value| Sourced { value, origin })
        .map_err(|why| Problem::Value { key, origin, why })
}

fn no(text: &str, what: &str, choices: &str) -> String {
    format!("{} is no {what}: give {choices}", plain::repeated(text))
}

pub(super) fn seat(text: &str) -> Result<bool, String> {
    text.parse()
        .map_err(|_| no(text, "answer", "true (people sit) or false"))
}

/// Nothing lets the session choose a rate that frames keep up with.
pub(super) fn rate(text: &str) -> Result<Option<DisplayRate>, String> {
    if text == "auto" {
        return Ok(None);
    }
    let named = DisplayRate::ALL
        .into_iter()
        .find(|rate| rate.hz().to_string() == text);
    named
        .map(Some)
        .ok_or_else(|| no(text, "display rate", "auto, 72, 80, 90 or 120"))
}

pub(super) fn placement(text: &str) -> Result<PlacementRequest, String> {
    text.parse()
        .map_err(|error: String| plain::one_line(&error))
}

pub(super) fn latency(text: &str) -> Result<LatencyMode, String> {
    match text {
        "interpolate" => Ok(LatencyMode::Interpolate),
        "extrapolate" => Ok(LatencyMode::Extrapolate),
        _ => Err(no(text, "latency mode", "interpolate or extrapolate")),
    }
}

pub(super) fn log_level(text: &str) -> Result<LevelFilter, String> {
    text.parse()
        .map_err(|_| no(text, "log level", "off, error, warn, info, debug or trace"))
}

pub(super) fn profile(text: &str) -> Result<Duration, String> {
    whole(text, 5..=3_600)
        .map(Duration::from_secs)
        .ok_or_else(|| no(text, "duration", "whole seconds from 5 to 3600"))
}

/// Bytes.
pub(super) fn cache(text: &str) -> Result<u64, String> {
    whole(text, 64..=16_384)
        .map(|mb| mb * 1_000_000)
        .ok_or_else(|| no(text, "size", "whole megabytes from 64 to 16384"))
}

pub(super) fn avatar(text: &str) -> Result<AvatarFile, String> {
    if is_file_name(text, ".m3a") {
        Ok(AvatarFile(text.to_owned()))
    } else {
        Err(no(
            text,
            "avatar",
            "the name of a file in the app's folder that ends with .m3a, of letters, digits, `.`, `_` and `-`",
        ))
    }
}

pub(super) fn certificates(text: &str) -> Result<Option<CertificateFile>, String> {
    if is_file_name(text, ".pem") {
        Ok(Some(CertificateFile(text.to_owned())))
    } else {
        Err(no(
            text,
            "file of certificates",
            "the name of a file in the app's folder that ends with .pem, of letters, digits, `.`, `_` and `-`",
        ))
    }
}

/// An address without a name, so that nothing has to be looked up.
pub(super) fn gaze_to(text: &str) -> Result<Option<SocketAddr>, String> {
    text.parse().map(Some).map_err(|_| {
        no(
            text,
            "address of a second screen",
            "one like 192.168.1.20:7215",
        )
    })
}

/// Whether it names a file in the app's folder, and nothing outside it.
fn is_file_name(text: &str, ending: &str) -> bool {
    let is_plain = |c: char| c.is_ascii_alphanumeric() || matches!(c, '.' | '_' | '-');
    let stem = text.strip_suffix(ending).unwrap_or_default();
    !stem.is_empty() && !stem.starts_with('.') && stem.chars().all(is_plain)
}

/// What others read, in any script.
pub(super) fn person(
    given: Option<(Origin, &str)>,
) -> Result<Sourced<Option<PersonName>>, Problem> {
    let Some((origin, text)) = given else {
        return Ok(Sourced {
            value: None,
            origin: Origin::Default,
        });
    };
    let value = text.parse().map(Some).map_err(|_| Problem::Value {
        key: Key::Name,
        origin,
        why: no(text, "name", "1 to 40 characters that can be seen"),
    })?;
    Ok(Sourced { value, origin })
}

fn whole(text: &str, within: std::ops::RangeInclusive<u64>) -> Option<u64> {
    // `parse` alone takes a plus sign.
    let number = text
        .bytes()
        .all(|byte| byte.is_ascii_digit())
        .then_some(text)?;
    number.parse().ok().filter(|number| within.contains(number))
}
