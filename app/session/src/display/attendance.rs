//! People who come and go while a session is shown: each newcomer is joined and made ready in the background, then taken into the picture between two frames;
//! to whoever has left, goodbye is said in the background.

use super::{SCENERY_GAUSSIANS, SessionError};
use crate::attendee::{Attendee, PersonReport};
use crate::call::CallWatch;
use crate::participant::{Origin, Participant, PersonSource};
use app_pipeline::control::Control;
use app_pipeline::error::ReceiverError;
use app_pipeline::lanes::{FinishedPerson, Lanes, PausableSource};
use app_pipeline::placement::{InferenceBackends, Placed, PlacementReport, place_like};
use app_pipeline::pool::in_own_pool;
use link_protocol::limits::MAX_PEOPLE;
use link_voice::VoiceQueue;
use renderer_splat::error::RenderError;
use renderer_splat::options::RendererOptions;
use renderer_splat::renderer::SplatRenderer;
use spmm3::Avatar;
use spmm3::package::PackageLimits;
use std::sync::Arc;
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender};
use std::time::Duration;

/// Between two looks whether the session is over.
const LOOK: Duration = Duration::from_millis(50);

/// Gaussians that all people of a call may have together: what others bring must not take the device's memory.
const MOST_GAUSSIANS: u32 = 2_000_000;

/// Each of them may have so many that there is room for everyone, whoever came first: an avatar of 100,000 to 200,000 fits.
const MOST_EACH: usize = PackageLimits::OTHERS.gaussians;
const _: () = assert!(
    MOST_EACH * MAX_PEOPLE <= MOST_GAUSSIANS as usize,
    "there is room for everyone"
);

/// Reports that are kept of people who left before the end, the newest: people may come and go without end.
const MOST_REPORTS: usize = 16;

/// A newcomer who is ready to be shown.
#[derive(Debug)]
pub(crate) struct Ready {
    avatar: Arc<Avatar>,
    placed: Placed,
    source: PersonSource,
    watch: Option<CallWatch>,
    voice: Option<VoiceQueue>,
}

/// Someone who has left the picture, or never came into it.
#[derive(Debug)]
pub(crate) enum Departed {
    Shown(Box<FinishedPerson<PersonSource>>, Box<Attendee>),
    TurnedAway(Box<PersonSource>),
}

/// Both ends that a session has while it is shown: who is ready to come, and who has left.
#[derive(Debug)]
pub(crate) struct Attendance {
    pub(crate) ready: Receiver<Ready>,
    pub(crate) departed: Sender<Departed>,
}

/// What newcomers are made ready with.
#[derive(Debug)]
pub(crate) struct Doorway<'a> {
    pub(crate) newcomers: Receiver<Participant>,
    pub(crate) ready: Sender<Ready>,
    pub(crate) departed: Receiver<Departed>,
    pub(crate) backends: &'a InferenceBackends<'a>,
    /// How the first person is placed.
    pub(crate) like: PlacementReport,
    pub(crate) control: &'a Control,
}

impl Doorway<'_> {
    /// Makes newcomers ready, one after the other, and says goodbye to who has left, until the session is over. Calls are joined first: the connection is
    /// made meanwhile. Returns the newest reports of people who were shown and have left.
    pub(crate) fn attend(self, is_over: impl Fn() -> bool) -> Vec<PersonReport> {
        let mut reports = Vec::new();
        while !is_over() && !self.control.is_leaving() {
            self.say_goodbyes(&mut reports);
            match self.newcomers.recv_timeout(LOOK) {
                Ok(newcomer) => self.make_ready(&newcomer),
                Err(RecvTimeoutError::Timeout) => {}
                // No one else comes, but people may go.
                Err(RecvTimeoutError::Disconnected) => std::thread::sleep(LOOK),
            }
        }
        // The display ends with the session, after its last picture.
        while !is_over() {
            std::thread::sleep(LOOK);
        }
        self.say_goodbyes(&mut reports);
        reports
    }

    fn make_ready(&self, newcomer: &Participant) {
        if let Origin::Room { watch, .. } = &newcomer.origin
            && watch.is_over()
        {
            // They have left while others were made ready.
            return;
        }
        let count = newcomer.avatar.gaussians.len();
        if count > MOST_EACH {
            log::warn!(
                "a person cannot be shown: their avatar has {count} Gaussians, and each of a call may have {MOST_EACH}"
            );
            if let Origin::Room { watch, .. } = &newcomer.origin {
                watch.leave();
            }
            return;
        }
        let source = newcomer.join(self.control);
        let motion = source.source().source();
        let (watch, voice) = (motion.watch(), motion.voice());
        match place_like(self.backends, &newcomer.avatar, &self.like, self.control) {
            Ok(placed) => {
                let newcomer = Ready {
                    avatar: Arc::clone(&newcomer.avatar),
                    placed,
                    source,
                    watch,
                    voice,
                };
                if let Err(unsent) = self.ready.send(newcomer) {
                    unsent.0.turn_away();
                }
            }
            Err(error) => {
                if !self.control.is_leaving() {
                    tell_refused(&error);
                }
                turn_away(source, watch.as_ref());
            }
        }
    }

    fn say_goodbyes(&self, reports: &mut Vec<PersonReport>) {
        for departed in self.departed.try_iter() {
            match departed {
                Departed::TurnedAway(source) => end(*source),
                Departed::Shown(finished, attendee) => {
                    if reports.len() == MOST_REPORTS {
                        reports.remove(0);
                    }
                    reports.push(PersonReport::of(*finished, *attendee));
                }
            }
        }
    }
}

