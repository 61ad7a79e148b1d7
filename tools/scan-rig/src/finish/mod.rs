//! From bound Gaussians to an avatar: the template in T-pose, its networks, the order of importance.
//!
//! Gaussians were bound in the scan's pose, and only the mesh is brought to T-pose: posed as in the scan, the avatar shows the
//! scan's own Gaussians again, up to rounding.

mod controllers;
mod face;
mod gaussians;
mod posed;
mod shade;

pub use face::linear;
pub use posed::Poser;

use crate::RigError;
use crate::body::SkinRow;
use crate::body::posing::{JointPose, blended, brought_to_t_pose, kept};
use crate::scan::Scan;
use glam::{DAffine3, DVec3, Vec3};
use reconstruct::bake::{Weights, importance};
use spmm3::networks::{DeformGraph, GraphParts};
use spmm3::package::MAX_GAUSSIANS;
use spmm3::{
    Avatar, BoundGaussians, ExpressionBasis, Expressions, Importance, JOINTS, Joint, MotionParams,
    Skeleton, SkinWeights, Template,
};
use std::time::Instant;

/// Gaussians on a mesh, both as they stand in the scan, and how the body that the mesh belongs to is posed there and in T-pose.
#[derive(Debug, Clone, Copy)]
pub struct Material<'a> {
    /// Gaussians in the scan's pose, `[N_g]`.
    pub scan: &'a Scan,
    /// The triangle of each, `[N_g]`.
    pub triangles: &'a [u32],
    /// The mesh in the scan's pose, metres, `[N_v]`.
    pub vertices: &'a [DVec3],
    /// Its triangles, counter-clockwise seen from outside, `[N_f]`.
    pub faces: &'a [[u32; 3]],
    /// Its skinning weights, `[N_v]`; of each row the four strongest count.
    pub weights: &'a [SkinRow],
    /// The first so many vertices are the body's: they say where its soles are.
    pub body_vertices: usize,
    /// The pose of the scan.
    pub scan_pose: &'a JointPose,
    /// The T-pose of the same body: arms along x, facing +z.
    pub tpose: &'a JointPose,
    /// Offsets of the vertices at coefficient 1 of each expression slot, metres, in the body model's rest pose, `[slots][N_v]`;
    /// shorter fields leave the vertices after theirs where they are.
    pub expressions: &'a [Vec<Vec3>],
    /// Named expressions in these slots.
    pub presets: &'a Expressions,
    /// The body model's scale: metres of the scan for one of the model's.
    pub scale: f64,
    /// The triangles that shade others: the outer skin.
    pub casters: &'a [[u32; 3]],
}

/// What may be chosen about an avatar.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct FinishOptions {
    /// Its name.
    pub name: String,
    /// Where it came from, in words.
    pub provenance: String,
    /// What one may do with it, in words.
    pub licence: String,
    /// At most so many Gaussians: the least important ones are left out.
    pub gaussians: Option<usize>,
}

/// An avatar and the motion that poses it as the scan stands.
#[derive(Debug, Clone)]
pub struct Finished {
    /// The avatar, its Gaussians rounded as its package keeps them.
    pub avatar: Avatar,
    /// The pose of the scan.
    pub scan_motion: MotionParams,
}

