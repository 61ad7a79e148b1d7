//! A skinned mesh and the Gaussians on it, checked and laid out as the shaders read them.

use half::f16;
use shaders_spirv::quantised;

use super::checks::{fits, refused};
use super::networks::{NetworkParts, Networks};
use crate::error::RenderError;

/// Attributes of a Gaussian, each a plane of its own.
pub(super) const ATTRIBUTES: usize = 14;
/// Bases that the shader reads at once, a byte each.
const BLOCK: usize = 16;
/// Planes of [`BoundMesh::bound`].
const BOUND_PLANES: usize = 10;

/// What a [`BoundMesh`] is made of, as plain arrays: N_v vertices, N_g Gaussians, C controllers, B bases.
///
/// The names are those of the rig, whatever it is of. A *basis* is a displacement of every Gaussian's attributes. A *controller* is a
/// control point that scales the bases by one potential each ([`PosedInput`](super::input::PosedInput)). A Gaussian follows three
/// controllers, weighted by its *masses*.
///
/// The 14 attributes are, in this order: offset x, y, z in the triangle's frame (metres), rotation x, y, z, w in it (a
/// quaternion, normalised in use), natural logarithms of the three scales (metres), the opacity's logit, and the colour's
/// three spherical-harmonic coefficients of degree 0. The triangle's frame has x from the first to the second corner, z
/// along the counter-clockwise normal, y = z cross x.
#[derive(Debug, Clone, Copy)]
pub struct BoundMeshParts<'a> {
    /// How many joints there are, at most 256.
    pub joints: usize,
    /// `[N_v]` joints that move a vertex.
    pub skin_joints: &'a [[u8; 4]],
    /// `[N_v]` their shares, which sum to 1.
    pub skin_weights: &'a [[f32; 4]],
    /// `[N_g]` vertices of the triangle a Gaussian is bound to.
    pub corners: &'a [[u32; 3]],
    /// `[N_g]` barycentric weights of its second and third corner.
    pub barycentrics: &'a [[f32; 2]],
    /// Template attributes, row-major [14, N_g].
    pub attributes: &'a [f32],
    /// How many controllers there are: C.
    pub controllers: usize,
    /// `[N_g]` the controllers that hold a Gaussian.
    pub neighbours: &'a [[u16; 3]],
    /// `[N_g]` their virtual masses.
    pub masses: &'a [[f32; 3]],
    /// How many bases there are: B.
    pub bases: usize,
    /// `[14]` attribute units of a relative scale's step.
    pub units: &'a [f32; ATTRIBUTES],
    /// Relative scales, row-major [14, N_g].
    pub scales: &'a [f16],
    /// Bases, row-major [14, B, N_g]; attribute = value x scale x unit.
    pub values: &'a [i8],
}

/// A level of detail: the Gaussians for a device that cannot draw all in time.
#[derive(Debug, Clone, Copy)]
pub struct DetailLevel<'a> {
    /// Indices of those that are drawn; the memory is read best in ascending order.
    pub kept: &'a [u32],
    /// For each of them what is added to the logarithms (base 2) of its scales, so that it closes the holes of those it stands
    /// for: 0 to 3.9, kept to a hundredth.
    pub log2_growth: &'a [f32],
}

/// A kept Gaussian's word: its index below its growth; `GROWTH_SHIFT` in the shader.
const INDEX_BITS: u32 = 24;
const INDEX_MASK: u32 = (1 << INDEX_BITS) - 1;
/// Steps of growth in an octave, and the largest growth that fits.
const GROWTH_STEPS: f32 = 64.0;
const MOST_GROWTH: f32 = 3.9;

/// Where a level's list lies among all of them.
#[derive(Debug, Clone, Copy)]
pub(super) struct LevelRange {
    pub(super) first: u32,
    pub(super) count: u32,
}

/// Gaussians bound to a skinned mesh, checked and ready for upload. Kept by its owner, so that it can be uploaded again
/// after a device was lost.
#[derive(Clone)]
pub struct BoundMesh {
    pub(super) vertices: u32,
    pub(super) gaussians: u32,
    pub(super) joints: u32,
    pub(super) controllers: u32,
    pub(super) bases: u32,
    /// Blocks of 16 bases, the last one filled up with zeros.
    pub(super) blocks: u32,
    /// Four joints a vertex.
    pub(super) skin_joints: Vec<[u8; 4]>,
    pub(super) skin_weights: Vec<[f32; 4]>,
    /// Ten planes: corners 3, barycentrics 2, neighbours 2 (the first two share a word), masses 3.
    pub(super) bound: Vec<u32>,
    pub(super) attributes: Vec<f32>,
    /// Seven planes of two neighbouring attributes' scales.
    pub(super) scales: Vec<[f16; 2]>,
    /// 14 x `blocks` planes.
    pub(super) values: Vec<[i8; BLOCK]>,
    /// Filled up to whole vectors.
    pub(super) units: [f32; 16],
    /// The levels' lists, one after another, and where each is.
    pub(super) kept: Vec<u32>,
    pub(super) levels: Vec<LevelRange>,
    /// What computes poses from parameters, where the device does.
    pub(super) networks: Option<Networks>,
}

