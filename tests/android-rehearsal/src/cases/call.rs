//! A whole call, from a link to the sender's end.

use super::{DESTRUCTION_MS, Figures, MAIN_THREAD_MS, assert_well, figure};
use crate::environment::{Environment, Scene, opening};
use crate::process::{LEAVE, Process};
use android_rehearsal::protocol::Callback;
use anyhow::{Context, ensure};
use serde_json::Value;
use std::fs;
use std::net::UdpSocket;
use std::thread::sleep;
use std::time::Duration;
use synthetic_person::PuppetSize;
use test_support::monado::Compositor;

/// The validation layer, for a program that does not ask for it; what it says goes to the standard output, which the app has in the log.
const VALIDATED: [(&str, &str); 1] = [("VK_INSTANCE_LAYERS", "VK_LAYER_KHRONOS_validation")];
const LAYER: &str = "libVkLayer_khronos_validation.so";

/// Until some more pictures of a person were handed to the compositor.
pub(super) fn shows_people(process: &mut Process) -> anyhow::Result<()> {
    let before = process.census()?.frames.people;
    process.wait_until("pictures of the person", |process| {
        Ok(process.census()?.frames.people >= before + 10)
    })
}

/// A second screen that `mon3tr.toml` has the app send the wearer's gaze to.
struct SecondScreen(UdpSocket);

impl SecondScreen {
    fn of(scene: &Scene<'_>) -> anyhow::Result<Self> {
        let socket = UdpSocket::bind(("127.0.0.1", 0)).context("no port")?;
        socket.set_read_timeout(Some(Duration::from_secs(30)))?;
        let line = format!("gaze_to = \"{}\"\n", socket.local_addr()?);
        fs::create_dir_all(scene.external())?;
        fs::write(scene.external().join("mon3tr.toml"), line)?;
        Ok(Self(socket))
    }

    /// Waits for a gaze, and checks that the wearer stands before the person, whom their head is turned to.
    fn sees(&self) -> anyhow::Result<()> {
        let mut line = [0; 512];
        let length = self.0.recv(&mut line).context("no gaze came")?;
        let line: Value = serde_json::from_slice(&line[..length]).context("no line of gaze")?;
        let metres = |name: &str, axis: usize| line[name][axis].as_f64().unwrap_or(f64::NAN);
        let (far, towards) = (metres("eye", 2), metres("towards", 2));
        ensure!(
            (1.2..2.0).contains(&far) && (far - towards - 1.0).abs() < 0.05,
            "the wearer is not before the person: {line}"
        );
        Ok(())
    }
}

pub(super) fn perform(environment: &Environment, name: &str) -> anyhow::Result<Figures> {
    let scene = environment.scene(name, Compositor::Null)?;
    let server = scene.server(PuppetSize::FULL)?;
    let mut sender = scene.sender(&server);
    let screen = SecondScreen::of(&scene)?;
    let mut process = scene.process()?;
    let activity = process.launch(opening(&sender.viewers))?;
    shows_people(&mut process)?;
    screen.sees()?;
    let package = fs::read_dir(scene.folder.join("internal/packages"))
        .context("no folder of packages")?
        .filter_map(Result::ok)
        .find(|file| {
            file.path()
                .extension()
                .is_some_and(|extension| extension == "m3a")
        })
        .context("the package was not kept")?;
    let sent = fs::metadata(&server.avatar)?.len();
    ensure!(
        package.metadata()?.len() == sent,
        "the package is not whole"
    );

    // A pause: no picture, and the call goes on.
    let mut longest: f64 = 0.0;
    for _ in 0..2 {
        longest = longest.max(process.call(activity, Callback::Pause)?);
        longest = longest.max(process.call(activity, Callback::Stop)?);
        // A picture that was begun before may still be finished.
        sleep(Duration::from_millis(500));
        let paused = process.census()?.frames;
        sleep(Duration::from_secs(1));
        ensure!(
            process.census()?.frames == paused,
            "frames were shown during a pause"
        );
        longest = longest.max(process.call(activity, Callback::LowMemory)?);
        longest = longest.max(process.call(activity, Callback::Start)?);
        longest = longest.max(process.call(activity, Callback::Resume)?);
        shows_people(&mut process)?;
    }
    process.calls(
        activity,
        &[
            Callback::FocusLost,
            Callback::FocusGained,
            Callback::ConfigurationChanged,
            Callback::LowMemory,
            Callback::SaveInstanceState,
        ],
    )?;
    shows_people(&mut process)?;
    ensure!(
        process.logged("joined (session") == 1,
        "a pause ended the call: joined {} times",
        process.logged("joined (session")
    );

    let trimmed = process.logged("are given back");
    ensure!(trimmed == 3, "the memory was trimmed {trimmed} times");

    // The sender's restart: the app waits for them, and sees them again.
    let own = sender.own.clone();
    sender.program.end();
    process.wait_for("waiting for the sender", 1)?;
    let mut again = scene.send(&server, &["--room", &own]);
    shows_people(&mut process)?;
    again.end();
    process.wait_for("waiting for the sender", 2)?;
    let calls = process.logged("a call of ");
    ensure!(calls == 2, "the log has {calls} calls");
    let lost = process.logged(" 0 frames taken");
    ensure!(lost == 0, "a call without a frame");

    let mut destruction: f64 = 0.0;
    for callback in LEAVE {
        let blocked = process.call(activity, callback)?;
        if callback == Callback::Destroy {
            destruction = blocked;
        } else {
            longest = longest.max(blocked);
        }
    }
    ensure!(
        longest <= MAIN_THREAD_MS && destruction <= DESTRUCTION_MS,
        "the main thread was blocked for {longest:.0} ms, and for {destruction:.0} ms by the destruction"
    );
    assert_well(&mut process)?;
    let frames = process.census()?.frames;
    process.quit()?;
    let mut figures = Figures::new();
    figure(&mut figures, "frames_with_people", frames.people);
    figure(&mut figures, "longest_ms", longest);
    figure(&mut figures, "destruction_ms", destruction);
    Ok(figures)
}

pub(super) fn perform_validated(environment: &Environment, name: &str) -> anyhow::Result<Figures> {
    let scene = environment.scene(name, Compositor::Null)?;
    let server = scene.server(PuppetSize::SMALL)?;
    let sender = scene.sender(&server);
    let mut process = scene.process_with(&VALIDATED)?;
    let activity = process.launch(opening(&sender.viewers))?;
    shows_people(&mut process)?;
    process.calls(activity, &[Callback::Pause, Callback::Resume])?;
    shows_people(&mut process)?;
    let libraries = process.census()?.libraries;
    ensure!(
        libraries.iter().any(|library| library == LAYER),
        "{LAYER} is not loaded: nothing would be validated"
    );
    process.leave(activity)?;
    assert_well(&mut process)?;
    let logcat = process.logcat();
    let messages: Vec<&str> = (logcat.lines())
        .filter(|line| line.contains("VUID") || line.contains("Validation "))
        .collect();
    ensure!(messages.is_empty(), "validation:\n{}", messages.join("\n"));
    process.quit()?;
    let mut figures = Figures::new();
    figure(&mut figures, "messages", messages.len());
    Ok(figures)
}
