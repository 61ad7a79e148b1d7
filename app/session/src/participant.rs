//! The people of a session: what they look like, where their motion comes from, and the call that each of them is in.

use crate::call::{Call, CallEnd, CallFigures, CallWatch};
use crate::clip::ClipSource;
use crate::own_motion::OwnMotion;
use crate::pose_queue::PoseQueue;
use crate::presence::Seated;
use app_pipeline::control::Control;
use app_pipeline::lanes::{MotionSource, PausableSource, Pose, Visibility};
use app_pipeline::timeline::DisplayLag;
use link_call::{Authentication, Credentials, Viewer};
use link_http::Client;
use link_playout::Clock;
use link_protocol::{Announcement, RoomLink};
use link_voice::VoiceQueue;
use spmm3::{Avatar, MotionParams};
use std::sync::Arc;
use std::time::Duration;
use tokio::runtime::Handle;

/// A person to be shown.
#[derive(Debug, Clone)]
pub struct Participant {
    /// What they look like.
    pub avatar: Arc<Avatar>,
    /// Whether they are to sit, on a chair.
    pub sits: bool,
    /// Where their motion comes from.
    pub origin: Origin,
}

/// Where a person's motion comes from.
#[derive(Debug, Clone)]
#[expect(
    clippy::large_enum_variant,
    reason = "a session has one for each of its few people"
)]
pub enum Origin {
    /// A sender in a room, which is joined as a viewer once everything is ready to be shown.
    Room {
        /// The viewers' link.
        link: RoomLink,
        /// What the sender announced there.
        announced: Announcement,
        /// The way to the room.
        network: NetworkContext,
        /// What they say goes there, to be played.
        voice: VoiceQueue,
        /// What is counted and told of the call goes there; a watch of its own for each call.
        watch: CallWatch,
    },
    /// A clip, again and again.
    Clip {
        /// Its frames.
        frames: Vec<MotionParams>,
        /// Frames a second.
        rate_hz: f64,
    },
    /// Poses that are handed to them one at a time.
    Queue(PoseQueue),
    /// The person who looks, as in a mirror.
    Own(OwnMotion),
}

/// What a call needs of the network.
#[derive(Debug, Clone)]
pub struct NetworkContext {
    /// The network's threads.
    pub network: Handle,
    /// Asks servers.
    pub client: Client,
    /// One's own key, which senders are shown.
    pub own: Option<Credentials>,
    /// The clock of frames' times.
    pub clock: Clock,
}

/// A call that is over.
#[derive(Debug)]
pub struct CallReport {
    /// What was measured.
    pub figures: CallFigures,
    /// Why it is over; nothing where this side left.
    pub end: Option<CallEnd>,
    /// What was counted and told of it, which tells whose it was.
    pub watch: CallWatch,
}

impl NetworkContext {
    /// Joins the room as a viewer of its sender, who announced this, and drives this avatar if its signer lets them. What is said goes to `voice`,
    /// what is counted to `watch`.
    #[must_use]
    pub fn join(
        &self,
        link: &RoomLink,
        announced: Announcement,
        avatar: &Avatar,
        voice: VoiceQueue,
        watch: CallWatch,
    ) -> Call {
        let viewer = {
            // Its tasks run on the network's threads.
            let _network = self.network.enter();
            let authentication = Authentication {
                own: self.own.clone(),
                signer: avatar.signer,
            };
            let client = self.client.clone();
            Viewer::join(
                client,
                link.clone(),
                authentication,
                self.clock,
                voice.clone(),
            )
        };
        Call::new(
            viewer,
            announced,
            &avatar.skeleton,
            self.clock,
            voice,
            watch,
        )
    }
}

impl CallReport {
    /// Says goodbye, on the network's threads.
    #[must_use]
    pub fn hang_up(mut call: Call, network: &Handle) -> Self {
        let report = Self {
            end: call.end(),
            figures: call.figures(),
            watch: call.watch(),
        };
        network.block_on(call.hang_up());
        report
    }
}

