//! The measurements of a bake: errors of the fits on training and held-out poses, sizes and times.

use serde::{Deserialize, Serialize};

/// What `bake` measured of the avatar, the same on every run of the same options; stored in the package's manifest. Times and what a device drew
/// are not here but in [`Baked`](super::Baked): equal avatars have equal packages.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct BakeReport {
    /// Seed of poses and random features.
    pub seed: u64,
    /// N_g.
    pub gaussians: usize,
    /// N_v.
    pub vertices: usize,
    /// Local attribute controllers.
    pub controllers: usize,
    /// Simulated poses that F_mesh learned from; F_attr takes some of them.
    pub training_poses: usize,
    /// Simulated poses that no fit has seen.
    pub held_out_poses: usize,
    /// The residual movement of the simulated cloth.
    pub simulation: SimulationReport,
    /// Share of the offsets' variance that F_mesh's components can hold at best, 0..=1.
    pub mesh_explained: f64,
    /// Errors of the posed mesh on training poses.
    pub mesh_training: MeshReport,
    /// Errors of the posed mesh on held-out poses.
    pub mesh_held_out: MeshReport,
    /// Errors of the Gaussians' attributes on training poses.
    pub attributes_training: AttributeReport,
    /// Errors of the Gaussians' attributes on held-out poses.
    pub attributes_held_out: AttributeReport,
    /// The error of storing F_attr's bases in 8 bits: position, millimetres.
    pub quantisation_position_mm: f32,
    /// The same for a colour channel, 0..=1.
    pub quantisation_colour: f32,
}

/// The simulated cloth.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct SimulationReport {
    /// Movement in the last step, root mean square over the cloth: mean over poses, millimetres.
    pub residual_mean_mm: f32,
    /// Its largest over poses, millimetres.
    pub residual_max_mm: f32,
    /// Offsets per pose that were shortened because they were longer than cloth may move.
    pub clamped_per_pose: f32,
}

/// Distances between posed vertices and the simulated truth, millimetres.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, Default)]
pub struct Distances {
    /// Mean.
    pub mean_mm: f32,
    /// 95th percentile.
    pub p95_mm: f32,
    /// Largest.
    pub max_mm: f32,
}

impl Distances {
    /// Summarises `distances`, metres.
    #[must_use]
    pub fn of(mut distances: Vec<f32>) -> Self {
        if distances.is_empty() {
            return Self::default();
        }
        let mean = distances.iter().map(|d| f64::from(*d)).sum::<f64>() / distances.len() as f64;
        let at = (distances.len() - 1) * 95 / 100;
        let (_, p95, above) = distances.select_nth_unstable_by(at, f32::total_cmp);
        let p95 = *p95;
        let max = above.iter().copied().fold(p95, f32::max);
        #[allow(clippy::cast_possible_truncation, reason = "f64 to f32 rounds")]
        let mean = mean as f32;
        Self {
            mean_mm: mean * 1e3,
            p95_mm: p95 * 1e3,
            max_mm: max * 1e3,
        }
    }
}

/// Errors of the posed mesh by linear blending alone, and with F_mesh.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct MeshReport {
    /// Every vertex, linear blending of the template and its expression.
    pub all_without: Distances,
    /// Every vertex, F_mesh.
    pub all_with: Distances,
    /// Hanging cloth, linear blending alone.
    pub garment_without: Distances,
    /// Hanging cloth, F_mesh.
    pub garment_with: Distances,
}

/// Root mean square errors of the Gaussians' attributes, without F_attr (F_mesh alone) and with.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct AttributeReport {
    /// Position, millimetres: without, with.
    pub position_mm: [f32; 2],
    /// Quaternion: without, with.
    pub rotation: [f32; 2],
    /// Log-scale: without, with.
    pub log_scale: [f32; 2],
    /// Colour channel, 0..=1: without, with.
    pub colour: [f32; 2],
}

/// Peak signal-to-noise ratio over the person's bounding box on held-out poses, dB, against the simulated truth.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct PictureReport {
    /// Pictures compared.
    pub pictures: usize,
    /// Linear blending alone, without expression.
    pub without_networks_db: f32,
    /// F_mesh.
    pub with_mesh_db: f32,
    /// F_mesh and F_attr.
    pub with_both_db: f32,
}

/// How long one step took.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct StepTime {
    /// The step.
    pub step: String,
    /// Wall-clock seconds.
    pub seconds: f32,
}
