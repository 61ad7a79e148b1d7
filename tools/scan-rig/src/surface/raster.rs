//! Gaussians drawn on the CPU: what a picture costs a device no more than reading back, and what no device returns: the depth at which
//! half of the light is gone, and how much of each Gaussian shows.
//!
//! The projection is the renderer's (Zwicker et al., "EWA Splatting", 2002; the numbers are those of 3DGS: a low-pass of 0.3 square
//! pixels, opacity at most 0.99, nothing below 1/255). Strips of rows are drawn at the same time, each from front to back, so the result
//! does not depend on the number of threads.

use crate::pinhole::Pinhole;
use crate::scan::Scan;
use glam::{Mat3, Vec3};
use rayon::prelude::*;

/// Square pixels by which every splat is widened.
const LOW_PASS: f32 = 0.3;
/// The largest opacity of a Gaussian in a pixel.
const ALPHA_MOST: f32 = 0.99;
/// What is less opaque in a pixel is not blended.
const ALPHA_CUT: f32 = 1.0 / 255.0;
/// A pixel through which less light comes is finished.
const DARK: f32 = 1e-4;
/// Gaussians nearer than this are not drawn, metres.
const NEAR: f32 = 0.2;
/// How far beyond the picture's edge the projection's derivative is followed, as a share of half the picture.
const MARGIN: f32 = 1.3;
/// Rows of a strip.
const STRIP: usize = 16;

/// A picture of Gaussians, row by row from the top.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Picture {
    /// Width, pixels.
    pub width: usize,
    /// Height, pixels.
    pub height: usize,
    /// Premultiplied display colours.
    pub colours: Vec<Vec3>,
    /// Share of the light from behind that comes through, 0..=1.
    pub transmittance: Vec<f32>,
    /// Distance along the camera's axis at which half of the light is gone, metres; infinite where more comes through.
    pub depth: Vec<f32>,
}

/// How much of each Gaussian shows in one picture.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Shares {
    /// The largest blending weight in any pixel.
    pub peak: Vec<f32>,
    /// The sum of the blending weights, pixels.
    pub sum: Vec<f32>,
}

impl Picture {
    /// The picture over one colour.
    #[must_use]
    pub fn over(&self, backdrop: Vec3) -> Vec<Vec3> {
        let pixels = self.colours.iter().zip(&self.transmittance);
        pixels.map(|(c, t)| *c + backdrop * *t).collect()
    }
}

/// Draws a scan.
#[must_use]
pub fn draw(scan: &Scan, view: &Pinhole) -> Picture {
    rasterise::<false>(scan, view).0
}

/// Draws a scan and says how much of each Gaussian shows.
#[must_use]
pub fn draw_with_shares(scan: &Scan, view: &Pinhole) -> (Picture, Shares) {
    rasterise::<true>(scan, view)
}

/// A Gaussian in the picture.
#[derive(Clone, Copy)]
struct Splat {
    gaussian: u32,
    depth: f32,
    /// Centre, pixels.
    centre: [f32; 2],
    /// The inverse covariance: xx, xy, yy.
    conic: [f32; 3],
    opacity: f32,
    /// Twice the negative exponent at which it is no longer blended.
    reach: f32,
    /// Half of its height, pixels.
    half_height: f32,
    colour: Vec3,
}

/// What a strip adds to a Gaussian's shares.
struct StripShares {
    peak: Vec<f32>,
    sum: Vec<f32>,
}

