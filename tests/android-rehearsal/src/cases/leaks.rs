//! Activities remade in one process, as Android does with an app that is left and opened again all day.

use super::activities::shows_a_notice;
use super::{Figures, assert_well, figure};
use crate::environment::Environment;
use crate::process::Process;
use android_rehearsal::protocol::{Census, Intent};
use anyhow::ensure;
use std::collections::BTreeMap;
use test_support::monado::Compositor;

const REMAKES: usize = 20;
/// The first of them, which fill caches.
const WARM_UP: usize = 5;
const OF_AN_ACTIVITY: [&str; 3] = ["android_main", "receiver", "network"];
/// What the rest may add to the resident memory: variation of the allocator and the driver, but not a renderer's 30 MB.
const MOST_GROWTH: u64 = 12_000_000;

pub(super) fn perform(environment: &Environment, name: &str) -> anyhow::Result<Figures> {
    let scene = environment.scene(name, Compositor::Null)?;
    // glibc keeps memory apart for each of many threads; Android does not.
    let mut process = scene.process_with(&[("MALLOC_ARENA_MAX", "1")])?;
    let mut warm = Census::default();
    for remake in 1..=REMAKES {
        let activity = process.launch(Intent::default())?;
        shows_a_notice(&mut process)?;
        process.leave(activity)?;
        its_threads_end(&mut process)?;
        if remake == WARM_UP {
            warm = process.census()?;
        }
    }
    assert_well(&mut process)?;
    let last = process.census()?;
    nothing_is_left(&warm, &last)?;
    ensure!(
        last.java.global_references <= warm.java.global_references,
        "global references: {} after {WARM_UP}, {} after {REMAKES}",
        warm.java.global_references,
        last.java.global_references
    );
    ensure!(
        last.java.attached_threads == warm.java.attached_threads,
        "attached threads: {} after {WARM_UP}, {} after {REMAKES}",
        warm.java.attached_threads,
        last.java.attached_threads
    );
    let growth = last.resident.saturating_sub(warm.resident);
    ensure!(
        growth < MOST_GROWTH,
        "{growth} bytes more are resident after {REMAKES} activities than after {WARM_UP}"
    );
    process.quit()?;
    let mut figures = Figures::new();
    figure(&mut figures, "activities", REMAKES);
    figure(&mut figures, "growth_bytes", growth);
    figure(&mut figures, "resident_bytes", last.resident);
    figure(&mut figures, "threads", last.threads);
    Ok(figures)
}

/// Android is answered a moment before the threads of an activity that it destroys end.
pub(super) fn its_threads_end(process: &mut Process) -> anyhow::Result<()> {
    process.wait_until("the end of the activity's threads", |process| {
        let threads = process.census()?.threads;
        Ok(!(threads.iter()).any(|name| OF_AN_ACTIVITY.contains(&name.as_str())))
    })
}

/// Checks that there are no more threads and descriptors than before.
pub(super) fn nothing_is_left(before: &Census, after: &Census) -> anyhow::Result<()> {
    for (what, before, after) in [
        ("threads", &before.threads, &after.threads),
        ("descriptors", &before.descriptors, &after.descriptors),
    ] {
        let new = more(before, after);
        ensure!(new.is_empty(), "{what} are left: {new:?}");
    }
    Ok(())
}

/// The kinds that there are more of.
fn more(before: &[String], after: &[String]) -> Vec<String> {
    let mut counts = BTreeMap::new();
    for name in after {
        *counts.entry(name).or_insert(0_i32) += 1;
    }
    for name in before {
        *counts.entry(name).or_insert(0) -= 1;
    }
    let more = counts.into_iter().filter(|(_, count)| *count > 0);
    more.map(|(name, count)| format!("{count} x {name}"))
        .collect()
}
