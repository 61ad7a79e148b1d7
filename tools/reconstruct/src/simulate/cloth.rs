//! Loose cloth as an extended position-based system (XPBD, Macklin et al. 2016) settled to rest over one posed body.
//!
//! Quasi-static: each pose starts from the skinned cloth and falls until it hangs, so the result depends on the pose
//! alone, as a network of the pose needs it. Stretch and bending keep the fabric's shape, a soft tether keeps the
//! tailoring, a hard one bounds the excursion, and the body's planes, a backstop and the arms keep it outside.

use super::{Capsule, Collider, Surface};
use glam::Vec3;

const STEPS: usize = 70;
const ITERATIONS: usize = 5;
const STEP_SECONDS: f32 = 1.0 / 100.0;
const GRAVITY: Vec3 = Vec3::new(0.0, -9.81, 0.0);
/// Share of the velocity a step keeps: heavy damping, because only the rest state matters.
const KEPT_VELOCITY: f32 = 0.86;
/// Steps between two searches for the nearest body points.
const SEARCH_EVERY: usize = 5;
/// Cloth stays this far off the body where it did so at rest, metres.
const THICKNESS: f32 = 0.004;
/// Nearest points deeper than this belong to the other side of a limb, metres.
const MAX_DEPTH: f32 = 0.045;
/// Strength of fabric against compression and bending, relative to stretching.
const COMPRESSION: f32 = 0.15;
const BENDING: f32 = 0.3;

/// Spring between two of the garment's particles.
#[derive(Debug, Clone, Copy)]
struct Spring {
    a: u32,
    b: u32,
    rest: f32,
}

/// The cloth of a template that hangs by itself.
#[derive(Debug)]
pub struct Garment {
    particles: Vec<u32>,
    looseness: Vec<f32>,
    gap: Vec<f32>,
    clearance: Vec<f32>,
    sheltered: Vec<bool>,
    stretch: Vec<Spring>,
    bend: Vec<Spring>,
}

/// Cloth at rest over one pose.
#[derive(Debug, Clone)]
pub struct Settled {
    /// Template vertices of the particles.
    pub vertices: Vec<u32>,
    /// Their posed positions, metres.
    pub positions: Vec<Vec3>,
    /// Root mean square movement in the last step, metres: how settled it is.
    pub residual: f32,
    /// Elastic and gravitational energy per unit mass, before and after, J/kg.
    pub energy: [f32; 2],
}

impl Garment {
    /// Every vertex with `looseness` (how far it may leave its skinned place, metres) above 0, and the rim that holds it.
    ///
    /// `rest` are the template's vertices, `under` the body below it in T-pose, `sheltered` marks what lies in a sleeve:
    /// the arm inside must not push it.
    #[must_use]
    pub fn new(
        rest: &[Vec3],
        surface: &Surface,
        looseness: &[f32],
        sheltered: &[bool],
        under: &Collider,
    ) -> Self {
        let loose = |v: u32| looseness[v as usize] > 0.0;
        let mut slot = vec![u32::MAX; rest.len()];
        let mut particles = Vec::new();
        let mut enter = |v: u32| {
            if slot[v as usize] == u32::MAX {
                slot[v as usize] = u32::try_from(particles.len()).unwrap_or(u32::MAX);
                particles.push(v);
            }
            slot[v as usize]
        };
        let mut springs = |pairs: &[[u32; 2]]| -> Vec<Spring> {
            let wanted = pairs.iter().filter(|[a, b]| loose(*a) || loose(*b));
            wanted
                .map(|[a, b]| Spring {
                    a: enter(*a),
                    b: enter(*b),
                    rest: rest[*a as usize].distance(rest[*b as usize]),
                })
                .collect()
        };
        let (stretch, bend) = (springs(surface.edges()), springs(surface.bends()));
        let normals = surface.normals(rest);
        let (mut gap, mut clearance) = (Vec::new(), Vec::new());
        for v in &particles {
            let (at, normal) = (rest[*v as usize], normals[*v as usize]);
            let below = under.nearest(at).map(|(point, n)| (at - point).dot(n));
            clearance.push(below.map_or(THICKNESS, |d| d.clamp(-0.02, THICKNESS)));
            // How far inwards it may go: to the layer below, or freely where nothing is within reach.
            let inwards = (0..4).find_map(|k| {
                let probe = at - normal * (0.02 * k as f32);
                under
                    .nearest(probe)
                    .map(|(point, _)| (at - point).dot(normal))
            });
            gap.push(inwards.map_or(looseness[*v as usize], |d| {
                (d - THICKNESS).clamp(0.001, 0.06)
            }));
        }
        let of = |values: &[f32]| particles.iter().map(|v| values[*v as usize]).collect();
        Self {
            looseness: of(looseness),
            sheltered: particles.iter().map(|v| sheltered[*v as usize]).collect(),
            gap,
            clearance,
            stretch,
            bend,
            particles,
        }
    }

    /// Template vertices of the particles.
    #[must_use]
    pub fn vertices(&self) -> &[u32] {
        &self.particles
    }