fn rasterise<const SHARES: bool>(scan: &Scan, view: &Pinhole) -> (Picture, Shares) {
    let (width, height) = (view.width as usize, view.height as usize);
    let splats = project(scan, view);
    let strips = by_strip(&splats, height);
    let mut picture = Picture {
        width,
        height,
        colours: vec![Vec3::ZERO; width * height],
        transmittance: vec![1.0; width * height],
        depth: vec![f32::INFINITY; width * height],
    };
    if width == 0 || height == 0 {
        return (picture, Shares::default());
    }
    let pixels = STRIP * width;
    let drawn: Vec<StripShares> = (
        picture.colours.par_chunks_mut(pixels),
        picture.transmittance.par_chunks_mut(pixels),
        picture.depth.par_chunks_mut(pixels),
        &strips,
    )
        .into_par_iter()
        .enumerate()
        .map(|(strip, (colours, transmittance, depth, members))| {
            let canvas = Canvas {
                width,
                first_row: strip * STRIP,
                colours,
                transmittance,
                depth,
            };
            canvas.blend::<SHARES>(&splats, members)
        })
        .collect();
    let mut shares = Shares::default();
    if SHARES {
        shares.peak = vec![0.0; scan.len()];
        shares.sum = vec![0.0; scan.len()];
        for (members, drawn) in strips.iter().zip(&drawn) {
            for (at, splat) in members.iter().enumerate() {
                let gaussian = splats[*splat as usize].gaussian as usize;
                shares.peak[gaussian] = shares.peak[gaussian].max(drawn.peak[at]);
                shares.sum[gaussian] += drawn.sum[at];
            }
        }
    }
    (picture, shares)
}

/// The Gaussians that can show, nearest first; those of one depth in their order.
fn project(scan: &Scan, view: &Pinhole) -> Vec<Splat> {
    let eye = view.eye.as_vec3();
    let camera_from_world = view.world_from_camera.transpose().as_mat3();
    #[expect(
        clippy::cast_possible_truncation,
        reason = "focal lengths and sizes of pictures"
    )]
    let (focal, width, height) = (view.focal as f32, view.width as f32, view.height as f32);
    let limit_x = MARGIN * width / 2.0 / focal;
    let limit_y = MARGIN * height / 2.0 / focal;
    let mut splats: Vec<Splat> = (0..scan.len())
        .into_par_iter()
        .filter_map(|at| {
            let opacity = scan.opacities[at];
            let seen = camera_from_world * (scan.positions[at] - eye);
            if !(seen.z > NEAR && opacity > ALPHA_CUT) {
                return None;
            }
            let inverse = 1.0 / seen.z;
            let slope_x = (seen.x * inverse).clamp(-limit_x, limit_x);
            let slope_y = (seen.y * inverse).clamp(-limit_y, limit_y);
            let axes = camera_from_world
                * Mat3::from_quat(scan.rotations[at])
                * Mat3::from_diagonal(scan.scales[at]);
            // Rows of the Jacobian times the Gaussian's axes.
            let row = |axis: usize| Vec3::new(axes.x_axis[axis], axes.y_axis[axis], axes.z_axis[axis]);
            let (x, y, z) = (row(0), row(1), row(2));
            let across = (x - z * slope_x) * (focal * inverse);
            let down = (y - z * slope_y) * (focal * inverse);
            let xx = across.length_squared() + LOW_PASS;
            let xy = across.dot(down);
            let yy = down.length_squared() + LOW_PASS;
            let determinant = xx * yy - xy * xy;
            let reach = 2.0 * (opacity * 255.0).ln();
            let half_width = (reach * xx).sqrt();
            let half_height = (reach * yy).sqrt();
            let centre = [
                seen.x * inverse * focal + width / 2.0,
                seen.y * inverse * focal + height / 2.0,
            ];
            let shows = determinant > 0.0
                && determinant.is_finite()
                && centre[0] + half_width > 0.0
                && centre[0] - half_width < width
                && centre[1] + half_height > 0.0
                && centre[1] - half_height < height;
            #[expect(
                clippy::cast_possible_truncation,
                reason = "a scene has at most 4,194,304 Gaussians"
            )]
            shows.then(|| Splat {
                gaussian: at as u32,
                depth: seen.z,
                centre,
                conic: [yy / determinant, -xy / determinant, xx / determinant],
                opacity,
                reach,
                half_height,
                colour: scan.colours[at].max(Vec3::ZERO),
            })
        })
        .collect();
    splats.par_sort_by(|a, b| {
        a.depth
            .total_cmp(&b.depth)
            .then(a.gaussian.cmp(&b.gaussian))
    });
    splats
}

