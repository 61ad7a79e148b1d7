//! The true shape of a person in one pose, by our simulation: the networks' target.

use super::{Capsule, Collider, Creases, Garment, PosedSkin, Settled, Surface, bulges};
use glam::Vec3;
use rayon::prelude::*;
use spmm3::{EXPRESSION, Joint, MotionParams, Skeleton, SkinningTransforms, Template};

/// A vertex's material, for the simulation.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Fabric {
    /// Moves with the bones alone: shoes, hair, eyes, teeth, lashes.
    Rigid,
    /// Skin outside the face.
    Skin,
    /// Skin of the face, which bulges.
    Face,
    /// Cloth: folds at the joints, and hangs where it is loose.
    Cloth,
}

/// The simulation's data of a person.
#[derive(Debug, Clone)]
pub struct Puppet {
    /// Mesh and skinning weights in T-pose.
    pub template: Template,
    /// The 55 joints.
    pub skeleton: Skeleton,
    /// What each vertex is made of, `[N_v]`.
    pub fabric: Vec<Fabric>,
    /// How far each vertex may leave its skinned place, metres, `[N_v]`; 0 for all but hanging cloth.
    pub looseness: Vec<f32>,
    /// Vertices of small loose pieces (lapels) sewn on the hanging cloth next to them.
    pub riders: Vec<u32>,
    /// Pairs of a vertex and one of an outer layer that it must stay under.
    pub covered: Vec<(u32, u32)>,
    /// Linear expression basis: offsets of every vertex at coefficient 1, metres, for the first slots.
    pub expressions: Vec<Vec<Vec3>>,
}

/// Offsets longer than this plus the cloth's looseness are spikes, metres.
const MAX_OFFSET: f32 = 0.06;

/// How far a covered vertex stays below what covers it, where it did at rest, metres.
const LAYER: f32 = 0.005;

/// One pose's truth.
#[derive(Debug, Clone)]
pub struct GroundTruth {
    /// Posed vertices, metres, root left out, `[N_v]`.
    pub posed: Vec<Vec3>,
    /// The target of F_mesh besides the linear expression: canonical offsets, metres, `[N_v]`.
    pub offsets: Vec<Vec3>,
    /// Root mean square movement of the cloth in its last step, metres.
    pub residual: f32,
    /// Offsets that were shortened because they were longer than cloth may move.
    pub clamped: usize,
}

/// Simulates poses of one puppet.
#[derive(Debug)]
pub struct Simulator<'a> {
    puppet: &'a Puppet,
    surface: Surface,
    normals: Vec<Vec3>,
    under: Vec<u32>,
    garment: Garment,
    face: Vec<f32>,
    cloth: Vec<f32>,
    riders: Vec<(u32, [(u32, f32); 3])>,
}

/// The radius of sleeves for collisions with a jacket's flank, metres.
const ARM_RADIUS: f32 = 0.05;

const ARMS: [(Joint, Joint); 4] = [
    (Joint::LeftShoulder, Joint::LeftElbow),
    (Joint::LeftElbow, Joint::LeftWrist),
    (Joint::RightShoulder, Joint::RightElbow),
    (Joint::RightElbow, Joint::RightWrist),
];

impl<'a> Simulator<'a> {
    /// Prepares the mesh's neighbourhoods and the garment.
    #[must_use]
    pub fn new(puppet: &'a Puppet) -> Self {
        let rest = puppet.template.vertices();
        let surface = Surface::new(rest.len(), puppet.template.faces());
        let normals = surface.normals(rest);
        let of_arm: Vec<f32> = puppet
            .template
            .skin()
            .iter()
            .map(|s| arm_share(&s.dense()))
            .collect();
        // Arms push as capsules: planes of a thin arm would push through to the body's other side.
        let mut solid: Vec<bool> = puppet.looseness.iter().map(|l| *l <= 0.0).collect();
        puppet
            .riders
            .iter()
            .for_each(|v| solid[*v as usize] = false);
        let under: Vec<u32> = (0u32..)
            .zip(&solid)
            .filter(|(v, solid)| {
                let v = *v as usize;
                **solid && normals[v] != Vec3::ZERO && of_arm[v] < 0.5
            })
            .map(|(v, _)| v)
            .collect();
        let sheltered: Vec<bool> = of_arm.iter().map(|share| *share > 0.25).collect();
        let below = collider(&under, rest, &normals);
        let garment = Garment::new(rest, &surface, &puppet.looseness, &sheltered, &below);
        let mut face: Vec<f32> = puppet
            .fabric
            .iter()
            .map(|f| if *f == Fabric::Face { 1.0 } else { 0.0 })
            .collect();
        surface.smooth(&mut face, 2);
        let cloth = puppet
            .fabric
            .iter()
            .map(|f| if *f == Fabric::Cloth { 1.0 } else { 0.0 })
            .collect();
        Self {
            puppet,
            surface,
            normals,
            under,
            riders: ties(puppet, &garment),
            garment,
            face,
            cloth,
        }
    }

