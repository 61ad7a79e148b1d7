//! The calls of everybody who is visited: joined when all is ready to show them, ended when it is over.

use crate::call::{Call, CallEnd, CallFigures};
use crate::headset::{
    FrameObserver, Gathered, HeadsetError, HeadsetHandle, Party, Wishes, show_party,
};
use crate::presence::Seated;
use app_pipeline::control::Control;
use app_pipeline::error::ReceiverError;
use app_pipeline::placement::InferenceBackends;
use link_call::Viewer;
use link_http::Client;
use link_playout::Clock;
use link_protocol::{Announcement, RoomLink};
use spmm3::Avatar;
use std::sync::Arc;
use tokio::runtime::Handle;

/// Somebody to be shown.
#[derive(Debug, Clone)]
pub struct Guest {
    /// Where they are.
    pub room: RoomLink,
    /// What was told of them there.
    pub announced: Announcement,
    /// What they look like.
    pub avatar: Arc<Avatar>,
    /// Whether they are to sit, on a chair.
    pub sits: bool,
}

/// The ways to people.
#[derive(Debug, Clone)]
pub struct NetworkContext {
    /// The network's threads.
    pub network: Handle,
    /// Asks servers.
    pub client: Client,
    /// What frames' times are told by.
    pub clock: Clock,
}

/// A call that is over.
#[derive(Debug)]
pub struct Ended {
    /// What it came to.
    pub figures: CallFigures,
    /// Why it is over; nothing where this side left.
    pub end: Option<CallEnd>,
}

/// What is left of a visit.
#[derive(Debug)]
pub struct Visited {
    /// Everybody's call, in the order of the guests, or what ended a lane of theirs.
    pub calls: Vec<Result<Ended, ReceiverError>>,
    /// What showing them came to.
    pub party: Party<()>,
}

/// Shows `guests` in the headset until all calls are over, `control` leaves or `watcher` says so,
/// and says goodbye to everybody. As [`show_party`] otherwise.
///
/// # Errors
/// If nothing can run or draw them, or the headset cannot be shown anything. That one of the calls fails is no error of all:
/// [`Visited::calls`] tells.
pub fn visit(
    found: HeadsetHandle,
    backends: &InferenceBackends<'_>,
    wishes: &Wishes,
    guests: &[Guest],
    ways: &NetworkContext,
    control: &Control,
    watcher: &mut dyn FrameObserver,
) -> Result<Visited, HeadsetError> {
    let avatars: Vec<_> = (guests.iter())
        .map(|guest| Arc::clone(&guest.avatar))
        .collect();
    let join = || {
        let sources: Vec<_> = (guests.iter()).map(|guest| guest.join(ways)).collect();
        Gathered {
            watch: sources.first().map(|first| first.source().watch()),
            sources,
        }
    };
    let party = show_party(found, backends, wishes, &avatars, join, control, watcher)?;
    let (sources, party) = party.without_sources();
    let calls = sources.into_iter().map(|source| {
        let mut call = source?.into_source();
        let ended = Ended {
            end: call.end(),
            figures: call.figures(),
        };
        ways.network.block_on(call.hang_up());
        Ok(ended)
    });
    Ok(Visited {
        calls: calls.collect(),
        party,
    })
}

impl Guest {
    fn join(&self, ways: &NetworkContext) -> Seated<Call> {
        let viewer = {
            // Its tasks run on the network's threads.
            let _network = ways.network.enter();
            Viewer::join(ways.client.clone(), self.room.clone(), ways.clock)
        };
        let skeleton = &self.avatar.skeleton;
        let call = Call::new(viewer, self.announced, skeleton, ways.clock);
        if self.sits {
            Seated::new(call, skeleton)
        } else {
            Seated::as_sent(call)
        }
    }
}
