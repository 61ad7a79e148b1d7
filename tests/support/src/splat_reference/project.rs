//! One Gaussian as one camera sees it: EWA projection as the public code of 3DGS does it (Kerbl et al., 2023), or with
//! the filter of Mip-Splatting (Yu et al., 2024, section 5.2).

use std::ops::RangeInclusive;

use glam::Affine3A;
use renderer_splat::camera::Camera;
use renderer_splat::gaussian::Gaussian;
use renderer_splat::options::Filter;
use splat_scene::Scene;

use super::harmonics::{ORDERS, real_harmonics};

/// Less is not drawn.
pub(super) const ALPHA_CUT: f64 = 1.0 / 255.0;
/// Nothing is more opaque.
pub(super) const ALPHA_MOST: f64 = 0.99;

type Vec3 = [f64; 3];
type Mat3 = [Vec3; 3];

/// A Gaussian as it looks from one place, world space.
pub(super) struct Ellipsoid {
    position: Vec3,
    /// Columns: own axes, each as long as its standard deviation.
    axes: Mat3,
    opacity: f64,
    colour: Vec3,
}

/// A Gaussian on the picture.
pub(super) struct Projected {
    pub(super) depth: f64,
    pub(super) mean: [f64; 2],
    /// a, b, c of q = a dx^2 + 2 b dx dy + c dy^2.
    pub(super) inverse_covariance: [f64; 3],
    pub(super) opacity: f64,
    pub(super) colour: Vec3,
    pub(super) columns: RangeInclusive<usize>,
    pub(super) rows: RangeInclusive<usize>,
}

fn product(a: &Mat3, b: &Mat3) -> Mat3 {
    std::array::from_fn(|i| std::array::from_fn(|j| (0..3).map(|k| a[i][k] * b[k][j]).sum()))
}

fn transposed(a: &Mat3) -> Mat3 {
    std::array::from_fn(|i| std::array::from_fn(|j| a[j][i]))
}

fn rotation(quaternion: [f32; 4]) -> Mat3 {
    let [x, y, z, w] = quaternion.map(f64::from);
    [
        [
            1.0 - 2.0 * (y * y + z * z),
            2.0 * (x * y - z * w),
            2.0 * (x * z + y * w),
        ],
        [
            2.0 * (x * y + z * w),
            1.0 - 2.0 * (x * x + z * z),
            2.0 * (y * z - x * w),
        ],
        [
            2.0 * (x * z - y * w),
            2.0 * (y * z + x * w),
            1.0 - 2.0 * (x * x + y * y),
        ],
    ]
}

fn scaled(turn: &Mat3, scale: Vec3) -> Mat3 {
    std::array::from_fn(|i| std::array::from_fn(|j| turn[i][j] * scale[j]))
}

impl From<&Gaussian> for Ellipsoid {
    fn from(gaussian: &Gaussian) -> Self {
        Self {
            position: gaussian.position.map(f64::from),
            axes: scaled(&rotation(gaussian.rotation), gaussian.scale.map(f64::from)),
            opacity: f64::from(gaussian.opacity),
            colour: gaussian.colour.map(f64::from),
        }
    }
}

impl Ellipsoid {
    /// The same, turned and shifted.
    pub(super) fn placed(self, to_from: &Affine3A) -> Self {
        let columns = to_from.matrix3.to_cols_array_2d();
        let turn = transposed(&columns.map(|column| column.map(f64::from)));
        let shift = to_from.translation.to_array().map(f64::from);
        let turned = |axis: usize| {
            (0..3)
                .map(|k| turn[axis][k] * self.position[k])
                .sum::<f64>()
        };
        Self {
            position: std::array::from_fn(|axis| turned(axis) + shift[axis]),
            axes: product(&turn, &self.axes),
            ..self
        }
    }

    /// One of a scene's Gaussians, with the colour it has from `eye`.
    pub(super) fn of_scene(scene: &Scene, index: usize, eye: Vec3) -> Self {
        let position = scene.positions()[index].map(f64::from);
        let way: Vec3 = std::array::from_fn(|axis| position[axis] - eye[axis]);
        let length = way.iter().map(|part| part * part).sum::<f64>().sqrt();
        let basis = real_harmonics(way.map(|part| part / length));
        let more = scene.rest_coefficients();
        debug_assert!(more < ORDERS, "at most degree 3");
        let rest = &scene.sh_rest()[3 * more * index..3 * more * (index + 1)];
        let colour = std::array::from_fn(|channel| {
            let constant = f64::from(scene.colours()[index][channel]) * basis[0];
            let others = rest.chunks_exact(3).zip(&basis[1..]);
            let others = others.map(|(rgb, basis)| f64::from(rgb[channel]) * basis);
            0.5 + constant + others.sum::<f64>()
        });
        Self {
            position,
            axes: scaled(
                &rotation(scene.rotations()[index]),
                scene.log_scales()[index].map(|log| f64::from(log).exp()),
            ),
            opacity: f64::from(scene.opacities()[index]),
            colour,
        }
    }
}

