//! The avatar of a dressed body: template, skeleton, controllers and networks that do nothing yet but for the expressions.

use crate::body::{Body, Canonical, Shape, offsets_in_tpose};
use crate::clothes::Dressed;
use crate::spread::Places;
use glam::{DVec3, Vec3};
use reconstruct::fit::scatter_controllers;
use reconstruct::simulate::{Fabric, Puppet};
use scan_rig::body::BodyPart;
use scan_rig::finish::linear;
use spmm3::networks::{
    AttributeNetwork, DeformGraph, Dense, GraphParts, MeshNetwork, QuantisedBases,
};
use spmm3::{
    ATTRIBUTES, Avatar, BoundGaussians, Controllers, EdgeGraph, ExpressionBasis, Expressions,
    Joint, PARAMS, PersonError, SH_C0, Skeleton, Template, attribute,
};

/// Controllers, as many as the paper's.
const CONTROLLERS: usize = 500;

/// Sizes of the F_attr that adds nothing: it is there because a package has one.
const HIDDEN: usize = 1;
const BASES: usize = 1;

/// Standard deviations of a first Gaussian as shares of the spacing: along the surface, and through it.
const WIDE: f64 = 0.62;
const THIN: f64 = 0.08;

/// Opacity of a first Gaussian, as a logit: 0.95.
const OPACITY: f32 = 2.94;

/// Where vertices swing farther than this, controllers are denser (`reconstruct::fit::scatter_controllers` knows it as 20 mm of looseness).
const LOOSE: f32 = 0.012;

/// Template and skeleton, standing on the floor.
#[derive(Debug)]
pub(crate) struct Figure {
    pub(crate) template: Template,
    pub(crate) skeleton: Skeleton,
}

/// Puts a body on the floor, its hips above the origin. `shift`: where the body is from the pelvis joint that the capture's poses mean, metres; the
/// skeleton gets that joint.
pub(crate) fn figure(
    body: &Body,
    canonical: &Canonical,
    shift: DVec3,
) -> Result<Figure, PersonError> {
    let own = &canonical.vertices[..body.model.body_vertices];
    let soles = own.iter().map(|v| v.y).fold(f64::INFINITY, f64::min);
    let [left, right] = [Joint::LeftHip, Joint::RightHip].map(|hip| canonical.joints[hip.index()]);
    let middle = 0.5 * (left + right);
    let to_floor = -DVec3::new(middle.x, soles, middle.z);
    let moved = |v: &DVec3| (*v + to_floor).as_vec3();
    let mut joints = canonical.joints;
    joints[Joint::Pelvis.index()] -= shift;
    Ok(Figure {
        template: Template::new(
            canonical.vertices.iter().map(moved).collect(),
            body.model.faces.clone(),
            body.skin.clone(),
        )?,
        skeleton: Skeleton::new(joints.map(|joint| moved(&joint)))?,
    })
}

/// The expression basis on the template: `[slots][N_v]` offsets in T-pose, metres at coefficient 1.
pub(crate) fn expressions(body: &Body, shape: &Shape) -> Vec<Vec<Vec3>> {
    offsets_in_tpose(body, shape, &body.model.expressions().0)
}

/// What an avatar is made of.
#[derive(Debug)]
pub(crate) struct Material<'a> {
    pub(crate) body: &'a Body,
    pub(crate) figure: Figure,
    pub(crate) dressed: &'a Dressed,
    pub(crate) places: &'a Places,
    /// `[N_g]` display values.
    pub(crate) colours: &'a [Vec3],
    pub(crate) fields: Vec<Vec<Vec3>>,
    pub(crate) presets: Expressions,
}

/// An avatar and its networks as numbers.
pub(crate) struct Assembled {
    pub(crate) avatar: Avatar,
    pub(crate) mesh: MeshNetwork,
    pub(crate) attributes: AttributeNetwork,
}

