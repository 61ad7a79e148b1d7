//! A training begins: with a first avatar, whose networks get room for what they are to learn.

use super::{Memory, Trainer, gauge};
use crate::colour::Correction;
use crate::density::Statistics;
use crate::error::TrainError;
use crate::fresh::{InputStatistics, MESH_HIDDEN, attribute_network, widened};
use crate::options::Options;
use crate::pictures::{Pictures, Split};
use crate::random::mixed;
use crate::trainer::optimiser::{FramePose, Optimiser};
use crate::trainer::regularise::Regularisers;
use crate::trainer::smoothing::Smoother;
use avatar_gradient::{Model, Networks, PoseCorrection};
use capture::Capture;
use splat_gradient::Splatter;
use spmm3::networks::{AttributeNetwork, MeshNetwork};
use spmm3::{Avatar, Controllers, MotionParams};

/// Parts of what a seed decides; rounds of pictures and changes of the population are numbered from 0.
const ATTRIBUTES: u64 = u64::MAX - 1;
const MESH: u64 = u64::MAX - 2;

impl<'a> Trainer<'a> {
    /// A training of `first` on the capture's pictures. `motions` say how the person stands in each of its frames, with the root translation of
    /// the avatar's skeleton ([`capture::FramePose::on`]); at most `options.gaussians` of its Gaussians are kept.
    ///
    /// # Errors
    /// Options out of their range, motions that are not as many as frames, an avatar whose graph this program did not write, no pictures.
    pub fn new(
        capture: &'a Capture,
        first: Avatar,
        motions: Vec<MotionParams>,
        options: Options,
    ) -> Result<Self, TrainError> {
        options.check()?;
        let split = Split::new(capture, options.validation, options.seed)?;
        let frames = frames(&split);
        check_motions(&motions, capture.frames())?;
        let networks = networks(&first, &motions, &frames, &options)?;
        let parts = (networks, first.controllers.clone(), first);
        let mut trainer = Self::of_parts(capture, parts, motions, split, options)?;
        trainer.keep_to_budget()?;
        Ok(trainer)
    }

    /// Begins with other poses than the capture's: `fitted` ones, as many as there are frames. What they have in common is taken from them.
    ///
    /// # Errors
    /// Motions that are not as many as frames, or not finite.
    pub fn begin_with_poses(&mut self, fitted: &[MotionParams]) -> Result<(), TrainError> {
        check_motions(fitted, self.motions.len())?;
        let captured = self.motions.iter().zip(fitted);
        for (pose, (captured, fitted)) in self.poses.iter_mut().zip(captured) {
            pose.correction = PoseCorrection::between(captured, fitted);
        }
        gauge::centre(&mut self.poses, &self.motions, &self.frames);
        Ok(())
    }

    /// With all state but the numbers of a training's first step.
    pub(super) fn of_parts(
        capture: &'a Capture,
        (networks, controllers, first): (Networks, Controllers, Avatar),
        motions: Vec<MotionParams>,
        split: Split,
        options: Options,
    ) -> Result<Self, TrainError> {
        let model = Model::new(&first.skeleton, &first.template, &controllers, &networks)?;
        let parameters = networks.parameters();
        let had_attributes = parameters.bases.iter().any(|number| *number != 0.0);
        let frames = frames(&split);
        Ok(Self {
            pictures: Pictures::new(capture, options.picture_memory),
            spread: statistics(&motions, &frames).spread,
            frames,
            split,
            poses: vec![FramePose::default(); motions.len()],
            motions,
            had_attributes,
            optimiser: Optimiser::new(&parameters),
            colours: vec![Correction::default(); capture.cameras().len()],
            statistics: Statistics::new(networks.gaussians.len()),
            regularisers: Regularisers::new(&first.template, &controllers, &networks.gaussians)?,
            smoother: Smoother::new(&first.template),
            bound: networks.gaussians,
            controllers,
            first,
            splatter: Box::new(Splatter::new()),
            perceptual: None,
            memory: Memory::new(&model),
            model,
            parameters,
            options,
            step: 0,
            unchanged: 0,
            rounds: 0,
            best: None,
        })
    }
}

/// Frames that are learnt from, ascending.
fn frames(split: &Split) -> Vec<usize> {
    let mut frames: Vec<usize> = split.training.iter().map(|pair| pair.frame).collect();
    frames.sort_unstable();
    frames.dedup();
    frames
}

pub(super) fn check_motions(motions: &[MotionParams], frames: usize) -> Result<(), TrainError> {
    if motions.len() != frames {
        return Err(TrainError::Option {
            what: "the number of motions",
            value: motions.len().to_string(),
            range: "the capture's number of frames",
        });
    }
    match motions.iter().position(|motion| !motion.is_finite()) {
        None => Ok(()),
        Some(frame) => Err(TrainError::Option {
            what: "a number of a frame's motion",
            value: format!("not finite in frame {frame}"),
            range: "finite",
        }),
    }
}

/// How motions are spread over the frames that are learnt from.
fn statistics(motions: &[MotionParams], frames: &[usize]) -> InputStatistics {
    InputStatistics::new(frames.iter().filter_map(|frame| motions.get(*frame)))
}

/// The first avatar's networks, with room for what a person's clothes do.
fn networks(
    first: &Avatar,
    motions: &[MotionParams],
    frames: &[usize],
    options: &Options,
) -> Result<Networks, TrainError> {
    let inputs = statistics(motions, frames);
    let unknown = |e: spmm3::networks::GraphRefused| TrainError::Network(e.to_string());
    let mut mesh = MeshNetwork::read(&first.deform_graph, &first.template).map_err(unknown)?;
    if options.learn_mesh && mesh.first.outputs() < MESH_HIDDEN {
        mesh = widened(&mesh, &inputs, mixed(options.seed, MESH))?;
    }
    let controllers = &first.controllers;
    let mut attributes =
        AttributeNetwork::read(&first.deform_graph, controllers).map_err(unknown)?;
    let moves = attributes.bases.values().iter().any(|value| *value != 0);
    if options.learn_attributes && !moves {
        let seed = mixed(options.seed, ATTRIBUTES);
        attributes = attribute_network(&first.template, controllers, &inputs, seed)?;
    }
    Ok(Networks {
        // A package's barycentrics are halves: so the trainer's are, and what it draws is what a receiver will.
        gaussians: first.gaussians.clone().quantised(),
        mesh,
        attributes,
    })
}
