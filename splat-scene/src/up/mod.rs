//! Which axis of a scene's file points up. Trainers leave it open: in COLMAP's world, which 3DGS keeps, y points roughly down,
//! in nerfstudio's z points up; `.spz` is defined as y up, but splat-transform from version 3 on writes it as y down.

mod floor;

use std::fmt;
use std::str::FromStr;

use glam::{Quat, Vec3};

use crate::axes::Axes;
use crate::axes::Direction;
use crate::cameras::Cameras;
use crate::{Format, Scene};

/// An axis of a file and its sign.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum UpAxis {
    /// x points up.
    PlusX,
    /// x points down.
    MinusX,
    /// y points up.
    PlusY,
    /// y points down.
    MinusY,
    /// z points up.
    PlusZ,
    /// z points down.
    MinusZ,
}

impl UpAxis {
    /// All six.
    pub const ALL: [Self; 6] = [
        Self::PlusX,
        Self::MinusX,
        Self::PlusY,
        Self::MinusY,
        Self::PlusZ,
        Self::MinusZ,
    ];

    fn unit(self) -> Vec3 {
        match self {
            Self::PlusX => Vec3::X,
            Self::MinusX => Vec3::NEG_X,
            Self::PlusY => Vec3::Y,
            Self::MinusY => Vec3::NEG_Y,
            Self::PlusZ => Vec3::Z,
            Self::MinusZ => Vec3::NEG_Z,
        }
    }

    /// The axis of a file in `axes` that points in a direction of OpenXR's axes.
    fn towards(axes: Axes, direction: Vec3) -> Self {
        let file = axes.file(direction);
        Self::ALL
            .into_iter()
            .max_by(|a, b| a.unit().dot(file).total_cmp(&b.unit().dot(file)))
            .unwrap_or(Self::PlusY)
    }
}

impl fmt::Display for UpAxis {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        out.write_str(match self {
            Self::PlusX => "+x",
            Self::MinusX => "-x",
            Self::PlusY => "+y",
            Self::MinusY => "-y",
            Self::PlusZ => "+z",
            Self::MinusZ => "-z",
        })
    }
}

/// Text that names no axis.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("`{0}` is no axis; give one of +x, -x, +y, -y, +z and -z")]
pub struct UnknownAxis(String);

impl FromStr for UpAxis {
    type Err = UnknownAxis;

    fn from_str(text: &str) -> Result<Self, UnknownAxis> {
        Self::ALL
            .into_iter()
            .find(|axis| axis.to_string().eq_ignore_ascii_case(text))
            .ok_or_else(|| UnknownAxis(text.to_owned()))
    }
}

/// The evidence that an axis was detected by.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub enum UpEvidence {
    /// The file states its axes.
    Stated,
    /// The mean of the cameras' own up.
    Cameras {
        /// How many there are.
        count: usize,
        /// How far their mean is from the axis.
        degrees: f32,
    },
    /// A level surface that most of the scene stands on.
    Floor {
        /// The share of the scene's ground plan that it fills, 0 to 1.
        share: f32,
    },
    /// The scene stands on the level of the origin, where editors put it.
    Origin,
    /// Nothing in the scene: what files of its format mostly have.
    Format,
}

impl fmt::Display for UpEvidence {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Stated => out.write_str("as the file states"),
            Self::Cameras { count, degrees } => {
                write!(
                    out,
                    "by the mean of {count} cameras, {degrees:.0} degrees off"
                )
            }
            Self::Floor { share } => {
                write!(out, "by a floor below {:.0} % of the scene", 100.0 * share)
            }
            Self::Origin => out.write_str("as the scene stands on the origin's level"),
            Self::Format => out.write_str("as is usual for the format"),
        }
    }
}

/// An axis and what it was detected by.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct DetectedUp {
    /// The axis of the file that points up.
    pub axis: UpAxis,
    /// Why.
    pub evidence: UpEvidence,
}

