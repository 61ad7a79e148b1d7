//! People as a flat picture has them: alone, where their motion takes them; together, side by side on a line. And a camera that
//! keeps to them.

use super::{LiveSession, SessionError};
use crate::presence::{APART, Lineup, Standing, first_apart};
use app_pipeline::error::ReceiverError;
use app_pipeline::lanes::DisplayClock;
use glam::{Affine3A, Quat, Vec3};
use renderer_splat::background::Background;
use renderer_splat::camera::Camera;
use renderer_splat::options::{Filter, RendererOptions};
use renderer_splat::renderer::SplatRenderer;
use spmm3::Joint;
use std::sync::Arc;
use std::time::{Duration, Instant};

/// Share of the way to the person that the camera makes up in a second: it must not sway with every step.
const FOLLOW: f32 = 3.8;

/// Loads the scene around people, given the floor below them, metres, and which way they face, as a turn about y from +z; nothing where
/// there is none.
pub type LoadBackground<'a> = Box<
    dyn FnOnce(
            Vec3,
            Quat,
        ) -> Result<
            Option<(Arc<Background>, Filter)>,
            Box<dyn std::error::Error + Send + Sync>,
        > + Send
        + 'a,
>;

/// Where people are, for a camera.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Standpoint {
    /// The floor below the middle of them, metres; of one person slowly following.
    pub floor: Vec3,
    /// Which way they faced at first, as a turn about y from +z.
    pub heading: Quat,
    /// From the person who stands leftmost to the rightmost, metres; 0 for one.
    pub width: f32,
    /// The place of the first person whose pose is known, apart from the viewer; while there is none, the last such place: world from motion space, rigid.
    pub first: Affine3A,
}

/// A flat display's pace, people and camera.
pub struct FlatView<'a> {
    clock: DisplayClock,
    begun: Instant,
    first: Option<Instant>,
    shown: u64,
    arrangement: Arrangement,
    world_from_person: Vec<Affine3A>,
    /// Until the first picture.
    background: Option<LoadBackground<'a>>,
}

impl std::fmt::Debug for FlatView<'_> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("FlatView")
            .field("clock", &self.clock)
            .field("arrangement", &self.arrangement)
            .field("shown", &self.shown)
            .finish_non_exhaustive()
    }
}

#[derive(Debug)]
enum Arrangement {
    /// One person, whom the camera follows.
    Alone(Option<Followed>),
    /// Several, whom it does not.
    Together {
        lineup: Lineup,
        standing: Vec<Option<Standing>>,
        present: Vec<bool>,
        /// The last place of the first person.
        first: Affine3A,
    },
}

#[derive(Debug, Clone, Copy)]
struct Followed {
    floor: Vec3,
    heading: Quat,
    at: Instant,
}

impl<'a> FlatView<'a> {
    /// Of the session's people on a display of so many pictures a second, with the scene around them, if there is one.
    #[must_use]
    pub fn new(
        session: &LiveSession<'_>,
        hertz: f64,
        background: Option<LoadBackground<'a>>,
    ) -> Self {
        let people = session.people.len();
        let now = Instant::now();
        Self {
            clock: DisplayClock::new(hertz),
            begun: now,
            first: None,
            shown: 0,
            arrangement: if people == 1 && !session.is_open() {
                Arrangement::Alone(None)
            } else {
                Arrangement::Together {
                    lineup: Lineup::default(),
                    standing: Vec::new(),
                    present: Vec::new(),
                    first: Affine3A::IDENTITY,
                }
            },
            world_from_person: vec![Affine3A::IDENTITY; people],
            background,
        }
    }

    /// Sleeps until the next picture is to be begun.
    pub fn wait(&self) {
        self.clock.wait();
    }

    /// When the picture was begun that is being made.
    #[must_use]
    pub fn begun(&self) -> Instant {
        self.begun
    }

    /// When the first picture with people in it was begun, with the scene there, if there was one.
    #[must_use]
    pub fn first(&self) -> Option<Instant> {
        self.first
    }

    /// Pictures shown so far.
    #[must_use]
    pub fn shown(&self) -> u64 {
        self.shown
    }

    /// Each person's place in the world, rigid.
    #[must_use]
    pub fn world_from_person(&self) -> &[Affine3A] {
        &self.world_from_person
    }

