//! A picture from its beginning until it is drawn: what all people's lanes have for it, in one drawing.

use super::cpu::Request;
use super::{Drawn, Lanes, MotionSource, Progress, Tick};
use crate::error::ReceiverError;
use renderer_splat::camera::Camera;
use renderer_splat::drawing::{Drawing, Foreground, Part};
use renderer_splat::error::RenderError;
use renderer_splat::external_images::ExternalImages;
use renderer_splat::limits::MOST_PARTS;
use spmm3::MotionParams;
use std::time::Instant;

impl<S: MotionSource> Lanes<S> {
    /// Begins the picture of `tick`: takes the newest Gaussians there are, and has those of the next picture made. Returns the
    /// pose that is about to be drawn, of the first person who is there, or `None` while there is no person to be seen yet.
    ///
    /// # Errors
    /// What ended a lane that cannot be replaced, if no other person stays; any other person whose lane ends is left out from then on.
    pub fn begin(&mut self, tick: Tick) -> Result<Option<&MotionParams>, ReceiverError> {
        self.people.check()?;
        let begun = Instant::now();
        self.quality = self.controller.quality();
        let level = self.quality.level;
        let at_once = |number| Request {
            number,
            displayed: tick.predicted,
            wanted: begun,
            level,
        };
        for person in self.people.iter_mut() {
            person.budget.begin(begun);
            person.take(&mut self.renderer, at_once(self.number + 1))?;
        }
        let is_seen = self.people.iter().any(|person| person.view().is_some());
        self.number += u64::from(is_seen);
        let number = self.number + 1;
        let next = Request {
            number,
            displayed: tick.next,
            wanted: tick.next_begins,
            level,
        };
        for person in self.people.iter_mut() {
            person.ask(at_once(number), next);
        }
        self.drawing = Some(Progress {
            tick,
            begun,
            sorted: begun,
            drawn: begun,
        });
        Ok(self.poses().flatten().next())
    }

    /// Draws the picture that was begun, as `cameras` (one, or two for stereo) see it, and waits until it is drawn. Without whom it would cost too much: they are
    /// left out, which is told once.
    ///
    /// # Errors
    /// If the renderer fails other than by losing its device, or there is no other device.
    pub fn draw(&mut self, cameras: &[Camera]) -> Result<Drawn, ReceiverError> {
        self.draw_to(cameras, None)
    }

    /// The same into a headset's images, as its two eyes see it.
    ///
    /// # Errors
    /// As [`Self::draw`].
    pub fn draw_onto(
        &mut self,
        cameras: &[Camera; 2],
        images: &mut dyn ExternalImages,
    ) -> Result<Drawn, ReceiverError> {
        self.draw_to(cameras, Some(images))
    }

    /// As [`Self::draw`], with everyone, however long it takes: for pictures that are asked for one by one.
    ///
    /// # Errors
    /// As there, and where there are more tiles to be drawn than any picture may have.
    pub fn draw_everyone(&mut self, cameras: &[Camera]) -> Result<Drawn, ReceiverError> {
        if self.is_lost {
            self.drawing = None;
            return Ok(Drawn::Lost);
        }
        match self.draw_once(cameras, &mut None) {
            (Ok(()), _) => {
                self.record_stages();
                Ok(Drawn::Picture)
            }
            (Err(error), _) if error.is_device_lost() => self.lose(&error),
            (Err(error), _) => Err(error.into()),
        }
    }

    fn draw_to(
        &mut self,
        cameras: &[Camera],
        mut images: Option<&mut dyn ExternalImages>,
    ) -> Result<Drawn, ReceiverError> {
        if self.is_lost {
            self.drawing = None;
            return Ok(Drawn::Lost);
        }
        // Each time someone else is left out.
        loop {
            let (drawn, numbers) = self.draw_once(cameras, &mut images);
            let Err(error) = drawn else {
                self.leave_out_slow(&numbers);
                break;
            };
            if error.is_device_lost() {
                return self.lose(&error);
            }
            let costly = error.costly_part();
            let Some(number) = costly.and_then(|part| *numbers.get(part)?) else {
                return Err(error.into());
            };
            let all = self.renderer.part_pairs();
            let pairs = costly.and_then(|part| all.get(part).copied()).unwrap_or(0);
            if self.exceed(number, pairs, false) {
                log::warn!(
                    "person {number} is left out of pictures: their Gaussians cover {pairs} screen tiles, more than this device may be asked to draw; they are tried again"
                );
            }
        }
        self.record_stages();
        Ok(Drawn::Picture)
    }

    /// Leaves out for good who makes pictures take seconds.
    fn leave_out_slow(&mut self, numbers: &[Option<usize>; MOST_PARTS]) {
        let number = |part: usize| *numbers.get(part)?;
        if let Some((number, pairs, took)) = self.slow.note(&self.renderer, number)
            && self.exceed(number, pairs, true)
        {
            log::warn!(
                "person {number} is not shown any longer: a picture took {:.1} s, and their Gaussians cover {pairs} screen tiles in it",
                took / 1e3
            );
        }
    }

    /// Returns whether it is to be told.
    fn exceed(&mut self, number: usize, pairs: u64, for_good: bool) -> bool {
        let person = self.people.iter_mut().nth(number);
        person.is_some_and(|person| person.budget.exceed(pairs, for_good))
    }

    /// Draws who is to be seen, and says whose each part was.
    fn draw_once(
        &mut self,
        cameras: &[Camera],
        images: &mut Option<&mut dyn ExternalImages>,
    ) -> (Result<(), RenderError>, [Option<usize>; MOST_PARTS]) {
        let level = self.quality.level;
        let people = self.people.iter_mut().enumerate();
        let there = people.filter_map(|(number, person)| Some((Some(number), person.part(level)?)));
        let scenery = self.scenery.part().map(|part| (None, part));
        let mut parts = [Part::here(Foreground::Set); MOST_PARTS];
        let mut numbers = [None; MOST_PARTS];
        let mut count = 0;
        for ((place, whose), (number, part)) in
            (parts.iter_mut().zip(&mut numbers)).zip(there.chain(scenery))
        {
            *place = part;
            *whose = number;
            count += 1;
        }
        let scale = self.quality.resolution_scale;
        let scaled: [Option<Camera>; 2] =
            std::array::from_fn(|view| cameras.get(view).map(|camera| camera.scaled(scale)));
        let scaled = match scaled {
            [Some(left), Some(right)] => &[left, right][..],
            [Some(only), _] => &[only],
            _ => &[],
        };
        let drawing = Drawing {
            // One camera too many is the renderer's to refuse.
            cameras: if scale < 1.0 { scaled } else { cameras },
            foreground: parts.get(..count).unwrap_or_default(),
            keep_order: !self
                .number
                .is_multiple_of(u64::from(self.quality.sort_every.max(1))),
        };
        let drawn = match images {
            Some(images) => self.renderer.draw_onto(&drawing, &mut **images),
            None => self.renderer.draw_with(&drawing),
        };
        (drawn, numbers)
    }
}
