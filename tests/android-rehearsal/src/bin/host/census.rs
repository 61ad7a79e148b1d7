//! The process's threads, descriptors, memory and libraries, from the kernel.

use android_rehearsal::protocol::Census;
use anyhow::Context;
use std::collections::BTreeSet;
use std::fs;

/// The process's part; the rest is the default's.
pub(crate) fn take() -> anyhow::Result<Census> {
    let mut threads = Vec::new();
    for task in fs::read_dir("/proc/self/task")? {
        // A thread may end meanwhile.
        if let Ok(name) = fs::read_to_string(task?.path().join("comm")) {
            threads.push(name.trim().to_owned());
        }
    }
    let mut descriptors = Vec::new();
    for descriptor in fs::read_dir("/proc/self/fd")? {
        if let Ok(what) = fs::read_link(descriptor?.path()) {
            descriptors.push(kind(&what.to_string_lossy()));
        }
    }
    threads.sort();
    descriptors.sort();
    let status = fs::read_to_string("/proc/self/status")?;
    let resident = status
        .lines()
        .find_map(|line| line.strip_prefix("VmRSS:"))
        .and_then(|rest| rest.trim().strip_suffix(" kB")?.trim().parse::<u64>().ok())
        .context("/proc/self/status has no VmRSS")?;
    Ok(Census {
        threads,
        descriptors,
        libraries: libraries()?,
        resident: resident * 1024,
        ..Census::default()
    })
}

/// A descriptor without what differs from one to the next of its kind: `socket:[123]` is `socket`.
fn kind(what: &str) -> String {
    match what.split_once(":[") {
        Some((kind, _)) => kind.to_owned(),
        None => what.to_owned(),
    }
}

/// Files that are mapped as libraries.
fn libraries() -> anyhow::Result<Vec<String>> {
    let maps = fs::read_to_string("/proc/self/maps")?;
    let names = maps.lines().filter_map(|line| {
        let name = line.rsplit('/').next()?;
        (name.ends_with(".so") || name.contains(".so.")).then(|| name.to_owned())
    });
    Ok(names.collect::<BTreeSet<_>>().into_iter().collect())
}
