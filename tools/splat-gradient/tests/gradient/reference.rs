//! The same image formation in f64, written apart: whole matrices, no tiles, and cuts that can be kept while numbers change.
//!
//! Which splats a pixel shows, and where a number is held at a limit, is decided once ([`Frozen`]); with that kept, a picture is a
//! smooth function, whose differences are the derivatives. A pixel where single precision might decide otherwise is left out.

use splat_gradient::{Attributes, View};

const ALPHA_CUT: f64 = 1.0 / 255.0;
const ALPHA_MOST: f64 = 0.99;

type Vec3 = [f64; 3];
type Mat3 = [Vec3; 3];

fn product(a: &Mat3, b: &Mat3) -> Mat3 {
    std::array::from_fn(|i| std::array::from_fn(|j| (0..3).map(|k| a[i][k] * b[k][j]).sum()))
}

fn transposed(a: &Mat3) -> Mat3 {
    std::array::from_fn(|i| std::array::from_fn(|j| a[j][i]))
}

fn applied(a: &Mat3, v: Vec3) -> Vec3 {
    std::array::from_fn(|i| (0..3).map(|k| a[i][k] * v[k]).sum())
}

/// The rotation by a rotation vector, by the series of the matrix exponential.
fn exponential(v: Vec3) -> Mat3 {
    let hat = [[0.0, -v[2], v[1]], [v[2], 0.0, -v[0]], [-v[1], v[0], 0.0]];
    let mut sum = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
    let mut term = sum;
    for n in 1..12 {
        term = product(&term, &hat).map(|row| row.map(|x| x / f64::from(n)));
        for (sum, term) in sum.iter_mut().flatten().zip(term.iter().flatten()) {
            *sum += term;
        }
    }
    sum
}

/// A pinhole camera.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Eye {
    turn: Mat3,
    shift: Vec3,
    focal: [f64; 2],
    centre: [f64; 2],
    pub(crate) size: [usize; 2],
}

impl Eye {
    pub(crate) fn of(view: &View) -> Self {
        let pose = view.camera_from_world();
        Self {
            turn: [0, 1, 2].map(|row| pose.matrix3.row(row).to_array().map(f64::from)),
            shift: pose.translation.to_array().map(f64::from),
            focal: view.focal().map(f64::from),
            centre: view.centre().map(f64::from),
            size: view.size(),
        }
    }

    /// What it sees turned by a rotation vector, then shifted.
    pub(crate) fn moved(&self, [x, y, z, rx, ry, rz]: [f64; 6]) -> Self {
        let turn = exponential([rx, ry, rz]);
        let shift = applied(&turn, self.shift);
        Self {
            turn: product(&turn, &self.turn),
            shift: [shift[0] + x, shift[1] + y, shift[2] + z],
            ..*self
        }
    }
}

/// The fourteen numbers of each Gaussian.
pub(crate) fn numbers_of(attributes: &Attributes) -> Vec<[f64; 14]> {
    (0..attributes.len())
        .map(|index| std::array::from_fn(|plane| f64::from(attributes.plane(plane)[index])))
        .collect()
}

/// A projected Gaussian.
struct Flat {
    depth: f64,
    mean: [f64; 2],
    /// a, b, c of q = a dx^2 + 2 b dx dy + c dy^2.
    conic: [f64; 3],
    opacity: f64,
    colour: Vec3,
}

/// Nothing where it is behind the near plane.
#[expect(clippy::cast_precision_loss, reason = "pixel counts are small")]
fn flat(numbers: &[f64; 14], eye: &Eye) -> Option<Flat> {
    let place = applied(&eye.turn, [numbers[0], numbers[1], numbers[2]]);
    let t: Vec3 = std::array::from_fn(|k| place[k] + eye.shift[k]);
    if t[2] <= f64::from(splat_gradient::view::NEAR) {
        return None;
    }
    let length = numbers[3..7].iter().map(|x| x * x).sum::<f64>().sqrt();
    let [x, y, z, w] = [3, 4, 5, 6].map(|k| numbers[k] / length);
    let rotation = [
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
    ];
    let variance = [7, 8, 9].map(|k| (2.0 * numbers[k]).exp());
    let scaled: Mat3 =
        std::array::from_fn(|i| std::array::from_fn(|j| rotation[i][j] * variance[j]));
    let covariance = product(&scaled, &transposed(&rotation));
    let slope: [f64; 2] = std::array::from_fn(|k| {
        let margin = 0.3 * 0.5 * eye.size[k] as f64 / eye.focal[k];
        let least = -eye.centre[k] / eye.focal[k] - margin;
        let most = (eye.size[k] as f64 - eye.centre[k]) / eye.focal[k] + margin;
        (t[k] / t[2]).clamp(least, most)
    });
    let [fx, fy] = eye.focal;
    let jacobian = [
        [fx / t[2], 0.0, -fx * slope[0] / t[2]],
        [0.0, fy / t[2], -fy * slope[1] / t[2]],
        [0.0; 3],
    ];
    let image_from_world = product(&jacobian, &eye.turn);
    let image = product(
        &product(&image_from_world, &covariance),
        &transposed(&image_from_world),
    );
    let (a, b, c) = (image[0][0] + 0.3, image[0][1], image[1][1] + 0.3);
    let determinant = a * c - b * b;
    Some(Flat {
        depth: t[2],
        mean: [
            fx * t[0] / t[2] + eye.centre[0],
            fy * t[1] / t[2] + eye.centre[1],
        ],
        conic: [c / determinant, -b / determinant, a / determinant],
        opacity: 1.0 / (1.0 + (-numbers[10]).exp()),
        colour: [11, 12, 13].map(|k| numbers[k].max(0.0)),
    })
}

