//! The cases: a headset's treatment of the app, one process each. A case fails by an error, and reports its measurements.

mod activities;
mod call;
mod consent;
mod first_run;
mod hostile;
mod leaks;
mod member;
mod panics;
mod placement;
mod profile;
mod prove;
mod two_headsets;

use crate::environment::Environment;
use crate::process::Process;
use anyhow::ensure;
use serde_json::{Map, Value};

/// The measurements of a case.
pub(crate) type Figures = Map<String, Value>;

/// A case.
pub(crate) struct Case {
    /// Its name, and that of the folder it leaves.
    pub(crate) name: &'static str,
    /// What it shows.
    pub(crate) shows: &'static str,
    pub(crate) perform: fn(&Environment, &str) -> anyhow::Result<Figures>,
}

/// All of them, the quickest first.
pub(crate) const CASES: [Case; 18] = [
    Case {
        name: "first-run",
        shows: "an app that knows no room says in the headset what to type",
        perform: first_run::perform,
    },
    Case {
        name: "five-activities",
        shows: "an activity may be made again in the same process, and none that is being destroyed is asked to finish",
        perform: activities::five_one_after_another,
    },
    Case {
        name: "two-activities",
        shows: "a second activity beside the first does not abort the process",
        perform: activities::two_at_once,
    },
    Case {
        name: "link-follows",
        shows: "a link that is opened while the app runs joins that room, and a launch without one goes back to the call",
        perform: activities::a_link_while_it_runs,
    },
    Case {
        name: "runtime-restarts",
        shows: "a notice comes back with the runtime's service",
        perform: activities::the_runtime_restarts,
    },
    Case {
        name: "hostile",
        shows: "intents and links from strangers are refused in words, and input is left to the system",
        perform: hostile::perform,
    },
    Case {
        name: "consent",
        shows: "a link to a server that is new to the wearer asks them first, and goes there once they hold a grip",
        perform: consent::perform,
    },
    Case {
        name: "panic",
        shows: "addresses that a panic of the packaged library logs become lines of the source",
        perform: panics::perform,
    },
    Case {
        name: "whole-call",
        shows: "a call from a link: download, motion, pauses, low memory, the sender's restart, the sender's end",
        perform: call::perform,
    },
    Case {
        name: "validation",
        shows: "a call makes the validation layer say nothing",
        perform: call::perform_validated,
    },
    Case {
        name: "member",
        shows: "a call of several with a desktop: each sees the other move and hears what the other says, also after the sound devices were away",
        perform: member::perform,
    },
    Case {
        name: "two-headsets",
        shows: "two apps in one call, and nobody else: each sees the other move and hears what the other says",
        perform: two_headsets::perform,
    },
    Case {
        name: "member-without",
        shows: "a call of several without an avatar says what to do, and without the microphone goes on",
        perform: member::perform_without,
    },
    Case {
        name: "placement-paused",
        shows: "pauses while placements are tried do not hold the main thread up",
        perform: placement::paused,
    },
    Case {
        name: "placement-destroyed",
        shows: "an activity is destroyed within a second while placements are tried",
        perform: placement::destroyed,
    },
    Case {
        name: "profile",
        shows: "a measurement of five seconds leaves all its files",
        perform: profile::perform,
    },
    Case {
        name: "prove",
        shows: "android/prove.sh, in short, with the rehearsal as its device: a row for every claim, and none that did not hold",
        perform: prove::perform,
    },
    Case {
        name: "leaks",
        shows: "twenty activities one after another leave no thread, descriptor, reference or memory behind",
        perform: leaks::perform,
    },
];

/// The most that one callback may keep Android's main thread, milliseconds; for a destruction, which waits for every thread's end.
const MAIN_THREAD_MS: f64 = 100.0;
const DESTRUCTION_MS: f64 = 1000.0;

/// Checks that there were no faults against Java, and no errors in the log.
fn assert_well(process: &mut Process) -> anyhow::Result<()> {
    let java = process.census()?.java;
    ensure!(
        java.faults.is_empty(),
        "Java's side: {}",
        java.faults.join("; ")
    );
    ensure!(
        java.borrowed_strings == 0,
        "{} strings of Java's were not given back",
        java.borrowed_strings
    );
    let trouble = process.trouble();
    ensure!(
        trouble.is_none(),
        "the log tells of trouble:\n{}",
        trouble.unwrap_or_default()
    );
    Ok(())
}

/// A figure by its name.
fn figure(figures: &mut Figures, name: &str, value: impl Into<Value>) {
    figures.insert(name.to_owned(), value.into());
}
