//! Gaussian splatting on the CPU in f64: slow, simple, and independent of the renderer.
//!
//! No tiles, no early stop, no packing, no keys: every Gaussian is projected as the 3DGS paper and its
//! public code say, all are sorted by exact depth, and each pixel blends all of them front to back. Only
//! pixels where alpha cannot reach 1/255 are skipped. Nothing of `renderer-splat` is used but its inputs; a
//! background is read as its file states it, not as the renderer packs it.

mod compare;
mod harmonics;
mod project;

pub use compare::{PixelBox, covered_box, depth_error, psnr, to_image};
pub use harmonics::{ORDERS, real_harmonics};

use std::cmp::Ordering;

use glam::Affine3A;
use rayon::prelude::*;
use renderer_splat::camera::Camera;
use renderer_splat::gaussian::Gaussian;
use renderer_splat::options::Filter;
use splat_scene::Scene;

use project::{ALPHA_CUT, ALPHA_MOST, Ellipsoid, Projected};

/// A scene.
#[derive(Debug, Clone, Copy, Default)]
pub struct World<'a> {
    /// Gaussians that may change from picture to picture.
    pub foreground: &'a [Gaussian],
    /// More of them, each row turned and shifted by its transform.
    pub parts: &'a [(&'a [Gaussian], Affine3A)],
    /// Gaussians that do not.
    pub background: Option<&'a Scene>,
    /// Against aliasing.
    pub filter: Filter,
}

impl<'a> World<'a> {
    /// A foreground alone.
    pub fn of(foreground: &'a [Gaussian]) -> Self {
        Self {
            foreground,
            ..Self::default()
        }
    }

    /// A background alone.
    pub fn scene(background: &'a Scene) -> Self {
        Self {
            background: Some(background),
            ..Self::default()
        }
    }
}

/// A picture in f64: premultiplied red, green, blue, alpha; row by row from the top.
#[derive(Debug, Clone)]
pub struct ReferencePicture {
    /// Pixels in a row.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// `width * height` pixels.
    pub pixels: Vec<[f64; 4]>,
    /// As many depths along the view's axis, metres, each times its pixel's alpha.
    pub depths: Vec<f64>,
}

/// Draws all Gaussians, which are finite, as one camera sees them.
pub fn render(gaussians: &[Gaussian], camera: &Camera) -> ReferencePicture {
    render_world(&World::of(gaussians), camera)
}

/// Draws foreground and background, which are finite, as one camera sees them.
pub fn render_world(world: &World<'_>, camera: &Camera) -> ReferencePicture {
    let eye = project::eye(camera);
    let mut splats: Vec<Projected> = world
        .foreground
        .par_iter()
        .map(Ellipsoid::from)
        .filter_map(|ellipsoid| project::project(&ellipsoid, camera, world.filter))
        .collect();
    for (gaussians, world_from_part) in world.parts {
        splats.par_extend(gaussians.par_iter().filter_map(|gaussian| {
            let ellipsoid = Ellipsoid::from(gaussian).placed(world_from_part);
            project::project(&ellipsoid, camera, world.filter)
        }));
    }
    if let Some(scene) = world.background {
        let indices = (0..scene.len()).into_par_iter();
        splats.par_extend(indices.filter_map(|index| {
            let ellipsoid = Ellipsoid::of_scene(scene, index, eye);
            project::project(&ellipsoid, camera, world.filter)
        }));
    }
    // Stable: equal depths stay in the order of their index, the foreground before the background.
    splats.par_sort_by(|a, b| a.depth.partial_cmp(&b.depth).unwrap_or(Ordering::Equal));

    let (width, height) = (camera.width as usize, camera.height as usize);
    let mut by_row: Vec<Vec<u32>> = vec![Vec::new(); height];
    for (index, splat) in (0..).zip(&splats) {
        for row in splat.rows.clone() {
            by_row[row].push(index);
        }
    }
    let mut pixels = vec![[0.0; 4]; width * height];
    let mut depths = vec![0.0; width * height];
    pixels
        .par_chunks_exact_mut(width)
        .zip(depths.par_chunks_exact_mut(width))
        .zip(&by_row)
        .enumerate()
        .for_each(|(y, ((row, depths), touching))| {
            let touching = touching.iter().map(|index| &splats[*index as usize]);
            blend_row(row, depths, y, touching);
        });
    ReferencePicture {
        width,
        height,
        pixels,
        depths,
    }
}

#[expect(clippy::cast_precision_loss, reason = "pixel counts are small")]
fn blend_row<'a>(
    row: &mut [[f64; 4]],
    depths: &mut [f64],
    y: usize,
    splats: impl Iterator<Item = &'a Projected>,
) {
    let mut transmittance = vec![1.0f64; row.len()];
    for splat in splats {
        let dy = y as f64 + 0.5 - splat.mean[1];
        let [a, b, c] = splat.inverse_covariance;
        for x in splat.columns.clone() {
            let dx = x as f64 + 0.5 - splat.mean[0];
            let q = a * dx * dx + 2.0 * b * dx * dy + c * dy * dy;
            let alpha = (splat.opacity * (-0.5 * q).exp()).min(ALPHA_MOST);
            if alpha < ALPHA_CUT {
                continue;
            }
            let weight = alpha * transmittance[x];
            for (sum, channel) in row[x].iter_mut().zip(splat.colour) {
                *sum += weight * channel;
            }
            row[x][3] += weight;
            depths[x] += weight * splat.depth;
            transmittance[x] *= 1.0 - alpha;
        }
    }
}
