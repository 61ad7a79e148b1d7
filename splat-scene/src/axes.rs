//! Where a file's axes point.

use glam::{Mat3, Quat, Vec3};

/// Where an axis points, in OpenXR's terms.
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

    /// As a unit vector of OpenXR's axes.
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

    /// The turn by right angles about x or z that brings a direction of OpenXR's axes up.
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

    /// The composition: first these axes, then `next`, whose input is the output of these.
    pub(crate) fn then(self, next: Self) -> Self {
        Self {
            house_from_file: next.house_from_file * self.house_from_file,
        }
    }

    /// Where a vector of the file points.
    pub(crate) fn house(self, file: Vec3) -> Vec3 {
        self.house_from_file * file
    }

    /// A vector in OpenXR's axes, in the file's.
    pub(crate) fn file(self, house: Vec3) -> Vec3 {
        self.house_from_file.transpose() * house
    }

    pub(crate) fn mirrored(self) -> bool {
        self.house_from_file.determinant() < 0.0
    }

    /// The rotation, which is followed by a point reflection where the axes are left-handed.
    pub(crate) fn rotation(self) -> Quat {
        let sign = if self.mirrored() { -1.0 } else { 1.0 };
        Quat::from_mat3(&(self.house_from_file * sign)).normalize()
    }
}
