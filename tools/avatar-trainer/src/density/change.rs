//! A new population of bound Gaussians, and what each inherits.

use super::plan::Plan;
use super::surface::Surface;
use crate::random::normal;
use glam::{Mat3, Quat, Vec3};
use half::f16;
use spmm3::{ATTRIBUTES, attribute, triangle_frame};

/// Children of a split are smaller by this; as 3DGS has it.
const SPLIT: f32 = 1.6;

/// Bound Gaussians as they are learnt.
#[derive(Debug, Clone, Copy)]
pub struct Population<'a> {
    /// `[N]` triangles.
    pub triangles: &'a [u32],
    /// `[N]` weights of the second and third corner.
    pub barycentrics: &'a [[f32; 2]],
    /// Row-major [14, N], in the triangles' frames.
    pub attributes: &'a [f32],
}

/// How a child's new triangle stands to its parent's: what is said in the parent's frame is turned by it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Turn {
    /// For offsets.
    pub matrix: Mat3,
    /// For rotations, from the left.
    pub rotation: Quat,
}

/// The population that takes another's place.
#[derive(Debug, Clone, PartialEq)]
pub struct Change {
    /// `[M]` which Gaussian each was, or is a child of.
    pub origin: Vec<u32>,
    /// `[M]` nothing for those that stayed; for children, how their frame stands to their parent's.
    pub turns: Vec<Option<Turn>>,
    /// `[M]` triangles.
    pub triangles: Vec<u32>,
    /// `[M]` weights of the second and third corner.
    pub barycentrics: Vec<[f32; 2]>,
    /// Row-major [14, M].
    pub attributes: Vec<f32>,
}

/// One Gaussian's numbers.
#[derive(Debug, Clone, Copy)]
struct Own {
    offset: Vec3,
    rotation: Quat,
    log_scale: Vec3,
    logit: f32,
    colour: Vec3,
}

impl Own {
    fn of(attributes: &[f32], count: usize, i: usize) -> Self {
        let at = |plane: usize| attributes[plane * count + i];
        let three = |plane: usize| Vec3::new(at(plane), at(plane + 1), at(plane + 2));
        let first = attribute::ROTATION.start;
        Self {
            offset: three(attribute::OFFSET.start),
            rotation: Quat::from_xyzw(at(first), at(first + 1), at(first + 2), at(first + 3)),
            log_scale: three(attribute::LOG_SCALE.start),
            logit: at(attribute::OPACITY),
            colour: three(attribute::COLOUR.start),
        }
    }

    fn numbers(&self) -> [f32; ATTRIBUTES] {
        let [x, y, z] = self.offset.to_array();
        let [i, j, k, w] = self.rotation.to_array();
        let [sx, sy, sz] = self.log_scale.to_array();
        let [r, g, b] = self.colour.to_array();
        [x, y, z, i, j, k, w, sx, sy, sz, self.logit, r, g, b]
    }
}

