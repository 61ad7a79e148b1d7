//! All numbers of an avatar that are learnt, and in the same shape the derivatives of a loss by them.

use crate::error::{ModelError, check_count};
use spmm3::{ATTRIBUTES, PARAMS};

/// The sizes of an avatar, from which all shapes follow.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Sizes {
    /// Gaussians N_g.
    pub gaussians: usize,
    /// Template vertices N_v.
    pub vertices: usize,
    /// Controllers C of F_attr.
    pub controllers: usize,
    /// Hidden units H of one controller.
    pub controller_hidden: usize,
    /// Deformation bases B of every Gaussian.
    pub bases: usize,
    /// Hidden units of F_mesh's two layers.
    pub mesh_hidden: [usize; 2],
    /// Offset fields of F_mesh.
    pub rank: usize,
}

/// y = x W + b.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Layer {
    /// W, row-major [inputs, outputs].
    pub weights: Vec<f32>,
    /// b, `[outputs]`.
    pub bias: Vec<f32>,
}

/// What is learnt. Each array is one group for an optimiser, or several: the planes of [`Self::gaussians`] and [`Self::bases`] have units of
/// their own (`spmm3::attribute` says which is which).
///
/// As derivatives, [`Self::bases`] may be empty: then [`crate::Model::backward`] leaves them out, and [`crate::step_bases`] makes the step.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Parameters {
    /// Template Gaussians in their triangles' frames, row-major [14, N_g]: metres, quaternion, ln metres, logit, coefficients of spherical
    /// harmonics of degree 0.
    pub gaussians: Vec<f32>,
    /// Deformation bases of every Gaussian, row-major [14, B, N_g], in the units of the attributes.
    pub bases: Vec<f32>,
    /// F_attr's first layer, all controllers side by side: 215 -> C x H, followed by SiLU.
    pub controllers_first: Layer,
    /// F_attr's second layers, row-major [C, H, B].
    pub controllers_second: Vec<f32>,
    /// Their bias, row-major [C, B].
    pub controllers_second_bias: Vec<f32>,
    /// F_mesh's first layer, 215 -> hidden, followed by SiLU.
    pub mesh_first: Layer,
    /// F_mesh's second layer, hidden -> hidden, followed by SiLU.
    pub mesh_second: Layer,
    /// F_mesh's third layer, hidden -> rank: how much of each offset field a pose has.
    pub mesh_code: Layer,
    /// F_mesh's offset fields, row-major [rank, 3 N_v], planes x|y|z, metres.
    pub mesh_fields: Vec<f32>,
    /// Mean offset from the template, [3 N_v], planes x|y|z, metres.
    pub mesh_mean: Vec<f32>,
}

/// The name of [`Parameters::bases`] among the arrays.
const BASES: &str = "bases";

impl Parameters {
    /// All numbers 0, as derivatives are before they are added up.
    #[must_use]
    pub fn zeros(sizes: &Sizes) -> Self {
        let mut zeros = Self::default();
        for ((_, array), length) in zeros.arrays_mut().into_iter().zip(lengths(sizes)) {
            array.resize(length, 0.0);
        }
        zeros
    }

    /// How many numbers each array has, in the order of [`Self::arrays`]; `None` if a machine cannot count them. For sizes that a file says.
    #[must_use]
    pub fn lengths(sizes: &Sizes) -> Option<[usize; 14]> {
        let mut counted = [0; 14];
        for (count, factors) in counted.iter_mut().zip(factors(sizes)) {
            *count =
                (factors.into_iter()).try_fold(1usize, |product, of| product.checked_mul(of))?;
        }
        Some(counted)
    }

    /// Derivatives without those by the bases, which [`crate::step_bases`] computes as it goes.
    #[must_use]
    pub fn zeros_without_bases(sizes: &Sizes) -> Self {
        let mut zeros = Self::default();
        for ((name, array), length) in zeros.arrays_mut().into_iter().zip(lengths(sizes)) {
            if name != BASES {
                array.resize(length, 0.0);
            }
        }
        zeros
    }

