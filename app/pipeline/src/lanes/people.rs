//! The people who are shown: they join, stay when another one leaves, and each has a place.

use super::person::{FinishedPerson, Person};
use super::{Lanes, MotionSource, Skipped};
use crate::error::ReceiverError;
use crate::inference::{Fault, Inference, ProviderChange};
use crate::plan::Plan;
use glam::Affine3A;
use renderer_splat::error::RenderError;
use renderer_splat::limits::MOST_PARTS;
use renderer_splat::renderer::SplatRenderer;
use shaders_spirv::PackedGaussian;
use spmm3::{Avatar, MotionParams};
use std::sync::Arc;

/// People that can be shown together. One part of a picture is the scenery's.
pub const MOST_PEOPLE: usize = MOST_PARTS - 1;

/// One person, and those who joined, by their numbers.
#[derive(Debug)]
pub(super) struct People<S: MotionSource> {
    pub(super) first: Person<S>,
    others: Vec<Person<S>>,
}

/// A person who has joined.
#[derive(Debug)]
pub struct Joined<S> {
    /// Their number: that of one who is gone, or else the next one.
    pub number: usize,
    /// What is left of the one who had it before.
    pub replaced: Option<FinishedPerson<S>>,
}

impl<S: MotionSource> People<S> {
    pub(super) fn new(first: Person<S>) -> Self {
        Self {
            first,
            others: Vec::new(),
        }
    }

    pub(super) fn count(&self) -> usize {
        1 + self.others.len()
    }

    pub(super) fn iter(&self) -> impl Iterator<Item = &Person<S>> {
        std::iter::once(&self.first).chain(&self.others)
    }

    pub(super) fn iter_mut(&mut self) -> impl Iterator<Item = &mut Person<S>> {
        std::iter::once(&mut self.first).chain(&mut self.others)
    }

    /// Takes in who has joined.
    fn admit(&mut self, person: Person<S>) -> Joined<S> {
        let vacant = self.iter().position(|one| one.is_gone);
        let number = vacant.unwrap_or(self.count());
        let gone = match number.checked_sub(1) {
            None => Some(&mut self.first),
            Some(other) => self.others.get_mut(other),
        };
        let replaced = if let Some(gone) = gone {
            Some(std::mem::replace(gone, person).finish())
        } else {
            self.others.push(person);
            None
        };
        Joined { number, replaced }
    }

    fn get(&self, person: usize) -> Option<&Person<S>> {
        self.iter().nth(person)
    }

    /// Gaussians that a renderer's foreground must have room for.
    pub(super) fn room(&self) -> u32 {
        (self.iter()).fold(0, |sum, person| sum.saturating_add(person.room()))
    }

    /// Looks after all people's lanes. A person who has left, or cannot go on, is left out of pictures while another one stays.
    ///
    /// # Errors
    /// What ended a lane of the last one who stayed.
    pub(super) fn check(&mut self) -> Result<(), ReceiverError> {
        for at in 0..self.count() {
            let stay = |one: &Person<S>| !one.is_gone && !one.threads.is_over();
            let others_stay =
                (self.iter().enumerate()).any(|(other, one)| other != at && stay(one));
            let Some(person) = self.iter_mut().nth(at).filter(|one| !one.is_gone) else {
                continue;
            };
            match person.threads.check() {
                Err(error) if others_stay => {
                    log::warn!(
                        "person {at} cannot be shown any longer: {}",
                        error.in_full()
                    );
                    person.leave();
                    person.error = Some(error);
                }
                Ok(()) if others_stay && person.threads.is_over() => {
                    log::info!("person {at} has left");
                    person.leave();
                }
                outcome => outcome?,
            }
        }
        Ok(())
    }

    /// Stops all lanes; what is left of each person, by their numbers.
    pub(super) fn finish(self) -> Vec<FinishedPerson<S>> {
        let all = std::iter::once(self.first).chain(self.others);
        all.map(Person::finish).collect()
    }
}

impl<S: MotionSource> Lanes<S> {
    /// Another person comes into the picture: lanes of their own for `avatar`, on poses from `source`. The first one's number is 0.
    ///
    /// # Errors
    /// A plan that poses on the device, which is the first person's only; too many people, or more Gaussians together than the renderer was made for;
    /// or as [`Self::start`].
    pub fn join(
        &mut self,
        avatar: &Arc<Avatar>,
        inference: Option<Inference>,
        source: S,
        plan: Plan,
    ) -> Result<Joined<S>, ReceiverError> {
        if plan.poses_on_device() {
            return Err(ReceiverError::PosedTwice);
        }
        if self.people.iter().filter(|one| !one.is_gone).count() >= MOST_PEOPLE {
            return Err(ReceiverError::TooManyPeople { most: MOST_PEOPLE });
        }
        let count = u32::try_from(avatar.gaussians.len()).unwrap_or(u32::MAX);
        check_room(&self.renderer, self.room_taken().saturating_add(count))?;
        let (renderer, latency) = (&self.renderer, self.latency);
        let person = Person::start(avatar, inference, renderer, source, plan, latency)?;
        let joined = self.people.admit(person);
        self.place(joined.number, Affine3A::IDENTITY);
        Ok(joined)
    }

