//! `--display none`: every frame is taken as soon as it is due, and nothing is drawn: what is measured is the network and the link.

use super::people::Person;
use crate::until::Until;
use app_session::participant::{CallReport, NetworkContext};
use std::time::Duration;

/// How long to wait at most before looking whether it is time to leave.
const LOOK: Duration = Duration::from_millis(50);

/// Takes a person's frames until it is over.
pub(super) fn run(person: &Person, network: &NetworkContext, until: &Until) -> CallReport {
    let skeleton = &person.avatar.skeleton;
    let mut call = network.join(
        &person.room,
        person.announced,
        skeleton,
        person.voice.clone(),
    );
    while !until.is_over(0) && !call.is_over() {
        call.wait(LOOK);
    }
    CallReport::hang_up(call, &network.network)
}