    /// Takes in who has come, begins the picture that is due now, and puts everyone in their place; `None` until there was a person to be seen.
    /// Loads the scene before the first one.
    ///
    /// # Errors
    /// What ended the last person's lanes; what keeps the scene from being loaded or drawn.
    pub fn begin(
        &mut self,
        session: &mut LiveSession<'_>,
    ) -> Result<Option<Standpoint>, SessionError> {
        session.observe();
        session.admit()?;
        self.begun = Instant::now();
        let tick = self.clock.tick(self.begun);
        // Once all are gone or hidden, their places are shown empty.
        if session.lanes.begin(tick)?.is_none() && (self.first.is_none() || !session.is_open()) {
            return Ok(None);
        }
        let Some(standpoint) = self.arrange(session) else {
            return Ok(None);
        };
        if let Some(load) = self.background.take()
            && let Some((background, filter)) =
                load(standpoint.floor, standpoint.heading).map_err(SessionError::Display)?
        {
            let options = RendererOptions {
                background: Some(background),
                filter,
                ..session.lanes.renderer().options().clone()
            };
            draw_as(session, options)?;
        }
        self.first.get_or_insert_with(|| {
            log::debug!("the first picture with people in it is begun");
            Instant::now()
        });
        Ok(Some(standpoint))
    }

    /// Takes note that the picture, seen from these cameras, is on its way to the display.
    pub fn displayed(&mut self, session: &mut LiveSession<'_>, cameras: &[Camera]) {
        self.shown += 1;
        session.place_voices_in_picture(cameras, &self.world_from_person);
        let shown = self.clock.drawn(self.begun, Instant::now());
        session.lanes.displayed(shown);
    }

    fn arrange(&mut self, session: &mut LiveSession<'_>) -> Option<Standpoint> {
        match &mut self.arrangement {
            Arrangement::Alone(followed) => {
                let motion = session.lanes.poses().next().flatten()?;
                let person = session.people.first()?;
                let pelvis = person.avatar.skeleton.rest_positions()[Joint::Pelvis.index()];
                let stands = Vec3::new(1.0, 0.0, 1.0) * (motion.root_translation + pelvis);
                let followed = followed.get_or_insert_with(|| {
                    let forward = motion.rotation(Joint::Pelvis) * Vec3::Z;
                    Followed {
                        floor: stands,
                        heading: Quat::from_rotation_y(forward.x.atan2(forward.z)),
                        at: self.begun,
                    }
                });
                let elapsed = self.begun.duration_since(followed.at).as_secs_f32();
                followed.floor += (stands - followed.floor) * (1.0 - (-FOLLOW * elapsed).exp());
                followed.at = self.begun;
                Some(Standpoint {
                    floor: followed.floor,
                    heading: followed.heading,
                    width: 0.0,
                    first: Affine3A::IDENTITY,
                })
            }
            Arrangement::Together {
                lineup,
                standing,
                present,
                first,
            } => {
                standing.clear();
                standing.extend(
                    (session.lanes.poses().zip(session.people.iter()))
                        .map(|(motion, person)| Standing::of(&person.avatar.skeleton, motion?)),
                );
                // Who hides keeps their place; who looks at themselves needs one.
                let there = session.lanes.present().zip(session.lanes.attending());
                present.clear();
                present.extend(there.enumerate().map(|(person, (is_seen, attends))| {
                    if person < session.own {
                        is_seen
                    } else {
                        attends
                    }
                }));
                let places = lineup.update(standing, present);
                self.world_from_person.clear();
                self.world_from_person.extend_from_slice(places);
                for (person, place) in self.world_from_person.iter().enumerate() {
                    session.lanes.place(person, *place);
                }
                let place = first_apart(standing, session.own);
                if let Some(place) = place.and_then(|place| self.world_from_person.get(place)) {
                    *first = *place;
                }
                Some(Standpoint {
                    floor: Vec3::ZERO,
                    heading: Quat::IDENTITY,
                    width: APART * lineup.count().saturating_sub(1) as f32,
                    first: *first,
                })
            }
        }
    }
}

/// Makes other pictures from now on.
///
/// # Errors
/// If the device cannot, or has no room for the people there are.
pub(super) fn draw_as(
    session: &mut LiveSession<'_>,
    options: RendererOptions,
) -> Result<(), SessionError> {
    let renderer = session.lanes.renderer();
    let options = RendererOptions {
        // The faster one has been found.
        back_end: Some(renderer.back_end()),
        ..options
    };
    let gpu = Arc::clone(renderer.gpu());
    let renderer = SplatRenderer::new(gpu, &options).map_err(ReceiverError::from)?;
    Ok(session.lanes.replace_renderer(renderer)?)
}

impl LiveSession<'_> {
    /// Makes pictures of another size from now on, pixels.
    ///
    /// # Errors
    /// If the device cannot.
    pub fn resize(&mut self, width: u32, height: u32) -> Result<(), SessionError> {
        let options = RendererOptions {
            width,
            height,
            ..self.lanes.renderer().options().clone()
        };
        draw_as(self, options)
    }
}

/// How long a flat display waits before it looks again whether there is a person to be seen.
pub(super) const WAITING: Duration = Duration::from_millis(2);