impl std::fmt::Debug for BoundMesh {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("BoundMesh")
            .field("vertices", &self.vertices)
            .field("gaussians", &self.gaussians)
            .field("joints", &self.joints)
            .field("controllers", &self.controllers)
            .field("bases", &self.bases)
            .finish_non_exhaustive()
    }
}

impl BoundMesh {
    /// Checks the parts and lays them out.
    ///
    /// # Errors
    /// [`RenderError::BoundMesh`] if counts differ, an index is out of range, or there are more of anything than the
    /// layout holds.
    pub fn new(parts: &BoundMeshParts<'_>) -> Result<Self, RenderError> {
        let vertices = parts.skin_joints.len();
        let gaussians = parts.corners.len();
        let BoundMeshParts {
            joints,
            controllers,
            bases,
            ..
        } = *parts;
        check_counts(parts, vertices, gaussians)?;
        check_indices(parts, vertices)?;
        let blocks = bases.div_ceil(BLOCK);
        let mut units = [0.0; 16];
        units[..ATTRIBUTES].copy_from_slice(parts.units);
        Ok(Self {
            vertices: fits("vertices", vertices)?,
            gaussians: fits("Gaussians", gaussians)?,
            joints: fits("joints", joints)?,
            controllers: fits("controllers", controllers)?,
            bases: fits("bases", bases)?,
            blocks: fits("bases", blocks)?,
            skin_joints: parts.skin_joints.to_vec(),
            skin_weights: parts.skin_weights.to_vec(),
            bound: bound_planes(parts),
            attributes: parts.attributes.to_vec(),
            scales: paired_scales(parts.scales, gaussians),
            values: blocked_values(parts.values, bases, gaussians),
            units,
            kept: Vec::new(),
            levels: Vec::new(),
            networks: None,
        })
    }

