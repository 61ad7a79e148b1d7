//! What `--gaze` says, and the gaze that comes of it.

use super::live::Live;
use super::track::Track;
use super::{Gaze, Source};
use anyhow::{Context, anyhow, bail};
use std::fmt;
use std::net::{Ipv4Addr, SocketAddr};
use std::path::{Path, PathBuf};
use std::str::FromStr;
use std::sync::Arc;

/// What `--gaze` says.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) enum GazeChoice {
    /// The mouse in the window.
    Mouse,
    /// Samples of an eye tracker.
    File(PathBuf),
    /// Samples as a program writes them.
    Stdin,
    /// Samples that come to this address of this machine: an eye tracker's, or a headset's.
    Udp(SocketAddr),
}

impl FromStr for GazeChoice {
    type Err = anyhow::Error;

    fn from_str(text: &str) -> anyhow::Result<Self> {
        Ok(match text {
            "mouse" => Self::Mouse,
            "-" => Self::Stdin,
            text => match text.strip_prefix("udp:") {
                Some(address) => Self::Udp(udp(address)?),
                None => Self::File(text.into()),
            },
        })
    }
}

/// A port alone is for this machine's programs.
fn udp(text: &str) -> anyhow::Result<SocketAddr> {
    let here = |port| SocketAddr::from((Ipv4Addr::LOCALHOST, port));
    text.parse().map(here).or_else(|_| text.parse()).map_err(|_| {
        anyhow!(
            "udp:{text} is no address: give udp:PORT, 1 to 65535, for programs of this machine, or udp:0.0.0.0:PORT for a headset in its network too"
        )
    })
}

impl fmt::Display for GazeChoice {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Mouse => f.write_str("mouse"),
            Self::File(file) => write!(f, "{}", file.display()),
            Self::Stdin => f.write_str("-"),
            Self::Udp(address) => write!(f, "udp:{address}"),
        }
    }
}

/// A file's samples. Whoever mistypes `udp:` is told what it was taken for.
fn read(file: &Path) -> anyhow::Result<Track> {
    Track::read(file).with_context(|| {
        format!(
            "--gaze {} is taken as a file (others are mouse, - and udp:PORT)",
            file.display()
        )
    })
}

/// Where there is a mouse to follow, and where pictures are made at all.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Sight {
    Window,
    Offscreen,
    Nothing,
}

impl GazeChoice {
    /// The gaze that was chosen, before anybody is kept waiting.
    ///
    /// # Errors
    /// If there can be none where the call is shown, the file holds none, or the address cannot be had.
    pub(crate) fn open(&self, sight: Sight) -> anyhow::Result<Gaze> {
        self.check_sight(sight)?;
        let source = match self {
            Self::Mouse => Source::Mouse {
                at: None,
                left: None,
            },
            Self::File(file) => Source::File(Arc::new(read(file)?)),
            Self::Stdin => Source::Live(Live::stdin()?),
            Self::Udp(address) => {
                let (live, address) = Live::udp(*address)?;
                println!("a gaze is taken at {address}, by UDP");
                Source::Live(live)
            }
        };
        Ok(Gaze::of(source, self.to_string()))
    }

    /// What can be said before it is opened, by another program.
    ///
    /// # Errors
    /// If there can be none where the call is shown, or the file holds none.
    pub(crate) fn check(&self, sight: Sight) -> anyhow::Result<()> {
        self.check_sight(sight)?;
        match self {
            Self::File(file) => read(file).map(drop),
            Self::Mouse | Self::Stdin | Self::Udp(_) => Ok(()),
        }
    }

    fn check_sight(&self, sight: Sight) -> anyhow::Result<()> {
        match (self, sight) {
            (_, Sight::Nothing) => {
                bail!("--gaze moves the camera, and nothing is drawn here: leave one of them out")
            }
            (Self::Mouse, Sight::Offscreen) => bail!(
                "--gaze mouse follows the mouse in a window, and pictures on disk have none: show a window, or give a file of \
                 gaze samples"
            ),
            _ => Ok(()),
        }
    }

    /// Refuses samples from standard input.
    ///
    /// # Errors
    /// If that is where they come from. `why` says what is there instead.
    pub(crate) fn check_no_stdin(&self, why: &str) -> anyhow::Result<()> {
        if *self == Self::Stdin {
            bail!("--gaze - reads standard input, and {why}: send the samples to --gaze udp:PORT");
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn chosen(text: &str) -> GazeChoice {
        text.parse().unwrap_or_else(|why| panic!("{text}: {why}"))
    }

    #[test]
    fn what_is_written_is_read() {
        for (text, choice) in [
            ("mouse", GazeChoice::Mouse),
            ("-", GazeChoice::Stdin),
            ("udp:127.0.0.1:7215", chosen("udp:7215")),
            ("udp:0.0.0.0:7215", GazeChoice::Udp(([0; 4], 7215).into())),
            ("udp:[::1]:7215", chosen("udp:[::1]:7215")),
            ("a/gaze.csv", GazeChoice::File("a/gaze.csv".into())),
        ] {
            assert_eq!(chosen(text), choice, "{text}");
            assert_eq!(choice.to_string(), text);
        }
        for text in ["udp:", "udp:65536", "udp:here:7215", "udp:127.0.0.1"] {
            let why = text.parse::<GazeChoice>().expect_err(text).to_string();
            assert!(why.contains("udp:0.0.0.0:PORT"), "{text}: {why}");
        }
    }

    #[test]
    fn a_gaze_that_cannot_be_is_refused_with_what_to_do() {
        let refused = |choice: &str, sight: Sight| {
            let refused = chosen(choice).open(sight).expect_err("refused");
            format!("{refused:#}")
        };
        let mouse = refused("mouse", Sight::Offscreen);
        assert!(mouse.contains("give a file"), "{mouse}");
        let nothing = refused("mouse", Sight::Nothing);
        assert!(nothing.contains("nothing is drawn"), "{nothing}");
        let file = refused("no/such/gaze.csv", Sight::Offscreen);
        assert!(file.contains("no/such/gaze.csv"), "{file}");
        assert!(!file.contains('\n'), "one line: {file}");
        let elsewhere = refused("udp:192.0.2.1:7215", Sight::Offscreen);
        assert!(
            elsewhere.contains("192.0.2.1:7215"),
            "not ours: {elsewhere}"
        );
        let typed = chosen("-")
            .check_no_stdin("it is taken")
            .expect_err("taken");
        assert!(typed.to_string().contains("udp:PORT"), "{typed}");
    }
}