/// Puts an avatar together.
///
/// # Errors
/// If counts do not fit each other or a number is not finite.
pub fn avatar(material: &Material<'_>, options: &FinishOptions) -> Result<Finished, RigError> {
    let skin: Vec<SkinWeights> = material.weights.iter().map(kept).collect();
    let rows: Vec<SkinRow> = skin.iter().map(SkinWeights::dense).collect();
    let (vertices, tpose) = brought_to_t_pose(
        material.vertices,
        &rows,
        material.body_vertices,
        material.scan_pose,
        material.tpose,
    );
    let template = Template::new(
        vertices.iter().map(|v| v.as_vec3()).collect(),
        material.faces.to_vec(),
        skin.clone(),
    )?;
    let posed = Template::new(
        material.vertices.iter().map(|v| v.as_vec3()).collect(),
        material.faces.to_vec(),
        skin,
    )?;
    let bound = gaussians::bind(&posed, material.scan, material.triangles)?;
    let everything: Vec<usize> = (0..bound.len()).collect();
    // On the template now: the same attributes in the same triangles' frames.
    let bound = gaussians::reordered(&template, &bound, &everything)?.quantised();
    // A large scan whose long Gaussians were split may have more than a package takes.
    let most = options
        .gaussians
        .map_or(MAX_GAUSSIANS, |most| most.min(MAX_GAUSSIANS));
    let bound = if most < bound.len() {
        thinned(&template, &bound, most)?
    } else {
        bound
    };

    let mut clock = Clock::start();
    let tied = controllers::tie(&template, &bound)?;
    clock.told("controllers");
    let bound = tied.gaussians;
    let skeleton = Skeleton::new(tpose.joints.map(|j| j.as_vec3()))?;
    let scan_motion = scan_motion(material, &tpose);
    let shaded = shade::Sitter {
        template: &template,
        weights: &rows,
        skeleton: &skeleton,
        controllers: &tied.controllers,
        gaussians: &bound,
        casters: material.casters,
        scan_motion: &scan_motion,
    }
    .shaded(material.presets)?;
    let (attributes, bound) = (shaded.network, shaded.gaussians);
    clock.told("light by pose");
    let importance = importance(&template, &bound, Weights::default())?;
    clock.told("order of importance");
    let fields = expression_fields(material, &tpose, &rows);
    let mesh = linear(&fields, template.vertices().len())?;
    let deform_graph = DeformGraph {
        template: &template,
        controllers: &tied.controllers,
        mesh: &mesh,
        attributes: &attributes,
    }
    .to_onnx(GraphParts::Whole)?;
    Ok(Finished {
        scan_motion,
        avatar: Avatar {
            name: options.name.clone(),
            provenance: options.provenance.clone(),
            licence: options.licence.clone(),
            skeleton,
            template,
            gaussians: bound,
            importance: Some(importance),
            controllers: tied.controllers,
            expression_basis: ExpressionBasis::MAKEHUMAN_1,
            expressions: material.presets.clone(),
            deform_graph,
            pose_range: None,
            compiled: Vec::new(),
            signer: None,
            report: serde_json::Value::Null,
        },
    })
}

/// Tells developers what each part of the assembly takes.
struct Clock(Instant);

impl Clock {
    fn start() -> Self {
        Self(Instant::now())
    }

    fn told(&mut self, what: &str) {
        log::debug!("{what}: {:.2} s", self.0.elapsed().as_secs_f64());
        self.0 = Instant::now();
    }
}

/// The expressions' offsets, turned from the body model's rest pose to the T-pose.
fn expression_fields(
    material: &Material<'_>,
    tpose: &JointPose,
    rows: &[SkinRow],
) -> Vec<Vec<Vec3>> {
    let turns: [DAffine3; JOINTS] = tpose
        .rotations
        .map(|turn| DAffine3::from_mat3(turn * material.scale));
    let maps: Vec<DAffine3> = rows.iter().map(|row| blended(row, &turns)).collect();
    let turned = |field: &Vec<Vec3>| {
        let offsets = field.iter().chain(std::iter::repeat(&Vec3::ZERO));
        (maps.iter().zip(offsets))
            .map(|(map, offset)| map.transform_vector3(offset.as_dvec3()).as_vec3())
            .collect()
    };
    material.expressions.iter().map(turned).collect()
}

/// The motion that poses the avatar as the scan stands: rotations relative to T-pose, each in its parent's frame.
fn scan_motion(material: &Material<'_>, tpose: &JointPose) -> MotionParams {
    let turned = |joint: Joint| {
        let j = joint.index();
        material.scan_pose.rotations[j] * tpose.rotations[j].transpose()
    };
    let mut motion = MotionParams::default();
    for joint in Joint::ALL {
        let local = match joint.parent() {
            Some(parent) => turned(parent).transpose() * turned(joint),
            None => turned(joint),
        };
        motion.set_rotation(joint, glam::DQuat::from_mat3(&local).normalize().as_quat());
    }
    let pelvis = Joint::Pelvis.index();
    motion.root_translation = (material.scan_pose.joints[pelvis] - tpose.joints[pelvis]).as_vec3();
    motion
}

/// The `most` most important Gaussians, grown over what is left out.
fn thinned(
    template: &Template,
    bound: &BoundGaussians,
    most: usize,
) -> Result<BoundGaussians, RigError> {
    let found: Importance = importance(template, bound, Weights::default())?;
    #[expect(clippy::cast_precision_loss, reason = "a share of at most millions")]
    let share = most as f32 / bound.len() as f32;
    let level = found.level(bound, share);
    let order: Vec<usize> = level.kept.iter().map(|i| *i as usize).collect();
    let kept = gaussians::reordered(template, bound, &order)?;
    gaussians::grown(template, &kept, &level.log2_growth).map_err(RigError::from)
}
