//! The demo's call: server, sender and receiver as three processes on this machine, as they would be on three.

use super::Options;
use crate::children::{LocalServer, Output, Process};
use crate::film::ANIMATION_PIXELS;
use crate::monado::Monado;
use crate::network::Network;
use anyhow::Context;
use link_http::Client;
use serde_json::Value;
use std::ffi::OsString;
use std::path::Path;
use std::sync::atomic::AtomicBool;
use std::time::Duration;

/// What the receiver needs beyond the motion: to fetch the avatar, to prepare, to write the pictures.
const BESIDES: Duration = Duration::from_secs(300);

/// Where and how long the call is shown.
#[derive(Debug)]
pub(super) enum Shown {
    /// In a window, until that is closed.
    Window,
    /// As pictures on disk.
    Offscreen { seconds: f64 },
    /// In a headset: Monado's, if one was started for it.
    Headset {
        monado: Option<Monado>,
        length: Length,
    },
}

/// How long a headset shows it.
#[derive(Debug, Clone, Copy)]
pub(super) enum Length {
    /// The headset's own frames.
    Frames(usize),
    Seconds(f64),
}

/// Holds the call and returns the receiver's figures; a window leaves none. When `stop` becomes true, the call ends and is an error: what
/// was shown until then is kept.
pub(super) fn run(
    options: &Options,
    package: &Path,
    mut shown: Shown,
    network: &Network,
    stop: &AtomicBool,
) -> anyhow::Result<Value> {
    let folder = tempfile::tempdir().context("cannot make a temporary folder")?;
    let server = LocalServer::start(folder.path())?;
    let client = Client::new(None)?;
    let (sender_link, viewer_link) = network.block_on(server.open_room(&client))?;

    let mut send = arguments(["--room"]);
    send.push(sender_link.to_string().into());
    send.push("--avatar".into());
    send.push(package.into());
    match options.camera.arguments() {
        Some(camera) => send.extend(camera),
        None => send.extend(options.motion.arguments()),
    }
    let figures = folder.path().join("call.json");
    let mut receive = vec![viewer_link.to_string().into()];
    receive.extend(arguments(["--view", &options.view.to_string()]));
    if let Some(gaze) = &options.gaze {
        receive.extend(["--gaze".into(), gaze.to_string().into()]);
    }
    receive.extend(options.scenery.arguments());
    // As large as the animation shows it: a machine without a GPU draws more of them then.
    let small = options.size.within(ANIMATION_PIXELS).to_string();
    let keep = |receive: &mut Vec<OsString>| {
        receive.extend(["--out".into(), options.out.clone().into()]);
        receive.extend(["--json".into(), figures.clone().into()]);
    };
    match &shown {
        Shown::Window => {
            let size = options.size.to_string();
            receive.extend(arguments(["--display", "window", "--size", &size]));
        }
        Shown::Offscreen { seconds } => {
            send.extend(arguments(["--seconds", &seconds.to_string()]));
            receive.extend(arguments(["--display", "offscreen", "--size", &small]));
            keep(&mut receive);
        }
        Shown::Headset { monado, length } => {
            receive.extend(arguments(["--display", "xr"]));
            match length {
                Length::Frames(frames) => {
                    receive.extend(arguments(["--frames", &frames.to_string()]));
                }
                Length::Seconds(seconds) => {
                    receive.extend(arguments(["--seconds", &seconds.to_string()]));
                }
            }
            if monado.is_some() {
                receive.extend(arguments(["--size", &small]));
            }
            keep(&mut receive);
        }
    }
    println!(
        "a call on this machine: a server, a sender and a receiver, each a process of its own"
    );
    let mut sender = Process::start_sender(send, &server.owner_token)?;
    let environment = match &shown {
        Shown::Headset { monado, .. } => monado.as_ref().map_or_else(Vec::new, Monado::environment),
        Shown::Window | Shown::Offscreen { .. } => Vec::new(),
    };
    let receiver = Process::start_in(environment, "receive", receive, Output::Shown)?;
    let held = match &mut shown {
        Shown::Window => receiver.finish_beside(None, stop, || sender.check()),
        Shown::Offscreen { seconds } => {
            let longest = BESIDES + Duration::from_secs_f64(*seconds);
            receiver.finish_beside(Some(longest), stop, || sender.check())
        }
        Shown::Headset { monado, length } => {
            // A frame a second at the slowest.
            let most = match length {
                Length::Frames(frames) => Duration::from_secs(*frames as u64),
                Length::Seconds(seconds) => Duration::from_secs_f64(*seconds),
            };
            // The receiver would wait for either to come back, and it does not.
            let live = || {
                sender.check()?;
                monado.as_mut().map_or(Ok(()), Monado::check)
            };
            receiver.finish_beside(Some(BESIDES + most), stop, live)
        }
    };
    // Off the screen the motion ends by itself.
    if held.is_ok() && matches!(shown, Shown::Offscreen { .. }) {
        sender.finish_unless(Some(BESIDES), stop)?;
    } else {
        sender.stop()?;
    }
    held?;
    if matches!(shown, Shown::Window) {
        return Ok(Value::Null);
    }
    server.stop()?;
    let text = std::fs::read(&figures).context("cannot read the receiver's figures")?;
    serde_json::from_slice(&text).context("cannot read the receiver's figures")
}

fn arguments<const N: usize>(words: [&str; N]) -> Vec<OsString> {
    words.map(OsString::from).to_vec()
}
