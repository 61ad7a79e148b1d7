//! The training loop.

mod avatar;
mod begin;
mod gauge;
mod jitter;
mod optimiser;
mod perceptual;
mod population;
mod regularise;
mod smoothing;
mod state;
#[cfg(test)]
mod tests;

pub use avatar::Validation;

use crate::backdrop::Backdrop;
use crate::colour::Correction;
use crate::density::Statistics;
use crate::error::TrainError;
use crate::options::Options;
use crate::pictures::{Pair, Pictures, Split};
use crate::schedule::{FIRST, Phase, SETTLED_FROM, phase};
use crate::score::Score;
use avatar_gradient::{Derivatives, Model, Moved, Parameters, PoseCorrection, Posed, step_bases};
use optimiser::{FramePose, Optimiser, basis_planes};
use perceptual::Perceptual;
use regularise::Regularisers;
use smoothing::Smoother;
use splat_gradient::loss::{PerceptualLoss, Ssim, Target, alpha_l1, colour_l1};
use splat_gradient::{Attributes, Picture, SplatDevice, View};
use spmm3::{Avatar, BoundGaussians, Controllers, MotionParams};

/// What a step found.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct StepReport {
    /// The picture.
    pub pair: Pair,
    /// The whole loss.
    pub loss: f64,
    /// PSNR within the mask of the picture before the step, decibels, at the resolution that it was compared in.
    pub psnr: f64,
    /// Gaussians after it.
    pub gaussians: usize,
}

/// One step moves one frame's pose: what all have in common is taken from them after so many.
const CENTRE_EVERY: u64 = 16;

/// An avatar in training.
#[derive(Debug)]
pub struct Trainer<'a> {
    options: Options,
    pictures: Pictures<'a>,
    split: Split,
    /// Frames that pictures are learnt from, ascending.
    frames: Vec<usize>,
    /// How the person stands in each frame, as the first avatar's skeleton has it.
    motions: Vec<MotionParams>,
    /// `[215]` How much each motion parameter varies over the frames that are learnt from.
    spread: Vec<f32>,
    /// The first avatar: what is not learnt of it stays.
    first: Avatar,
    /// Whether the first avatar's F_attr already moves something.
    had_attributes: bool,
    /// Where Gaussians are bound; its attributes are those at the last change of the population.
    bound: BoundGaussians,
    controllers: Controllers,
    model: Model,
    parameters: Parameters,
    optimiser: Optimiser,
    poses: Vec<FramePose>,
    colours: Vec<Correction>,
    statistics: Statistics,
    regularisers: Regularisers,
    smoother: Smoother,
    /// Steps made.
    step: u64,
    /// Steps since the population changed, and how often it did.
    unchanged: u32,
    rounds: u32,
    /// PSNR within the masks of the best avatar that was handed out.
    best: Option<f64>,
    /// Not state either: two of them differ by rounding.
    splatter: Box<dyn SplatDevice>,
    /// Of its state, a checkpoint has the identity.
    perceptual: Option<Perceptual>,
    memory: Memory,
}

/// Memory that is kept from step to step; nothing in it is state.
#[derive(Debug)]
struct Memory {
    ssim: Ssim,
    posed: Posed,
    by_gaussians: Attributes,
    by_pixel: Picture,
    gradients: Parameters,
}

impl Memory {
    fn new(model: &Model) -> Self {
        Self {
            ssim: Ssim::new(),
            posed: Posed::new(),
            by_gaussians: Attributes::zeros(model.sizes().gaussians),
            by_pixel: Picture::default(),
            gradients: Parameters::zeros_without_bases(model.sizes()),
        }
    }
}

