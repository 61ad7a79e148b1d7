//! F_attr of a scanned person: light by pose. The scan's colours hold the light that fell on the person as it stood; where an arm is lifted,
//! the flank below it sees more of the sky, and what the arm now covers sees less. How much of an even sky each place sees is computed on the
//! template, for some poses, relative to the scan's; the network learns the ratio.

use crate::RigError;
use crate::body::SkinRow;
use crate::body::posing::{posed_by_motion, skinned};
use glam::{DVec3, Vec3};
use rayon::prelude::*;
use reconstruct::Light;
use reconstruct::fit::{AttributeOptions, Residuals, fit_residuals, residuals};
use reconstruct::simulate::{Fabric, PoseSampler, Puppet, without_root};
use spmm3::networks::AttributeNetwork;
use spmm3::{
    ATTRIBUTES, BoundGaussians, Controllers, Expressions, MotionParams, SH_C0, Skeleton, Template,
    attribute,
};

/// Poses that it learns from.
const POSES: usize = 56;

/// Seed of the poses and of the random features.
const SEED: u64 = 11;

/// How much of the change of light is shown: the scan's own light is not known, and too little is less wrong than too much.
const STRENGTH: f32 = 0.75;

/// Bounds of the ratio of light between two poses: beyond them colours would be made up.
const RATIO: (f32, f32) = (0.6, 1.5);

/// Sizes of the network. Bases are most of a package's size.
const OPTIONS: AttributeOptions = AttributeOptions {
    bases: 3,
    hidden: 8,
    controller_ridge: 1e-2,
    basis_ridge: 1e-2,
};

/// The fitted network, and the Gaussians with colours such that the pose of the scan shows the scan's.
pub(super) struct Shaded {
    pub(super) network: AttributeNetwork,
    pub(super) gaussians: BoundGaussians,
}

/// A person as it is shaded.
pub(super) struct Sitter<'a> {
    pub(super) template: &'a Template,
    /// The template's skinning weights, `[N_v]`.
    pub(super) weights: &'a [SkinRow],
    pub(super) skeleton: &'a Skeleton,
    pub(super) controllers: &'a Controllers,
    pub(super) gaussians: &'a BoundGaussians,
    /// The triangles that shade: the outer skin.
    pub(super) casters: &'a [[u32; 3]],
    pub(super) scan_motion: &'a MotionParams,
}

/// The ratios of light at the vertices in the training poses.
struct Ratios<'a> {
    gaussians: &'a BoundGaussians,
    /// `[poses][N_v]`, less 1.
    change: Vec<Vec<f32>>,
}

impl Residuals for Ratios<'_> {
    fn gaussians(&self) -> usize {
        self.gaussians.len()
    }

    fn residual(&self, gaussian: usize, pose: usize) -> [f32; ATTRIBUTES] {
        let mut residual = [0.0; ATTRIBUTES];
        let corners = self.gaussians.corners().get(gaussian);
        let barycentric = self.gaussians.barycentrics().get(gaussian);
        let change = self.change.get(pose);
        let (Some(corners), Some([v, w]), Some(change)) = (corners, barycentric, change) else {
            return residual;
        };
        let at = |corner: usize| change.get(corners[corner] as usize).copied().unwrap_or(0.0);
        let change = at(0) * (1.0 - v - w) + at(1) * v + at(2) * w;
        let planes = self.gaussians.attributes();
        let count = self.gaussians.len();
        for plane in attribute::COLOUR {
            let own = planes.get(plane * count + gaussian).copied().unwrap_or(0.0);
            // A display value and its coefficient: c = 0.5 + SH_C0 k.
            residual[plane] = change * (0.5 / SH_C0 + own);
        }
        residual
    }
}

impl Sitter<'_> {
    /// Fits the network.
    pub(super) fn shaded(&self, expressions: &Expressions) -> Result<Shaded, RigError> {
        let light = Light::sky(self.template, self.casters.to_vec());
        let mut sampler = PoseSampler::new(SEED, expressions, 0);
        let mut poses = vec![without_root(self.scan_motion), MotionParams::default()];
        poses.extend((0..POSES).map(|_| sampler.sample()));
        let vertices: Vec<DVec3> = (self.template.vertices().iter())
            .map(|vertex| vertex.as_dvec3())
            .collect();
        let brightness: Vec<Vec<f32>> = poses
            .par_iter()
            .map(|motion| {
                let maps = posed_by_motion(self.skeleton, &without_root(motion));
                let posed: Vec<Vec3> = (skinned(self.weights, &maps, &vertices).iter())
                    .map(|vertex| vertex.as_vec3())
                    .collect();
                let factors = light.factors(&posed);
                factors.iter().map(|f| f.x).collect()
            })
            .collect();
        let scan = brightness.first().cloned().unwrap_or_default();
        // The mouth's inside, eyeballs and things keep their colours.
        let mut outside = vec![false; self.template.vertices().len()];
        for corner in self.casters.iter().flatten() {
            if let Some(slot) = outside.get_mut(*corner as usize) {
                *slot = true;
            }
        }
        let change = brightness
            .iter()
            .map(|lit| {
                (lit.iter().zip(&scan).zip(&outside))
                    .map(|((lit, scan), outside)| {
                        if !outside {
                            return 0.0;
                        }
                        let ratio = (lit / scan.max(1e-3)).powf(STRENGTH);
                        ratio.clamp(RATIO.0, RATIO.1) - 1.0
                    })
                    .collect()
            })
            .collect();
        let wanted = Ratios {
            gaussians: self.gaussians,
            change,
        };
        let vertices = self.template.vertices().len();
        let puppet = Puppet {
            template: self.template.clone(),
            skeleton: self.skeleton.clone(),
            fabric: vec![Fabric::Skin; vertices],
            looseness: vec![0.0; vertices],
            riders: Vec::new(),
            covered: Vec::new(),
            expressions: Vec::new(),
        };
        let fitted = fit_residuals(
            &puppet,
            self.controllers,
            &wanted,
            &poses,
            OPTIONS,
            SEED,
            || (),
        )?;
        let network = fitted.network;
        let gaussians = self.corrected(&network)?;
        Ok(Shaded { network, gaussians })
    }

    /// The Gaussians less what the network adds in the pose of the scan.
    fn corrected(&self, network: &AttributeNetwork) -> Result<BoundGaussians, RigError> {
        let full = network.bases.dequantise();
        let motion = without_root(self.scan_motion);
        let added = residuals(network, &full, self.controllers, &motion);
        let mut attributes = self.gaussians.attributes().to_vec();
        for (value, added) in attributes.iter_mut().zip(added) {
            *value -= added;
        }
        let corrected = BoundGaussians::new(
            self.template,
            self.gaussians.triangles().to_vec(),
            self.gaussians.barycentrics().to_vec(),
            attributes,
        )?;
        Ok(corrected.quantised())
    }
}
