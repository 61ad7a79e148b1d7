//! Posing on the device: what the networks gave goes to the GPU as it is, and pictures lie between two states there.

use super::cpu::{Request, View};
use super::npu::Inferred;
use super::states::{Heads, StateHead};
use super::triple_buffer::Reader;
use crate::concealment::between;
use crate::error::ReceiverError;
use crate::timeline::{DisplayLag, LatencyMode, Timeline};
use renderer_splat::drawing::Foreground;
use renderer_splat::posing::{PosedInput, StateId};
use renderer_splat::renderer::SplatRenderer;
use std::time::Instant;

const VERTICES: usize = 0;
const POTENTIALS: usize = 1;

/// The GPU lane's own part of making Gaussians, where that is not the CPU lane's.
#[derive(Debug)]
pub(super) struct DevicePosing {
    inferred: Reader<Inferred>,
    heads: Heads,
    /// The states' names on the device, by their places.
    ids: [Option<StateId>; Heads::PLACES],
    timeline: Timeline,
    /// Where the last picture lay.
    shown: Option<([StateId; 2], f32)>,
}

impl DevicePosing {
    pub(super) fn new(inferred: Reader<Inferred>, latency: LatencyMode, lag: DisplayLag) -> Self {
        Self {
            inferred,
            heads: Heads::new(),
            ids: [None; Heads::PLACES],
            timeline: Timeline::new(latency, lag),
            shown: None,
        }
    }

    /// Hands the newest inference to the device, if there is one, and finds the place of the picture that is asked for.
    /// `None` before the first state.
    ///
    /// # Errors
    /// If the graph's results are not those of the renderer's mesh.
    pub(super) fn view(
        &mut self,
        renderer: &mut SplatRenderer,
        request: Request,
    ) -> Result<Option<View>, ReceiverError> {
        if self.inferred.take() {
            self.push(renderer)?;
        }
        let Some(newest) = self.heads.newest_due() else {
            return Ok(None);
        };
        let begun = Instant::now();
        let moment = self.timeline.moment(request.displayed, newest);
        let Some(now) = self.heads.around(moment, &self.timeline) else {
            return Ok(None);
        };
        let [Some(from), Some(to)] = now.places.map(|place| self.heads.at(place)) else {
            return Ok(None);
        };
        let ids = (now.places).map(|place| self.ids.get(place).copied().flatten());
        self.shown = match ids {
            [Some(first), Some(second)] => Some(([first, second], now.alpha)),
            // The device is lost; the pose goes on.
            _ => None,
        };
        Ok(Some(View {
            number: request.number,
            states: [from.times, to.times],
            alpha: now.alpha,
            motion: between(&from.motion, &to.motion, now.alpha),
            // Known better once the device has told.
            interpolation: [begun; 2],
            level: request.level,
        }))
    }

    /// What the renderer is to draw; nothing where the device that had it was lost.
    pub(super) fn foreground(&self, level: usize) -> Option<Foreground<'static>> {
        let ([from, to], share) = self.shown?;
        Some(Foreground::Posed {
            from,
            to,
            share,
            level,
        })
    }

    /// The device was lost with its states; the newest inference is handed to the other one.
    ///
    /// # Errors
    /// As [`Self::view`].
    pub(super) fn renewed(&mut self, renderer: &mut SplatRenderer) -> Result<(), ReceiverError> {
        let had_states = self.heads.newest_due().is_some();
        self.heads = Heads::new();
        self.ids = [None; Heads::PLACES];
        self.shown = None;
        if had_states {
            self.push(renderer)?;
            self.shown = self
                .heads
                .newest_place()
                .and_then(|place| self.ids.get(place).copied().flatten())
                .map(|id| ([id, id], 1.0));
        }
        Ok(())
    }

    fn push(&mut self, renderer: &mut SplatRenderer) -> Result<(), ReceiverError> {
        let inferred = self.inferred.taken();
        let posed = &inferred.posed;
        let input = PosedInput {
            canonical_vertices: inferred.outputs.get(VERTICES),
            skinning: &posed.skinning.0,
            potentials: inferred.outputs.get(POTENTIALS),
            root: posed.pose.motion.root_translation.to_array(),
        };
        let id = match renderer.push_state(&input) {
            // Drawing finds out, and does something about it.
            Err(error) if error.is_device_lost() => None,
            pushed => Some(pushed?),
        };
        let place = self.heads.next_place();
        self.heads.make_room();
        let mut head = StateHead::new(&posed.pose);
        head.times.ready = Instant::now();
        if let Some(slot) = self.ids.get_mut(place) {
            *slot = id;
        }
        self.heads.push(head, place, &mut self.timeline);
        Ok(())
    }
}
