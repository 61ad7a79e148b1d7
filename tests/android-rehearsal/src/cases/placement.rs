//! While placements are tried: the longest stretch of work of a call's start, and the one that Android is most likely to interrupt.

use super::leaks::{its_threads_end, nothing_is_left};
use super::{DESTRUCTION_MS, Figures, MAIN_THREAD_MS, assert_well, figure};
use crate::environment::{Environment, Server, opening};
use crate::process::{LEAVE, Process};
use android_rehearsal::protocol::{ActivityIndex, Callback};
use anyhow::ensure;
use std::thread::sleep;
use std::time::Duration;
use synthetic_person::PuppetSize;
use test_support::monado::Compositor;

/// Moments after the headset was opened for the call, milliseconds.
const MOMENTS: [u64; 6] = [0, 150, 400, 900, 1600, 2600];

/// A call with a person of real size, so that trials take as long as they do.
fn call(
    environment: &Environment,
    name: &str,
) -> anyhow::Result<(String, Server, impl Sized, impl Sized, Process)> {
    let scene = environment.scene(name, Compositor::Null)?;
    let server = scene.server(PuppetSize::FULL)?;
    let sender = scene.sender(&server);
    let link = sender.viewers.clone();
    let process = scene.process()?;
    Ok((link, server, sender, scene, process))
}

/// An activity that is about to try placements: the headset was opened a second time, after the one of the notice.
fn trying(process: &mut Process, link: &str) -> anyhow::Result<ActivityIndex> {
    let opened = process.logged("xrCreateInstance for API");
    let activity = process.launch(opening(link))?;
    process.wait_for("xrCreateInstance for API", opened + 2)?;
    Ok(activity)
}

pub(super) fn paused(environment: &Environment, name: &str) -> anyhow::Result<Figures> {
    let (link, _server, _sender, _scene, mut process) = call(environment, name)?;
    let activity = trying(&mut process, &link)?;
    let mut longest: f64 = 0.0;
    for moment in MOMENTS {
        sleep(Duration::from_millis(moment / 4));
        // What follows a pause waits until the pause is done with.
        for callback in [
            Callback::Pause,
            Callback::Stop,
            Callback::Start,
            Callback::Resume,
        ] {
            longest = longest.max(process.call(activity, callback)?);
        }
    }
    ensure!(
        longest <= MAIN_THREAD_MS,
        "the main thread was blocked for {longest:.0} ms"
    );
    // The call begins all the same.
    let before = process.census()?.frames.people;
    process.wait_until("pictures of the person", |process| {
        Ok(process.census()?.frames.people > before + 10)
    })?;
    process.leave(activity)?;
    assert_well(&mut process)?;
    process.quit()?;
    let mut figures = Figures::new();
    figure(&mut figures, "longest_ms", longest);
    Ok(figures)
}

pub(super) fn destroyed(environment: &Environment, name: &str) -> anyhow::Result<Figures> {
    let (link, _server, _sender, _scene, mut process) = call(environment, name)?;
    let (mut longest, mut destruction): (f64, f64) = (0.0, 0.0);
    let mut after_each = Vec::new();
    for moment in MOMENTS {
        let activity = trying(&mut process, &link)?;
        sleep(Duration::from_millis(moment));
        for callback in LEAVE {
            let blocked = process.call(activity, callback)?;
            if callback == Callback::Destroy {
                destruction = destruction.max(blocked);
            } else {
                longest = longest.max(blocked);
            }
        }
        its_threads_end(&mut process)?;
        after_each.push(process.census()?);
    }
    assert_well(&mut process)?;
    // The first calls find pools and caches empty; ONNX Runtime and Vulkan are loaded, and stay.
    if let ([_, _, warm, ..], Some(last)) = (after_each.as_slice(), after_each.last()) {
        nothing_is_left(warm, last)?;
    }
    ensure!(
        longest <= MAIN_THREAD_MS && destruction <= DESTRUCTION_MS,
        "the main thread was blocked for {longest:.0} ms, and for {destruction:.0} ms by a destruction"
    );
    process.quit()?;
    let mut figures = Figures::new();
    figure(&mut figures, "longest_ms", longest);
    figure(&mut figures, "destruction_ms", destruction);
    Ok(figures)
}