/// Where a camera's eye is in the world: -R^T t.
pub(super) fn eye(camera: &Camera) -> Vec3 {
    let (turn, offset) = (
        camera.camera_from_world.matrix3,
        camera.camera_from_world.translation,
    );
    std::array::from_fn(|axis| {
        -(0..3)
            .map(|row| f64::from(turn.col(axis)[row]) * f64::from(offset[row]))
            .sum::<f64>()
    })
}

/// The pixels of one axis whose centres lie within `mean +- reach`.
#[expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "clamped first"
)]
#[expect(clippy::cast_precision_loss, reason = "pixel counts are small")]
fn pixels_within(mean: f64, reach: f64, count: usize) -> Option<RangeInclusive<usize>> {
    let first = (mean - reach - 0.5).ceil().max(0.0);
    let last = (mean + reach - 0.5).floor().min(count as f64 - 1.0);
    (first <= last).then_some(first as usize..=last as usize)
}

/// Nothing where no pixel can have an alpha of 1/255.
pub(super) fn project(from: &Ellipsoid, camera: &Camera, filter: Filter) -> Option<Projected> {
    // OpenXR's camera (y up, looking along -z) to the image's frame (y down, z forward).
    let flip = [1.0, -1.0, -1.0];
    let view: Mat3 = std::array::from_fn(|row| {
        std::array::from_fn(|column| {
            flip[row] * f64::from(camera.camera_from_world.matrix3.col(column)[row])
        })
    });
    let t: Vec3 = std::array::from_fn(|row| {
        let turned: f64 = (0..3)
            .map(|column| view[row][column] * from.position[column])
            .sum();
        turned + flip[row] * f64::from(camera.camera_from_world.translation[row])
    });
    if t[2] <= f64::from(camera.near) {
        return None;
    }
    let (fx, fy) = (f64::from(camera.fx), f64::from(camera.fy));
    let (cx, cy) = (f64::from(camera.cx), f64::from(camera.cy));
    let (width, height) = (f64::from(camera.width), f64::from(camera.height));

    let half_tan = [0.5 * width / fx, 0.5 * height / fy];
    let x = (t[0] / t[2]).clamp(
        -cx / fx - 0.3 * half_tan[0],
        (width - cx) / fx + 0.3 * half_tan[0],
    ) * t[2];
    let y = (t[1] / t[2]).clamp(
        -cy / fy - 0.3 * half_tan[1],
        (height - cy) / fy + 0.3 * half_tan[1],
    ) * t[2];
    let jacobian: Mat3 = [
        [fx / t[2], 0.0, -fx * x / (t[2] * t[2])],
        [0.0, fy / t[2], -fy * y / (t[2] * t[2])],
        [0.0; 3],
    ];
    let covariance_3d = product(&from.axes, &transposed(&from.axes));
    let image_from_world = product(&jacobian, &view);
    let covariance = product(
        &product(&image_from_world, &covariance_3d),
        &transposed(&image_from_world),
    );
    let (a, b, c) = (covariance[0][0], covariance[0][1], covariance[1][1]);
    let low_pass = match filter {
        Filter::Dilation => 0.3,
        Filter::Mip => 0.1,
    };
    let wide = [a + low_pass, b, c + low_pass];
    let determinant = wide[0] * wide[2] - b * b;
    let faded = match filter {
        Filter::Dilation => 1.0,
        // Rounding may leave less than nothing of a splat seen from its edge.
        Filter::Mip => ((a * c - b * b).max(0.0) / determinant).sqrt(),
    };

    let opacity = from.opacity * faded;
    if opacity <= ALPHA_CUT {
        return None;
    }
    let reach = 2.0 * (opacity / ALPHA_CUT).ln();
    let mean = [fx * t[0] / t[2] + cx, fy * t[1] / t[2] + cy];
    Some(Projected {
        depth: t[2],
        mean,
        inverse_covariance: [
            wide[2] / determinant,
            -b / determinant,
            wide[0] / determinant,
        ],
        opacity,
        colour: from.colour.map(|channel| channel.max(0.0)),
        columns: pixels_within(mean[0], (reach * wide[0]).sqrt(), camera.width as usize)?,
        rows: pixels_within(mean[1], (reach * wide[2]).sqrt(), camera.height as usize)?,
    })
}
