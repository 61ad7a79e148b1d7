//! One session: people are prepared, joined, shown on a display, and said goodbye to.

mod report;

pub use report::SessionReport;

use crate::SetAtEnd;
use crate::attendee::{Attendee, PersonReport};
use crate::display::attendance::{Attendance, Doorway, Ready};
use crate::display::{
    Display, DisplayNeeds, LiveSession, SCENERY_GAUSSIANS, SessionError, SessionObserver,
};
use crate::participant::{Origin, Participant, PersonSource};
use app_pipeline::control::Control;
use app_pipeline::error::ReceiverError;
use app_pipeline::lanes::{LaneOptions, Lanes, MOST_PEOPLE};
use app_pipeline::placement::{InferenceBackends, Placed, place, place_first};
use app_pipeline::plan::{PlacementRequest, Plan};
use app_pipeline::pool::in_own_pool;
use app_pipeline::quality::QualityMode;
use app_pipeline::timeline::LatencyMode;
use renderer_splat::options::RendererOptions;
use renderer_splat::renderer::SplatRenderer;
use spmm3::Avatar;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering::Relaxed};
use std::sync::mpsc::{Receiver, channel};
use std::time::{Duration, Instant};

/// People that a call's first renderer has room for, each with as many Gaussians as oneself.
const EXPECTED_PEOPLE: u32 = 3;

/// How people are to be shown.
#[derive(Debug, Clone, Copy)]
pub struct SessionConfig<'a> {
    /// What this machine runs graphs with.
    pub backends: InferenceBackends<'a>,
    /// What runs where.
    pub placement: PlacementRequest,
    /// What is done about the time from one motion frame to the next.
    pub latency: LatencyMode,
    /// What is done when the GPU cannot hold the display's rate.
    pub quality: QualityMode,
}

/// People who are to be shown together.
#[derive(Debug)]
pub struct Session<'a> {
    config: SessionConfig<'a>,
    participants: Vec<Participant>,
    newcomers: Option<Receiver<Participant>>,
    observer: Option<&'a mut (dyn SessionObserver + 'static)>,
    control: Control,
}

/// What was made ready before the people's motion begins.
struct Prepared {
    placed: Vec<Placed>,
    renderer: SplatRenderer,
}

impl<'a> Session<'a> {
    /// Of these people. `control` pauses and ends it from any thread, its preparations between any two steps.
    #[must_use]
    pub fn new(
        config: SessionConfig<'a>,
        participants: Vec<Participant>,
        control: Control,
    ) -> Self {
        Self {
            config,
            participants,
            newcomers: None,
            observer: None,
            control,
        }
    }