impl Scene {
    /// The axis of the file that points up, to OpenXR's +y, as the scene lies now.
    pub fn up(&self) -> UpAxis {
        UpAxis::towards(self.axes, Vec3::Y)
    }

    /// A point or direction as the file has it, in the axes that the scene has now. Not after the scene was placed.
    pub fn point_of_file(&self, point: Vec3) -> Vec3 {
        self.axes.house(point)
    }

    /// The inverse of [`Self::point_of_file`].
    pub fn point_in_file(&self, point: Vec3) -> Vec3 {
        self.axes.file(point)
    }

    /// Finds out which axis of the file points up; `cameras` are those that the scene was trained from. A scene without any
    /// evidence keeps the axis that is usual for its format. Call it before the scene is placed.
    pub fn detect_up(&self, cameras: Option<&Cameras>) -> DetectedUp {
        let found = |direction: Vec3, evidence| DetectedUp {
            axis: UpAxis::towards(self.axes, direction),
            evidence,
        };
        if self.axes_stated {
            return found(Vec3::Y, UpEvidence::Stated);
        }
        let by_cameras = || {
            let (direction, evidence) = mean_up(cameras?)?;
            Some(found(direction.unit(), evidence))
        };
        let by_floor = || {
            let (direction, share) = floor::find(self.positions(), self.opacities())?;
            let detected = found(direction.unit(), UpEvidence::Floor { share });
            // No program makes scenes with another axis up: there the surface is a wall.
            let usual = [UpAxis::PlusY, UpAxis::MinusY, UpAxis::PlusZ];
            usual.contains(&detected.axis).then_some(detected)
        };
        let by_origin = || {
            let direction = floor::stands_on_origin(self.positions(), self.opacities())?;
            Some(found(direction.unit(), UpEvidence::Origin))
        };
        // Whether an .spz has its format's axes or those of the PLY that it was made from cannot be inferred from its cameras.
        let detected = if matches!(self.format(), Format::Spz { .. }) {
            by_floor().or_else(by_origin).or_else(by_cameras)
        } else {
            by_cameras().or_else(by_floor)
        };
        detected.unwrap_or_else(|| found(Vec3::Y, UpEvidence::Format))
    }

    /// Turns the scene by right angles so that an axis of its file points up, before it is placed. The scene's cameras, as
    /// [`Cameras`] has them, are to be turned about the origin by the rotation that this returns.
    pub fn turn_up(&mut self, axis: UpAxis) -> Quat {
        let direction = Direction::nearest(self.axes.house(axis.unit()));
        let raise = Axes::raising(direction);
        // An .spz with one of these up has the axes of the PLY that it was made from, as the cameras do.
        let as_cameras = matches!(self.format(), Format::Spz { .. })
            && self.axes == Axes::HOUSE
            && !self.axes_stated
            && matches!(axis, UpAxis::MinusY | UpAxis::PlusZ);
        self.turn_from(raise);
        self.axes = self.axes.then(raise);
        if as_cameras {
            (raise.rotation() * Axes::COLMAP.rotation()).normalize()
        } else {
            raise.rotation()
        }
    }
}

/// The direction that the cameras' mean up is nearest to, unless they disagree or are too few to tell.
fn mean_up(cameras: &Cameras) -> Option<(Direction, UpEvidence)> {
    const FEWEST: usize = 4;
    /// The shortest mean of unit vectors that still says something.
    const SHORTEST: f32 = 0.4;
    const FARTHEST_DEGREES: f32 = 40.0;
    let count = cameras.all().len();
    if count < FEWEST {
        return None;
    }
    let ups = cameras
        .all()
        .iter()
        .map(|camera| camera.world_from_camera * Vec3::Y);
    #[expect(clippy::cast_precision_loss, reason = "a share, not a count")]
    let mean = ups.sum::<Vec3>() / count as f32;
    let direction = Direction::nearest(mean);
    let degrees = direction.unit().angle_between(mean).to_degrees();
    (mean.length() >= SHORTEST && degrees <= FARTHEST_DEGREES)
        .then_some((direction, UpEvidence::Cameras { count, degrees }))
}
