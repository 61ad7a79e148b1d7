//! What a distant light sees of a mesh: an orthographic map of heights. Shading and the culling of covered surfaces ask
//! it how much of the light reaches a point.

use glam::{Mat3, Vec3};

/// The surface nearest to a distant light.
pub(crate) struct DepthMap {
    side: usize,
    light_from_person: Mat3,
    low: Vec3,
    texels_per_metre: f32,
    /// Height towards the light, metres.
    nearest: Vec<f32>,
}

impl DepthMap {
    /// Draws `casters` of the mesh as seen from a distant light `towards` (unit), on `side` x `side` texels that span
    /// the mesh.
    pub(crate) fn new(towards: Vec3, side: usize, vertices: &[Vec3], casters: &[[u32; 3]]) -> Self {
        let x = towards.any_orthonormal_vector();
        let person_from_light = Mat3::from_cols(x, towards.cross(x), towards);
        let light_from_person = person_from_light.transpose();
        let seen: Vec<Vec3> = vertices.iter().map(|v| light_from_person * *v).collect();
        let low = seen.iter().copied().fold(Vec3::INFINITY, Vec3::min);
        let high = seen.iter().copied().fold(Vec3::NEG_INFINITY, Vec3::max);
        // Two texels of margin on every side.
        let extent = (high - low).truncate().max_element().max(1e-3);
        let texels_per_metre = (side - 4) as f32 / extent;
        let low = low - 2.0 / texels_per_metre;
        let mut map = Self {
            side,
            light_from_person,
            low,
            texels_per_metre,
            nearest: vec![f32::NEG_INFINITY; side * side],
        };
        for caster in casters {
            let [a, b, c] = caster.map(|v| {
                let p = seen[v as usize];
                ((p - low) * texels_per_metre).truncate().extend(p.z)
            });
            map.draw(a, b, c);
        }
        map
    }

    /// Draws a triangle in texels; a triangle too small to cover a texel's centre still marks the one it is in.
    fn draw(&mut self, a: Vec3, b: Vec3, c: Vec3) {
        let side = self.side;
        let low = a.min(b).min(c);
        let high = a.max(b).max(c);
        let area = (b - a).truncate().perp_dot((c - a).truncate());
        #[allow(clippy::cast_possible_truncation, reason = "texels of a small map")]
        let texel = |v: f32| (v.max(0.0) as usize).min(side - 1);
        let centre = (a + b + c) / 3.0;
        self.mark(texel(centre.x), texel(centre.y), centre.z);
        // Most of a person's triangles are smaller than a texel of a coarse map.
        if area.abs() < 1e-6 || (high - low).truncate().max_element() < 1.0 {
            return;
        }
        for y in texel(low.y)..=texel(high.y) {
            for x in texel(low.x)..=texel(high.x) {
                let p = Vec3::new(x as f32 + 0.5, y as f32 + 0.5, 0.0);
                let wb = (p - a).truncate().perp_dot((c - a).truncate()) / area;
                let wc = (b - a).truncate().perp_dot((p - a).truncate()) / area;
                if wb >= 0.0 && wc >= 0.0 && wb + wc <= 1.0 {
                    self.mark(x, y, a.z + wb * (b.z - a.z) + wc * (c.z - a.z));
                }
            }
        }
    }

    fn mark(&mut self, x: usize, y: usize, height: f32) {
        let slot = &mut self.nearest[y * self.side + x];
        *slot = slot.max(height);
    }

    /// How much of the light reaches `point`, 0..=1: soft tests of 3 x 3 texels under a quadratic B-spline.
    /// The light fades over `penumbra` metres below an occluder.
    pub(crate) fn visibility(&self, point: Vec3, penumbra: f32) -> f32 {
        let seen = self.light_from_person * point;
        let at = (seen - self.low) * self.texels_per_metre - 0.5;
        let middle = at.round();
        let past = at - middle;
        let weights = |d: f32| {
            [
                0.5 * (0.5 - d) * (0.5 - d),
                0.75 - d * d,
                0.5 * (0.5 + d) * (0.5 + d),
            ]
        };
        #[allow(clippy::cast_possible_truncation, reason = "clamped to the map")]
        let texel = |v: f32| v.clamp(0.0, (self.side - 1) as f32) as usize;
        let mut lit = 0.0;
        for (j, wy) in (-1i8..).zip(weights(past.y)) {
            let row = texel(middle.y + f32::from(j)) * self.side;
            for (i, wx) in (-1i8..).zip(weights(past.x)) {
                let height = self.nearest[row + texel(middle.x + f32::from(i))];
                lit += wx * wy * (1.0 - (height - seen.z) / penumbra).clamp(0.0, 1.0);
            }
        }
        lit
    }
}
