//! Calibrated cameras of the `Pose2Sim` demonstration: its `.qca.txt` file, undistortion, triangulation. In f64.

use anyhow::{Context, bail};
use glam::{DMat3, DVec2, DVec3};
use nalgebra::DMatrix;
use std::path::Path;

/// One calibrated camera. Its axes are x right, y down, z away.
#[derive(Debug, Clone)]
pub(super) struct Calibrated {
    pub(super) camera_from_room: DMat3,
    pub(super) translation: DVec3,
    pub(super) focal: DVec2,
    pub(super) centre: DVec2,
    /// Radial k1, k2 and tangential p1, p2 (Brown and Conrady).
    distortion: [f64; 4],
}

impl Calibrated {
    /// All cameras of a Qualisys calibration file, in its order. Its lengths are millimetres and 64ths of pixels, its cameras look along
    /// -z with y up.
    pub(super) fn read(path: &Path) -> anyhow::Result<Vec<Self>> {
        let text = std::fs::read_to_string(path)
            .with_context(|| format!("cannot read {}", path.display()))?;
        let wrong = || format!("{} is no calibration as Qualisys writes it", path.display());
        let document = roxmltree::Document::parse(&text).with_context(wrong)?;
        let cameras: Vec<Self> = document
            .descendants()
            .filter(|node| node.has_tag_name("camera"))
            .map(|node| Self::of(node).with_context(wrong))
            .collect::<anyhow::Result<_>>()?;
        if cameras.is_empty() {
            bail!("{}", wrong());
        }
        Ok(cameras)
    }

    fn of(node: roxmltree::Node<'_, '_>) -> Option<Self> {
        let child = |name: &str| node.children().find(|node| node.has_tag_name(name));
        let (transform, intrinsic) = (child("transform")?, child("intrinsic")?);
        let number = |node: &roxmltree::Node<'_, '_>, name: &str| -> Option<f64> {
            node.attribute(name)?.parse().ok()
        };
        let pixels = |name: &str| Some(number(&intrinsic, name)? / 64.0);
        // r11, r12, r13 are the file's first row; its rotation leads from the camera to the room once transposed.
        let mut rows = [DVec3::ZERO; 3];
        for (row, k) in rows.iter_mut().zip(1..) {
            for axis in 0..3 {
                row[axis] = number(&transform, &format!("r{k}{}", axis + 1))?;
            }
        }
        let room_from_camera = DMat3::from_cols(rows[0], rows[1], rows[2]);
        let at = DVec3::new(
            number(&transform, "x")?,
            number(&transform, "y")?,
            number(&transform, "z")?,
        ) / 1e3;
        let to_sight = DMat3::from_diagonal(DVec3::new(1.0, -1.0, -1.0));
        let camera_from_room = to_sight * room_from_camera.transpose();
        Some(Self {
            camera_from_room,
            translation: -(camera_from_room * at),
            focal: DVec2::new(pixels("focalLengthU")?, pixels("focalLengthV")?),
            centre: DVec2::new(pixels("centerPointU")?, pixels("centerPointV")?),
            distortion: [
                pixels("radialDistortion1")?,
                pixels("radialDistortion2")?,
                pixels("tangentalDistortion1")?,
                pixels("tangentalDistortion2")?,
            ],
        })
    }

    /// A point of the room in the camera's axes, metres.
    pub(super) fn sight(&self, point: DVec3) -> DVec3 {
        self.camera_from_room * point + self.translation
    }

    /// Where the ray through a pixel meets z = 1, without the lens' distortion.
    fn undistorted(&self, pixel: DVec2) -> DVec2 {
        let [k1, k2, p1, p2] = self.distortion;
        let distorted = (pixel - self.centre) / self.focal;
        let mut at = distorted;
        // The distortion is small: a fixed-point iteration converges.
        for _ in 0..8 {
            let r2 = at.length_squared();
            let radial = 1.0 + k1 * r2 + k2 * r2 * r2;
            let tangential = DVec2::new(
                2.0 * p1 * at.x * at.y + p2 * (r2 + 2.0 * at.x * at.x),
                p1 * (r2 + 2.0 * at.y * at.y) + 2.0 * p2 * at.x * at.y,
            );
            at = (distorted - tangential) / radial;
        }
        at
    }
}

