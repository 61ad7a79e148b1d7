//! From a file's axes to the house's (x right, y up, z back). Most files are in COLMAP's (x right, y down, z forward): a turn
//! by 180 degrees about x, which is its own inverse, done as each Gaussian is read. Other axes are turned as a whole.

use glam::{Mat3, Quat, Vec3};

use crate::{Scene, ShRotation, Splat};

/// The signs of the SH coefficients above degree 0 under y -> -y, z -> -z: each basis function of [`crate::sh_basis`] is a
/// polynomial that is even or odd in that change.
const REST_SIGNS: [f32; 15] = [
    -1.0, -1.0, 1.0, // y, z, x
    -1.0, 1.0, 1.0, -1.0, 1.0, // xy, yz, 2zz-xx-yy, xz, xx-yy
    -1.0, 1.0, -1.0, -1.0, 1.0, -1.0,
    1.0, // y(3xx-yy), xyz, y(4zz-..), z(..), x(4zz-..), z(xx-yy), x(xx-3yy)
];

/// Turns a Gaussian by 180 degrees about x.
pub(crate) fn turn(splat: &mut Splat, sh_rest: &mut [f32]) {
    splat.position = turned_vector(splat.position);
    splat.rotation = turned_rotation(splat.rotation);
    for (coefficient, sign) in sh_rest.chunks_exact_mut(3).zip(REST_SIGNS) {
        for value in coefficient {
            *value *= sign;
        }
    }
}

/// A vector or point turned by 180 degrees about x.
pub(crate) fn turned_vector([x, y, z]: [f32; 3]) -> [f32; 3] {
    [x, -y, -z]
}

/// The rotation `F R F`, with F the turn: R between frames that are both turned. For a Gaussian it gives the covariance of
/// `F R`, as its own axes' signs do not matter.
pub(crate) fn turned_rotation([x, y, z, w]: [f32; 4]) -> [f32; 4] {
    [x, -y, -z, w]
}

/// Where an axis points, in the house's terms.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Direction {
    Right,
    Left,
    Up,
    Down,
    Back,
    Front,
}

impl Direction {
    pub(crate) const ALL: [Self; 6] = [
        Self::Right,
        Self::Left,
        Self::Up,
        Self::Down,
        Self::Back,
        Self::Front,
    ];

    /// As a unit vector of the house's axes.
    pub(crate) fn unit(self) -> Vec3 {
        match self {
            Self::Right => Vec3::X,
            Self::Left => Vec3::NEG_X,
            Self::Up => Vec3::Y,
            Self::Down => Vec3::NEG_Y,
            Self::Back => Vec3::Z,
            Self::Front => Vec3::NEG_Z,
        }
    }

    /// The direction that is nearest to a vector.
    pub(crate) fn nearest(to: Vec3) -> Self {
        Self::ALL
            .into_iter()
            .max_by(|a, b| a.unit().dot(to).total_cmp(&b.unit().dot(to)))
            .unwrap_or(Self::Up)
    }
}

/// Where the axes x, y and z of a file point. They may be left-handed.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Axes {
    house_from_file: Mat3,
}

impl Axes {
    pub(crate) const HOUSE: Self = Self {
        house_from_file: Mat3::IDENTITY,
    };

    /// x right, y down, z forward.
    pub(crate) const COLMAP: Self = Self {
        house_from_file: Mat3::from_diagonal(Vec3::new(1.0, -1.0, -1.0)),
    };

    /// Three directions at right angles.
    pub(crate) fn new(directions: [Direction; 3]) -> Self {
        let [x, y, z] = directions.map(Direction::unit);
        Self {
            house_from_file: Mat3::from_cols(x, y, z),
        }
    }

    /// The turn by right angles about x or z that brings a direction of the house up.
    pub(crate) fn raising(direction: Direction) -> Self {
        use Direction::{Back, Down, Front, Left, Right, Up};
        Self::new(match direction {
            Up => [Right, Up, Back],
            Down => [Right, Down, Front],
            Back => [Right, Front, Up],
            Front => [Right, Back, Down],
            Right => [Up, Left, Back],
            Left => [Down, Right, Back],
        })
    }

    /// First these, then `next`, whose file axes are the house's of these.
    pub(crate) fn then(self, next: Self) -> Self {
        Self {
            house_from_file: next.house_from_file * self.house_from_file,
        }
    }

    /// Where a vector of the file points.
    pub(crate) fn house(self, file: Vec3) -> Vec3 {
        self.house_from_file * file
    }

    /// A vector of the house in the file's axes.
    pub(crate) fn file(self, house: Vec3) -> Vec3 {
        self.house_from_file.transpose() * house
    }

    fn mirrored(self) -> bool {
        self.house_from_file.determinant() < 0.0
    }

    /// The rotation, which is followed by a point reflection where the axes are left-handed.
    pub(crate) fn rotation(self) -> Quat {
        let sign = if self.mirrored() { -1.0 } else { 1.0 };
        Quat::from_mat3(&(self.house_from_file * sign)).normalize()
    }
}

impl Scene {
    /// Turns all Gaussians, which lie in `axes`, into the house's.
    pub(crate) fn turn_from(&mut self, axes: Axes) {
        if axes == Axes::HOUSE {
            return;
        }
        let rest_values = 3 * self.rest_coefficients();
        let rotation = axes.rotation();
        let arrays = &mut self.arrays;
        for position in &mut arrays.positions {
            *position = axes.house(Vec3::from_array(*position)).to_array();
        }
        // A point reflection leaves a Gaussian's shape as it is.
        for own in &mut arrays.rotations {
            *own = (rotation * Quat::from_array(*own)).normalize().to_array();
        }
        if rest_values == 0 {
            return;
        }
        let turn = ShRotation::new(rotation);
        for rest in arrays.sh_rest.chunks_exact_mut(rest_values) {
            turn.apply(rest);
            if axes.mirrored() {
                // Functions of odd degree change their sign: three values for each of 3 and of 7 coefficients.
                for (index, value) in rest.iter_mut().enumerate() {
                    if !(9..24).contains(&index) {
                        *value = -*value;
                    }
                }
            }
        }
    }
}
