//! What a file's Gaussians are, in the file's own terms, and how far a scene read from it is from them: all in f64 and apart
//! from the crate's code.

use glam::{DMat3, DQuat, DVec3};
use splat_scene::Scene;

/// One Gaussian in the terms of a 3DGS file, but with its opacity activated.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Raw {
    pub(crate) position: [f32; 3],
    pub(crate) log_scale: [f32; 3],
    /// w, x, y, z.
    pub(crate) rotation: [f32; 4],
    pub(crate) opacity: f32,
    pub(crate) colour: [f32; 3],
    /// Coefficients above degree 0, each red, green, blue.
    pub(crate) rest: Vec<[f32; 3]>,
}

/// The axes that a [`Raw`]'s numbers are in.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Axes {
    /// x right, y down, z forward.
    Colmap,
    /// x right, y up, z back.
    House,
    /// Where x, y and z point: Right, Left, Up, Down, Front or Back.
    Named(&'static str),
}

impl Axes {
    /// The coordinate systems of .spz, from number 1 on, as its library names them.
    pub(crate) const SPZ: [Self; 16] = [
        Self::Named("LDB"),
        Self::Named("RDB"),
        Self::Named("LUB"),
        Self::Named("RUB"),
        Self::Named("LDF"),
        Self::Named("RDF"),
        Self::Named("LUF"),
        Self::Named("RUF"),
        Self::Named("LFD"),
        Self::Named("RFD"),
        Self::Named("LFU"),
        Self::Named("RFU"),
        Self::Named("LBD"),
        Self::Named("RBD"),
        Self::Named("LBU"),
        Self::Named("RBU"),
    ];

    fn house_from(self) -> DMat3 {
        match self {
            Self::Colmap => Self::Named("RDF").house_from(),
            Self::House => Self::Named("RUB").house_from(),
            Self::Named(letters) => {
                let mut columns = letters.chars().map(|letter| match letter {
                    'R' => DVec3::X,
                    'L' => DVec3::NEG_X,
                    'U' => DVec3::Y,
                    'D' => DVec3::NEG_Y,
                    'B' => DVec3::Z,
                    _ => DVec3::NEG_Z,
                });
                let mut next = || columns.next().expect("three letters");
                DMat3::from_cols(next(), next(), next())
            }
        }
    }
}

/// The largest differences over all Gaussians.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct Difference {
    pub(crate) position: f64,
    pub(crate) log_scale: f64,
    /// Radians between own axes, whose signs do not matter.
    pub(crate) angle: f64,
    pub(crate) opacity: f64,
    /// In display values, over directions all around.
    pub(crate) colour: f64,
}

impl Difference {
    pub(crate) fn assert_within(&self, limit: &Self) {
        let all = [
            (self.position, limit.position, "position"),
            (self.log_scale, limit.log_scale, "log scale"),
            (self.angle, limit.angle, "angle"),
            (self.opacity, limit.opacity, "opacity"),
            (self.colour, limit.colour, "colour"),
        ];
        for (is, most, what) in all {
            assert!(
                is <= most,
                "{what} differs by {is}, more than {most}: {self:?}"
            );
        }
    }
}

