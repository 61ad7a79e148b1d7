//! A link to a server that the wearer has never been to: the app asks, and joins once the wearer holds a controller's grip.

use super::activities::shows_a_notice;
use super::call::shows_people;
use super::{Figures, assert_well, figure};
use crate::environment::{Environment, opening, opening_call};
use anyhow::ensure;
use std::fs;
use std::thread::sleep;
use std::time::Duration;
use synthetic_person::PuppetSize;
use test_support::monado::{Compositor, Driver, Head, Scripted};

/// How long a wearer who does nothing is watched.
const NOTHING: Duration = Duration::from_secs(3);
/// How long the grip is held: longer than it has to be.
const HELD: Duration = Duration::from_secs(3);

/// Both hands for so long, squeezed so far.
fn squeeze(head: &mut Head, squeezed: f32, length: Duration) {
    let mut scripted = Scripted::default();
    for controller in &mut scripted.controllers {
        controller.squeeze = squeezed;
        controller.trigger = squeezed;
    }
    head.send(&scripted);
    sleep(length);
}

pub(super) fn perform(environment: &Environment, name: &str) -> anyhow::Result<Figures> {
    let scene = environment.scene_of(name, Driver::Remote, Compositor::Null)?;
    let mut head = scene.monado.head();
    // Held when the question comes: that is no answer.
    squeeze(&mut head, 1.0, Duration::ZERO);
    let server = scene.server(PuppetSize::SMALL)?;
    fs::remove_file(scene.known_servers())?;
    let sender = scene.sender(&server);
    let mut process = scene.process()?;
    let activity = process.launch(opening(&sender.viewers))?;
    process.wait_for("asking whether to go to", 1)?;
    shows_a_notice(&mut process)?;
    sleep(NOTHING);
    ensure!(
        process.logged("agrees") == 0 && !sender.program.said().contains("viewer has joined"),
        "the app joined without an answer"
    );
    // Not long enough.
    squeeze(&mut head, 0.0, Duration::from_millis(500));
    squeeze(&mut head, 1.0, Duration::from_millis(300));
    squeeze(&mut head, 0.0, Duration::from_millis(500));
    ensure!(process.logged("agrees") == 0, "a short press is no answer");
    squeeze(&mut head, 1.0, HELD);
    process.wait_for("agrees to go to", 1)?;
    squeeze(&mut head, 0.0, Duration::ZERO);
    shows_people(&mut process)?;
    process.leave(activity)?;

    // The same server again, and by another link.
    let activity = process.launch(opening(&sender.viewers))?;
    shows_people(&mut process)?;
    process.leave(activity)?;
    ensure!(
        process.logged("asking whether to go to") == 1,
        "the wearer was asked twice about one server"
    );

    assert_well(&mut process)?;

    // Over the internet without TLS: not even asked.
    let activity = process.launch(opening_call("http://203.0.113.9:8080/calls/c7#token"))?;
    // It is an error in the log, which no further wait would pass.
    process.wait_for("speaks plain HTTP", 1).or_else(|error| {
        let is_told = process.logged("speaks plain HTTP") > 0;
        if is_told { Ok(()) } else { Err(error) }
    })?;
    process.leave(activity)?;
    ensure!(
        process.logged("asking whether to go to") == 1,
        "what is not protected was asked about"
    );
    process.quit()?;
    let mut figures = Figures::new();
    figure(&mut figures, "asked", 1);
    Ok(figures)
}
