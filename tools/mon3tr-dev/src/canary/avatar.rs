//! The canary's avatar: a triangle with one Gaussian, the smallest package that a server takes. It is the same in every
//! run, so a server stores it once.

use glam::Vec3;
use spmm3::networks::{
    AttributeNetwork, DeformGraph, Dense, GraphParts, MeshNetwork, QuantisedBases, QuantisedDecoder,
};
use spmm3::{
    ATTRIBUTES, Avatar, BoundGaussians, Controllers, EdgeGraph, ExpressionBasis, Expressions,
    GaussianSet, INFLUENCES, JOINTS, NEIGHBOURS, PARAMS, PersonError, Skeleton, SkinWeights,
    Template,
};

/// Hidden units, bases and offset fields of its networks, each.
const SIZE: usize = 1;

/// Edge of the triangle and size of the Gaussian, metres.
const EDGE: f32 = 0.1;

/// Makes it.
pub(super) fn avatar() -> anyhow::Result<Avatar> {
    let skin = SkinWeights {
        joints: [0; INFLUENCES],
        weights: std::array::from_fn(|k| if k == 0 { 1.0 } else { 0.0 }),
    };
    let vertices = vec![Vec3::ZERO, Vec3::X * EDGE, Vec3::Y * EDGE];
    let template = Template::new(vertices, vec![[0, 1, 2]], vec![skin; 3])?;
    let mut at_rest = GaussianSet::zeroed(1);
    at_rest.log_scales = vec![Vec3::splat(EDGE.ln())];
    let gaussians =
        BoundGaussians::bind(&template, &at_rest, vec![0], vec![[0.3, 0.3]])?.quantised();
    let surface = EdgeGraph::new(&template, &[]);
    let seats = (0_u32..).take(NEIGHBOURS).collect();
    let controllers = Controllers::tie(&template, &surface, &gaussians, seats)?;
    let columns = 3 * template.vertices().len();
    let mesh = MeshNetwork {
        first: zeros(PARAMS, SIZE)?,
        second: zeros(SIZE, SIZE)?,
        code: zeros(SIZE, SIZE)?,
        decoder: QuantisedDecoder::quantise(SIZE, &vec![0.0; SIZE * columns], vec![0.0; columns])?,
    };
    let attributes = AttributeNetwork {
        first: zeros(PARAMS, NEIGHBOURS * SIZE)?,
        second: vec![Default::default(); NEIGHBOURS * SIZE * SIZE],
        second_bias: vec![0.0; NEIGHBOURS * SIZE],
        bases: QuantisedBases::quantise(SIZE, 1, &[0.0; ATTRIBUTES * SIZE])?,
    };
    let graph = DeformGraph {
        template: &template,
        controllers: &controllers,
        mesh: &mesh,
        attributes: &attributes,
    };
    Ok(Avatar {
        name: "canary".into(),
        provenance: "made by mon3tr-dev canary".into(),
        licence: "CC0-1.0".into(),
        skeleton: Skeleton::new([Vec3::ZERO; JOINTS])?,
        deform_graph: graph.to_onnx(GraphParts::Whole)?,
        template,
        gaussians,
        importance: None,
        controllers,
        expression_basis: ExpressionBasis::FLAME_2020,
        expressions: Expressions::default(),
        pose_range: None,
        compiled: Vec::new(),
        signer: None,
        report: serde_json::json!({}),
    })
}

fn zeros(inputs: usize, outputs: usize) -> Result<Dense, PersonError> {
    let weights = vec![0.0; inputs * outputs];
    Dense::new(inputs, outputs, &weights, vec![0.0; outputs])
}

#[cfg(test)]
mod tests {
    use super::avatar;
    use spmm3::Avatar;

    #[test]
    fn the_canarys_package_is_small_valid_and_the_same_each_time() {
        let bytes = || avatar().expect("an avatar").to_bytes().expect("a package");
        let package = bytes();
        assert!(package.len() < 32 << 10, "{} bytes", package.len());
        assert_eq!(package, bytes(), "a server would store each");
        let folder = tempfile::tempdir().expect("a folder");
        let file = folder.path().join("canary.m3a");
        std::fs::write(&file, package).expect("it is written");
        Avatar::load(&file).expect("it is one");
    }
}
