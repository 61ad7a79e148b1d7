//! `--display none`: every frame is taken as soon as it is due, and nothing is drawn: what is measured is the network and the link.

use super::people::Person;
use crate::until::Until;
use app_session::call::Call;
use app_session::participant::{CallReport, NetworkContext};
use link_call::Viewer;
use std::time::Duration;

/// How long to wait at most before looking whether it is time to leave.
const LOOK: Duration = Duration::from_millis(50);

/// Takes a person's frames until it is over.
pub(super) fn run(person: &Person, network: &NetworkContext, until: &Until) -> CallReport {
    let viewer = {
        // Its tasks run on the network's threads.
        let _network = network.network.enter();
        Viewer::join(network.client.clone(), person.room.clone(), network.clock)
    };
    let skeleton = &person.avatar.skeleton;
    let mut call = Call::new(viewer, person.announced, skeleton, network.clock);
    while !until.is_over(0) && !call.is_over() {
        call.wait(LOOK);
    }
    let report = CallReport {
        end: call.end(),
        figures: call.figures(),
    };
    network.network.block_on(call.hang_up());
    report
}