    /// The mesh's neighbourhoods.
    #[must_use]
    pub fn surface(&self) -> &Surface {
        &self.surface
    }

    /// Template vertices that hang by themselves, and the rims they hang on.
    #[must_use]
    pub fn garment(&self) -> &Garment {
        &self.garment
    }

    /// Skinning of one pose, the root's orientation left out.
    #[must_use]
    pub fn skin(&self, motion: &MotionParams) -> PosedSkin {
        let mut transforms = SkinningTransforms::default();
        let joints = self.puppet.skeleton.pose(&without_root(motion));
        self.puppet.skeleton.skinning(&joints, &mut transforms);
        PosedSkin::new(&self.puppet.template, &transforms)
    }

    /// Template plus the linear expression, canonical, metres.
    #[must_use]
    pub fn expressed(&self, motion: &MotionParams) -> Vec<Vec3> {
        let mut points = self.puppet.template.vertices().to_vec();
        for (field, coefficient) in self
            .puppet
            .expressions
            .iter()
            .take(EXPRESSION)
            .zip(motion.expression())
        {
            if *coefficient != 0.0 {
                for (point, offset) in points.iter_mut().zip(field) {
                    *point += *offset * *coefficient;
                }
            }
        }
        points
    }

    /// Simulates one pose.
    #[must_use]
    pub fn simulate(&self, motion: &MotionParams) -> GroundTruth {
        let motion = without_root(motion);
        let template = &self.puppet.template;
        let skin = self.skin(&motion);
        let expressed = self.expressed(&motion);
        let canonical = self.with_creases(&motion, &skin, &expressed);
        let mut posed = skin.pose_all(template, &canonical);
        let mut settled = self.hang(&motion, &posed);
        self.garment.iron(&mut settled, &posed);
        for (v, at) in settled.vertices.iter().zip(&settled.positions) {
            posed[*v as usize] = *at;
        }
        let mut clamped = 0;
        let mut offsets = Vec::with_capacity(posed.len());
        for (v, at) in posed.iter_mut().enumerate() {
            let wanted = skin.canonical(v, *at, expressed[v]) - expressed[v];
            let offset = wanted.clamp_length_max(MAX_OFFSET + self.puppet.looseness[v]);
            clamped += usize::from(offset != wanted);
            *at = skin.linear(v, expressed[v] + offset);
            offsets.push(offset);
        }
        for (rider, carriers) in &self.riders {
            let offset = carriers
                .iter()
                .map(|(v, share)| offsets[*v as usize] * *share)
                .sum();
            let v = *rider as usize;
            offsets[v] = offset;
            posed[v] = skin.linear(v, expressed[v] + offset);
        }
        self.tuck_in(&skin, &expressed, &mut posed, &mut offsets);
        GroundTruth {
            posed,
            offsets,
            residual: settled.residual,
            clamped,
        }
    }

    /// Simulates all poses, in parallel; `done` is called after each.
    pub fn simulate_all(&self, poses: &[MotionParams], done: impl Fn() + Sync) -> Vec<GroundTruth> {
        poses
            .par_iter()
            .map(|motion| {
                let truth = self.simulate(motion);
                done();
                truth
            })
            .collect()
    }