/// For each strip the splats that reach into it, nearest first.
fn by_strip(splats: &[Splat], height: usize) -> Vec<Vec<u32>> {
    let mut strips = vec![Vec::new(); height.div_ceil(STRIP)];
    let last = strips.len().saturating_sub(1);
    for (at, splat) in splats.iter().enumerate() {
        let row = |y: f32| pixel(y) / STRIP;
        let first = row(splat.centre[1] - splat.half_height);
        let until = row(splat.centre[1] + splat.half_height).min(last);
        #[expect(clippy::cast_possible_truncation, reason = "fewer than the scan's")]
        for strip in strips.iter_mut().take(until + 1).skip(first) {
            strip.push(at as u32);
        }
    }
    strips
}

/// The pixel that contains a coordinate; the first for what is left of or above the picture.
fn pixel(coordinate: f32) -> usize {
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "saturates, and what is no number becomes 0"
    )]
    let pixel = coordinate as usize;
    pixel
}

/// Some rows of a picture.
struct Canvas<'a> {
    width: usize,
    first_row: usize,
    colours: &'a mut [Vec3],
    transmittance: &'a mut [f32],
    depth: &'a mut [f32],
}

impl Canvas<'_> {
    fn blend<const SHARES: bool>(self, splats: &[Splat], members: &[u32]) -> StripShares {
        let rows = self.transmittance.len() / self.width;
        let counted = if SHARES { members.len() } else { 0 };
        let mut shares = StripShares {
            peak: vec![0.0; counted],
            sum: vec![0.0; counted],
        };
        for (at, member) in members.iter().enumerate() {
            let splat = &splats[*member as usize];
            let [xx, xy, yy] = splat.conic;
            let (mut peak, mut sum) = (0.0_f32, 0.0_f32);
            let low = pixel((splat.centre[1] - splat.half_height - 0.5).ceil()).max(self.first_row);
            let high = pixel(splat.centre[1] + splat.half_height + 0.5)
                .min(self.first_row + rows);
            for row in low..high {
                let dy = row as f32 + 0.5 - splat.centre[1];
                // Where xx dx^2 + 2 xy dx dy + yy dy^2 <= reach.
                let middle = -xy * dy / xx;
                let rest = middle * middle - (yy * dy * dy - splat.reach) / xx;
                if !(rest > 0.0) {
                    continue;
                }
                let half = rest.sqrt();
                let left = pixel((splat.centre[0] + middle - half - 0.5).ceil());
                let right = pixel(splat.centre[0] + middle + half + 0.5).min(self.width);
                let start = (row - self.first_row) * self.width;
                for x in left..right {
                    let i = start + x;
                    let before = self.transmittance[i];
                    if before < DARK {
                        continue;
                    }
                    let dx = x as f32 + 0.5 - splat.centre[0];
                    let power = -0.5 * (xx * dx * dx + yy * dy * dy) - xy * dx * dy;
                    let alpha = (splat.opacity * power.exp()).min(ALPHA_MOST);
                    if alpha < ALPHA_CUT {
                        continue;
                    }
                    let weight = alpha * before;
                    let after = before - weight;
                    if before >= 0.5 && after < 0.5 {
                        self.depth[i] = splat.depth;
                    }
                    self.colours[i] += splat.colour * weight;
                    self.transmittance[i] = after;
                    if SHARES {
                        peak = peak.max(weight);
                        sum += weight;
                    }
                }
            }
            if SHARES {
                shares.peak[at] = peak;
                shares.sum[at] = sum;
            }
        }
        shares
    }
}
