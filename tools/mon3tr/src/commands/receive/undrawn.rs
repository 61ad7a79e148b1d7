//! `--display none`: every frame is taken as soon as it is due, and nothing is drawn: what is measured is the network and the link.

use crate::until::Until;
use app_session::participant::{CallReport, Origin, Participant};
use std::collections::VecDeque;
use std::sync::mpsc::{Receiver, RecvTimeoutError, channel};
use std::thread::ScopedJoinHandle;
use std::time::Duration;

/// How long to wait at most before looking whether it is time to leave.
const LOOK: Duration = Duration::from_millis(50);

/// Reports that are kept of people who left before the end, the newest: people may come and go without end.
const MOST_DEPARTED: usize = 16;

/// The next one of `newcomers`; nothing when it is over.
pub(super) fn next(newcomers: &Receiver<Participant>, until: &Until) -> Option<Participant> {
    while !until.is_over(0) {
        match newcomers.recv_timeout(LOOK) {
            Ok(newcomer) => return Some(newcomer),
            Err(RecvTimeoutError::Timeout) => {}
            Err(RecvTimeoutError::Disconnected) => return None,
        }
    }
    None
}

/// Takes the frames of all `people`, each from when they come, until it is over or there are no more of them. Returns
/// the reports of those who were there to the end, and the newest of the others.
pub(super) fn run(people: impl Iterator<Item = Participant>, until: &Until) -> Vec<CallReport> {
    // By the number of the person.
    let (ended, reports) = channel();
    let mut departed = VecDeque::new();
    std::thread::scope(|scope| {
        let mut live: Vec<ScopedJoinHandle<'_, ()>> = Vec::new();
        for (number, person) in people.enumerate() {
            // A thread that has ended keeps its stack until it is joined.
            for handle in live.extract_if(.., |handle| handle.is_finished()) {
                joined(handle);
            }
            departed.extend(reports.try_iter());
            while departed.len() > MOST_DEPARTED {
                departed.pop_front();
            }
            let ended = ended.clone();
            live.push(scope.spawn(move || {
                // The receiver outlives the scope.
                let _ = ended.send((number, follow(&person, until)));
            }));
        }
        live.into_iter().for_each(joined);
    });
    let mut reports: Vec<_> = departed.into_iter().chain(reports.try_iter()).collect();
    reports.sort_by_key(|(number, _)| *number);
    reports
        .into_iter()
        .filter_map(|(_, report)| report)
        .collect()
}

/// A panic has been written to standard error; the others go on.
fn joined(handle: ScopedJoinHandle<'_, ()>) {
    let _ = handle.join();
}

/// Takes a person's frames until it is over; nothing of one who is in no room.
fn follow(person: &Participant, until: &Until) -> Option<CallReport> {
    let Origin::Room {
        link,
        announced,
        network,
        voice,
        watch,
    } = &person.origin
    else {
        return None;
    };
    let mut call = network.join(
        link,
        *announced,
        &person.avatar,
        voice.clone(),
        watch.clone(),
    );
    while !until.is_over(0) && !call.is_over() {
        call.wait(LOOK);
    }
    Some(CallReport::hang_up(call, &network.network))
}
