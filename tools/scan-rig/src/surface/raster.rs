//! Gaussians drawn on the CPU: what a picture costs a device no more than reading back, and what no device returns: the depth at which
//! half of the light is gone, and how much of each Gaussian shows.
//!
//! The projection is the renderer's (Zwicker et al., "EWA Splatting", 2002; the numbers are those of 3DGS: a low-pass of 0.3 square
//! pixels, opacity at most 0.99, nothing below its cut-off of alpha). Strips of rows are drawn at the same time, each from front to back, so the result
//! does not depend on the number of threads.

use crate::mesh_depth::pixel;
use crate::pinhole::Pinhole;
use crate::scan::Scan;
use glam::{Mat3, Vec3};
use rayon::prelude::*;
use renderer_splat::gaussian::ALPHA_CUT;

/// Square pixels by which every splat is widened.
const LOW_PASS: f32 = 0.3;
/// The largest opacity of a Gaussian in a pixel.
const ALPHA_MOST: f32 = 0.99;
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

/// A picture in which some Gaussians are left to be painted: its colours are linear in theirs.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Unpainted {
    /// What the other Gaussians show. What comes through and the depths are of all.
    pub picture: Picture,
    /// Where the shares of each pixel begin, and the end of the last pixel's.
    pub starts: Vec<usize>,
    /// The Gaussians to be painted that show in a pixel, nearest first, and their blending weights there.
    pub shares: Vec<(u32, f32)>,
}

impl Picture {
    fn empty(view: &Pinhole) -> Self {
        let (width, height) = (view.width as usize, view.height as usize);
        Self {
            width,
            height,
            colours: vec![Vec3::ZERO; width * height],
            transmittance: vec![1.0; width * height],
            depth: vec![f32::INFINITY; width * height],
        }
    }

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
    let splats = Splats::new(scan, view);
    let mut picture = Picture::empty(view);
    let colours = std::mem::take(&mut picture.colours);
    let colours = splats.blend(
        &mut picture,
        colours,
        |_| (),
        |colour, (), splat, weight| *colour += splat.colour * weight,
    );
    picture.colours = colours.0;
    picture
}

/// Draws a scan and says how much of each Gaussian shows: the largest blending weight that it has in any pixel.
#[must_use]
pub fn draw_with_peaks(scan: &Scan, view: &Pinhole) -> (Picture, Vec<f32>) {
    let splats = Splats::new(scan, view);
    let mut picture = Picture::empty(view);
    let colours = std::mem::take(&mut picture.colours);
    let (colours, strips) = splats.blend(
        &mut picture,
        colours,
        |_| 0.0_f32,
        |colour, peak, splat, weight| {
            *colour += splat.colour * weight;
            *peak = peak.max(weight);
        },
    );
    picture.colours = colours;
    let mut peaks = vec![0.0_f32; scan.len()];
    for (members, values) in splats.strips.iter().zip(&strips) {
        for (member, peak) in members.iter().zip(values) {
            let most = &mut peaks[splats.splats[*member as usize].gaussian as usize];
            *most = most.max(*peak);
        }
    }
    (picture, peaks)
}