    /// All arrays with their names, in a fixed order: for optimisers and for files.
    #[must_use]
    pub fn arrays(&self) -> [(&'static str, &[f32]); 14] {
        [
            ("gaussians", &self.gaussians),
            (BASES, &self.bases),
            ("controllers.first.weights", &self.controllers_first.weights),
            ("controllers.first.bias", &self.controllers_first.bias),
            ("controllers.second.weights", &self.controllers_second),
            ("controllers.second.bias", &self.controllers_second_bias),
            ("mesh.first.weights", &self.mesh_first.weights),
            ("mesh.first.bias", &self.mesh_first.bias),
            ("mesh.second.weights", &self.mesh_second.weights),
            ("mesh.second.bias", &self.mesh_second.bias),
            ("mesh.code.weights", &self.mesh_code.weights),
            ("mesh.code.bias", &self.mesh_code.bias),
            ("mesh.fields", &self.mesh_fields),
            ("mesh.mean", &self.mesh_mean),
        ]
    }

    /// As [`Self::arrays`], to write.
    pub fn arrays_mut(&mut self) -> [(&'static str, &mut Vec<f32>); 14] {
        [
            ("gaussians", &mut self.gaussians),
            (BASES, &mut self.bases),
            (
                "controllers.first.weights",
                &mut self.controllers_first.weights,
            ),
            ("controllers.first.bias", &mut self.controllers_first.bias),
            ("controllers.second.weights", &mut self.controllers_second),
            ("controllers.second.bias", &mut self.controllers_second_bias),
            ("mesh.first.weights", &mut self.mesh_first.weights),
            ("mesh.first.bias", &mut self.mesh_first.bias),
            ("mesh.second.weights", &mut self.mesh_second.weights),
            ("mesh.second.bias", &mut self.mesh_second.bias),
            ("mesh.code.weights", &mut self.mesh_code.weights),
            ("mesh.code.bias", &mut self.mesh_code.bias),
            ("mesh.fields", &mut self.mesh_fields),
            ("mesh.mean", &mut self.mesh_mean),
        ]
    }

    /// Sets all numbers to 0.
    pub fn clear(&mut self) {
        for (_, array) in self.arrays_mut() {
            array.fill(0.0);
        }
    }

    /// Refuses arrays of other shapes. `without_bases`: those of the bases may be empty.
    pub(crate) fn check(&self, sizes: &Sizes, without_bases: bool) -> Result<(), ModelError> {
        let expected = lengths(sizes);
        for ((name, array), expected) in self.arrays().into_iter().zip(expected) {
            if name == BASES && without_bases && array.is_empty() {
                continue;
            }
            check_count(name, array.len(), expected)?;
        }
        Ok(())
    }
}

/// The arrays' lengths, in the order of [`Parameters::arrays`].
fn lengths(sizes: &Sizes) -> [usize; 14] {
    factors(sizes).map(|factors| factors.into_iter().product())
}

/// The factors of the arrays' lengths.
fn factors(sizes: &Sizes) -> [[usize; 3]; 14] {
    let Sizes {
        gaussians,
        vertices,
        controllers,
        controller_hidden: hidden,
        bases,
        mesh_hidden: [first, second],
        rank,
    } = *sizes;
    [
        [ATTRIBUTES, gaussians, 1],
        [ATTRIBUTES, bases, gaussians],
        [PARAMS, controllers, hidden],
        [controllers, hidden, 1],
        [controllers, hidden, bases],
        [controllers, bases, 1],
        [PARAMS, first, 1],
        [first, 1, 1],
        [first, second, 1],
        [second, 1, 1],
        [second, rank, 1],
        [rank, 1, 1],
        [rank, 3, vertices],
        [3, vertices, 1],
    ]
}
