//! A display without a screen: the session drawn at a display's rate, each picture handed to an observer.

use super::flat::WAITING;
use super::{
    Display, DisplayNeeds, FlatView, LiveSession, LoadBackground, SessionError, Standpoint,
};
use app_pipeline::lanes::Drawn;
use glam::Affine3A;
use renderer_splat::camera::Camera;
use renderer_splat::renderer::SplatRenderer;
use spmm3::{Avatar, MotionParams};
use std::time::Instant;

/// Looks on while a session is drawn offscreen.
pub trait PictureObserver {
    /// Everything is ready to be shown.
    fn prepared(&mut self) {}

    /// Whether to end the session. Asked before each picture; `first` is when the first one with people in it was begun.
    ///
    /// # Errors
    /// What ends it for a bad reason.
    fn is_over(
        &mut self,
        session: &LiveSession<'_>,
        first: Option<Instant>,
    ) -> Result<bool, SessionError>;

    /// The cameras of the next picture, one for each view.
    fn cameras(&mut self, people: &Standpoint) -> Vec<Camera>;

    /// A picture was drawn.
    ///
    /// # Errors
    /// What keeps it from being used. The loss of the device is none: the next picture finds that out again.
    fn drawn(&mut self, picture: DrawnPicture<'_>) -> Result<(), SessionError>;
}

/// A picture that was drawn offscreen.
#[derive(Debug)]
pub struct DrawnPicture<'a> {
    /// Holds its pixels.
    pub renderer: &'a mut SplatRenderer,
    /// As it was seen.
    pub cameras: &'a [Camera],
    /// When it was begun.
    pub begun: Instant,
    /// The people in it: avatar, motion, and place in the world.
    pub people: Vec<(&'a Avatar, MotionParams, Affine3A)>,
}

/// Draws a session for an observer.
pub struct OffscreenDisplay<'a> {
    needs: DisplayNeeds,
    background: Option<LoadBackground<'a>>,
    observer: &'a mut dyn PictureObserver,
    first: Option<Instant>,
}

impl std::fmt::Debug for OffscreenDisplay<'_> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("OffscreenDisplay")
            .field("needs", &self.needs)
            .finish_non_exhaustive()
    }
}

impl<'a> OffscreenDisplay<'a> {
    /// Pictures as `needs` says, with the scene around the people, if there is one.
    pub fn new(
        needs: DisplayNeeds,
        background: Option<LoadBackground<'a>>,
        observer: &'a mut dyn PictureObserver,
    ) -> Self {
        Self {
            needs,
            background,
            observer,
            first: None,
        }
    }

    /// When the first picture with people in it was begun, if there was one.
    #[must_use]
    pub fn first_picture(self) -> Option<Instant> {
        self.first
    }
}

impl Display for OffscreenDisplay<'_> {
    fn needs(&mut self) -> Result<DisplayNeeds, SessionError> {
        Ok(self.needs.clone())
    }

    fn prepared(&mut self) {
        self.observer.prepared();
    }

    fn show(&mut self, mut session: LiveSession<'_>) -> Result<(), SessionError> {
        let session = &mut session;
        let hertz = self.needs.period.as_secs_f64().recip();
        let mut view = FlatView::new(session, hertz, self.background.take());
        while !session.lanes.is_over()
            && !session.control.is_leaving()
            && !self.observer.is_over(session, view.first())?
        {
            view.wait();
            let control = session.control;
            let Some(step) = control.step() else {
                break;
            };
            let Some(people) = view.begin(session)? else {
                drop(step);
                std::thread::sleep(WAITING);
                continue;
            };
            self.first = view.first();
            let cameras = self.observer.cameras(&people);
            let Drawn::Picture = session.lanes.draw(&cameras)? else {
                continue;
            };
            view.displayed(session, &cameras);
            let people = (session.lanes.poses().zip(session.people.iter()))
                .zip(view.world_from_person())
                .filter_map(|((motion, person), place)| {
                    Some((&*person.avatar, motion?.clone(), *place))
                })
                .collect();
            self.observer.drawn(DrawnPicture {
                renderer: session.lanes.renderer(),
                cameras: &cameras,
                begun: view.begun(),
                people,
            })?;
        }
        Ok(())
    }
}
