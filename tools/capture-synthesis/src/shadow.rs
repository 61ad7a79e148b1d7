//! Shadows of one distant light: an orthographic map of heights, and soft tests against it (percentage-closer filtering: Reeves, Salesin and
//! Cook, "Rendering Antialiased Shadows with Depth Maps", 1987).

use crate::raster::{Corner, Facets, Sample};
use glam::{Mat3, Vec3};

/// Texels along the map's side: about 2.5 mm each on a person with spread arms.
const SIDE: usize = 768;

/// Texels along the side of the square of tests, whose mean is the light: a penumbra of about a centimetre.
const TESTS: usize = 4;

/// How far a point is lifted off its surface, and how much deeper it may lie, metres: more than a texel, so that a surface does not shade
/// itself.
const LIFT: f32 = 0.005;
const BIAS: f32 = 0.003;

/// The surface nearest to a distant light.
#[derive(Debug, Clone)]
pub struct ShadowMap {
    light_from_world: Mat3,
    towards: Vec3,
    low: Vec3,
    texels_per_metre: f32,
    /// Height towards the light, metres; row by row.
    heights: Vec<f32>,
}

impl ShadowMap {
    /// Draws the triangles `faces` over `positions` (metres) as a light in the direction `towards` (unit length) sees them.
    ///
    /// `casts` is asked whether a triangle (by its index) holds the light back at shares of its second and third corner.
    #[must_use]
    pub fn new(
        towards: Vec3,
        positions: &[Vec3],
        faces: &[[u32; 3]],
        casts: impl Fn(u32, [f32; 2]) -> bool,
    ) -> Self {
        let x = towards.any_orthonormal_vector();
        let light_from_world = Mat3::from_cols(x, towards.cross(x), towards).transpose();
        let seen: Vec<Vec3> = positions.iter().map(|p| light_from_world * *p).collect();
        let low = seen.iter().copied().fold(Vec3::INFINITY, Vec3::min);
        let high = seen.iter().copied().fold(Vec3::NEG_INFINITY, Vec3::max);
        // A margin as wide as the tests on every side.
        let extent = (high - low).truncate().max_element().max(1e-3);
        let texels_per_metre = (SIDE - 2 * TESTS) as f32 / extent;
        let low = low - TESTS as f32 / texels_per_metre;
        let corner = |vertex: u32| {
            let seen = seen[vertex as usize];
            let at = (seen - low) * texels_per_metre;
            Corner {
                x: f64::from(at.x),
                y: f64::from(at.y),
                inverse_w: 1.0,
                nearness: seen.z,
            }
        };
        let facets = Facets::new(
            faces.len(),
            |face| Some(faces[face].map(corner)),
            [SIDE; 2],
            SIDE,
        );
        let mut samples = Vec::new();
        facets.draw(0, &mut samples, |_, _, sample: &Sample| {
            casts(sample.face, sample.shares)
        });
        Self {
            light_from_world,
            towards,
            low,
            texels_per_metre,
            heights: samples.iter().map(|sample| sample.nearness).collect(),
        }
    }

    /// How much of the light reaches a point of a surface with this `normal` (unit length, on the side that is seen), 0..=1.
    #[must_use]
    pub fn light(&self, point: Vec3, normal: Vec3) -> f32 {
        let lifted = point + normal * LIFT + self.towards * BIAS;
        let seen = self.light_from_world * lifted;
        let at = (seen - self.low) * self.texels_per_metre;
        let first = |at: f32| {
            // The texel before the square's first full one, and how far the square reaches into it.
            let start = at - 0.5 * TESTS as f32;
            let whole = start.floor();
            (whole, start - whole)
        };
        let ((column, past_x), (row, past_y)) = (first(at.x), first(at.y));
        let weight = |k: usize, past: f32| match k {
            0 => 1.0 - past,
            TESTS => past,
            _ => 1.0,
        };
        let mut lit = 0.0;
        for j in 0..=TESTS {
            let y = row + j as f32;
            for i in 0..=TESTS {
                if self.height(column + i as f32, y) < seen.z {
                    lit += weight(i, past_x) * weight(j, past_y);
                }
            }
        }
        lit / (TESTS * TESTS) as f32
    }

    /// Outside the map nothing holds light back.
    fn height(&self, x: f32, y: f32) -> f32 {
        let side = SIDE as f32;
        if (0.0..side).contains(&x) && (0.0..side).contains(&y) {
            #[expect(
                clippy::cast_possible_truncation,
                clippy::cast_sign_loss,
                reason = "inside the map"
            )]
            let (x, y) = (x as usize, y as usize);
            self.heights[y * SIDE + x]
        } else {
            f32::NEG_INFINITY
        }
    }
}
