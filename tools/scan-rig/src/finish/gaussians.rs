//! Gaussians of a scan on the triangles of a mesh in the same pose, as the template's.

use crate::bind::carried::shares;
use crate::scan::Scan;
use glam::{Quat, Vec3};
use spmm3::{ATTRIBUTES, BoundGaussians, GaussianSet, PersonError, SH_C0, Template, attribute};

/// The thinnest that a Gaussian is stored, metres: renderers widen it to a pixel anyway.
const THINNEST: f32 = 1e-5;

/// Opacities are stored as logits: of these at least and at most.
const OPACITY: (f32, f32) = (1e-3, 0.999);

/// Binds the scan's Gaussians to `triangles` of `posed`, the mesh in the scan's pose.
///
/// # Errors
/// If counts differ, or a number is not finite.
pub(super) fn bind(
    posed: &Template,
    scan: &Scan,
    triangles: &[u32],
) -> Result<BoundGaussians, PersonError> {
    let faces = posed.faces();
    let barycentrics = triangles
        .iter()
        .zip(&scan.positions)
        .map(|(triangle, position)| {
            let corners = faces.get(*triangle as usize).copied().unwrap_or_default();
            let at = |v: u32| {
                let known = posed.vertices().get(v as usize);
                known.copied().unwrap_or_default()
            };
            shares(*position, corners.map(at))
        })
        .collect();
    let set = GaussianSet {
        positions: scan.positions.clone(),
        rotations: scan.rotations.iter().map(upright).collect(),
        log_scales: scan
            .scales
            .iter()
            .map(|s| s.max(Vec3::splat(THINNEST)).map(f32::ln))
            .collect(),
        opacity_logits: scan
            .opacities
            .iter()
            .map(|o| {
                let o = o.clamp(OPACITY.0, OPACITY.1);
                (o / (1.0 - o)).ln()
            })
            .collect(),
        colours: scan.colours.iter().map(|c| (*c - 0.5) / SH_C0).collect(),
    };
    BoundGaussians::bind(posed, &set, triangles.to_vec(), barycentrics)
}

/// A unit quaternion, whatever it was.
fn upright(rotation: &Quat) -> Quat {
    let length = rotation.length_squared();
    if length.is_finite() && length > 1e-12 {
        rotation.normalize()
    } else {
        Quat::IDENTITY
    }
}

/// The Gaussians that `order` lists, in its order.
///
/// # Errors
/// If `order` names one that does not exist.
pub(super) fn reordered(
    template: &Template,
    bound: &BoundGaussians,
    order: &[usize],
) -> Result<BoundGaussians, PersonError> {
    let count = bound.len();
    let planes = bound.attributes();
    let attributes = (0..ATTRIBUTES)
        .flat_map(|plane| order.iter().map(move |i| planes[plane * count + i]))
        .collect();
    BoundGaussians::new(
        template,
        order.iter().map(|i| bound.triangles()[*i]).collect(),
        order.iter().map(|i| bound.barycentrics()[*i]).collect(),
        attributes,
    )
}

/// The same Gaussians grown to areas that are 4 to the power of `log2_growth` times as large, `[N_g]`. A scan's Gaussians are often long and
/// narrow, and longer ones would stand out of the body as spikes: each gets wider first, and longer only once it is round.
///
/// # Errors
/// None that its arguments could cause.
pub(super) fn grown(
    template: &Template,
    bound: &BoundGaussians,
    log2_growth: &[f32],
) -> Result<BoundGaussians, PersonError> {
    let count = bound.len();
    let mut attributes = bound.attributes().to_vec();
    for (at, growth) in log2_growth.iter().enumerate().take(count) {
        let mut planes: Vec<usize> = attribute::LOG_SCALE.collect();
        planes.sort_by(|a, b| attributes[b * count + at].total_cmp(&attributes[a * count + at]));
        let [long, wide] = [planes[0] * count + at, planes[1] * count + at];
        let area = 2.0 * growth * std::f32::consts::LN_2;
        let widened = area.clamp(0.0, attributes[long] - attributes[wide]);
        attributes[wide] += widened;
        for axis in [long, wide] {
            attributes[axis] += 0.5 * (area - widened);
        }
    }
    BoundGaussians::new(
        template,
        bound.triangles().to_vec(),
        bound.barycentrics().to_vec(),
        attributes,
    )
    .map(BoundGaussians::quantised)
}
