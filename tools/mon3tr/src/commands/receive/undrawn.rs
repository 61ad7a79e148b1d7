//! `--display none`: every frame is taken as soon as it is due, and nothing is drawn: what is measured is the network and the link.

use crate::until::Until;
use app_session::call::Call;
use std::time::Duration;

/// How long to wait at most before looking whether it is time to leave.
const LOOK: Duration = Duration::from_millis(50);

/// Takes frames until it is over.
pub(super) fn run(call: &mut Call, until: &Until) {
    while !until.is_over() && !call.is_over() {
        call.wait(LOOK);
    }
}
