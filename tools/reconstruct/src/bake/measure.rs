//! Measures the stored networks against the simulated truth.

use super::report::{AttributeReport, Distances, MeshReport, PictureReport};
use crate::fit::{Frame, MeshRunner, Targets, residuals};
use crate::simulate::{GroundTruth, Puppet, Simulator};
use glam::Vec3;
use rayon::prelude::*;
use spmm3::networks::{AttributeNetwork, MeshNetwork};
use spmm3::{
    ATTRIBUTES, BoundGaussians, Controllers, GaussianSet, MotionParams, PersonError,
    PlanarVertices, SH_C0, attribute,
};

/// A picture to take: a pinhole camera in the person's space.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Shot {
    /// Where the camera is, metres.
    pub eye: Vec3,
    /// What it looks at, metres.
    pub target: Vec3,
    /// Vertical field of view, radians.
    pub fov_y: f32,
    /// Width and height, pixels.
    pub size: u32,
}

/// Draws Gaussians: premultiplied linear or gamma RGBA, row by row, `size` x `size`; `None` if it cannot.
pub type Draw<'a> = dyn Fn(&GaussianSet, &Shot) -> Option<Vec<[f32; 4]>> + 'a;

/// Errors of the posed mesh over `poses`.
pub(super) fn mesh(
    simulator: &Simulator<'_>,
    puppet: &Puppet,
    network: &MeshNetwork,
    poses: &[MotionParams],
    truths: &[GroundTruth],
) -> MeshReport {
    let runner = MeshRunner::new(network);
    let loose: Vec<bool> = puppet.looseness.iter().map(|l| *l > 0.0).collect();
    let distances: Vec<[Vec<f32>; 2]> = poses
        .par_iter()
        .zip(truths)
        .map(|(motion, truth)| {
            let skin = simulator.skin(motion);
            let without = skin.pose_linear(&simulator.expressed(motion));
            let with = pose_mesh(simulator, puppet, &runner, motion);
            [without, with].map(|posed| {
                posed
                    .iter()
                    .zip(&truth.posed)
                    .map(|(a, b)| a.distance(*b))
                    .collect()
            })
        })
        .collect();
    let pick = |which: usize, garment: bool| {
        let picked = distances.iter().flat_map(|d| d[which].iter().zip(&loose));
        Distances::of(
            picked
                .filter(|(_, l)| !garment || **l)
                .map(|(d, _)| *d)
                .collect(),
        )
    };
    MeshReport {
        all_without: pick(0, false),
        all_with: pick(1, false),
        garment_without: pick(0, true),
        garment_with: pick(1, true),
    }
}

/// Posed vertices as the deform graph gives them.
pub(super) fn pose_mesh(
    simulator: &Simulator<'_>,
    puppet: &Puppet,
    runner: &MeshRunner<'_>,
    motion: &MotionParams,
) -> Vec<Vec3> {
    let canonical: Vec<Vec3> = puppet
        .template
        .vertices()
        .iter()
        .zip(runner.offsets(motion))
        .map(|(rest, offset)| *rest + offset)
        .collect();
    simulator.skin(motion).pose_linear(&canonical)
}

/// Errors of the attributes over `frames`.
pub(super) fn attributes(
    network: &AttributeNetwork,
    controllers: &Controllers,
    targets: &Targets,
    poses: &[MotionParams],
    frames: &[Frame],
) -> AttributeReport {
    let full = network.bases.dequantise();
    let count = targets.len().max(1);
    let mut sums = [[0.0f64; ATTRIBUTES]; 2];
    let [without, with] = &mut sums;
    for (motion, frame) in poses.iter().zip(frames) {
        let wanted = targets.planes(frame);
        let given = residuals(network, &full, controllers, motion);
        let planes = wanted.chunks_exact(count).zip(given.chunks_exact(count));
        for ((wanted, given), (without, with)) in
            planes.zip(without.iter_mut().zip(with.iter_mut()))
        {
            for (w, g) in wanted.iter().zip(given) {
                *without += f64::from(w * w);
                *with += f64::from((w - g) * (w - g));
            }
        }
    }
    let samples = (count * frames.len().max(1)) as f64;
    let rms = |which: usize, planes: std::ops::Range<usize>, summed: bool| {
        let width = if summed { 1.0 } else { planes.len() as f64 };
        let sum: f64 = planes.map(|p| sums[which][p]).sum();
        #[allow(clippy::cast_possible_truncation, reason = "f64 to f32 rounds")]
        let value = (sum / samples / width).sqrt() as f32;
        value
    };
    let both = |planes: std::ops::Range<usize>, summed: bool, unit: f32| {
        [0, 1].map(|which| rms(which, planes.clone(), summed) * unit)
    };
    AttributeReport {
        position_mm: both(attribute::OFFSET, true, 1e3),
        rotation: both(attribute::ROTATION, true, 1.0),
        log_scale: both(attribute::LOG_SCALE, false, 1.0),
        colour: both(attribute::COLOUR, false, SH_C0),
    }
}