impl Trainer<'_> {
    /// Steps that were made.
    #[must_use]
    pub fn steps(&self) -> u64 {
        self.step
    }

    /// Gaussians at present.
    #[must_use]
    pub fn gaussians(&self) -> usize {
        self.bound.len()
    }

    /// The options.
    #[must_use]
    pub fn options(&self) -> &Options {
        &self.options
    }

    /// Which pictures are learnt from.
    #[must_use]
    pub fn split(&self) -> &Split {
        &self.split
    }

    /// Draws and derives with another device than the CPU from now on. Only the CPU's bytes are the same on every machine.
    pub fn draw_with(&mut self, splatter: Box<dyn SplatDevice>) {
        self.splatter = splatter;
    }

    /// Adds a perceptual loss to the others, once pictures are no longer halved: the paper's LPIPS. It has to be there from the first step on.
    ///
    /// # Errors
    /// Where steps were made without it.
    pub fn judge_with(&mut self, perceptual: Box<dyn PerceptualLoss>) -> Result<(), TrainError> {
        if self.step > 0 {
            return Err(TrainError::Option {
                what: "the perceptual loss",
                value: format!("given after {} steps", self.step),
                range: "given before the first",
            });
        }
        self.perceptual = Some(Perceptual::new(perceptual));
        Ok(())
    }

    /// Learns from one picture. `progress` (0..=1) is how much of the training is done: it decides rates, resolution and stages, and should not
    /// fall.
    ///
    /// # Errors
    /// A picture that cannot be read, a device that fails, or numbers that are not finite: nothing was learnt then. A population that cannot be changed: it stays as it was.
    /// Either way the training can go on or be written.
    pub fn step(&mut self, progress: f32) -> Result<StepReport, TrainError> {
        let phase = phase(progress, &self.options);
        let pair = self.split.at(self.step, self.options.seed);
        let cut = self.pictures.cut(pair)?;
        let halvings = cut.halvings(phase.halvings);
        let target = cut.target(halvings)?;
        let camera = &self.pictures.capture().cameras()[pair.camera];
        let view = cut.view(camera, halvings)?;

        self.model.parts.attributes = self.had_attributes || phase.attributes;
        let chance = (self.options.seed, self.step);
        jitter::draw(
            chance,
            self.options.jitter,
            &self.spread,
            &mut self.model.jitter,
        );
        let whole = phase.halvings == 0;
        let compared = self.compare(pair, whole, &target, &view);
        self.model.jitter.clear();
        let compared = compared?;
        let mut loss = compared.loss;
        loss += self.learn(pair, &phase, &compared)?;
        self.step += 1;
        self.unchanged = self.unchanged.saturating_add(1);
        if progress < SETTLED_FROM {
            // What comes is better, whatever the figure says: where the capture's poses are wrong, an avatar that has learnt nothing meets pictures best.
            self.best = None;
        }
        if self.options.refine_poses && self.step.is_multiple_of(CENTRE_EVERY) {
            gauge::centre(&mut self.poses, &self.motions, &self.frames);
        }
        self.change_population(progress, &phase)?;
        Ok(StepReport {
            pair,
            loss,
            psnr: compared.psnr,
            gaussians: self.bound.len(),
        })
    }

    /// Draws the person and gathers the photometric loss' derivatives by the Gaussians and by the camera's colours. The perceptual loss is of `whole` pictures, that
    /// are no longer halved.
    fn compare(
        &mut self,
        pair: Pair,
        whole: bool,
        target: &Target,
        view: &View,
    ) -> Result<Compared, TrainError> {
        let (pictures, step) = (&self.pictures, self.step);
        let wrong = |what| not_finite(pictures, step, pair, what);
        let Memory {
            ssim,
            posed,
            by_gaussians,
            by_pixel,
            ..
        } = &mut self.memory;
        let correction = &self.poses[pair.frame].correction;
        let motion = &self.motions[pair.frame];
        self.model
            .pose(&self.parameters, motion, Some(correction), posed)?;
        // The splatter leaves out what is not finite: the picture would not tell.
        if !all_finite(posed.gaussians().numbers()) {
            return Err(wrong("a number of the posed Gaussians"));
        }
        let mut drawn = self.splatter.draw(posed.gaussians(), view)?;
        let colours = self
            .options
            .colour_correction
            .then(|| &self.colours[pair.camera]);
        let corrected = colours
            .map(|colours| colours.apply(drawn.picture()))
            .transpose()?;
        let picture = corrected.as_ref().unwrap_or(drawn.picture());
        let [width, height] = view.size();
        if [by_pixel.width(), by_pixel.height()] == [width, height] {
            by_pixel.clear();
        } else {
            *by_pixel = Picture::transparent(width, height);
        }
        let weights = &self.options.weights;
        let backdrop = Backdrop::of_step(self.options.seed, self.step);
        let (shown, wanted) = (backdrop.behind(picture)?, backdrop.behind_target(target)?);
        let mut loss = 0.0;
        let mut l1_share = 1.0 - weights.ssim;
        if let Some(perceptual) = self.perceptual.as_mut().filter(|_| whole) {
            l1_share -= weights.lpips;
            let chance = (self.options.seed, self.step);
            let pictures = (&shown, &wanted);
            loss += (perceptual.add(chance, pictures, &backdrop, weights.lpips, by_pixel))
                .map_err(TrainError::Perceptual)?;
        }
        let l1 = colour_l1(&shown, &wanted, l1_share, by_pixel)?;
        let dissimilar = ssim.loss(&shown, &wanted, weights.ssim, by_pixel)?;
        backdrop.pull_back(by_pixel);
        let silhouette = alpha_l1(picture, target, weights.alpha, by_pixel)?;
        loss += f64::from(l1_share) * l1
            + f64::from(weights.ssim) * dissimilar
            + f64::from(weights.alpha) * silhouette;
        if !loss.is_finite() {
            return Err(wrong("the loss"));
        }
        let mut score = Score::default();
        score.add(picture, target);
        let by_colours = colours.map(|colours| colours.pull_back(drawn.picture(), by_pixel));
        by_gaussians.numbers_mut().fill(0.0);
        drawn.backward(by_pixel, by_gaussians)?;
        let by_colours_finite = by_colours.as_ref().is_none_or(|by| all_finite(by));
        if !by_colours_finite || !all_finite(by_gaussians.numbers()) {
            return Err(wrong("a derivative of the loss"));
        }
        self.statistics.add(posed.gaussians(), by_gaussians, view);
        Ok(Compared {
            loss,
            psnr: score.psnr(),
            by_colours,
        })
    }

    /// Adds the regularising terms, takes all derivatives back to the parameters, and moves these. Returns the terms' sum.
    fn learn(&mut self, pair: Pair, phase: &Phase, compared: &Compared) -> Result<f64, TrainError> {
        let (pictures, step) = (&self.pictures, self.step);
        let wrong = |what| not_finite(pictures, step, pair, what);
        let Memory {
            posed,
            by_gaussians,
            gradients,
            ..
        } = &mut self.memory;
        gradients.clear();
        let terms = self.regularisers.add(
            self.step,
            (&self.model, &self.parameters),
            posed,
            &self.options.weights,
            by_gaussians,
        )?;
        let by = Derivatives {
            gaussians: Some(by_gaussians),
            offsets: terms.by_offsets,
            vertices: terms.by_vertices,
        };
        let sum = terms.sum;
        let by_pose: PoseCorrection =
            self.model
                .backward(&self.parameters, posed, &by, gradients)?;
        // Before anything moves: Adam would keep what is not finite for ever.
        if !sum.is_finite() {
            return Err(wrong("the sum of the regularising terms"));
        }
        let learnt = gradients
            .arrays()
            .iter()
            .all(|(_, array)| all_finite(array));
        if !learnt || !all_finite(&by_pose.0) || !all_finite(by_gaussians.numbers()) {
            return Err(wrong("a derivative by what is learnt"));
        }
        let rates = &phase.rates;
        if rates.mesh_mean > 0.0 || rates.mesh_fields > 0.0 {
            self.smoother.spread(gradients);
        }
        if rates.bases > 0.0 && self.model.parts.attributes {
            step_bases(
                &mut self.optimiser.bases,
                &mut self.parameters.bases,
                &self.model,
                posed,
                &basis_planes(rates),
                Moved::Seen,
            )?;
        }
        self.optimiser
            .step(&mut self.parameters, gradients, rates)?;
        let pull = self.options.weights.pose;
        self.poses[pair.frame].step(&by_pose, pull, rates)?;
        if let Some(by_colours) = &compared.by_colours {
            let slower = rates.colour / FIRST.colour;
            self.colours[pair.camera].step(by_colours, slower)?;
        }
        Ok(sum)
    }
}

/// The error of step number `step` on `pair`, in which `what` is not finite.
fn not_finite(pictures: &Pictures<'_>, step: u64, pair: Pair, what: &'static str) -> TrainError {
    let camera = pictures.capture().cameras().get(pair.camera);
    TrainError::NotFinite {
        step,
        camera: camera.map_or_else(String::new, |camera| camera.name.clone()),
        frame: pair.frame,
        what,
    }
}

/// Whether all numbers are; looks at every one, since they nearly always are.
fn all_finite(numbers: &[f32]) -> bool {
    numbers.iter().fold(true, |all, x| all & x.is_finite())
}

/// One picture compared.
#[derive(Debug)]
struct Compared {
    loss: f64,
    psnr: f64,
    by_colours: Option<[f32; crate::colour::NUMBERS]>,
}