/// The point of the room that the cameras saw at these pixels with these confidences, by linear triangulation, reweighted where a camera is
/// far from the others.
pub(super) fn triangulate(cameras: &[Calibrated], seen: &[(DVec2, f64)]) -> Option<DVec3> {
    /// Pixels at which a camera's weight is halved.
    const DOUBTFUL: f64 = 12.0;
    let rays: Vec<DVec2> = (cameras.iter().zip(seen))
        .map(|(camera, (pixel, _))| camera.undistorted(*pixel))
        .collect();
    let mut weights: Vec<f64> = seen
        .iter()
        .map(|(_, confidence)| confidence + 0.01)
        .collect();
    let mut point = None;
    for _ in 0..4 {
        let mut rows = DMatrix::<f64>::zeros(2 * cameras.len(), 4);
        for (k, ((camera, ray), weight)) in cameras.iter().zip(&rays).zip(&weights).enumerate() {
            for (axis, along) in [ray.x, ray.y].into_iter().enumerate() {
                for column in 0..4 {
                    let element = |row: usize| match column {
                        3 => camera.translation[row],
                        _ => camera.camera_from_room.col(column)[row],
                    };
                    rows[(2 * k + axis, column)] = weight * (along * element(2) - element(axis));
                }
            }
        }
        let svd = rows.svd(false, true);
        let v_t = svd.v_t?;
        let least = v_t.row(v_t.nrows() - 1);
        let found = DVec3::new(least[0], least[1], least[2]) / least[3];
        if !found.is_finite() {
            return None;
        }
        point = Some(found);
        for (((camera, ray), weight), (_, confidence)) in
            cameras.iter().zip(&rays).zip(&mut weights).zip(seen)
        {
            let sight = camera.sight(found);
            let error = (sight.truncate() / sight.z - *ray).length() * camera.focal.x;
            *weight = (confidence + 0.01) / (1.0 + (error / DOUBTFUL).powi(2));
        }
    }
    point
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_point_that_cameras_see_is_found_again() {
        let point = DVec3::new(0.2, 1.1, -0.3);
        let cameras: Vec<Calibrated> = [0.0, 1.4, 2.9]
            .map(|angle: f64| {
                let camera_from_room = DMat3::from_rotation_x(0.1) * DMat3::from_rotation_y(angle);
                Calibrated {
                    camera_from_room,
                    translation: DVec3::new(0.1, 0.2, 4.0),
                    focal: DVec2::new(900.0, 905.0),
                    centre: DVec2::new(540.0, 960.0),
                    distortion: [-0.08, 0.02, 0.001, -0.002],
                }
            })
            .to_vec();
        let seen: Vec<(DVec2, f64)> = (cameras.iter())
            .map(|camera| {
                let sight = camera.sight(point);
                let at = sight.truncate() / sight.z;
                let [k1, k2, p1, p2] = camera.distortion;
                let (x, y, r2) = (at.x, at.y, at.length_squared());
                let radial = 1.0 + k1 * r2 + k2 * r2 * r2;
                let bent = DVec2::new(
                    x * radial + 2.0 * p1 * x * y + p2 * (r2 + 2.0 * x * x),
                    y * radial + p1 * (r2 + 2.0 * y * y) + 2.0 * p2 * x * y,
                );
                (bent * camera.focal + camera.centre, 1.0)
            })
            .collect();
        let found = triangulate(&cameras, &seen).expect("a point");
        assert!(found.distance(point) < 1e-6, "{found} for {point}");
    }
}