fn tell_refused(error: &ReceiverError) {
    log::warn!("a person cannot be shown: {}", error.in_full());
}

/// Says goodbye to a person who is not shown, which takes as long as the network does.
fn end(source: PersonSource) {
    drop(PausableSource::into_source(source).into_source().end());
}

fn turn_away(source: PersonSource, watch: Option<&CallWatch>) {
    // Who is in the call shall not be told that they are seen.
    if let Some(watch) = watch {
        watch.leave();
    }
    end(source);
}

impl Ready {
    /// Says goodbye instead.
    pub(crate) fn turn_away(self) {
        turn_away(self.source, self.watch.as_ref());
    }

    /// Takes the person into the picture. Returns their number; nothing where they cannot be shown, which is told.
    ///
    /// # Errors
    /// If nothing can be drawn any longer.
    pub(crate) fn join(
        self,
        lanes: &mut Lanes<PersonSource>,
        people: &mut Vec<Attendee>,
        departed: &Sender<Departed>,
    ) -> Result<Option<usize>, SessionError> {
        let Self {
            avatar,
            placed,
            source,
            watch,
            voice,
        } = self;
        // The other end is there as long as the session: there is nothing to do where it is not.
        let bid_farewell = |gone| drop(departed.send(gone));
        if let Err(refusal) = make_room(lanes, &avatar)? {
            tell_refused(&refusal);
            if let Some(watch) = &watch {
                watch.leave();
            }
            bid_farewell(Departed::TurnedAway(Box::new(source)));
            return Ok(None);
        }
        let Placed {
            plan,
            inference,
            report,
        } = placed;
        // Networks are repacked for the kernels by several threads, which end with that.
        let joined = in_own_pool("join", || lanes.join(&avatar, inference, source, plan)).flatten();
        let joined = match joined {
            Ok(joined) => joined,
            Err(error) => {
                tell_refused(&error);
                // Their source is gone, and ends by itself.
                if let Some(watch) = &watch {
                    watch.leave();
                }
                return Ok(None);
            }
        };
        let attendee = Attendee {
            avatar,
            placement: report,
            watch,
            voice,
        };
        match people.get_mut(joined.number) {
            Some(place) => {
                let gone = std::mem::replace(place, attendee);
                if let Some(finished) = joined.replaced {
                    bid_farewell(Departed::Shown(Box::new(finished), Box::new(gone)));
                }
            }
            None => people.push(attendee),
        }
        Ok(Some(joined.number))
    }
}

/// Has the renderer take the Gaussians of one more person; or says why it does not.
///
/// # Errors
/// If the people who are there cannot be drawn any longer.
fn make_room(
    lanes: &mut Lanes<PersonSource>,
    avatar: &Avatar,
) -> Result<Result<(), ReceiverError>, SessionError> {
    let count = u32::try_from(avatar.gaussians.len()).unwrap_or(u32::MAX);
    // Each person's shadow is more scenery than there is now.
    let wanted = (lanes.room_taken())
        .saturating_add(count)
        .saturating_add(SCENERY_GAUSSIANS);
    let renderer = lanes.renderer();
    let room = renderer.options().max_foreground;
    if wanted <= room {
        return Ok(Ok(()));
    }
    if wanted > MOST_GAUSSIANS {
        let refusal = RenderError::TooManyGaussians {
            count: wanted as usize,
            limit: MOST_GAUSSIANS,
        };
        return Ok(Err(refusal.into()));
    }
    let options = RendererOptions {
        // Twice as many: the next newcomers find room.
        max_foreground: wanted.max(room.saturating_mul(2).min(MOST_GAUSSIANS)),
        // The faster one has been found, but for a headset's images, into which each has a way of its own.
        back_end: if renderer.gpu().belongs_to_headset() {
            renderer.options().back_end
        } else {
            Some(renderer.back_end())
        },
        ..renderer.options().clone()
    };
    let gpu = Arc::clone(renderer.gpu());
    match SplatRenderer::new(gpu, &options) {
        Ok(renderer) => Ok(Ok(lanes.replace_renderer(renderer)?)),
        Err(error) => Ok(Err(error.into())),
    }
}
