//! The demo's call: server, sender and receiver as three processes on this machine, as they would be on three.

use super::Options;
use crate::children::{LocalServer, Output, Process};
use crate::film::ANIMATION_PIXELS;
use crate::network::Network;
use anyhow::Context;
use link::Client;
use serde_json::Value;
use std::ffi::OsString;
use std::path::Path;
use std::time::Duration;

/// What the receiver needs beyond the motion: to fetch the avatar, to prepare, to write the pictures.
const BESIDES: Duration = Duration::from_secs(300);

/// Holds the call, of so many `seconds`, and returns the receiver's figures. Without a length it goes on in a window until that
/// is closed, and there are none.
pub(super) fn run(
    options: &Options,
    package: &Path,
    seconds: Option<f64>,
) -> anyhow::Result<Value> {
    let folder = tempfile::tempdir().context("cannot make a temporary folder")?;
    let server = LocalServer::start(folder.path())?;
    let network = Network::start()?;
    let client = Client::new(None)?;
    let (sender_link, viewer_link) = network.block_on(server.open_room(&client))?;

    let mut send = arguments(["--room"]);
    send.push(sender_link.to_string().into());
    send.push("--avatar".into());
    send.push(package.into());
    send.extend(options.motion.arguments());
    let figures = folder.path().join("call.json");
    let mut receive = vec![viewer_link.to_string().into()];
    receive.extend(arguments(["--camera", &options.camera.to_string()]));
    if let Some(gaze) = &options.gaze {
        receive.extend(["--gaze".into(), gaze.to_string().into()]);
    }
    receive.extend(options.scenery.arguments());
    match seconds {
        Some(seconds) => {
            send.extend(arguments(["--seconds", &seconds.to_string()]));
            // As large as the animation shows it: a machine without a GPU draws more of them then.
            let size = options.size.within(ANIMATION_PIXELS).to_string();
            receive.extend(arguments([
                "--size",
                &size,
                "--display",
                "offscreen",
                "--out",
            ]));
            receive.push(options.out.clone().into());
            receive.push("--json".into());
            receive.push(figures.clone().into());
        }
        None => receive.extend(arguments([
            "--size",
            &options.size.to_string(),
            "--display",
            "window",
        ])),
    }
    println!(
        "a call on this machine: a server, a sender and a receiver, each a process of its own"
    );
    let sender = Process::start_sender(send, &server.owner_token)?;
    let receiver = Process::start("receive", receive, Output::Shown)?;
    let longest = seconds.map(|seconds| BESIDES + Duration::from_secs_f64(seconds));
    receiver.finish(longest)?;
    if seconds.is_none() {
        return Ok(Value::Null);
    }
    sender.finish(Some(BESIDES))?;
    server.stop()?;
    let text = std::fs::read(&figures).context("cannot read the receiver's figures")?;
    serde_json::from_slice(&text).context("cannot read the receiver's figures")
}

fn arguments<const N: usize>(words: [&str; N]) -> Vec<OsString> {
    words.map(OsString::from).to_vec()
}