    /// Puts a person there from the next picture on: `world_from_person` is rigid, from the space of their poses. At first it
    /// is the identity. A person who has not joined cannot be put anywhere.
    pub fn place(&mut self, person: usize, world_from_person: Affine3A) {
        if let Some(person) = self.people.iter_mut().nth(person) {
            person.world_from_person = world_from_person;
        }
    }

    /// Each person's pose as it is about to be drawn, in the space of their poses; `None` for one who is not there yet, or not any more.
    pub fn poses(&self) -> impl Iterator<Item = Option<&MotionParams>> {
        (self.people.iter()).map(|person| person.view().map(|view| &view.motion))
    }

    /// Whether each person, by number, is to be seen as soon as there are Gaussians of them: not while they are hidden, nor once they are gone.
    pub fn present(&self) -> impl Iterator<Item = bool> {
        self.people.iter().map(Person::is_present)
    }

    /// Whether each person, by number, has not left yet, hidden or not.
    pub fn attending(&self) -> impl Iterator<Item = bool> {
        self.people.iter().map(|person| !person.is_gone)
    }

    /// The number of the newest motion frame that goes into the picture that was begun, of a person who is in it. Motion frames are
    /// numbered from 1 as the person's source hands them out.
    #[must_use]
    pub fn motion_frame(&self, person: usize) -> Option<u64> {
        Some(self.people.get(person)?.view()?.states[1].number)
    }

    /// Draws these with the people from now on (world space, 256 at most): shadows, say. The same ones again cost nothing,
    /// others no memory.
    ///
    /// # Errors
    /// Too many of them, or more Gaussians together with the people's than the renderer was made for.
    pub fn set_scenery(&mut self, gaussians: &[PackedGaussian]) -> Result<(), ReceiverError> {
        let count = u32::try_from(gaussians.len()).unwrap_or(u32::MAX);
        let wanted = self.people.room().saturating_add(count);
        check_room(&self.renderer, wanted)?;
        Ok(self.scenery.set(gaussians)?)
    }

    /// Gaussians that the foreground needs room for already.
    #[must_use]
    pub fn room_taken(&self) -> u32 {
        self.people.room().saturating_add(self.scenery.len())
    }

    /// What was left out so far, of all people together.
    #[must_use]
    pub fn skipped(&self) -> Skipped {
        let mut sum = Skipped::default();
        for counts in self.people.iter().map(|person| &person.counts) {
            sum.poses += counts.poses.count();
            sum.inferences += counts.inferences.count();
            sum.requests += counts.requests.count();
            sum.interpolations += counts.interpolations.count();
        }
        sum
    }

    /// Looks after the lanes, which [`Self::begin`] does for each picture too.
    ///
    /// # Errors
    /// What ended a lane that cannot be replaced, if no other person stays.
    pub fn check(&mut self) -> Result<(), ReceiverError> {
        self.people.check()
    }

    /// Whether no source has any more poses.
    #[must_use]
    pub fn is_over(&self) -> bool {
        let mut people = self.people.iter();
        people.all(|person| person.is_gone || person.threads.is_over())
    }

    /// The first person's providers that were given up so far, and for what.
    #[must_use]
    pub fn provider_changes(&self) -> Vec<ProviderChange> {
        self.people.first.changes.all()
    }

    /// A way to make the first person's inference fail.
    #[must_use]
    pub fn fault(&self) -> Fault {
        self.people.first.fault.clone()
    }

    /// As [`Self::fault`], of any person who has joined.
    #[must_use]
    pub fn fault_of(&self, person: usize) -> Option<Fault> {
        self.people.get(person).map(|person| person.fault.clone())
    }

    /// Stops the lanes; what is left of each person, by their numbers. Whoever was replaced was handed out by [`Self::join`].
    pub fn finish(self) -> Vec<FinishedPerson<S>> {
        self.people.finish()
    }
}

/// Whether a renderer's foreground has room for so many Gaussians.
pub(super) fn check_room(renderer: &SplatRenderer, wanted: u32) -> Result<(), ReceiverError> {
    let limit = renderer.options().max_foreground;
    if wanted > limit {
        let count = wanted as usize;
        return Err(RenderError::TooManyGaussians { count, limit }.into());
    }
    Ok(())
}