/// Draws a scan without the colours of the Gaussians that `free` chooses (`[N_g]`), and says how they would show.
#[must_use]
pub fn draw_unpainted(scan: &Scan, view: &Pinhole, free: &[bool]) -> Unpainted {
    let splats = Splats::new(scan, view);
    let mut picture = Picture::empty(view);
    let pixels = vec![(Vec3::ZERO, Vec::new()); picture.colours.len()];
    let (pixels, _) = splats.blend(
        &mut picture,
        pixels,
        |splat| free[splat.gaussian as usize],
        |(colour, shares), free, splat, weight| {
            if *free {
                shares.push((splat.gaussian, weight));
            } else {
                *colour += splat.colour * weight;
            }
        },
    );
    let mut unpainted = Unpainted::default();
    for ((colour, shares), slot) in pixels.into_iter().zip(&mut picture.colours) {
        *slot = colour;
        unpainted.starts.push(unpainted.shares.len());
        unpainted.shares.extend(shares);
    }
    unpainted.starts.push(unpainted.shares.len());
    unpainted.picture = picture;
    unpainted
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

/// A scan's Gaussians in one view.
struct Splats {
    splats: Vec<Splat>,
    /// For each strip of rows the splats that reach into it, nearest first.
    strips: Vec<Vec<u32>>,
}

impl Splats {
    fn new(scan: &Scan, view: &Pinhole) -> Self {
        let splats = project(scan, view);
        let strips = by_strip(&splats, view.height as usize);
        Self { splats, strips }
    }

    /// Blends all splats into a picture, which is empty before. For each splat and pixel `add` is given the pixel's entry in `pixels`, the
    /// splat's value in the strip (made by `start`), the splat and its blending weight. Returns `pixels` and each strip's values.
    fn blend<P: Send, V: Send>(
        &self,
        picture: &mut Picture,
        mut pixels: Vec<P>,
        start: impl Fn(&Splat) -> V + Sync,
        add: impl Fn(&mut P, &mut V, &Splat, f32) + Sync,
    ) -> (Vec<P>, Vec<Vec<V>>) {
        let width = picture.width;
        let size = (STRIP * width).max(1);
        let values = (
            pixels.par_chunks_mut(size),
            picture.transmittance.par_chunks_mut(size),
            picture.depth.par_chunks_mut(size),
            &self.strips,
        )
            .into_par_iter()
            .enumerate()
            .map(|(strip, (pixels, transmittance, depth, members))| {
                let mut canvas = Canvas {
                    width,
                    first_row: strip * STRIP,
                    pixels,
                    transmittance,
                    depth,
                };
                let members = members.iter().map(|member| &self.splats[*member as usize]);
                members
                    .map(|splat| {
                        let mut value = start(splat);
                        canvas.blend(splat, |pixel, weight| add(pixel, &mut value, splat, weight));
                        value
                    })
                    .collect()
            })
            .collect();
        (pixels, values)
    }
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
            let row =
                |axis: usize| Vec3::new(axes.x_axis[axis], axes.y_axis[axis], axes.z_axis[axis]);
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

/// For each strip of rows the splats that reach into it, nearest first.
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

/// Some rows of a picture.
struct Canvas<'a, P> {
    width: usize,
    first_row: usize,
    pixels: &'a mut [P],
    transmittance: &'a mut [f32],
    depth: &'a mut [f32],
}

impl<P> Canvas<'_, P> {
    fn blend(&mut self, splat: &Splat, mut add: impl FnMut(&mut P, f32)) {
        let rows = self.transmittance.len() / self.width;
        let [xx, xy, yy] = splat.conic;
        let low = pixel((splat.centre[1] - splat.half_height - 0.5).ceil()).max(self.first_row);
        let high = pixel(splat.centre[1] + splat.half_height + 0.5).min(self.first_row + rows);
        for row in low..high {
            let dy = row as f32 + 0.5 - splat.centre[1];
            // Where xx dx^2 + 2 xy dx dy + yy dy^2 <= reach.
            let middle = -xy * dy / xx;
            let rest = middle * middle - (yy * dy * dy - splat.reach) / xx;
            if rest.is_nan() || rest <= 0.0 {
                continue;
            }
            let half = rest.sqrt();
            let left = pixel((splat.centre[0] + middle - half - 0.5).ceil());
            let right = pixel(splat.centre[0] + middle + half + 0.5).min(self.width);
            let start = (row - self.first_row) * self.width;
            for x in left..right {
                let at = start + x;
                let before = self.transmittance[at];
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
                    self.depth[at] = splat.depth;
                }
                self.transmittance[at] = after;
                add(&mut self.pixels[at], weight);
            }
        }
    }
}