    /// Has `observer` look on while it is shown.
    #[must_use]
    pub fn observed(self, observer: &'a mut (dyn SessionObserver + 'static)) -> Self {
        Self {
            observer: Some(observer),
            ..self
        }
    }

    /// Takes in who comes while it is shown, at most [`MOST_PEOPLE`] at once. Their stages are placed as those of the first person, who is therefore
    /// not posed by the device.
    #[must_use]
    pub fn with_newcomers(self, newcomers: Receiver<Participant>) -> Self {
        Self {
            newcomers: Some(newcomers),
            ..self
        }
    }

    /// Prepares all people for `display`, joins them only then (no call waits for preparations), shows them until all calls are over,
    /// the control leaves or the display says so, and says goodbye to each.
    ///
    /// # Errors
    /// If nothing can run or draw them, or the display cannot go on. [`SessionError::Left`] where the control ends it before anyone is
    /// joined. That one of several people cannot be shown any longer is no error of all: [`PersonReport::error`] tells.
    pub fn run(mut self, display: &mut dyn Display) -> Result<SessionReport, SessionError> {
        let newcomers = self.newcomers.take();
        let observer = self.observer.take();
        let control = &self.control;
        if self.participants.len() > MOST_PEOPLE {
            return Err(ReceiverError::TooManyPeople { most: MOST_PEOPLE }.into());
        }
        let needs = display.needs()?;
        let avatars: Vec<Arc<Avatar>> = (self.participants.iter())
            .map(|person| Arc::clone(&person.avatar))
            .collect();
        let Prepared { placed, renderer } = self.prepare(&needs, &avatars, newcomers.is_some())?;
        control.checkpoint()?;
        display.prepared();
        let sources: Vec<PersonSource> = (self.participants.iter())
            .map(|person| person.join(control))
            .collect();
        let mut people: Vec<Attendee> = (avatars.iter().zip(&placed).zip(&sources))
            .map(|((avatar, placed), source)| Attendee {
                avatar: Arc::clone(avatar),
                placement: placed.report.clone(),
                watch: source.source().source().watch(),
                voice: source.source().source().voice(),
            })
            .collect();
        let like = people.first().map(|first| first.placement.clone());
        // Also when it is time to leave: the calls that were joined say goodbye at their end.
        let step = control.step();
        let mut lanes = self.start(needs.period, &avatars, placed, renderer, sources)?;
        // Its device would outlive its headset, which comes back with another one.
        drop(needs);
        drop(step);
        let began = Instant::now();
        let over = AtomicBool::new(false);
        let open = newcomers.zip(like).map(|(newcomers, like)| {
            let (ready, arrived) = channel();
            let (leaving, departed) = channel();
            let attendance = Attendance {
                ready: arrived,
                departed: leaving,
            };
            let doorway = Doorway {
                newcomers,
                ready,
                departed,
                backends: &self.config.backends,
                like,
                control,
            };
            (attendance, doorway)
        });
        let (mut attendance, doorway): (Option<Attendance>, _) = open.unzip();
        let mut ended = began;
        let (shown, departed) = std::thread::scope(|scope| {
            let set_at_end = SetAtEnd(&over);
            let attending = doorway.map(|doorway: Doorway<'_>| {
                let is_over = || over.load(Relaxed);
                std::thread::Builder::new()
                    .name("newcomers".to_owned())
                    .spawn_scoped(scope, move || doorway.attend(is_over))
                    .map_err(SessionError::Thread)
            });
            let attending = attending.transpose()?;
            let shown = display.show(LiveSession {
                lanes: &mut lanes,
                people: &mut people,
                control,
                own: (self.participants.iter())
                    .take_while(|person| matches!(person.origin, Origin::Own(_)))
                    .count(),
                attendance: attendance.as_mut(),
                observer,
            });
            ended = Instant::now();
            drop(set_at_end);
            // A thread that panicked has said so.
            let departed = attending.map(|attending| attending.join().unwrap_or_default());
            Ok::<_, SessionError>((shown, departed.unwrap_or_default()))
        })?;
        if let Some(attendance) = &attendance {
            attendance.ready.try_iter().for_each(Ready::turn_away);
        }
        // All that is on the device is freed now.
        let step = control.step();
        let renderer = lanes.renderer();
        let (back_end, back_end_trial) = (renderer.back_end(), renderer.back_end_trial());
        let (skipped, quality) = (lanes.skipped(), lanes.quality_figures());
        let finished = lanes.finish();
        drop(step);
        let there = finished.into_iter().zip(people);
        let people = (departed.into_iter())
            .chain(there.map(|(finished, attendee)| PersonReport::of(finished, attendee)))
            .collect();
        shown?;
        Ok(SessionReport {
            people,
            skipped,
            quality,
            back_end,
            back_end_trial,
            began,
            ended,
        })
    }

    /// Places each person's stages, with the renderer that is to draw all of them.
    fn prepare(
        &self,
        needs: &DisplayNeeds,
        avatars: &[Arc<Avatar>],
        others_come: bool,
    ) -> Result<Prepared, SessionError> {
        let (first, others) = avatars.split_first().ok_or(SessionError::NoParticipants)?;
        let SessionConfig {
            backends,
            placement,
            ..
        } = &self.config;
        let gaussians = (avatars.iter()).fold(0u32, |sum, avatar| {
            sum.saturating_add(u32::try_from(avatar.gaussians.len()).unwrap_or(u32::MAX))
        });
        // Where others come, a renderer with room for a few of them is not made anew while it is looked at.
        let people = if others_come { EXPECTED_PEOPLE } else { 1 };
        let gaussians = gaussians
            .saturating_mul(people)
            .saturating_add(SCENERY_GAUSSIANS);
        let options = RendererOptions {
            max_foreground: gaussians,
            ..needs.renderer.clone()
        };
        let first_placement = PlacementRequest {
            for_several: others_come,
            ..*placement
        };
        let (placed, mut renderer) = place_first(
            backends,
            first,
            &needs.gpu,
            options,
            &needs.cameras,
            first_placement,
            &self.control,
        )?;
        // Only one person's Gaussians can stay on the device.
        let for_others = PlacementRequest {
            plan: Some(if placed.plan.poses_on_device() {
                Plan::Cpu
            } else {
                placed.plan
            }),
            ..*placement
        };
        let mut all = vec![placed];
        for avatar in others {
            all.push(place(
                backends,
                avatar,
                &mut renderer,
                &needs.cameras,
                for_others,
                &self.control,
            )?);
        }
        Ok(Prepared {
            placed: all,
            renderer,
        })
    }

    fn start(
        &self,
        display_period: Duration,
        avatars: &[Arc<Avatar>],
        placed: Vec<Placed>,
        renderer: SplatRenderer,
        sources: Vec<PersonSource>,
    ) -> Result<Lanes<PersonSource>, SessionError> {
        let mut people = avatars.iter().zip(placed).zip(sources);
        let ((avatar, placed), source) = people.next().ok_or(SessionError::NoParticipants)?;
        let options = LaneOptions {
            plan: placed.plan,
            latency: self.config.latency,
            quality: self.config.quality,
            display_period,
            // Of the first person alone: who joins is noticed by the pictures.
            expected_picture: placed.report.picture(),
        };
        // Networks are repacked for the kernels by several threads, which must end with that: the app may outlive many calls.
        let lanes = in_own_pool("start", move || {
            let mut lanes = Lanes::start(avatar, placed.inference, renderer, source, &options)?;
            for ((avatar, placed), source) in people {
                lanes.join(avatar, placed.inference, source, placed.plan)?;
            }
            Ok::<_, ReceiverError>(lanes)
        })?;
        Ok(lanes?)
    }
}