/// All that posing for a picture takes.
pub(super) struct Sitter<'a> {
    pub(super) simulator: &'a Simulator<'a>,
    pub(super) puppet: &'a Puppet,
    pub(super) gaussians: &'a BoundGaussians,
    pub(super) attributes: &'a AttributeNetwork,
    pub(super) controllers: &'a Controllers,
    pub(super) targets: &'a Targets,
}

impl Sitter<'_> {
    /// The Gaussians of one pose: the truth, no networks, F_mesh alone, both.
    pub(super) fn sets(
        &self,
        motion: &MotionParams,
        frame: &Frame,
    ) -> Result<[GaussianSet; 4], PersonError> {
        let full = self.attributes.bases.dequantise();
        let plain = self
            .simulator
            .skin(motion)
            .pose_linear(self.puppet.template.vertices());
        let wanted = self.targets.planes(frame);
        let given = residuals(self.attributes, &full, self.controllers, motion);
        Ok([
            self.set(&frame.predicted, Some(&wanted))?,
            self.set(&plain, None)?,
            self.set(&frame.predicted, None)?,
            self.set(&frame.predicted, Some(&given))?,
        ])
    }

    fn set(&self, posed: &[Vec3], residuals: Option<&[f32]>) -> Result<GaussianSet, PersonError> {
        let planes: Vec<f32> = (0..3)
            .flat_map(|axis| posed.iter().map(move |v| v[axis]))
            .collect();
        let mut out = GaussianSet::zeroed(self.gaussians.len());
        let vertices = PlanarVertices::new(&planes, posed.len())?;
        self.gaussians
            .pose(vertices, residuals, Vec3::ZERO, &mut out)?;
        Ok(out)
    }

    /// Pictures of the first poses, front and half-left, with and without the networks, against the truth.
    pub(super) fn pictures(
        &self,
        poses: &[MotionParams],
        frames: &[Frame],
        draw: &Draw<'_>,
    ) -> Result<Option<PictureReport>, PersonError> {
        let mut errors = [0.0f64; 3];
        let mut pixels = 0.0f64;
        let mut pictures = 0;
        for (motion, frame) in poses.iter().zip(frames) {
            let sets = self.sets(motion, frame)?;
            let low = frame.truth.iter().copied().fold(Vec3::INFINITY, Vec3::min);
            let high = frame
                .truth
                .iter()
                .copied()
                .fold(Vec3::NEG_INFINITY, Vec3::max);
            let centre = (low + high) * 0.5;
            for angle in [0.0f32, 0.7] {
                let shot = Shot {
                    eye: centre + Vec3::new(angle.sin(), 0.1, angle.cos()) * 2.6,
                    target: centre,
                    fov_y: 0.75,
                    size: 512,
                };
                let drawn: Option<Vec<Vec<[f32; 4]>>> =
                    sets.iter().map(|set| draw(set, &shot)).collect();
                let Some(drawn) = drawn else { return Ok(None) };
                let inside = bounding_box(&drawn[0], shot.size as usize);
                for (which, error) in errors.iter_mut().enumerate() {
                    *error += square_error(&drawn[0], &drawn[which + 1], &inside);
                }
                pixels += inside.len() as f64;
                pictures += 1;
            }
        }
        #[allow(clippy::cast_possible_truncation, reason = "f64 to f32 rounds")]
        let db = |error: f64| (-10.0 * (error / (3.0 * pixels).max(1.0)).max(1e-12).log10()) as f32;
        Ok((pictures > 0).then(|| PictureReport {
            pictures,
            without_networks_db: db(errors[0]),
            with_mesh_db: db(errors[1]),
            with_both_db: db(errors[2]),
        }))
    }
}

/// Pixels of the smallest upright box around everything visible.
fn bounding_box(picture: &[[f32; 4]], width: usize) -> Vec<usize> {
    let seen = || {
        picture
            .iter()
            .enumerate()
            .filter(|(_, p)| p[3] > 0.02)
            .map(|(at, _)| (at % width, at / width))
    };
    let (left, right) = seen().fold((usize::MAX, 0), |(l, r), (x, _)| (l.min(x), r.max(x)));
    let (top, bottom) = seen().fold((usize::MAX, 0), |(t, b), (_, y)| (t.min(y), b.max(y)));
    let inside = |at: &usize| {
        (left..=right).contains(&(at % width)) && (top..=bottom).contains(&(at / width))
    };
    (0..picture.len()).filter(inside).collect()
}

fn square_error(a: &[[f32; 4]], b: &[[f32; 4]], inside: &[usize]) -> f64 {
    inside
        .iter()
        .map(|at| {
            (0..3)
                .map(|c| f64::from(a[*at][c].clamp(0.0, 1.0) - b[*at][c].clamp(0.0, 1.0)).powi(2))
                .sum::<f64>()
        })
        .sum()
}
