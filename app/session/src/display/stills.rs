//! A display that waits: each still shows its pose exactly, however long that takes.

use super::{Display, DisplayNeeds, DrawnPicture, LiveSession, SessionError};
use crate::steps::Steps;
use app_pipeline::lanes::{Drawn, Tick};
use app_pipeline::stage::Stage;
use glam::Affine3A;
use renderer_splat::camera::Camera;
use spmm3::MotionParams;
use std::time::{Duration, Instant};

/// Between two looks whether a pose's Gaussians are there.
const LOOK: Duration = Duration::from_millis(1);

/// A picture of one pose.
#[derive(Debug, Clone)]
pub struct Still {
    /// The pose.
    pub motion: MotionParams,
    /// One camera a view.
    pub cameras: Vec<Camera>,
}

/// Draws stills of one person, whose [`Origin`](crate::participant::Origin) are the same [`Steps`], in a session with
/// [`LatencyMode::Newest`](app_pipeline::timeline::LatencyMode::Newest).
pub struct StillsDisplay<'a> {
    needs: DisplayNeeds,
    steps: Steps,
    stills: Vec<Still>,
    drawn: OnDrawn<'a>,
}

/// Takes each still with its number.
type OnDrawn<'a> = Box<dyn FnMut(usize, DrawnPicture<'_>) -> Result<(), SessionError> + 'a>;

impl std::fmt::Debug for StillsDisplay<'_> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("StillsDisplay")
            .field("needs", &self.needs)
            .field("stills", &self.stills.len())
            .finish_non_exhaustive()
    }
}

impl<'a> StillsDisplay<'a> {
    /// Draws these one after the other and hands each to `drawn`.
    pub fn new(
        needs: DisplayNeeds,
        steps: Steps,
        stills: Vec<Still>,
        drawn: impl FnMut(usize, DrawnPicture<'_>) -> Result<(), SessionError> + 'a,
    ) -> Self {
        Self {
            needs,
            steps,
            stills,
            drawn: Box::new(drawn),
        }
    }
}

impl Display for StillsDisplay<'_> {
    fn needs(&mut self) -> Result<DisplayNeeds, SessionError> {
        Ok(self.needs.clone())
    }

    fn show(&mut self, mut session: LiveSession<'_>) -> Result<(), SessionError> {
        let session = &mut session;
        let avatar = session
            .avatars
            .first()
            .ok_or(SessionError::NoParticipants)?;
        let stills = std::mem::take(&mut self.stills);
        for (number, (still, motion_frame)) in stills.into_iter().zip(1..).enumerate() {
            self.steps.pose(still.motion.clone());
            wait_for_inference(session, motion_frame)?;
            loop {
                wait_for_gaussians(session, motion_frame)?;
                if session.control.is_leaving() {
                    return Err(SessionError::Left);
                }
                let begun = Instant::now();
                if let Drawn::Picture = session.lanes.draw(&still.cameras)? {
                    let picture = DrawnPicture {
                        renderer: session.lanes.renderer(),
                        cameras: &still.cameras,
                        begun,
                        people: vec![(&**avatar, still.motion.clone(), Affine3A::IDENTITY)],
                    };
                    (self.drawn)(number, picture)?;
                    session.lanes.displayed(Instant::now());
                    break;
                }
            }
        }
        Ok(())
    }
}

/// Waits until the graph has run for a motion frame. No picture is begun meanwhile: the CPU would make Gaussians for it.
fn wait_for_inference(
    session: &mut LiveSession<'_>,
    motion_frame: u64,
) -> Result<(), SessionError> {
    let is_done = |session: &mut LiveSession<'_>| {
        let mut newest = session.lanes.collector().spans().rev().take(64);
        newest.any(|span| span.stage == Stage::Inference && span.frame == motion_frame)
    };
    while !is_done(session) && !session.control.is_leaving() {
        session.lanes.check()?;
        std::thread::sleep(LOOK);
    }
    Ok(())
}

/// Begins pictures until one has the Gaussians of a motion frame.
fn wait_for_gaussians(
    session: &mut LiveSession<'_>,
    motion_frame: u64,
) -> Result<(), SessionError> {
    while !session.control.is_leaving() {
        let now = Instant::now();
        session.lanes.begin(Tick {
            predicted: now,
            next_begins: now,
            next: now,
            period: LOOK,
        })?;
        if session.lanes.motion_frame(0) == Some(motion_frame) {
            return Ok(());
        }
        std::thread::sleep(LOOK);
    }
    Ok(())
}
