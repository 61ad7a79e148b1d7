//! What a training hands out: the avatar as it is now, and how near it comes to pictures that were held back.

use super::Trainer;
use crate::error::TrainError;
use crate::pictures::Pair;
use crate::preview::Preview;
use crate::score::Score;
use avatar_gradient::{Networks, Parameters, Parts};
use reconstruct::bake::{Weights as ImportanceWeights, importance};
use spmm3::networks::{DeformGraph, GraphParts};
use spmm3::{Avatar, MotionParams, PoseRange, package::PackageError};
use std::path::Path;

/// Pictures that a preview shows.
const SHOWN: usize = 3;
/// Where nothing is held back, so many pictures that were learnt from are looked at.
const WITHOUT_VALIDATION: usize = 4;

/// How near the avatar comes to pictures.
#[derive(Debug, Clone)]
pub struct Validation {
    /// PSNR within the masks of all of them, decibels, as a receiver draws the package.
    pub psnr: f64,
    /// How many pictures.
    pub pictures: usize,
    /// Whether they were held back; else they were learnt from.
    pub held_back: bool,
    /// Some of them: photograph, drawn, difference.
    pub preview: Preview,
}

impl Trainer<'_> {
    /// Networks and Gaussians as a package stores them.
    fn networks(&self) -> Result<Networks, TrainError> {
        let template = &self.first.template;
        Ok(self
            .parameters
            .to_networks(template, &self.controllers, &self.bound)?)
    }

    /// Draws the pictures that were held back, whole and as a receiver of the package would see them: driven by the capture's own poses, as poses to come
    /// have no correction. Cameras' colours are corrected, which belongs to the capture.
    ///
    /// # Errors
    /// A picture that cannot be read, a device that fails, or numbers that do not make a package.
    pub fn validate(&mut self) -> Result<Validation, TrainError> {
        let networks = self.networks()?;
        let parameters = networks.parameters();
        let held_back = !self.split.validation.is_empty();
        let pairs: Vec<Pair> = if held_back {
            self.split.validation.clone()
        } else {
            let some = self.split.training.len().div_ceil(WITHOUT_VALIDATION);
            (self.split.training.iter().step_by(some.max(1)))
                .copied()
                .collect()
        };
        let mut score = Score::default();
        let mut previews = Vec::new();
        for pair in &pairs {
            let preview = self.look(*pair, &parameters, &mut score)?;
            if previews.len() < SHOWN {
                previews.push(preview);
            }
        }
        Ok(Validation {
            psnr: score.psnr(),
            pictures: pairs.len(),
            held_back,
            preview: Preview::stacked(&previews),
        })
    }

    fn look(
        &mut self,
        pair: Pair,
        parameters: &Parameters,
        score: &mut Score,
    ) -> Result<Preview, TrainError> {
        let cut = self.pictures.cut(pair)?;
        let target = cut.target(0)?;
        let view = cut.view(&self.pictures.capture().cameras()[pair.camera], 0)?;
        let motion = &self.motions[pair.frame];
        let memory = &mut self.memory;
        // As a receiver has it, whatever learns at present.
        self.model.parts = Parts::ALL;
        self.model
            .pose(parameters, motion, None, &mut memory.posed)?;
        let drawn = self.splatter.draw(memory.posed.gaussians(), &view)?;
        let corrected = if self.options.colour_correction {
            Some(self.colours[pair.camera].apply(drawn.picture())?)
        } else {
            None
        };
        let picture = corrected.as_ref().unwrap_or(drawn.picture());
        score.add(picture, &target);
        Ok(Preview::new(&target, picture))
    }

    /// The poses that the networks were shown, as captured and as refined, and those that the first avatar's had learnt from. Nothing where it had learnt,
    /// and states none: its networks may know more than the capture shows.
    fn pose_range(&self) -> Option<PoseRange> {
        let refined: Vec<MotionParams> = (self.frames.iter())
            .map(|frame| {
                let correction = &self.poses[*frame].correction;
                correction.applied(&self.motions[*frame])
            })
            .collect();
        let captured = self.frames.iter().map(|frame| &self.motions[*frame]);
        let shown = PoseRange::of(captured.chain(&refined))?;
        match &self.first.pose_range {
            Some(first) => Some(shown.joined(first)),
            None if self.had_attributes => None,
            None => Some(shown),
        }
    }

    /// The avatar as it is now. Its report says how it was trained.
    ///
    /// # Errors
    /// Numbers that do not make an avatar.
    pub fn avatar(&self) -> Result<Avatar, TrainError> {
        let networks = self.networks()?;
        let graph = DeformGraph {
            template: &self.first.template,
            controllers: &self.controllers,
            mesh: &networks.mesh,
            attributes: &networks.attributes,
        };
        let deform_graph = graph.to_onnx(GraphParts::Whole)?;
        let mut report = self.first.report.clone();
        if !report.is_object() {
            report = serde_json::json!({ "first": report });
        }
        report["training"] = serde_json::json!({
            "steps": self.step,
            "gaussians": self.bound.len(),
            "pictures": self.split.training.len(),
            "validation_psnr_db": self.best,
        });
        // The first avatar's order is of Gaussians that have come and gone.
        let order = importance(
            &self.first.template,
            &networks.gaussians,
            ImportanceWeights::default(),
        )?;
        Ok(Avatar {
            gaussians: networks.gaussians,
            controllers: self.controllers.clone(),
            importance: Some(order),
            compiled: Vec::new(),
            signer: None,
            deform_graph,
            pose_range: self.pose_range(),
            report,
            ..self.first.clone()
        })
    }

    /// Writes the package if it is the best so far by `validation`, or if there is none at `path`: complete or not at all. Tells whether it was
    /// written.
    ///
    /// # Errors
    /// Numbers that do not make an avatar, a file that cannot be written.
    pub fn keep_best(&mut self, validation: &Validation, path: &Path) -> Result<bool, TrainError> {
        // The best one was written elsewhere, or is gone: this one is the best that there is.
        if !path.exists() {
            self.best = None;
        }
        if self.best.is_some_and(|best| validation.psnr <= best) {
            return Ok(false);
        }
        let before = self.best.replace(validation.psnr);
        let saved = self
            .avatar()
            .and_then(|avatar| avatar.save(path).map_err(|e: PackageError| e.into()));
        if saved.is_err() {
            self.best = before;
        }
        saved.map(|_| true)
    }

    /// PSNR within the masks of the best avatar that was written, decibels.
    #[must_use]
    pub fn best(&self) -> Option<f64> {
        self.best
    }
}
