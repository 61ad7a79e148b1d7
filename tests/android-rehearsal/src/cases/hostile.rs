//! Intents and links that any app on the headset, any page and any message can send: hostile and meaningless ones.

use super::activities::shows_a_notice;
use super::{Figures, assert_well, figure};
use crate::environment::Environment;
use android_rehearsal::protocol::{Extra, Intent};
use anyhow::{Context, ensure};
use std::net::TcpListener;
use test_support::monado::Compositor;

/// Events that are put into the input queue.
const EVENTS: u32 = 5;

pub(super) fn perform(environment: &Environment, name: &str) -> anyhow::Result<Figures> {
    let scene = environment.scene(name, Compositor::Null)?;
    let mut process = scene.process()?;
    // A connection here means that the app followed a link that it should have refused.
    let trap = TcpListener::bind(("127.0.0.1", 0)).context("no port")?;
    trap.set_nonblocking(true)?;
    let address = trap.local_addr()?.to_string();
    let intents = intents(&address);
    let count = intents.len();
    for (what, refusal, intent) in intents {
        let refused = process.logged(refusal);
        let activity = process
            .launch(intent)
            .and_then(|activity| {
                shows_a_notice(&mut process)?;
                Ok(activity)
            })
            .with_context(|| format!("an intent with {what}"))?;
        ensure!(
            process.logged(refusal) > refused,
            "an intent with {what} is not refused in the log by `{refusal}`"
        );
        if what == "no room" {
            let input = process.input(activity, EVENTS)?;
            let events = EVENTS.cast_signed();
            ensure!(
                input.taken == events && input.finished == events && input.handled == 0,
                "input that is not read counts as an app that hangs: {input:?}"
            );
        }
        process
            .leave(activity)
            .with_context(|| format!("after an intent with {what}"))?;
        ensure!(
            trap.accept().is_err(),
            "an intent with {what} made the app connect"
        );
    }
    assert_well(&mut process)?;
    let logcat = process.logcat();
    ensure!(!logcat.contains("s3cret"), "a token is in the log");
    process.quit()?;
    let mut figures = Figures::new();
    figure(&mut figures, "intents", count);
    Ok(figures)
}

/// The defect of an intent, the log's line about it, and the intent. None of them may make the app connect to `address`.
fn intents(address: &str) -> Vec<(&'static str, &'static str, Intent)> {
    let link = |link: String| Intent {
        data: Some(link),
        ..Intent::default()
    };
    let extra = |name: &str, value: Extra| Intent {
        extras: vec![(name.to_owned(), value)],
        ..Intent::default()
    };
    vec![
        ("no room", "room is missing", Intent::default()),
        (
            "a name and password before the server",
            "must not hold a user name or password",
            link(format!(
                "mon3tr://room/http/call.example@{address}/rooms/R#s3cret"
            )),
        ),
        (
            "an address that a parser understands as another",
            "would be understood as",
            link(format!(
                "mon3tr://room/http/0x7f.1:{}/rooms/R#s3cret",
                port(address)
            )),
        ),
        (
            "a path that leads out of itself",
            "not written as links are",
            link(format!("mon3tr://room/http/{address}/../rooms/R#s3cret")),
        ),
        (
            "another scheme",
            "must come https/ or http/",
            link(format!("mon3tr://room/file/{address}/rooms/R#s3cret")),
        ),
        (
            "no room in the link",
            "must come https/ or http/",
            link("mon3tr://room/".to_owned()),
        ),
        (
            "a link of a megabyte",
            "longer than 8192 characters",
            link(format!("mon3tr://room/http/{}", "a".repeat(1 << 20))),
        ),
        (
            "a link with NUL, surrogates and right-to-left marks",
            "only plain ASCII is taken",
            link("mon3tr://room/http/\u{0}\u{1f600}\u{202e}/rooms/R#s3cret".to_owned()),
        ),
        (
            "extras that cannot be unpacked",
            "the intent cannot be read: Java exception was thrown",
            Intent {
                unparcelable: true,
                ..Intent::default()
            },
        ),
        (
            "a room that is a number",
            "server is missing",
            extra("room", Extra::Integer(-1)),
        ),
        (
            "a room that is a truth",
            "server is missing",
            extra("room", Extra::Boolean(true)),
        ),
        (
            "a room of a megabyte",
            "longer than 65536 characters",
            extra("room", Extra::Text("R".repeat(1 << 20))),
        ),
        (
            "a rate that no display has",
            "is no display rate",
            extra("rate", Extra::Integer(i32::MAX)),
        ),
        (
            "a measurement of no length",
            "is no duration",
            extra("profile", Extra::Text("-5".to_owned())),
        ),
        (
            "a second screen of another app's",
            "gaze_to in the intent",
            extra("gaze_to", Extra::Text(address.to_owned())),
        ),
        (
            "a thousand extras",
            "`launcher.63` is no setting",
            Intent {
                extras: (0..1000)
                    .map(|at| (format!("launcher.{at}"), Extra::Text("x".to_owned())))
                    .collect(),
                ..Intent::default()
            },
        ),
        (
            "a token for a server that the file did not name",
            "room is missing",
            extra("server", Extra::Text(format!("http://{address}"))).with("token", "s3cret\n"),
        ),
    ]
}

fn port(address: &str) -> &str {
    address.rsplit(':').next().unwrap_or_default()
}
