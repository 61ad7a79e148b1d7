//! The puppet as the tests of this program pose it.

use renderer_splat::posing::{BoundMesh, Deformation, DenseParts, NetworkParts, PosedInput};
use spmm3::networks::Dense;
use spmm3::{MotionParams, SkinningTransforms};
use std::sync::LazyLock;
use synthetic_person::reference::{self as reference, V3};
use synthetic_person::{Puppet, Random};
use test_support::bound_person::bound_mesh;

/// Building the puppet takes longer than a test.
pub(crate) static PUPPET: LazyLock<Puppet> = LazyLock::new(Puppet::small);

/// The puppet as a mesh.
pub(crate) fn mesh_of(puppet: &Puppet) -> BoundMesh {
    bound_mesh(
        &puppet.template,
        &puppet.gaussians,
        &puppet.controllers,
        &puppet.attributes.bases,
    )
}

/// The same with the puppet's networks, for a device that runs them.
pub(crate) fn driven_mesh_of(puppet: &Puppet) -> BoundMesh {
    fn dense(layer: &Dense) -> DenseParts<'_> {
        DenseParts {
            weights: layer.weights(),
            bias: layer.bias(),
        }
    }
    let (mesh, attributes) = (&puppet.mesh, &puppet.attributes);
    let planes = (0..3).flat_map(|axis| puppet.template.vertices().iter().map(move |v| v[axis]));
    let rest: Vec<f32> = (planes.zip(mesh.decoder.mean()))
        .map(|(rest, mean)| rest + mean)
        .collect();
    let networks = NetworkParts {
        first: dense(&mesh.first),
        second: dense(&mesh.second),
        code: dense(&mesh.code),
        fields: mesh.decoder.values(),
        scales: mesh.decoder.scales(),
        unit: mesh.decoder.unit(),
        rest: &rest,
        controllers_first: dense(&attributes.first),
        controllers_second: &attributes.second,
        controllers_bias: &attributes.second_bias,
    };
    let driven = mesh_of(puppet).with_networks(&networks);
    driven.expect("networks of one puppet")
}

/// The networks' results for one motion, by the reference, rounded to single precision.
pub(crate) struct Pose {
    pub(crate) canonical: Vec<f32>,
    pub(crate) skinning: SkinningTransforms,
    pub(crate) potentials: Vec<f32>,
    /// The motion that they are of.
    pub(crate) parameters: Vec<f32>,
    pub(crate) root: [f32; 3],
}

#[allow(
    clippy::cast_possible_truncation,
    reason = "networks give single precision"
)]
impl Pose {
    pub(crate) fn of(puppet: &Puppet, motion: &MotionParams) -> Self {
        let offsets = reference::mesh_offsets(&puppet.mesh, motion.values());
        let vertices = puppet.template.vertices();
        let canonical = (0..3)
            .flat_map(|axis| {
                let moved = vertices.iter().zip(&offsets);
                moved.map(move |(rest, offset)| (f64::from(rest[axis]) + offset[axis]) as f32)
            })
            .collect();
        let controllers = puppet.controllers.vertices().len();
        let potentials = reference::potentials(&puppet.attributes, controllers, motion.values());
        let mut skinning = SkinningTransforms::default();
        let joints = puppet.skeleton.pose(motion);
        puppet.skeleton.skinning(&joints, &mut skinning);
        Self {
            canonical,
            skinning,
            potentials: potentials.iter().flatten().map(|u| *u as f32).collect(),
            parameters: motion.values().to_vec(),
            root: motion.root_translation.to_array(),
        }
    }

    /// A pose that no other test has.
    pub(crate) fn random(puppet: &Puppet, seed: u64) -> Self {
        Self::of(puppet, &Random::new(seed).motion(0.6))
    }

    pub(crate) fn input(&self) -> PosedInput<'_> {
        PosedInput {
            deformation: Deformation::Computed {
                canonical_vertices: &self.canonical,
                potentials: &self.potentials,
            },
            skinning: &self.skinning.0,
            root: self.root,
        }
    }

    /// What the device computes the same from.
    pub(crate) fn driven(&self) -> PosedInput<'_> {
        PosedInput {
            deformation: Deformation::Parameters(&self.parameters),
            ..self.input()
        }
    }

    /// The skinned mesh, in f64.
    pub(crate) fn skinned(&self, puppet: &Puppet) -> Vec<V3> {
        let count = puppet.template.vertices().len();
        let shape: Vec<V3> = (0..count)
            .map(|v| [0, 1, 2].map(|axis| f64::from(self.canonical[axis * count + v])))
            .collect();
        let matrices: Vec<reference::Rigid> = (0..spmm3::JOINTS)
            .map(|joint| {
                let at = |column: usize, row: usize| {
                    f64::from(self.skinning.0[(3 * column + row) * spmm3::JOINTS + joint])
                };
                reference::Rigid {
                    rotation: [0, 1, 2].map(|row| [0, 1, 2].map(|column| at(column, row))),
                    translation: [0, 1, 2].map(|row| at(3, row)),
                }
            })
            .collect();
        reference::skin(&puppet.template, &shape, &matrices)
    }

    /// Residuals of every Gaussian, in f64.
    pub(crate) fn residuals(&self, puppet: &Puppet) -> Vec<[f64; 14]> {
        let bases = &puppet.attributes.bases;
        let rows = self.potentials.chunks_exact(bases.bases());
        let potentials: Vec<Vec<f64>> = rows
            .map(|row| row.iter().map(|u| f64::from(*u)).collect())
            .collect();
        reference::residuals_of(bases, &puppet.controllers, &potentials)
    }
}
