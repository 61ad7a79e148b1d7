//! Activities that share a process: Android keeps it between them.

use super::{Figures, assert_well};
use crate::environment::Environment;
use crate::process::{LEAVE, Process};
use android_rehearsal::protocol::Intent;
use anyhow::ensure;
use test_support::monado::Compositor;

/// Until the notice is shown.
pub(super) fn shows_a_notice(process: &mut Process) -> anyhow::Result<()> {
    let before = process.census()?.frames.others;
    process.wait_until("frames with a notice", |process| {
        Ok(process.census()?.frames.others >= before + 3)
    })
}

pub(super) fn five_one_after_another(
    environment: &Environment,
    name: &str,
) -> anyhow::Result<Figures> {
    let scene = environment.scene(name, Compositor::Null)?;
    let mut process = scene.process()?;
    for _ in 0..5 {
        let activity = process.launch(Intent::default())?;
        shows_a_notice(&mut process)?;
        process.leave(activity)?;
    }
    assert_well(&mut process)?;
    let census = process.census()?;
    for (activity, [java, _]) in census.java.finishes.iter().enumerate() {
        ensure!(
            *java == 0,
            "activity {activity} was asked to finish {java} times by the app, although it was being destroyed"
        );
    }
    ensure!(
        process.logged("the call is over") == 0,
        "the log says that a call is over where there was none"
    );
    ensure!(
        census.window_references == 0,
        "{} references to windows are held by activities that are gone",
        census.window_references
    );
    process.quit()?;
    Ok(Figures::new())
}

/// As when the app is launched again while its activity, which has asked to be finished, is still being taken down: the second one is in
/// front before the first one gets its last events.
pub(super) fn two_at_once(environment: &Environment, name: &str) -> anyhow::Result<Figures> {
    let scene = environment.scene(name, Compositor::Null)?;
    let mut process = scene.process()?;
    let first = process.launch(Intent::default())?;
    shows_a_notice(&mut process)?;
    let (pause, rest) = LEAVE.split_at(1);
    process.calls(first, pause)?;
    let second = process.launch(Intent::default())?;
    process.calls(first, rest)?;
    shows_a_notice(&mut process)?;
    process.leave(second)?;
    assert_well(&mut process)?;
    process.quit()?;
    Ok(Figures::new())
}

/// The runtime's service ends under a notice, as Meta's does when it is updated, and comes back.
pub(super) fn the_runtime_restarts(
    environment: &Environment,
    name: &str,
) -> anyhow::Result<Figures> {
    let mut scene = environment.scene(name, Compositor::Null)?;
    let mut process = scene.process()?;
    let activity = process.launch(Intent::default())?;
    shows_a_notice(&mut process)?;
    scene.monado.kill();
    process.wait_for("waiting for it", 1)?;
    scene.monado.restart();
    shows_a_notice(&mut process)?;
    process.leave(activity)?;
    assert_well(&mut process)?;
    process.quit()?;
    Ok(Figures::new())
}
