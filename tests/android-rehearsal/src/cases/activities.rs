//! Activities that share a process: Android keeps it between them.

use super::call::shows_people;
use super::{Figures, assert_well};
use crate::environment::{Environment, opening};
use crate::process::{LEAVE, Process};
use android_rehearsal::protocol::{ActivityIndex, Callback, Intent};
use anyhow::ensure;
use synthetic_person::PuppetSize;
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

/// As when a link is opened in the browser during a call: Android makes another activity on top. Then the app is launched by its icon.
pub(super) fn a_link_while_it_runs(
    environment: &Environment,
    name: &str,
) -> anyhow::Result<Figures> {
    let scene = environment.scene(name, Compositor::Null)?;
    let server = scene.server(PuppetSize::SMALL)?;
    let (one, other) = (scene.sender(&server), scene.sender(&server));
    let mut process = scene.process()?;
    let first = process.launch(opening(&one.viewers))?;
    shows_people(&mut process)?;
    let (pause, rest) = LEAVE.split_at(1);
    process.calls(first, pause)?;
    let second = process.launch(opening(&other.viewers))?;
    asks_to_finish(&mut process, first)?;
    process.calls(first, rest)?;
    shows_people(&mut process)?;
    let joined = process.logged("joined (session");
    ensure!(joined == 2, "{joined} rooms were joined");
    // By the icon: there is no link, and the call is still there.
    process.calls(second, &[Callback::Pause, Callback::Stop])?;
    let launched = process.launch(Intent::default())?;
    asks_to_finish(&mut process, launched)?;
    process.calls(launched, pause)?;
    process.calls(second, &[Callback::Start, Callback::Resume])?;
    process.calls(launched, rest)?;
    shows_people(&mut process)?;
    process.leave(second)?;
    assert_well(&mut process)?;
    let finishes: Vec<u32> = (process.census()?.java.finishes.iter())
        .map(|[java, _]| *java)
        .collect();
    ensure!(finishes == [1, 0, 1], "asked to finish: {finishes:?}");
    process.quit()?;
    Ok(Figures::new())
}

/// Until the app has asked Android to finish this activity.
fn asks_to_finish(process: &mut Process, activity: ActivityIndex) -> anyhow::Result<()> {
    process.wait_until("an activity that asks to be finished", |process| {
        let finishes = process.census()?.java.finishes;
        Ok(finishes.get(activity).is_some_and(|[java, _]| *java > 0))
    })
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