/// Puts the avatar together; name, provenance, licence and report are left to the caller.
pub(crate) fn assemble(material: Material<'_>) -> Result<Assembled, PersonError> {
    let Figure { template, skeleton } = material.figure;
    let gaussians = gaussians(&template, material.places, material.colours)?;
    let puppet = puppet(material.body, material.dressed, &template, &skeleton);
    let seats = scatter_controllers(&puppet, &gaussians, CONTROLLERS);
    let graph = EdgeGraph::new(&template, &[]);
    let controllers = Controllers::tie(&template, &graph, &gaussians, seats)?;
    let mesh = linear(&material.fields, template.vertices().len())?;
    let attributes = nothing(controllers.vertices().len(), gaussians.len())?;
    let deform_graph = DeformGraph {
        template: &template,
        controllers: &controllers,
        mesh: &mesh,
        attributes: &attributes,
    }
    .to_onnx(GraphParts::Whole)?;
    Ok(Assembled {
        avatar: Avatar {
            name: String::new(),
            provenance: String::new(),
            licence: String::new(),
            skeleton,
            template,
            gaussians,
            importance: None,
            controllers,
            expression_basis: ExpressionBasis::MAKEHUMAN_1,
            expressions: material.presets,
            deform_graph,
            pose_range: None,
            compiled: Vec::new(),
            signer: None,
            report: serde_json::Value::Null,
        },
        mesh,
        attributes,
    })
}

/// Flat Gaussians in their triangles' planes, rounded as a package keeps them.
fn gaussians(
    template: &Template,
    places: &Places,
    colours: &[Vec3],
) -> Result<BoundGaussians, PersonError> {
    let count = places.faces.len();
    let mut attributes = vec![0.0; ATTRIBUTES * count];
    let mut plane = |plane: usize, value: &dyn Fn(usize) -> f32| {
        for (at, slot) in attributes[plane * count..][..count].iter_mut().enumerate() {
            *slot = value(at);
        }
    };
    plane(attribute::ROTATION.end - 1, &|_| 1.0);
    for (axis, share) in attribute::LOG_SCALE.zip([WIDE, WIDE, THIN]) {
        #[expect(clippy::cast_possible_truncation, reason = "a size")]
        plane(axis, &|at| (share * places.spacing[at]).ln() as f32);
    }
    plane(attribute::OPACITY, &|_| OPACITY);
    for (channel, at_plane) in attribute::COLOUR.enumerate() {
        plane(at_plane, &|at| (colours[at][channel] - 0.5) / SH_C0);
    }
    let bound = BoundGaussians::new(
        template,
        places.faces.clone(),
        places.barycentrics.clone(),
        attributes,
    )?;
    Ok(bound.quantised())
}

/// What the choice of controllers needs to know: what each vertex is made of, and where outlines of single frames are off the surface.
fn puppet(body: &Body, dressed: &Dressed, template: &Template, skeleton: &Skeleton) -> Puppet {
    #[expect(clippy::cast_possible_truncation, reason = "millimetres")]
    let loose = |looseness: &f64| (*looseness as f32) * (0.02 / LOOSE);
    Puppet {
        template: template.clone(),
        skeleton: skeleton.clone(),
        fabric: (body.parts.iter().zip(&body.clothed))
            .map(|(part, clothed)| match part {
                BodyPart::Face => Fabric::Face,
                BodyPart::Skin if *clothed > 0.5 => Fabric::Cloth,
                BodyPart::Skin | BodyPart::Head | BodyPart::Hand => Fabric::Skin,
                _ => Fabric::Rigid,
            })
            .collect(),
        looseness: dressed.looseness.iter().map(loose).collect(),
        riders: Vec::new(),
        covered: Vec::new(),
        expressions: Vec::new(),
    }
}

/// The F_attr that adds nothing.
fn nothing(controllers: usize, gaussians: usize) -> Result<AttributeNetwork, PersonError> {
    let units = controllers * HIDDEN;
    let zero = Dense::new(1, 1, &[0.0], vec![0.0])?.weights()[0];
    Ok(AttributeNetwork {
        first: Dense::new(PARAMS, units, &vec![0.0; PARAMS * units], vec![0.0; units])?,
        second: vec![zero; units * BASES],
        second_bias: vec![0.0; controllers * BASES],
        bases: QuantisedBases::quantise(
            BASES,
            gaussians,
            &vec![0.0; ATTRIBUTES * BASES * gaussians],
        )?,
    })
}