impl Change {
    /// Carries out a plan on `surface`, the template's surface at rest. `seed` scatters the children within their parents.
    #[must_use]
    pub fn new(plan: &Plan, before: Population<'_>, surface: &Surface<'_>, seed: u64) -> Self {
        let count = before.triangles.len();
        let mut rng = fastrand::Rng::with_seed(seed);
        let mut rows: Vec<[f32; ATTRIBUTES]> = Vec::with_capacity(plan.count());
        let mut change = Self {
            origin: Vec::with_capacity(plan.count()),
            turns: Vec::with_capacity(plan.count()),
            triangles: Vec::with_capacity(plan.count()),
            barycentrics: Vec::with_capacity(plan.count()),
            attributes: Vec::new(),
        };
        let cloned: std::collections::HashSet<u32> = plan.cloned.iter().copied().collect();
        for index in &plan.kept {
            let i = *index as usize;
            let mut own = Own::of(before.attributes, count, i);
            if cloned.contains(index) {
                // Two that are as opaque together (Rota Bulò et al., "Revising Densification in Gaussian Splatting", 2024).
                own.logit = halved(own.logit);
            }
            rows.push(own.numbers());
            change.origin.push(*index);
            change.turns.push(None);
            change.triangles.push(before.triangles[i]);
            change.barycentrics.push(before.barycentrics[i]);
        }
        let parents = plan.split.iter().flat_map(|index| [(*index, true); 2]);
        let parents = parents.chain(plan.cloned.iter().map(|index| (*index, false)));
        for (index, split) in parents {
            let i = index as usize;
            let mut own = Own::of(before.attributes, count, i);
            let scale = own.log_scale.exp();
            // Within the parent's one standard deviation or so; a clone hardly moves.
            let spread = if split { 1.0 } else { 0.2 };
            let sample = Vec3::new(normal(&mut rng), normal(&mut rng), normal(&mut rng));
            let turn = if own.rotation.length_squared() > 1e-12 {
                own.rotation.normalize()
            } else {
                Quat::IDENTITY
            };
            let shift = turn * (scale * sample * spread);
            if split {
                own.log_scale -= Vec3::splat(SPLIT.ln());
            } else {
                own.logit = halved(own.logit);
            }
            let corners = surface.corners(before.triangles[i]);
            let frame = triangle_frame(corners);
            let place = at(corners, before.barycentrics[i]) + frame * (own.offset + shift);
            let mut foot = surface.under(before.triangles[i], place);
            // As a package stores them, so that what is learnt is what a receiver draws.
            foot.barycentric = foot
                .barycentric
                .map(|weight| f16::from_f32(weight).to_f32());
            foot.point = at(surface.corners(foot.triangle), foot.barycentric);
            let now = triangle_frame(surface.corners(foot.triangle));
            let matrix = now.transpose() * frame;
            let rotation = Quat::from_mat3(&matrix);
            own.offset = now.transpose() * (place - foot.point);
            own.rotation = rotation * own.rotation;
            rows.push(own.numbers());
            change.origin.push(index);
            change.turns.push(Some(Turn { matrix, rotation }));
            change.triangles.push(foot.triangle);
            change.barycentrics.push(foot.barycentric);
        }
        change.attributes = (0..ATTRIBUTES)
            .flat_map(|plane| rows.iter().map(move |row| row[plane]))
            .collect();
        change
    }

    /// Orders the new Gaussians by a key of their origin and their triangle, equals as they are.
    pub fn sort_by_key<K: Ord>(&mut self, key: impl Fn(u32, u32) -> K) {
        let count = self.origin.len();
        let mut order: Vec<usize> = (0..count).collect();
        order.sort_by_key(|i| key(self.origin[*i], self.triangles[*i]));
        self.origin = order.iter().map(|i| self.origin[*i]).collect();
        self.turns = order.iter().map(|i| self.turns[*i]).collect();
        self.triangles = order.iter().map(|i| self.triangles[*i]).collect();
        self.barycentrics = order.iter().map(|i| self.barycentrics[*i]).collect();
        let planes = self.attributes.chunks_exact(count.max(1));
        self.attributes = planes
            .flat_map(|plane| order.iter().map(|i| plane[*i]))
            .collect();
    }

    /// The planes of another array [planes, N], for the new population: everyone's, children have their parent's.
    #[must_use]
    pub fn inherited(&self, planes: &[f32], before: usize) -> Vec<f32> {
        self.carried(planes, before, |value, _| value)
    }

    /// As [`Self::inherited`], but 0 for children: an optimiser's memory of others.
    #[must_use]
    pub fn remembered(&self, planes: &[f32], before: usize) -> Vec<f32> {
        self.carried(
            planes,
            before,
            |value, turn| {
                if turn.is_none() { value } else { 0.0 }
            },
        )
    }

    fn carried(
        &self,
        planes: &[f32],
        before: usize,
        value: impl Fn(f32, Option<Turn>) -> f32,
    ) -> Vec<f32> {
        let mut carried = Vec::with_capacity(planes.len() / before.max(1) * self.origin.len());
        for plane in planes.chunks_exact(before.max(1)) {
            let members = self.origin.iter().zip(&self.turns);
            carried.extend(members.map(|(i, turn)| value(plane[*i as usize], *turn)));
        }
        carried
    }

    /// F_attr's bases, row-major [14, B, N], for the new population: a child's offsets and rotations are turned into its own frame.
    #[must_use]
    pub fn bases(&self, bases: &[f32], before: usize, each: usize) -> Vec<f32> {
        let mut carried = self.inherited(bases, before);
        let count = self.origin.len();
        for (i, turn) in self.turns.iter().enumerate() {
            let Some(turn) = turn else {
                continue;
            };
            for b in 0..each {
                let place = |plane: usize| (plane * each + b) * count + i;
                let offset = attribute::OFFSET.start;
                let [x, y, z] = [0, 1, 2].map(|k| carried[place(offset + k)]);
                let turned = turn.matrix * Vec3::new(x, y, z);
                for (k, value) in turned.to_array().into_iter().enumerate() {
                    carried[place(offset + k)] = value;
                }
                let first = attribute::ROTATION.start;
                let [x, y, z, w] = [0, 1, 2, 3].map(|k| carried[place(first + k)]);
                // A product of quaternions is linear in each: residuals turn as rotations do.
                let turned = turn.rotation * Quat::from_xyzw(x, y, z, w);
                for (k, value) in turned.to_array().into_iter().enumerate() {
                    carried[place(first + k)] = value;
                }
            }
        }
        carried
    }
}