/// How far `scene` is from `raws`, each Gaussian taken with the nearest of the others, as some writers sort.
pub(crate) fn difference(scene: &Scene, raws: &[Raw], axes: Axes) -> Difference {
    assert_eq!(scene.len(), raws.len(), "as many Gaussians as the file has");
    let turn = axes.house_from();
    let coefficients = scene.rest_coefficients();
    let mut most = Difference::default();
    let mut taken = vec![false; scene.len()];
    for raw in raws {
        let position = turn * vector(raw.position);
        let squared = |index: &usize| vector(scene.positions()[*index]).distance_squared(position);
        let index = (0..scene.len())
            .filter(|&index| !taken[index])
            .min_by(|a, b| squared(a).total_cmp(&squared(b)))
            .expect("there are as many");
        taken[index] = true;

        most.position = most.position.max(squared(&index).sqrt());
        let log_scale = vector(scene.log_scales()[index]) - vector(raw.log_scale);
        most.log_scale = most.log_scale.max(log_scale.abs().max_element());
        let [w, x, y, z] = raw.rotation.map(f64::from);
        let expected = turn * DMat3::from_quat(DQuat::from_xyzw(x, y, z, w).normalize());
        let [x, y, z, w] = scene.rotations()[index].map(f64::from);
        let got = DMat3::from_quat(DQuat::from_xyzw(x, y, z, w));
        for axis in 0..3 {
            let across = got.col(axis).cross(expected.col(axis)).length();
            let along = got.col(axis).dot(expected.col(axis)).abs();
            most.angle = most.angle.max(across.atan2(along));
        }
        let opacity = f64::from(scene.opacities()[index]) - f64::from(raw.opacity);
        most.opacity = most.opacity.max(opacity.abs());
        assert_eq!(coefficients, raw.rest.len(), "the file's SH degree");
        let rest = &scene.sh_rest()[3 * coefficients * index..][..3 * coefficients];
        let rest: Vec<[f32; 3]> = rest.as_chunks().0.to_vec();
        for direction in directions() {
            let expected = seen(raw.colour, &raw.rest, direction);
            let got = seen(scene.colours()[index], &rest, turn * direction);
            most.colour = most.colour.max((expected - got).abs().max_element());
        }
    }
    most
}

fn vector(values: [f32; 3]) -> DVec3 {
    DVec3::from_array(values.map(f64::from))
}

/// The colour a Gaussian shows in a direction, not cut at zero.
pub(crate) fn seen(colour: [f32; 3], rest: &[[f32; 3]], direction: DVec3) -> DVec3 {
    let mut sum = DVec3::splat(0.5);
    let all = std::iter::once(&colour).chain(rest);
    for (coefficient, basis) in all.zip(harmonics(direction)) {
        sum += basis * vector(*coefficient);
    }
    sum
}

/// Directions spread over the sphere on a spiral.
pub(crate) fn directions() -> impl Iterator<Item = DVec3> {
    (0..40).map(|step| {
        let z = (f64::from(step) + 0.5) / 20.0 - 1.0;
        let angle = 2.399_963_229_728_653 * f64::from(step);
        let radius = (1.0 - z * z).sqrt();
        DVec3::new(radius * angle.cos(), radius * angle.sin(), z)
    })
}

/// Real spherical harmonics of degree 0 to 3 from their definition: associated Legendre functions with the Condon-Shortley
/// phase times cosines (order m > 0) and sines (m < 0), in the order l, then m from -l to l.
pub(crate) fn harmonics(direction: DVec3) -> Vec<f64> {
    let angle = direction.y.atan2(direction.x);
    let mut all = Vec::new();
    for degree in 0..=3_i32 {
        for order in -degree..=degree {
            let m = order.abs();
            let ratio: f64 = (degree - m + 1..=degree + m).map(f64::from).product();
            let norm = (f64::from(2 * degree + 1) / (4.0 * std::f64::consts::PI * ratio)).sqrt();
            let around = match order {
                0 => 1.0,
                1.. => std::f64::consts::SQRT_2 * (f64::from(m) * angle).cos(),
                _ => std::f64::consts::SQRT_2 * (f64::from(m) * angle).sin(),
            };
            all.push(norm * legendre(degree, m, direction.z) * around);
        }
    }
    all
}

/// The associated Legendre function by its recurrence over the degree.
fn legendre(degree: i32, order: i32, z: f64) -> f64 {
    let mut before = 0.0;
    // P_m^m = (-1)^m (2m - 1)!! (1 - z^2)^(m/2)
    let mut at: f64 = (1..=order)
        .map(|k| -f64::from(2 * k - 1) * (1.0 - z * z).max(0.0).sqrt())
        .product();
    for l in order + 1..=degree {
        let next = (f64::from(2 * l - 1) * z * at - f64::from(l + order - 1) * before)
            / f64::from(l - order);
        before = at;
        at = next;
    }
    at
}
