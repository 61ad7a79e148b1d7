//! A small puppet made in code: a whole avatar for tests, without downloads.
//!
//! Tubes around the bones of an SMPL-X-sized skeleton in T-pose, smooth skinning weights, Gaussians spread over the
//! surface, and small random networks whose effect is visible (centimetres) yet tame. The same size gives the same puppet.

#![forbid(unsafe_code)]

mod body;
pub mod hostile;
mod networks;
mod random;
pub mod real_files;
pub mod reference;
mod skin;

pub use random::Random;
use spmm3::networks::{AttributeNetwork, DeformGraph, GraphParts, MeshNetwork};
use spmm3::{
    Avatar, BoundGaussians, Controllers, EXPRESSION, EdgeGraph, ExpressionBasis, ExpressionPreset,
    Expressions, GaussianSet, Importance, Skeleton, Template,
};

/// How large a puppet is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct PuppetSize {
    /// Multiplies rings and segments of every tube; vertices grow with its square (about 860 at 1, 20,700 at 5).
    pub detail: usize,
    /// N_g.
    pub gaussians: usize,
    /// Number of controllers.
    pub controllers: usize,
    /// Hidden units of one controller.
    pub controller_hidden: usize,
    /// B.
    pub bases: usize,
    /// Hidden units of F_mesh.
    pub mesh_hidden: usize,
    /// Offset fields of F_mesh.
    pub rank: usize,
}

impl PuppetSize {
    /// For tests: a few hundred vertices, 2,000 Gaussians, 16 controllers.
    pub const SMALL: Self = Self {
        detail: 1,
        gaussians: 2_000,
        controllers: 16,
        controller_hidden: 4,
        bases: 5,
        mesh_hidden: 24,
        rank: 8,
    };
    /// As large as the demo person: for benches and package sizes.
    pub const FULL: Self = Self {
        detail: 5,
        gaussians: 60_000,
        controllers: 500,
        controller_hidden: 8,
        bases: 15,
        mesh_hidden: 256,
        rank: 64,
    };
}

/// All parts of the puppet, consistent with each other.
#[derive(Debug, Clone)]
pub struct Puppet {
    /// 55 joints in T-pose.
    pub skeleton: Skeleton,
    /// Tubes and their weights.
    pub template: Template,
    /// The template's surface with the tubes joined, as the controllers were assigned on.
    pub surface: EdgeGraph,
    /// Pairs of vertices that join the tubes in [`Self::surface`].
    pub bridges: Vec<(u32, u32)>,
    /// The Gaussians in the template's space, before binding.
    pub at_rest: GaussianSet,
    /// The Gaussians bound to the tubes, rounded as a package keeps them.
    pub gaussians: BoundGaussians,
    /// Controllers and virtual masses.
    pub controllers: Controllers,
    /// F_mesh.
    pub mesh: MeshNetwork,
    /// F_attr.
    pub attributes: AttributeNetwork,
    /// `smile`, `blink` and `a`.
    pub expressions: Expressions,
}

impl Puppet {
    /// Makes the puppet.
    ///
    /// # Panics
    /// If the parts do not fit each other: a bug here or in `spmm3`.
    #[must_use]
    pub fn new(size: PuppetSize) -> Self {
        let rest = body::rest_positions();
        let skeleton = Skeleton::new(rest).expect("the skeleton is finite");
        let mut surface = body::Surface::default();
        for limb in body::limbs(&rest) {
            surface.add(&limb, &rest, size.detail);
        }
        let body::Surface {
            vertices,
            faces,
            skin,
            bridges,
            colours,
        } = surface;
        let template = Template::new(vertices, faces, skin).expect("the tubes are a template");
        let mut random = Random::new(17);
        let (at_rest, triangles, barycentrics) =
            skin::scatter(&template, &colours, size.gaussians, &mut random);
        let gaussians = BoundGaussians::bind(&template, &at_rest, triangles, barycentrics)
            .expect("the Gaussians are bound to the template")
            .quantised();
        let surface = EdgeGraph::new(&template, &bridges);
        let seats = skin::spread(template.vertices(), size.controllers);
        let controllers = Controllers::tie(&template, &surface, &gaussians, seats)
            .expect("the controllers sit on the template");
        Self {
            mesh: networks::mesh_network(&template, size, &mut random),
            attributes: networks::attribute_network(size, &mut random),
            skeleton,
            surface,
            bridges,
            at_rest,
            gaussians,
            controllers,
            expressions: expressions(),
            template,
        }
    }

    /// The small puppet.
    #[must_use]
    pub fn small() -> Self {
        Self::new(PuppetSize::SMALL)
    }

    /// The parts of the deform graph.
    #[must_use]
    pub fn graph(&self) -> DeformGraph<'_> {
        DeformGraph {
            template: &self.template,
            controllers: &self.controllers,
            mesh: &self.mesh,
            attributes: &self.attributes,
        }
    }

    /// The larger Gaussians first; each one's heir is the one before it in the order.
    fn importance(&self) -> Importance {
        let order = Importance::by_size(&self.gaussians).order().to_vec();
        let mut heirs = order.clone();
        for pair in order.windows(2) {
            heirs[pair[1] as usize] = pair[0];
        }
        heirs[order[0] as usize] = order[0];
        Importance::new(order, Some(heirs), self.gaussians.len()).expect("an order")
    }

    /// The puppet as an avatar, ready to be saved.
    ///
    /// # Panics
    /// If the networks do not fit: a bug here.
    #[must_use]
    pub fn avatar(&self) -> Avatar {
        Avatar {
            name: "puppet".into(),
            provenance: "made in code by the tests".into(),
            licence: "CC0-1.0".into(),
            skeleton: self.skeleton.clone(),
            template: self.template.clone(),
            gaussians: self.gaussians.clone(),
            importance: Some(self.importance()),
            controllers: self.controllers.clone(),
            expression_basis: ExpressionBasis::FLAME_2020,
            expressions: self.expressions.clone(),
            deform_graph: self
                .graph()
                .to_onnx(GraphParts::Whole)
                .expect("the networks fit"),
            pose_range: None,
            compiled: Vec::new(),
            signer: None,
            report: serde_json::json!({ "vertices": self.template.vertices().len(), "error_mm": 0.1 + 0.2 }),
        }
    }
}

fn expressions() -> Expressions {
    let preset = |slot: usize, jaw: f32| {
        let mut coefficients = [0.0; EXPRESSION];
        coefficients[slot] = 1.5;
        ExpressionPreset { coefficients, jaw }
    };
    [
        ("smile", preset(0, 0.0)),
        ("blink", preset(1, 0.0)),
        ("a", preset(2, 0.3)),
    ]
    .map(|(name, preset)| (name.to_owned(), preset))
    .into()
}

/// Indices of a puppet fit 32 bits.
fn index(at: usize) -> u32 {
    u32::try_from(at).expect("a puppet is small")
}