/// The logit of 1 - sqrt(1 - opacity).
fn halved(logit: f32) -> f32 {
    let through = 1.0 / (1.0 + logit.exp());
    let each = through.max(1e-12).sqrt();
    ((1.0 - each).max(1e-6) / each).ln()
}

fn at([a, b, c]: [Vec3; 3], [v, w]: [f32; 2]) -> Vec3 {
    a + (b - a) * v + (c - a) * w
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::density::{Statistics, plan};
    use spmm3::BoundGaussians;
    use synthetic_person::Puppet;

    #[test]
    fn children_are_bound_under_them_and_stay_within_their_parents() {
        let puppet = Puppet::small();
        let (template, bound) = (&puppet.template, &puppet.gaussians);
        let count = bound.len();
        let statistics = Statistics {
            pull: (0u8..=255).cycle().take(count).map(f32::from).collect(),
            seen: vec![1; count],
        };
        let plan = plan(bound.attributes(), &statistics, 10, 700, 2_500);
        assert_eq!(plan.count(), 2_500, "up to the budget");
        let surface = Surface::new(template.vertices(), template.faces());
        let before = Population {
            triangles: bound.triangles(),
            barycentrics: bound.barycentrics(),
            attributes: bound.attributes(),
        };
        let change = Change::new(&plan, before, &surface, 5);
        let made = BoundGaussians::new(
            template,
            change.triangles.clone(),
            change.barycentrics.clone(),
            change.attributes.clone(),
        )
        .expect("a valid binding");
        assert_eq!(made.len(), plan.count(), "all of them");
        let rest = |bound: &BoundGaussians, i: usize| {
            let corners = bound.corners()[i].map(|v| template.vertices()[v as usize]);
            let own = Own::of(bound.attributes(), bound.len(), i);
            at(corners, bound.barycentrics()[i]) + triangle_frame(corners) * own.offset
        };
        for (child, parent) in change.origin.iter().enumerate() {
            let own = Own::of(bound.attributes(), count, *parent as usize);
            let reach = 6.0 * own.log_scale.exp().max_element() + 1e-5;
            let moved = rest(&made, child).distance(rest(bound, *parent as usize));
            assert!(moved <= reach, "child {child}: {moved} m of {reach}");
        }
    }

    #[test]
    fn residuals_in_a_childs_frame_mean_what_they_meant_in_its_parents() {
        let puppet = Puppet::small();
        let (template, bound) = (&puppet.template, &puppet.gaussians);
        let count = bound.len();
        let every: Vec<u32> = (0..).take(count).collect();
        let plan = Plan {
            kept: Vec::new(),
            split: every,
            cloned: Vec::new(),
        };
        let surface = Surface::new(template.vertices(), template.faces());
        let before = Population {
            triangles: bound.triangles(),
            barycentrics: bound.barycentrics(),
            attributes: bound.attributes(),
        };
        let change = Change::new(&plan, before, &surface, 5);
        let each = puppet.attributes.bases.bases();
        let full = puppet.attributes.bases.dequantise();
        let carried = change.bases(&full, count, each);
        let made = change.origin.len();
        let offset = |bases: &[f32], of: usize, i: usize| {
            let [x, y, z] = [0, 1, 2].map(|k| bases[k * each * of + i]);
            Vec3::new(x, y, z)
        };
        let mut moved_on = 0;
        for (child, parent) in change.origin.iter().enumerate() {
            let parent = *parent as usize;
            let of = |triangle: u32| triangle_frame(surface.corners(triangle));
            let then = of(bound.triangles()[parent]) * offset(&full, count, parent);
            let now = of(change.triangles[child]) * offset(&carried, made, child);
            assert!(then.distance(now) < 1e-6, "{then}, {now}");
            moved_on += usize::from(change.triangles[child] != bound.triangles()[parent]);
        }
        assert!(moved_on > 10, "some children lie on other triangles");
    }
}
