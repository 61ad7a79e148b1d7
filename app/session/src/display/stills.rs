//! A display that waits: each still shows its pose exactly, however long that takes.

use super::{Display, DisplayNeeds, DrawnPicture, LiveSession, SessionError};
use crate::participant::Origin;
use crate::pose_queue::PoseQueue;
use app_pipeline::lanes::{Drawn, Tick};
use app_pipeline::plan::Plan;
use app_pipeline::stage::Stage;
use glam::Affine3A;
use renderer_splat::camera::Camera;
use spmm3::MotionParams;
use std::sync::Arc;
use std::time::{Duration, Instant};

/// Between two looks whether a pose's state is there.
const LOOK: Duration = Duration::from_millis(1);

/// Between two pictures that are begun for their Gaussians, at most.
const LONGEST_PAUSE: Duration = Duration::from_millis(100);

/// Times that a still is drawn, at most: again after a device was lost.
const ATTEMPTS: u32 = 3;

/// A picture of one pose.
#[derive(Debug, Clone)]
pub struct Still {
    /// The pose.
    pub motion: MotionParams,
    /// One camera a view.
    pub cameras: Vec<Camera>,
}

/// Draws stills of one person, whose motion is [`Self::origin`], in a session with
/// [`LatencyMode::Newest`](app_pipeline::timeline::LatencyMode::Newest).
pub struct StillsDisplay<'a> {
    needs: DisplayNeeds,
    poses: PoseQueue,
    stills: Stills<'a>,
    drawn: OnDrawn<'a>,
}

/// The stills: each is asked for when the one before has been drawn, so what gives them may wait for what is to be shown live.
type Stills<'a> = Box<dyn Iterator<Item = Still> + 'a>;

/// Takes each still with its number, and says whether it could: not where the device was lost meanwhile, and the still is to be drawn again.
type OnDrawn<'a> = Box<dyn FnMut(usize, DrawnPicture<'_>) -> Result<bool, SessionError> + 'a>;

impl std::fmt::Debug for StillsDisplay<'_> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("StillsDisplay")
            .field("needs", &self.needs)
            .finish_non_exhaustive()
    }
}

impl<'a> StillsDisplay<'a> {
    /// Draws these one after the other and hands each to `drawn`, which says whether it could be used: not where the device was lost
    /// meanwhile, and the still is drawn again.
    pub fn new(
        needs: DisplayNeeds,
        stills: impl IntoIterator<Item = Still, IntoIter: 'a>,
        drawn: impl FnMut(usize, DrawnPicture<'_>) -> Result<bool, SessionError> + 'a,
    ) -> Self {
        Self {
            needs,
            poses: PoseQueue::default(),
            stills: Box::new(stills.into_iter()),
            drawn: Box::new(drawn),
        }
    }

    /// Where the motion of the session's one person comes from.
    #[must_use]
    pub fn origin(&self) -> Origin {
        Origin::Queue(self.poses.clone())
    }
}

impl Display for StillsDisplay<'_> {
    fn needs(&mut self) -> Result<DisplayNeeds, SessionError> {
        Ok(self.needs.clone())
    }

    fn show(&mut self, mut session: LiveSession<'_>) -> Result<(), SessionError> {
        let session = &mut session;
        let person = session.people.first().ok_or(SessionError::NoParticipants)?;
        let avatar = Arc::clone(&person.avatar);
        let stills = std::mem::replace(&mut self.stills, Box::new(std::iter::empty()));
        for (number, (still, motion_frame)) in stills.into_iter().zip(1..).enumerate() {
            self.poses.push(still.motion.clone());
            wait_for_state(session, motion_frame)?;
            let mut attempts = 0..ATTEMPTS;
            loop {
                attempts.next().ok_or(SessionError::LostAgain)?;
                wait_for_gaussians(session, motion_frame)?;
                let Some(_step) = session.control.step() else {
                    return Err(SessionError::Left);
                };
                let begun = Instant::now();
                let Drawn::Picture = session.lanes.draw_everyone(&still.cameras)? else {
                    continue;
                };
                session.lanes.displayed(Instant::now());
                let picture = DrawnPicture {
                    renderer: session.lanes.renderer(),
                    cameras: &still.cameras,
                    begun,
                    people: vec![(&*avatar, still.motion.clone(), Affine3A::IDENTITY)],
                };
                if (self.drawn)(number, picture)? {
                    break;
                }
            }
        }
        Ok(())
    }
}

/// Waits until a motion frame's state is made. No picture is begun meanwhile: the CPU would make Gaussians for it first.
fn wait_for_state(session: &mut LiveSession<'_>, motion_frame: u64) -> Result<(), SessionError> {
    let plan = session.people.first().map(|one| one.placement.plan);
    let last = match plan {
        // The rest is done with the picture.
        Some(Plan::GpuAlone) => Stage::Kinematics,
        Some(Plan::Gpu) => Stage::Inference,
        Some(Plan::Npu | Plan::CpuTail | Plan::Cpu) | None => Stage::Bind,
    };
    let is_made = |session: &mut LiveSession<'_>| {
        let mut newest = session.lanes.collector().spans().rev().take(64);
        newest.any(|span| span.stage == last && span.frame == motion_frame)
    };
    while !is_made(session) {
        session.lanes.check()?;
        rest(session, LOOK)?;
    }
    Ok(())
}

/// Begins pictures until one has the Gaussians of a motion frame. Ever more rarely: each makes the CPU interpolate, before anything else.
fn wait_for_gaussians(
    session: &mut LiveSession<'_>,
    motion_frame: u64,
) -> Result<(), SessionError> {
    let mut pause = LOOK;
    loop {
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
        rest(session, pause)?;
        pause = (pause * 2).min(LONGEST_PAUSE);
    }
}

fn rest(session: &LiveSession<'_>, time: Duration) -> Result<(), SessionError> {
    std::thread::sleep(time);
    if session.control.is_leaving() {
        return Err(SessionError::Left);
    }
    Ok(())
}