    /// Lets the loose cloth fall over the posed rest.
    #[must_use]
    pub fn hang(&self, motion: &MotionParams, posed: &[Vec3]) -> Settled {
        let normals = self.surface.normals(posed);
        let body = collider(&self.under, posed, &normals);
        let joints = self.puppet.skeleton.pose(&without_root(motion));
        let limbs = ARMS.map(|(from, to)| Capsule {
            from: joints.position(from).lerp(joints.position(to), 0.25),
            to: joints.position(to),
            radius: ARM_RADIUS,
        });
        self.garment.settle(posed, &normals, &body, &limbs)
    }

    /// Pushes covered vertices back under what covers them.
    fn tuck_in(
        &self,
        skin: &PosedSkin,
        expressed: &[Vec3],
        posed: &mut [Vec3],
        offsets: &mut [Vec3],
    ) {
        let rest = self.puppet.template.vertices();
        let normals = self.surface.normals(posed);
        for (inner, outer) in &self.puppet.covered {
            let (v, o) = (*inner as usize, *outer as usize);
            let gap = (rest[o] - rest[v]).dot(self.normals[o]).clamp(0.0, LAYER);
            let excess = (posed[v] - posed[o]).dot(normals[o]) + gap;
            if excess > 0.0 {
                let under = posed[v] - normals[o] * excess.min(MAX_OFFSET);
                let offset = skin.canonical(v, under, expressed[v]) - expressed[v];
                offsets[v] = offset.clamp_length_max(MAX_OFFSET);
                posed[v] = skin.linear(v, expressed[v] + offsets[v]);
            }
        }
    }

    fn with_creases(
        &self,
        motion: &MotionParams,
        skin: &PosedSkin,
        expressed: &[Vec3],
    ) -> Vec<Vec3> {
        let rest = self.puppet.template.vertices();
        let creases = Creases::new(&self.puppet.skeleton, motion);
        let moved: Vec<Vec3> = (0..rest.len())
            .map(|v| {
                if self.face[v] > 0.0 {
                    skin.linear(v, expressed[v])
                } else {
                    rest[v]
                }
            })
            .collect();
        let bulge = bulges(&self.surface, rest, &moved, &self.face);
        (0..rest.len())
            .map(|v| {
                let fold = if self.cloth[v] > 0.0 {
                    creases.bunch(rest[v])
                } else {
                    0.0
                };
                expressed[v] + self.normals[v] * (bulge[v] + fold)
            })
            .collect()
    }
}

/// The pose with the root upright: the networks never see the root.
#[must_use]
pub fn without_root(motion: &MotionParams) -> MotionParams {
    let mut upright = motion.clone();
    upright.set_axis_angle(Joint::Pelvis, Vec3::ZERO);
    upright.root_translation = Vec3::ZERO;
    upright
}

/// Share of a vertex' weights that an arm below the collar holds.
pub(crate) fn arm_share(dense: &[f32]) -> f32 {
    let arms = [
        Joint::LeftShoulder,
        Joint::LeftElbow,
        Joint::LeftWrist,
        Joint::RightShoulder,
        Joint::RightElbow,
        Joint::RightWrist,
    ];
    arms.iter().map(|joint| dense[joint.index()]).sum()
}

/// The three nearest particles of the garment for each rider, and their shares.
fn ties(puppet: &Puppet, garment: &Garment) -> Vec<(u32, [(u32, f32); 3])> {
    let rest = puppet.template.vertices();
    puppet
        .riders
        .iter()
        .filter_map(|rider| {
            let at = rest[*rider as usize];
            let mut near: Vec<(u32, f32)> = garment
                .vertices()
                .iter()
                .map(|v| (*v, 1.0 / (rest[*v as usize].distance(at) + 1e-4)))
                .collect();
            near.sort_by(|a, b| b.1.total_cmp(&a.1).then(a.0.cmp(&b.0)));
            let kept = [*near.first()?, *near.get(1)?, *near.get(2)?];
            let total: f32 = kept.iter().map(|(_, w)| w).sum();
            Some((*rider, kept.map(|(v, w)| (v, w / total))))
        })
        .collect()
}

fn collider(under: &[u32], points: &[Vec3], normals: &[Vec3]) -> Collider {
    let pick = |values: &[Vec3]| under.iter().map(|v| values[*v as usize]).collect();
    Collider::new(pick(points), pick(normals))
}
