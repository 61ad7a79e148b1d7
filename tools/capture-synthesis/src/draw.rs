//! A picture of the posed person from one camera: 4 x 4 samples a pixel, each textured and lit for itself, then averaged by a box filter.
//!
//! Light and averages are computed on display values, as a Gaussian avatar's renderer computes: an albedo times a factor, and colours mixed
//! by coverage. The light is fixed in the world: a soft sky, and one key lamp that casts shadows.

use crate::lens::Lens;
use crate::model::Model;
use crate::raster::{Corner, Facets, SAMPLES, Sample};
use crate::shadow::ShadowMap;
use crate::sitter::Posed;
use glam::Vec3;
use rayon::prelude::*;

/// Towards the key lamp, not of unit length: high and from the left of a person who faces +z.
const TOWARDS_KEY: Vec3 = Vec3::new(0.55, 0.62, 0.75);

/// What the sky and the key lamp add to a surface's factor, red, green and blue.
const SKY: Vec3 = Vec3::new(0.63, 0.65, 0.68);
const KEY: Vec3 = Vec3::new(0.50, 0.47, 0.43);

/// The key lamp's mirror image on a wet eye: cosine at its edge, and how soft the edge is.
const GLINT_EDGE: f32 = 0.990;
const GLINT_BLUR: f32 = 0.005;
const GLINT: f32 = 0.85;

/// Rows of pixels that are drawn at once.
const BAND: usize = 16;

/// Nothing nearer than this along a camera's axis can be drawn, metres.
pub const NEAR: f64 = 0.2;

/// The least alpha at which a strand holds back the key light.
const CASTING_ALPHA: f32 = 0.5;

/// When samples of a pixel turn opaque as alpha grows (Bayer, 1973), in sixteenths.
const ORDER: [u8; SAMPLES * SAMPLES] = [0, 8, 2, 10, 12, 4, 14, 6, 3, 11, 1, 9, 15, 7, 13, 5];

/// A picture of a person.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Drawn {
    /// Width and height, pixels.
    pub size: [u32; 2],
    /// `[height, width, 3]` display values. Where a pixel shows the person at all: the person's colour, not mixed with the background,
    /// so that colour times mask is the person over black.
    pub rgb: Vec<u8>,
    /// `[height, width]` share of the pixel that the person covers, of 255.
    pub mask: Vec<u8>,
}

/// A triangle as one camera sees it.
#[derive(Debug, Clone, Copy)]
struct Side {
    /// Level of the texture.
    level: f32,
    /// Whether its back is seen.
    back: bool,
}

/// A posed person, ready to be drawn from any camera.
#[derive(Debug)]
pub struct Scene<'a> {
    model: &'a Model,
    posed: &'a Posed,
    shadows: ShadowMap,
    towards_key: Vec3,
}

impl<'a> Scene<'a> {
    /// Draws the shadows. `posed` must be of `model`'s person.
    #[must_use]
    pub fn new(model: &'a Model, posed: &'a Posed) -> Self {
        let towards_key = TOWARDS_KEY.normalize();
        let casts = |face: u32, shares: [f32; 2]| {
            let material = &model.materials[face as usize];
            let is_strand = material.strands.is_some();
            material.casts
                && (!is_strand || model.paint(face as usize, shares, 1.0).1 > CASTING_ALPHA)
        };
        Self {
            model,
            posed,
            shadows: ShadowMap::new(towards_key, &posed.positions, &model.faces, casts),
            towards_key,
        }
    }

    /// Draws the person as `lens` sees them before a plain `background`. A triangle nearer than [`NEAR`] is left out: the caller keeps the
    /// person away from the cameras.
    #[must_use]
    pub fn draw(&self, lens: &Lens, background: [u8; 3]) -> Drawn {
        let (width, height) = (lens.size[0] as usize, lens.size[1] as usize);
        let corners = self.corners(lens);
        let of_face = |face: usize| -> Option<[Corner; 3]> {
            let [a, b, c] = self.model.faces[face].map(|vertex| corners[vertex as usize]);
            Some([a?, b?, c?])
        };
        let sides: Vec<Side> = (0..self.model.faces.len())
            .map(|face| self.side(face, of_face(face)))
            .collect();
        let facets = Facets::new(
            self.model.faces.len(),
            of_face,
            [width * SAMPLES, height * SAMPLES],
            BAND * SAMPLES,
        );
        let eye = lens.eye().as_vec3();
        let bands: Vec<(Vec<u8>, Vec<u8>)> = (0..facets.bands())
            .into_par_iter()
            .map(|band| self.band(&facets, band, &sides, eye, background))
            .collect();
        let mut drawn = Drawn {
            size: lens.size,
            rgb: Vec::with_capacity(width * height * 3),
            mask: Vec::with_capacity(width * height),
        };
        for (rgb, mask) in bands {
            drawn.rgb.extend(rgb);
            drawn.mask.extend(mask);
        }
        drawn
    }