/// A person's poses, as the lanes take them: dropped in a pause, seated if asked for.
pub type PersonSource = PausableSource<Seated<PersonMotion>>;

/// A person's motion.
#[derive(Debug)]
pub enum PersonMotion {
    /// From a sender.
    Call {
        /// The viewer's end.
        call: Box<Call>,
        /// The threads that it ends on.
        network: Handle,
    },
    /// From a clip.
    Clip(ClipSource),
    /// One pose at a time.
    Queue(PoseQueue),
    /// As this side's own capture gives it.
    Own(OwnMotion),
}

impl MotionSource for PersonMotion {
    fn next(&mut self, longest: Duration) -> Option<Pose> {
        match self {
            Self::Call { call, .. } => call.next(longest),
            Self::Clip(clip) => clip.next(longest),
            Self::Queue(poses) => poses.next(longest),
            Self::Own(own) => own.next(longest),
        }
    }

    fn is_over(&self) -> bool {
        match self {
            Self::Call { call, .. } => call.is_over(),
            Self::Clip(clip) => clip.is_over(),
            Self::Queue(poses) => poses.is_over(),
            Self::Own(own) => own.is_over(),
        }
    }

    fn display_lag(&self) -> DisplayLag {
        match self {
            Self::Call { call, .. } => call.display_lag(),
            Self::Clip(clip) => clip.display_lag(),
            Self::Queue(poses) => poses.display_lag(),
            Self::Own(own) => own.display_lag(),
        }
    }

    fn visibility(&self) -> Visibility {
        match self {
            Self::Call { call, .. } => call.visibility(),
            Self::Clip(clip) => clip.visibility(),
            Self::Queue(poses) => poses.visibility(),
            Self::Own(own) => own.visibility(),
        }
    }
}

impl PersonMotion {
    /// What the call counts, if there is one.
    pub(crate) fn watch(&self) -> Option<CallWatch> {
        match self {
            Self::Call { call, .. } => Some(call.watch()),
            Self::Clip(_) | Self::Queue(_) | Self::Own(_) => None,
        }
    }

    /// What they say, if there is a call.
    pub(crate) fn voice(&self) -> Option<VoiceQueue> {
        match self {
            Self::Call { call, .. } => Some(call.voice()),
            Self::Clip(_) | Self::Queue(_) | Self::Own(_) => None,
        }
    }

    /// Says goodbye; what the call came to, if there was one.
    pub(crate) fn end(self) -> Option<CallReport> {
        match self {
            Self::Call { call, network } => Some(CallReport::hang_up(*call, &network)),
            Self::Clip(_) | Self::Queue(_) | Self::Own(_) => None,
        }
    }
}

impl Participant {
    /// Joins the sender's room, or begins the clip.
    pub(crate) fn join(&self, control: &Control) -> PersonSource {
        let skeleton = &self.avatar.skeleton;
        let motion = match &self.origin {
            Origin::Room {
                link,
                announced,
                network,
                voice,
                watch,
            } => PersonMotion::Call {
                call: Box::new(network.join(
                    link,
                    *announced,
                    &self.avatar,
                    voice.clone(),
                    watch.clone(),
                )),
                network: network.network.clone(),
            },
            Origin::Clip { frames, rate_hz } => {
                PersonMotion::Clip(ClipSource::new(frames.clone(), *rate_hz))
            }
            Origin::Queue(poses) => PersonMotion::Queue(poses.clone()),
            Origin::Own(own) => PersonMotion::Own(own.clone()),
        };
        let seated = if self.sits {
            Seated::new(motion, skeleton)
        } else {
            Seated::as_sent(motion)
        };
        let control = match &self.origin {
            // Each pose is waited for: none may be dropped.
            Origin::Queue(_) => Control::default(),
            Origin::Room { .. } | Origin::Clip { .. } | Origin::Own(_) => control.clone(),
        };
        PausableSource::new(seated, control)
    }
}
