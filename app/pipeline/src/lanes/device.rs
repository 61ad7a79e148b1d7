//! Posing on the device: what the networks gave goes to the GPU as it is, or what they would be given where they run there too, and pictures lie
//! between two states there.

use super::cpu::{Request, View};
use super::motion::Posed;
use super::npu::Inferred;
use super::states::{Heads, StateHead};
use super::triple_buffer::Reader;
use crate::concealment::between;
use crate::error::ReceiverError;
use crate::posing::computed;
use crate::timeline::{DisplayLag, LatencyMode, Timeline};
use renderer_splat::drawing::Foreground;
use renderer_splat::posing::{Deformation, PosedInput, StateId};
use renderer_splat::renderer::SplatRenderer;
use spmm3::{Avatar, PARAMS};
use std::sync::Arc;
use std::time::Instant;

/// What the device is given of a pose.
#[derive(Debug)]
pub(super) enum DeviceInput {
    /// What the networks made of it.
    Inferred(Reader<Inferred>),
    /// The pose itself; the device runs the networks.
    Posed {
        posed: Reader<Posed>,
        avatar: Arc<Avatar>,
        /// What the networks see of it.
        seen: Vec<f32>,
    },
}

impl DeviceInput {
    /// The pose, for a device that runs the networks of `avatar`.
    pub(super) fn posed(posed: Reader<Posed>, avatar: &Arc<Avatar>) -> Self {
        Self::Posed {
            posed,
            avatar: Arc::clone(avatar),
            seen: vec![0.0; PARAMS],
        }
    }

    fn take(&mut self) -> bool {
        match self {
            Self::Inferred(inferred) => inferred.take(),
            Self::Posed { posed, .. } => posed.take(),
        }
    }

    /// The newest that was taken: the pose, and what is told of it to the device.
    fn taken(&mut self) -> (&Posed, Deformation<'_>) {
        match self {
            Self::Inferred(inferred) => {
                let Inferred { posed, outputs } = inferred.taken();
                (posed, computed(outputs))
            }
            Self::Posed {
                posed,
                avatar,
                seen,
            } => {
                let posed = posed.taken();
                avatar.networks_see(&posed.pose.motion, seen);
                (posed, Deformation::Parameters(seen))
            }
        }
    }
}

/// The GPU lane's own part of making Gaussians, where that is not the CPU lane's.
#[derive(Debug)]
pub(super) struct DevicePosing {
    input: DeviceInput,
    heads: Heads,
    /// The states' names on the device, by their places.
    ids: [Option<StateId>; Heads::PLACES],
    timeline: Timeline,
    /// Where the last picture lay.
    shown: Option<([StateId; 2], f32)>,
}

impl DevicePosing {
    pub(super) fn new(input: DeviceInput, latency: LatencyMode, lag: DisplayLag) -> Self {
        Self {
            input,
            heads: Heads::new(),
            ids: [None; Heads::PLACES],
            timeline: Timeline::new(latency, lag),
            shown: None,
        }
    }

    /// Hands the newest input to the device, if there is one, and finds the place of the picture that is asked for.
    /// `None` before the first state.
    ///
    /// # Errors
    /// If the graph's results are not those of the renderer's mesh.
    pub(super) fn view(
        &mut self,
        renderer: &mut SplatRenderer,
        request: Request,
    ) -> Result<Option<View>, ReceiverError> {
        if self.input.take() {
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

    /// Whether the device runs the networks.
    pub(super) fn runs_networks(&self) -> bool {
        matches!(self.input, DeviceInput::Posed { .. })
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

    /// The device was lost with its states; the newest input is handed to the other one.
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
        let handed = Instant::now();
        let is_driven = self.runs_networks();
        let (posed, deformation) = self.input.taken();
        let input = PosedInput {
            deformation,
            skinning: &posed.skinning.0,
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
        if is_driven {
            // The networks are run with the picture, and count as drawing it.
            head.times.inference = [handed; 2];
        }
        if let Some(slot) = self.ids.get_mut(place) {
            *slot = id;
        }
        self.heads.push(head, place, &mut self.timeline);
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::super::triple_buffer::{WakeSignal, triple_buffer};
    use super::*;
    use glam::Vec3;
    use spmm3::{Joint, MotionParams, PoseRange};
    use synthetic_person::Puppet;

    /// A fold of the left arm.
    fn folded(angle: f32) -> MotionParams {
        let mut motion = MotionParams::default();
        motion.set_axis_angle(Joint::LeftElbow, Vec3::new(0.0, angle, 0.0));
        motion
    }

    #[test]
    fn networks_of_the_device_see_the_nearest_pose_of_their_range_and_the_skeleton_the_motion_itself()
     {
        let avatar = Arc::new(Avatar {
            pose_range: PoseRange::of([&folded(-0.2), &folded(0.3)]),
            ..Puppet::small().avatar()
        });
        let none = Posed::none;
        let bell = WakeSignal::default();
        let (mut writer, reader) = triple_buffer([none(), none(), none()], &bell);
        let mut input = DeviceInput::posed(reader, &avatar);
        for (given, seen) in [(1.4, 0.3), (0.1, 0.1)] {
            writer.place().pose.motion = folded(given);
            writer.give();
            assert!(input.take(), "a pose");
            let (posed, deformation) = input.taken();
            assert_eq!(posed.pose.motion, folded(given), "the skeleton's");
            let Deformation::Parameters(parameters) = deformation else {
                panic!("{deformation:?}");
            };
            assert_eq!(parameters, folded(seen).values(), "the networks'");
        }
    }
}
