//! Skinning as the simulation needs it: blended matrices per vertex, their inverse, and the volume that linear blending
//! loses at elbows, knees and shoulders.

use glam::{Affine3A, DMat3, DVec3, Quat, Vec3, Vec4};
use rayon::prelude::*;
use spmm3::{Joint, SkinWeights, SkinningTransforms, Template};

/// Share of the way from linear blending to dual quaternions that flesh and cloth really take: the whole way bulges.
const VOLUME_SHARE: f32 = 0.7;

/// Largest stretch the inverse may undo. Where linear blending collapses (a wrung wrist) the inverse would explode.
const MAX_INVERSE_GAIN: f64 = 4.0;

/// One pose's skinning: for each vertex the blended map from canonical to posed space, as the deform graph computes it.
#[derive(Debug, Clone)]
pub struct PosedSkin {
    posed_from_canonical: Vec<Affine3A>,
    joints: Vec<(Quat, Quat)>,
}

impl PosedSkin {
    /// Blends the joints' transforms by the template's weights.
    #[must_use]
    pub fn new(template: &Template, transforms: &SkinningTransforms) -> Self {
        let matrices: Vec<Affine3A> = Joint::ALL
            .iter()
            .map(|joint| transforms.posed_from_rest(*joint))
            .collect();
        let posed_from_canonical = template
            .skin()
            .iter()
            .map(|skin| {
                let mut sum = [0.0f32; 12];
                for (joint, weight) in skin.joints.iter().zip(skin.weights) {
                    let matrix = matrices[usize::from(*joint)].to_cols_array();
                    for (s, m) in sum.iter_mut().zip(matrix) {
                        *s += weight * m;
                    }
                }
                Affine3A::from_cols_array(&sum)
            })
            .collect();
        let joints = matrices.iter().map(dual_quaternion).collect();
        Self {
            posed_from_canonical,
            joints,
        }
    }

    /// Linear blend skinning of one canonical point that moves with `vertex`.
    #[must_use]
    pub fn linear(&self, vertex: usize, canonical: Vec3) -> Vec3 {
        self.posed_from_canonical[vertex].transform_point3(canonical)
    }

    /// Linear blend skinning plus most of the volume that dual quaternions (Kavan et al. 2007) keep.
    #[must_use]
    pub fn volumetric(&self, vertex: usize, skin: &SkinWeights, canonical: Vec3) -> Vec3 {
        let linear = self.linear(vertex, canonical);
        linear + (self.rigid(skin, canonical) - linear) * VOLUME_SHARE
    }

    /// Every vertex of `canonical`, with volume kept.
    #[must_use]
    pub fn pose_all(&self, template: &Template, canonical: &[Vec3]) -> Vec<Vec3> {
        canonical
            .iter()
            .zip(template.skin())
            .enumerate()
            .map(|(v, (point, skin))| self.volumetric(v, skin, *point))
            .collect()
    }

    /// Every vertex of `canonical` by linear blending alone, as the deform graph does it.
    #[must_use]
    pub fn pose_linear(&self, canonical: &[Vec3]) -> Vec<Vec3> {
        canonical
            .par_iter()
            .enumerate()
            .map(|(v, point)| self.linear(v, *point))
            .collect()
    }

    /// The canonical point that linear blending would carry to `posed`: Tikhonov-damped where the blend is nearly
    /// singular, so that the answer stays near `rest` instead of flying off.
    #[must_use]
    pub fn canonical(&self, vertex: usize, posed: Vec3, rest: Vec3) -> Vec3 {
        let map = &self.posed_from_canonical[vertex];
        let matrix = DMat3::from_cols(
            DVec3::from(Vec3::from(map.matrix3.x_axis)),
            DVec3::from(Vec3::from(map.matrix3.y_axis)),
            DVec3::from(Vec3::from(map.matrix3.z_axis)),
        );
        let missing = DVec3::from(posed) - DVec3::from(map.transform_point3(rest));
        let inverse = matrix.inverse();
        let gain = inverse
            .to_cols_array()
            .iter()
            .fold(0.0f64, |a, b| a.max(b.abs()));
        let step = if gain.is_finite() && gain <= MAX_INVERSE_GAIN {
            inverse * missing
        } else {
            let square = matrix.transpose() * matrix
                + DMat3::from_diagonal(DVec3::splat(1.0 / MAX_INVERSE_GAIN.powi(2)));
            square.inverse() * (matrix.transpose() * missing)
        };
        rest + step.as_vec3()
    }

    fn rigid(&self, skin: &SkinWeights, point: Vec3) -> Vec3 {
        let heaviest = (0..skin.weights.len())
            .max_by(|a, b| skin.weights[*a].total_cmp(&skin.weights[*b]))
            .map_or(0, |slot| usize::from(skin.joints[slot]));
        let reference = self.joints[heaviest].0;
        let (mut real, mut dual) = (Vec4::ZERO, Vec4::ZERO);
        for (joint, weight) in skin.joints.iter().zip(skin.weights) {
            let (r, d) = self.joints[usize::from(*joint)];
            let signed = if r.dot(reference) < 0.0 {
                -weight
            } else {
                weight
            };
            real += Vec4::from(r) * signed;
            dual += Vec4::from(d) * signed;
        }
        let norm = real.length().max(1e-6);
        let (real, dual) = (Quat::from_vec4(real / norm), Quat::from_vec4(dual / norm));
        let translation = (dual * real.conjugate()) * 2.0;
        real * point + Vec3::new(translation.x, translation.y, translation.z)
    }
}

fn dual_quaternion(rigid: &Affine3A) -> (Quat, Quat) {
    let real = Quat::from_mat3a(&rigid.matrix3).normalize();
    let t: Vec3 = rigid.translation.into();
    let dual = (Quat::from_xyzw(t.x, t.y, t.z, 0.0) * real) * 0.5;
    (real, dual)
}