    /// Every vertex on the sample grid; nothing for one that is too near.
    fn corners(&self, lens: &Lens) -> Vec<Option<Corner>> {
        let samples = SAMPLES as f64;
        let corner = |position: &Vec3| {
            let seen = lens.camera_point(*position);
            #[expect(
                clippy::cast_possible_truncation,
                reason = "single precision is enough"
            )]
            let nearness = (1.0 / seen.z) as f32;
            (seen.z >= NEAR).then(|| Corner {
                x: (seen.x / seen.z * lens.focal[0] + lens.centre[0]) * samples,
                y: (seen.y / seen.z * lens.focal[1] + lens.centre[1]) * samples,
                inverse_w: nearness,
                nearness,
            })
        };
        self.posed.positions.iter().map(corner).collect()
    }

    fn side(&self, face: usize, corners: Option<[Corner; 3]>) -> Side {
        let Some([a, b, c]) = corners else {
            return Side {
                level: 0.0,
                back: false,
            };
        };
        // Rows grow downwards: a counter-clockwise triangle's area is negative here.
        let area = 0.5 * ((b.x - a.x) * (c.y - a.y) - (b.y - a.y) * (c.x - a.x));
        #[expect(
            clippy::cast_possible_truncation,
            reason = "single precision is enough"
        )]
        let samples = area.abs().max(1e-6) as f32;
        let texels = self.model.materials[face].texels;
        Side {
            level: (0.5 * (texels / samples).log2()).max(0.0),
            back: area > 0.0,
        }
    }

    /// Colours and mask of a band's pixels.
    fn band(
        &self,
        facets: &Facets,
        band: usize,
        sides: &[Side],
        eye: Vec3,
        background: [u8; 3],
    ) -> (Vec<u8>, Vec<u8>) {
        let mut samples = Vec::new();
        facets.draw(band, &mut samples, |x, y, sample| {
            self.is_opaque(x, y, sample, sides)
        });
        let rows = facets.rows(band).len();
        let width = samples.len() / rows.max(1);
        let (mut rgb, mut mask) = (Vec::new(), Vec::new());
        for y in (0..rows).step_by(SAMPLES) {
            for x in (0..width).step_by(SAMPLES) {
                let of_row = |k: usize| &samples[(y + k) * width + x..][..SAMPLES];
                let seen = (0..SAMPLES)
                    .flat_map(of_row)
                    .filter(|sample| sample.is_covered());
                let (mut sum, mut count) = (Vec3::ZERO, 0u16);
                for sample in seen {
                    sum += self.colour(sample, sides[sample.face as usize], eye);
                    count += 1;
                }
                if count == 0 {
                    rgb.extend(background);
                } else {
                    rgb.extend((sum / f32::from(count)).to_array().map(byte));
                }
                let all = SAMPLES * SAMPLES;
                mask.push(byte(f32::from(count) / all as f32));
            }
        }
        (rgb, mask)
    }

    /// Whether a triangle is opaque at a sample: strands are at as many samples of a pixel as their alpha says. Which ones is another
    /// for each quad, so that one strand does not hide exactly what the one behind it shows.
    fn is_opaque(&self, x: usize, y: usize, sample: &Sample, sides: &[Side]) -> bool {
        let face = sample.face as usize;
        let Some(density) = self.model.materials[face].strands else {
            return true;
        };
        let (_, alpha) = self.model.paint(face, sample.shares, sides[face].level);
        let rank = ORDER[y % SAMPLES * SAMPLES + x % SAMPLES];
        let shift = (sample.face / 2).wrapping_mul(0x9e37_79b9) >> 28;
        let rank = (u32::from(rank) + shift) % 16;
        alpha * density > (rank as f32 + 0.5) / 16.0
    }

    /// The lit colour of a sample, display values 0..=1.
    fn colour(&self, sample: &Sample, side: Side, eye: Vec3) -> Vec3 {
        let face = sample.face as usize;
        let [second, third] = sample.shares;
        let mixed = |values: &[Vec3]| {
            let [a, b, c] = self.model.faces[face].map(|vertex| values[vertex as usize]);
            a + (b - a) * second + (c - a) * third
        };
        let (albedo, _) = self.model.paint(face, sample.shares, side.level);
        let position = mixed(&self.posed.positions);
        let towards_eye = (eye - position).normalize_or_zero();
        let outward = mixed(&self.posed.normals)
            .try_normalize()
            .unwrap_or(towards_eye);
        let normal = if side.back { -outward } else { outward };
        let facing = normal.dot(self.towards_key).max(0.0);
        let lamp = if facing > 0.0 {
            facing * self.shadows.light(position, normal)
        } else {
            0.0
        };
        let depth = self.depth(face, sample.shares);
        let lit = albedo * (SKY * mixed(&self.posed.sky) + KEY * (lamp * depth));
        let lit = lit.clamp(Vec3::ZERO, Vec3::ONE);
        if self.model.materials[face].wet {
            // Blinn's half-way vector.
            let half_way = (self.towards_key + towards_eye).normalize_or_zero();
            let glint = ((normal.dot(half_way) - GLINT_EDGE) / GLINT_BLUR).clamp(0.0, 1.0);
            lit.lerp(Vec3::ONE, GLINT * glint)
        } else {
            lit
        }
    }

    /// How deep in the mouth: factor of the lamp's light.
    fn depth(&self, face: usize, [second, third]: [f32; 2]) -> f32 {
        let [a, b, c] =
            self.model.faces[face].map(|vertex| self.model.shades[vertex as usize].depth);
        a + (b - a) * second + (c - a) * third
    }
}

#[expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "clamped to 0..=255"
)]
fn byte(value: f32) -> u8 {
    (value * 255.0).round().clamp(0.0, 255.0) as u8
}