    /// Adds levels of detail 1, 2, ... in place of those there were: level 0 is all Gaussians.
    ///
    /// # Errors
    /// [`RenderError::BoundMesh`] if a level keeps none, more than there are, or one that does not exist.
    pub fn with_levels(mut self, levels: &[DetailLevel<'_>]) -> Result<Self, RenderError> {
        self.kept.clear();
        self.levels.clear();
        for (number, level) in (1..).zip(levels) {
            let count = fits("Gaussians", level.kept.len())?;
            if !(1..=self.gaussians.min(INDEX_MASK)).contains(&count)
                || level.log2_growth.len() != level.kept.len()
            {
                return Err(refused(format!(
                    "its level {number} keeps {count} Gaussians of {} and grows {}",
                    self.gaussians,
                    level.log2_growth.len()
                )));
            }
            self.levels.push(LevelRange {
                first: fits("Gaussians in all levels", self.kept.len())?,
                count,
            });
            for (index, growth) in level.kept.iter().zip(level.log2_growth) {
                if *index >= self.gaussians {
                    return Err(refused(format!(
                        "there is no Gaussian {index} for its level {number} to keep"
                    )));
                }
                if !(0.0..=MOST_GROWTH).contains(growth) {
                    return Err(refused(format!(
                        "Gaussian {index} grows by {growth} octaves at level {number}, not 0 to {MOST_GROWTH}"
                    )));
                }
                self.kept
                    .push(index | quantised(growth * GROWTH_STEPS, 255.0) << INDEX_BITS);
            }
        }
        Ok(self)
    }

    /// Adds the networks that drive it, in place of those there were: poses may then come as parameters
    /// ([`Deformation::Parameters`](super::input::Deformation)).
    ///
    /// # Errors
    /// [`RenderError::BoundMesh`] if layers do not follow one another or do not end at this mesh.
    pub fn with_networks(mut self, parts: &NetworkParts<'_>) -> Result<Self, RenderError> {
        let potentials = [self.controllers, self.bases, 16 * self.blocks];
        self.networks = Some(Networks::new(parts, self.vertices, potentials)?);
        Ok(self)
    }

    /// How many parameters its networks take, if it has any.
    #[must_use]
    pub fn parameters(&self) -> Option<u32> {
        self.networks.as_ref().map(|networks| networks.parameters)
    }

    /// Number of vertices N_v.
    #[must_use]
    pub fn vertices(&self) -> u32 {
        self.vertices
    }

    /// Number of Gaussians N_g.
    #[must_use]
    pub fn gaussians(&self) -> u32 {
        self.gaussians
    }

    /// Number of Gaussians of a level of detail; of those beyond the last, the last.
    #[must_use]
    pub fn gaussians_at(&self, level: usize) -> u32 {
        let Some(index) = level.checked_sub(1) else {
            return self.gaussians;
        };
        let range = self.levels.get(index).or(self.levels.last());
        range.map_or(self.gaussians, |range| range.count)
    }

    /// Number of joints.
    #[must_use]
    pub fn joints(&self) -> u32 {
        self.joints
    }

    /// Number of controllers C.
    #[must_use]
    pub fn controllers(&self) -> u32 {
        self.controllers
    }

    /// Number of bases B.
    #[must_use]
    pub fn bases(&self) -> u32 {
        self.bases
    }
}

fn check_counts(
    parts: &BoundMeshParts<'_>,
    vertices: usize,
    gaussians: usize,
) -> Result<(), RenderError> {
    let none = [
        ("vertices", vertices),
        ("Gaussians", gaussians),
        ("joints", parts.joints),
        ("controllers", parts.controllers),
        ("bases", parts.bases),
    ]
    .into_iter()
    .find(|(_, count)| *count == 0);
    if let Some((what, _)) = none {
        return Err(refused(format!("it has no {what}")));
    }
    let planes = ATTRIBUTES.saturating_mul(gaussians);
    let counts = [
        ("skinning weights", parts.skin_weights.len(), vertices),
        ("barycentrics", parts.barycentrics.len(), gaussians),
        ("attributes", parts.attributes.len(), planes),
        ("neighbours", parts.neighbours.len(), gaussians),
        ("masses", parts.masses.len(), gaussians),
        ("scales", parts.scales.len(), planes),
        (
            "values",
            parts.values.len(),
            planes.saturating_mul(parts.bases),
        ),
    ];
    for (what, got, expected) in counts {
        if got != expected {
            return Err(refused(format!("{got} {what}, not {expected}")));
        }
    }
    Ok(())
}

fn check_indices(parts: &BoundMeshParts<'_>, vertices: usize) -> Result<(), RenderError> {
    let worst = |indices: &mut dyn Iterator<Item = usize>| indices.max().unwrap_or_default();
    let joints = &mut parts.skin_joints.iter().flatten().map(|j| usize::from(*j));
    let corners = &mut parts.corners.iter().flatten().map(|v| *v as usize);
    let held = &mut parts.neighbours.iter().flatten().map(|c| usize::from(*c));
    for (what, greatest, end) in [
        ("joint", worst(joints), parts.joints),
        ("vertex", worst(corners), vertices),
        ("controller", worst(held), parts.controllers),
    ] {
        if greatest >= end {
            return Err(refused(format!("there is no {what} {greatest} of {end}")));
        }
    }
    Ok(())
}

/// Plane after plane of 32-bit words.
fn bound_planes(parts: &BoundMeshParts<'_>) -> Vec<u32> {
    let count = parts.corners.len();
    let mut planes = Vec::with_capacity(BOUND_PLANES * count);
    for k in 0..3 {
        planes.extend(parts.corners.iter().map(|corners| corners[k]));
    }
    for k in 0..2 {
        planes.extend(
            parts
                .barycentrics
                .iter()
                .map(|weights| weights[k].to_bits()),
        );
    }
    let neighbours = parts.neighbours.iter();
    planes.extend(
        neighbours
            .clone()
            .map(|[a, b, _]| u32::from(*a) | u32::from(*b) << 16),
    );
    planes.extend(neighbours.map(|[.., c]| u32::from(*c)));
    for k in 0..3 {
        planes.extend(parts.masses.iter().map(|masses| masses[k].to_bits()));
    }
    planes
}

/// Attributes 2p and 2p + 1 of a Gaussian side by side.
fn paired_scales(scales: &[f16], gaussians: usize) -> Vec<[f16; 2]> {
    let mut paired = Vec::with_capacity(scales.len() / 2);
    for pair in scales.chunks_exact(2 * gaussians) {
        let (even, odd) = pair.split_at(gaussians);
        paired.extend(even.iter().zip(odd).map(|(even, odd)| [*even, *odd]));
    }
    paired
}

/// From [14, B, N_g] to [14, blocks, N_g] blocks of 16 bases.
fn blocked_values(values: &[i8], bases: usize, gaussians: usize) -> Vec<[i8; BLOCK]> {
    let blocks = bases.div_ceil(BLOCK);
    let mut blocked = vec![[0; BLOCK]; ATTRIBUTES * blocks * gaussians];
    for (row, values) in values.chunks_exact(gaussians).enumerate() {
        let (plane, basis) = (row / bases, row % bases);
        let first = (plane * blocks + basis / BLOCK) * gaussians;
        for (block, value) in blocked[first..first + gaussians].iter_mut().zip(values) {
            block[basis % BLOCK] = *value;
        }
    }
    blocked
}

#[cfg(test)]
mod tests;