    /// Lets the cloth fall from `skinned` (the whole template, posed, with its `normals`) until it hangs.
    #[must_use]
    pub fn settle(
        &self,
        skinned: &[Vec3],
        normals: &[Vec3],
        body: &Collider,
        limbs: &[Capsule],
    ) -> Settled {
        let home: Vec<Vec3> = self
            .particles
            .iter()
            .map(|v| skinned[*v as usize])
            .collect();
        let outward: Vec<Vec3> = self
            .particles
            .iter()
            .map(|v| normals[*v as usize])
            .collect();
        let mut positions = home.clone();
        let mut velocities = vec![Vec3::ZERO; home.len()];
        let mut planes = vec![None; home.len()];
        let before = self.energy(&positions, &home);
        let mut residual = 0.0;
        for step in 0..STEPS {
            if step % SEARCH_EVERY == 0 {
                for (p, plane) in planes.iter_mut().enumerate() {
                    *plane = if self.looseness[p] > 0.0 {
                        body.nearest(positions[p])
                    } else {
                        None
                    };
                }
            }
            let start = positions.clone();
            for p in 0..positions.len() {
                if self.looseness[p] > 0.0 {
                    velocities[p] = (velocities[p] + GRAVITY * STEP_SECONDS) * KEPT_VELOCITY;
                    positions[p] += velocities[p] * STEP_SECONDS;
                    // The free sag against this tether is about half the looseness.
                    let pull = (GRAVITY.length() * STEP_SECONDS * STEP_SECONDS * 2.0
                        / self.looseness[p])
                        .min(0.5);
                    positions[p] = positions[p].lerp(home[p], pull);
                }
            }
            for _ in 0..ITERATIONS {
                self.project(&self.stretch, &mut positions, 1.0, COMPRESSION);
                self.project(&self.bend, &mut positions, BENDING, BENDING);
                for p in 0..positions.len() {
                    if self.looseness[p] > 0.0 {
                        positions[p] =
                            self.confine(p, positions[p], home[p], outward[p], planes[p], limbs);
                    }
                }
            }
            let mut moved = 0.0;
            for p in 0..positions.len() {
                velocities[p] = (positions[p] - start[p]) / STEP_SECONDS;
                moved += positions[p].distance_squared(start[p]);
            }
            residual = (moved / positions.len().max(1) as f32).sqrt();
        }
        let energy = [before, self.energy(&positions, &home)];
        Settled {
            vertices: self.particles.clone(),
            positions,
            residual,
            energy,
        }
    }

    /// Takes out ripples of the mesh's own wavelength, which no network can learn: each particle's excursion from its
    /// skinned place is averaged with its neighbours'.
    pub fn iron(&self, settled: &mut Settled, skinned: &[Vec3]) {
        let home = |p: usize| skinned[self.particles[p] as usize];
        let excursions: Vec<Vec3> = (0..self.particles.len())
            .map(|p| settled.positions[p] - home(p))
            .collect();
        let mut around = vec![(Vec3::ZERO, 0.0f32); excursions.len()];
        for Spring { a, b, .. } in &self.stretch {
            for (to, from) in [(*a as usize, *b as usize), (*b as usize, *a as usize)] {
                around[to].0 += excursions[from];
                around[to].1 += 1.0;
            }
        }
        for (p, (sum, count)) in around.into_iter().enumerate() {
            if self.looseness[p] > 0.0 && count > 0.0 {
                settled.positions[p] = home(p) + excursions[p].lerp(sum / count, 0.5);
            }
        }
    }

    fn project(&self, springs: &[Spring], positions: &mut [Vec3], pulling: f32, pushing: f32) {
        for Spring { a, b, rest } in springs {
            let (a, b) = (*a as usize, *b as usize);
            let (wa, wb) = (mobility(self.looseness[a]), mobility(self.looseness[b]));
            let apart = positions[b] - positions[a];
            let length = apart.length();
            if wa + wb == 0.0 || length < 1e-7 {
                continue;
            }
            let stiffness = if length > *rest { pulling } else { pushing };
            let correction = apart * (stiffness * (length - rest) / (length * (wa + wb)));
            positions[a] += correction * wa;
            positions[b] -= correction * wb;
        }
    }

    /// Keeps a particle outside body and arms and within its tether.
    fn confine(
        &self,
        p: usize,
        mut at: Vec3,
        home: Vec3,
        outward: Vec3,
        plane: Option<(Vec3, Vec3)>,
        limbs: &[Capsule],
    ) -> Vec3 {
        if !self.sheltered[p] {
            at += limbs.iter().map(|limb| limb.push(at)).sum::<Vec3>() * 0.5;
        }
        let excursion = at - home;
        let limit = self.looseness[p];
        at = home + excursion.clamp_length_max(limit);
        let inwards = (at - home).dot(outward) + self.gap[p];
        if inwards < 0.0 {
            at -= outward * inwards;
        }
        if let Some((point, normal)) = plane {
            let depth = self.clearance[p] - (at - point).dot(normal);
            if depth > 0.0 && depth < MAX_DEPTH {
                at += normal * depth;
            }
        }
        at
    }

    /// Elastic energy of stretch and tethers, and height, per unit mass: falls while the cloth settles.
    fn energy(&self, positions: &[Vec3], home: &[Vec3]) -> f32 {
        let count = positions.len().max(1) as f32;
        let elastic: f32 = self
            .stretch
            .iter()
            .map(|s| {
                let strain =
                    (positions[s.a as usize].distance(positions[s.b as usize]) - s.rest).max(0.0);
                strain * strain
            })
            .sum();
        let height: f32 = (0..positions.len())
            .filter(|p| self.looseness[*p] > 0.0)
            .map(|p| {
                let tether =
                    GRAVITY.length() / self.looseness[p] * positions[p].distance_squared(home[p]);
                (positions[p].y - home[p].y) * GRAVITY.length() + tether
            })
            .sum();
        (elastic / (STEP_SECONDS * STEP_SECONDS) + height) / count
    }
}

fn mobility(looseness: f32) -> f32 {
    if looseness > 0.0 { 1.0 } else { 0.0 }
}
