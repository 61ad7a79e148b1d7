//! People who come while a session is shown: each is joined and made ready in the background, then taken into the picture between two frames.

use super::{SCENERY_GAUSSIANS, SessionError};
use crate::participant::{Participant, PersonSource};
use app_pipeline::control::Control;
use app_pipeline::error::ReceiverError;
use app_pipeline::lanes::{Lanes, PausableSource};
use app_pipeline::placement::{InferenceBackends, Placed, PlacementReport, place_like};
use app_pipeline::pool::in_own_pool;
use renderer_splat::options::RendererOptions;
use renderer_splat::renderer::SplatRenderer;
use spmm3::Avatar;
use std::sync::Arc;
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender};
use std::time::Duration;

/// Between two looks whether the session is over.
const LOOK: Duration = Duration::from_millis(50);

/// A newcomer who is ready to be shown.
#[derive(Debug)]
pub(crate) struct Ready {
    avatar: Arc<Avatar>,
    placed: Placed,
    source: PersonSource,
}

/// Makes newcomers ready, one after the other, until the session is over. Their calls are joined first: the connection is made meanwhile.
pub(crate) fn make_ready(
    newcomers: &Receiver<Participant>,
    ready: &Sender<Ready>,
    backends: &InferenceBackends<'_>,
    like: &PlacementReport,
    control: &Control,
    is_over: impl Fn() -> bool,
) {
    while !is_over() && !control.is_leaving() {
        let newcomer = match newcomers.recv_timeout(LOOK) {
            Ok(newcomer) => newcomer,
            Err(RecvTimeoutError::Timeout) => continue,
            Err(RecvTimeoutError::Disconnected) => return,
        };
        let source = newcomer.join(control);
        match place_like(backends, &newcomer.avatar, like, control) {
            Ok(placed) => {
                let newcomer = Ready {
                    avatar: newcomer.avatar,
                    placed,
                    source,
                };
                if let Err(unsent) = ready.send(newcomer) {
                    end(unsent.0.source);
                    return;
                }
            }
            Err(error) => {
                if !control.is_leaving() {
                    log::warn!("a person cannot be shown: {}", error.in_full());
                }
                end(source);
            }
        }
    }
}

/// Says goodbye to a person who is not shown.
pub(crate) fn end(source: PersonSource) {
    drop(PausableSource::into_source(source).into_source().end());
}

impl Ready {
    /// Says goodbye instead.
    pub(crate) fn turn_away(self) {
        end(self.source);
    }

    /// Takes the person into the picture. Returns their number, their avatar, and how they were placed; nothing where they cannot be shown, which is told.
    ///
    /// # Errors
    /// If there is no renderer with room for them, nor one without.
    pub(crate) fn join(
        self,
        lanes: &mut Lanes<PersonSource>,
    ) -> Result<Option<(usize, Arc<Avatar>, PlacementReport)>, SessionError> {
        let Self {
            avatar,
            placed,
            source,
        } = self;
        make_room(lanes, &avatar)?;
        let Placed {
            plan,
            inference,
            report,
        } = placed;
        // Networks are repacked for the kernels by several threads, which end with that.
        let joined = in_own_pool("join", || lanes.join(&avatar, inference, source, plan)).flatten();
        match joined {
            Ok(number) => Ok(Some((number, avatar, report))),
            Err(error) => {
                log::warn!("a person cannot be shown: {}", error.in_full());
                Ok(None)
            }
        }
    }
}

/// Has the renderer take the Gaussians of one more person.
fn make_room(lanes: &mut Lanes<PersonSource>, avatar: &Avatar) -> Result<(), SessionError> {
    let count = u32::try_from(avatar.gaussians.len()).unwrap_or(u32::MAX);
    // Each person's shadow is more scenery than there is now.
    let wanted = (lanes.room_taken())
        .saturating_add(count)
        .saturating_add(SCENERY_GAUSSIANS);
    let renderer = lanes.renderer();
    if wanted <= renderer.options().max_foreground {
        return Ok(());
    }
    let options = RendererOptions {
        max_foreground: wanted,
        // The faster one has been found, but for a headset's images, into which each has a way of its own.
        back_end: if renderer.gpu().belongs_to_headset() {
            renderer.options().back_end
        } else {
            Some(renderer.back_end())
        },
        ..renderer.options().clone()
    };
    let gpu = Arc::clone(renderer.gpu());
    let renderer = SplatRenderer::new(gpu, &options).map_err(ReceiverError::from)?;
    Ok(lanes.replace_renderer(renderer)?)
}