impl Flat {
    #[expect(clippy::cast_precision_loss, reason = "pixel counts are small")]
    fn alpha(&self, x: usize, y: usize) -> f64 {
        let (dx, dy) = (x as f64 + 0.5 - self.mean[0], y as f64 + 0.5 - self.mean[1]);
        let [a, b, c] = self.conic;
        self.opacity * (-0.5 * (a * dx * dx + 2.0 * b * dx * dy + c * dy * dy)).exp()
    }
}

/// What each pixel shows, decided once.
pub(crate) struct Frozen {
    /// Of each pixel, from front to back: which Gaussian, and whether its alpha is held at the most.
    shown: Vec<Vec<(usize, bool)>>,
    /// Pixels where no cut is near, so that single precision decides alike.
    pub(crate) clear: Vec<bool>,
}

impl Frozen {
    /// Pixels that let less than `least_through` through are not clear: the splatter may stop there.
    pub(crate) fn new(gaussians: &[[f64; 14]], eye: &Eye, least_through: f64) -> Self {
        let mut flats: Vec<(usize, Flat)> = gaussians
            .iter()
            .enumerate()
            .filter_map(|(index, numbers)| Some((index, flat(numbers, eye)?)))
            .collect();
        flats.sort_by(|a, b| a.1.depth.total_cmp(&b.1.depth));
        for pair in flats.windows(2) {
            let gap = pair[1].1.depth - pair[0].1.depth;
            assert!(
                gap > 1e-6,
                "an order that single precision might miss: {gap}"
            );
        }
        let [width, height] = eye.size;
        let mut shown = Vec::new();
        let mut clear = Vec::new();
        for (y, x) in (0..height).flat_map(|y| (0..width).map(move |x| (y, x))) {
            let (mut here, mut sure, mut through) = (Vec::new(), true, 1.0);
            for (index, flat) in &flats {
                let alpha = flat.alpha(x, y);
                sure &= (alpha / ALPHA_CUT - 1.0).abs() > 1e-4;
                sure &= (alpha / ALPHA_MOST - 1.0).abs() > 1e-4;
                if alpha >= ALPHA_CUT {
                    here.push((*index, alpha > ALPHA_MOST));
                    through *= 1.0 - alpha.min(ALPHA_MOST);
                }
            }
            shown.push(here);
            clear.push(sure && through >= least_through);
        }
        Self { shown, clear }
    }

    /// The sum of every pixel's numbers times `by_pixel` ([4, height, width]), for Gaussians that may have changed a little.
    pub(crate) fn loss(&self, gaussians: &[[f64; 14]], eye: &Eye, by_pixel: &[f64]) -> f64 {
        let flats: Vec<Option<Flat>> = gaussians.iter().map(|g| flat(g, eye)).collect();
        let width = eye.size[0];
        let pixels = self.shown.len();
        let mut loss = 0.0;
        for (pixel, shown) in self.shown.iter().enumerate() {
            let by_channel: [f64; 4] = std::array::from_fn(|c| by_pixel[c * pixels + pixel]);
            if by_channel == [0.0; 4] {
                continue;
            }
            let mut through = 1.0;
            for (index, held) in shown {
                let flat = flats[*index].as_ref().expect("a small change");
                let free = flat.alpha(pixel % width, pixel / width);
                let alpha = if *held { ALPHA_MOST } else { free };
                for (channel, by_channel) in flat.colour.iter().zip(by_channel) {
                    loss += alpha * through * channel * by_channel;
                }
                through *= 1.0 - alpha;
            }
            loss += (1.0 - through) * by_channel[3];
        }
        loss
    }
}
