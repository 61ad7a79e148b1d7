//! Where the camera stands: named places around the person, or exact ones.

use crate::size::Views;
use anyhow::{Context, bail};
use glam::{Quat, Vec3};
use renderer_splat::camera::Camera;
use std::path::{Path, PathBuf};
use std::str::FromStr;

/// Distance between the eyes in metres (the adult mean).
pub const EYE_SPACING: f32 = 0.063;

/// A place to look from, relative to where the person stands and faces.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Viewpoint {
    /// Metres, relative to the floor point below the person, who faces +z.
    eye: Vec3,
    /// Metres, same frame.
    target: Vec3,
    /// Vertical field of view, degrees.
    fov_degrees: f32,
}

/// Names for `--view`, with what they show.
const NAMED: [(&str, Viewpoint); 7] = [
    ("front", Viewpoint::FRONT),
    ("three-quarter", Viewpoint::THREE_QUARTER),
    (
        "side",
        Viewpoint::new([4.1, 1.05, 0.0], [0.0, 0.92, 0.0], 28.0),
    ),
    (
        "back",
        Viewpoint::new([0.0, 1.05, -4.1], [0.0, 0.92, 0.0], 28.0),
    ),
    (
        "waist-up",
        Viewpoint::new([0.35, 1.45, 1.9], [0.0, 1.32, 0.0], 28.0),
    ),
    (
        "face",
        Viewpoint::new([0.22, 1.62, 0.85], [0.0, 1.6, 0.05], 24.0),
    ),
    (
        "hands",
        Viewpoint::new([0.3, 1.3, 1.3], [0.0, 1.15, 0.2], 28.0),
    ),
];

/// How tall the demo person is in T-pose, with hair and shoes, metres: what [`NAMED`] is made for; and by what share another may differ for the same views.
const USUAL_HEIGHT: f32 = 1.77;
const SAME_HEIGHT: f32 = 0.01;

impl Viewpoint {
    /// From before the person.
    pub(crate) const FRONT: Self = Self::new([0.0, 1.05, 4.1], [0.0, 0.92, 0.0], 28.0);
    /// From before and beside.
    pub(crate) const THREE_QUARTER: Self = Self::new([2.2, 1.25, 3.5], [0.0, 0.92, 0.0], 28.0);

    const fn new(eye: [f32; 3], target: [f32; 3], fov_degrees: f32) -> Self {
        Self {
            eye: Vec3::from_array(eye),
            target: Vec3::from_array(target),
            fov_degrees,
        }
    }

    /// The place as a camera of `width` x `height` pixels, for a person at `floor` (metres) who faces along `heading`.
    pub fn camera(&self, floor: Vec3, heading: Quat, width: u32, height: u32) -> Camera {
        let place = |p: Vec3| floor + heading * p;
        let fov = self.fov_degrees.to_radians();
        Camera::look_at(
            place(self.eye),
            place(self.target),
            Vec3::Y,
            fov,
            width,
            height,
        )
    }

    /// The same picture of an avatar that is so tall in T-pose, metres, as this is of one of usual size.
    pub(crate) fn of_height(self, metres: f32) -> Self {
        let scale = metres / USUAL_HEIGHT;
        if (scale - 1.0).abs() < SAME_HEIGHT || !scale.is_finite() {
            return self;
        }
        Self {
            eye: self.eye * scale,
            target: self.target * scale,
            ..self
        }
    }

    /// The direction it looks along, for a person who faces +z.
    pub(crate) fn direction(&self) -> Vec3 {
        (self.target - self.eye).normalize_or(Vec3::NEG_Z)
    }

    /// Vertical field of view, degrees.
    pub(crate) fn fov_degrees(&self) -> f32 {
        self.fov_degrees
    }
}

/// The camera alone, or for stereo the eyes to its left and right.
pub fn eyes(camera: Camera, views: Views) -> Vec<Camera> {
    let moved = |metres: f32| {
        let mut world_from_camera = camera.camera_from_world.inverse();
        world_from_camera.translation += world_from_camera.matrix3.x_axis * metres;
        Camera {
            camera_from_world: world_from_camera.inverse(),
            ..camera
        }
    };
    match views {
        Views::Mono => vec![camera],
        Views::Stereo => vec![moved(-EYE_SPACING / 2.0), moved(EYE_SPACING / 2.0)],
    }
}

/// What `--view` of `render` says.
#[derive(Debug, Clone, PartialEq)]
pub(crate) enum CameraChoice {
    /// A name of [`NAMED`].
    Named(Viewpoint),
    /// Eye, target and field of view.
    Exact(Viewpoint),
    /// A file of the scene's cameras.
    File(PathBuf),
}

impl FromStr for CameraChoice {
    type Err = anyhow::Error;

    fn from_str(text: &str) -> anyhow::Result<Self> {
        if Path::new(text)
            .extension()
            .is_some_and(|ending| ending.eq_ignore_ascii_case("json"))
        {
            return Ok(Self::File(text.into()));
        }
        let viewpoint = text.parse()?;
        Ok(if NAMED.iter().any(|(name, _)| *name == text) {
            Self::Named(viewpoint)
        } else {
            Self::Exact(viewpoint)
        })
    }
}

impl Viewpoint {
    /// Turns the eye around its target: to the left by `yaw`, upwards by `pitch`, in radians, short of the poles.
    pub(crate) fn orbit(&mut self, yaw: f32, pitch: f32) {
        let arm = self.eye - self.target;
        let distance = arm.length().max(f32::MIN_POSITIVE);
        let up = (arm.y / distance).clamp(-1.0, 1.0).asin() + pitch;
        let around = arm.x.atan2(arm.z) + yaw;
        let turn = Quat::from_rotation_y(around) * Quat::from_rotation_x(-up.clamp(-1.4, 1.4));
        self.eye = self.target + turn * Vec3::Z * distance;
    }

    /// From eye to target, metres; never 0.
    pub(crate) fn distance(&self) -> f32 {
        self.eye.distance(self.target).max(f32::MIN_POSITIVE)
    }

    /// Multiplies the distance from eye to target, within 0.3 to 20 m; a factor of 1 leaves any as it is.
    pub(crate) fn approach(&mut self, factor: f32) {
        if factor == 1.0 {
            return;
        }
        let arm = self.eye - self.target;
        let distance = (arm.length() * factor).clamp(0.3, 20.0);
        self.eye = self.target + arm.normalize_or(Vec3::Z) * distance;
    }
}

impl Viewpoint {
    /// Moves the eye away from its target until so many metres beside one another fit a square picture there.
    pub(crate) fn back_off(&mut self, metres: f32) {
        let arm = self.eye - self.target;
        let seen = 2.0 * arm.length() * (self.fov_degrees.to_radians() / 2.0).tan();
        self.eye = self.target + arm * (metres / seen.max(f32::MIN_POSITIVE)).max(1.0);
    }
}

impl std::fmt::Display for Viewpoint {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let (e, t) = (self.eye, self.target);
        let fov = self.fov_degrees;
        write!(f, "{},{},{}:{},{},{}:{fov}", e.x, e.y, e.z, t.x, t.y, t.z)
    }
}

impl FromStr for Viewpoint {
    type Err = anyhow::Error;

    /// One of the names that the options list, or `ex,ey,ez:tx,ty,tz[:fov]` (eye and target in metres, field of view in degrees).
    fn from_str(text: &str) -> anyhow::Result<Self> {
        if let Some((_, viewpoint)) = NAMED.iter().find(|(name, _)| *name == text) {
            return Ok(*viewpoint);
        }
        let names = NAMED.map(|(name, _)| name).join(", ");
        let parts: Vec<&str> = text.split(':').collect();
        let (eye, target, fov) = match parts[..] {
            [eye, target] => (eye, target, "28"),
            [eye, target, fov] => (eye, target, fov),
            _ => bail!(
                "{text} is neither one of {names} nor EYE:TARGET or EYE:TARGET:FOV, e.g. 0,1.6,2:0,1.4,0:30"
            ),
        };
        let point = |text: &str| -> anyhow::Result<[f32; 3]> {
            let numbers: Vec<f32> = text
                .split(',')
                .map(|n| {
                    n.trim()
                        .parse()
                        .with_context(|| format!("{n} is not a number of metres"))
                })
                .collect::<anyhow::Result<_>>()?;
            numbers
                .try_into()
                .map_err(|_| anyhow::anyhow!("{text} is not three numbers x,y,z"))
        };
        let fov: f32 = fov
            .parse()
            .with_context(|| format!("{fov} is not a field of view in degrees"))?;
        if !(1.0..=150.0).contains(&fov) {
            bail!("a field of view of {fov} degrees is outside 1..150");
        }
        Ok(Self::new(point(eye)?, point(target)?, fov))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_eyes_stand_apart_to_the_left_and_right_of_the_camera() {
        let view = Viewpoint::new([0.0, 1.0, 2.0], [0.0, 1.0, 0.0], 40.0);
        let camera = view.camera(Vec3::ZERO, Quat::IDENTITY, 64, 64);
        let places: Vec<Vec3> = eyes(camera, Views::Stereo)
            .iter()
            .map(Camera::position)
            .collect();
        let expected = [-0.0315, 0.0315].map(|x| Vec3::new(x, 1.0, 2.0));
        for (place, expected) in places.iter().zip(expected) {
            assert!(place.abs_diff_eq(expected, 1e-5), "{place} for {expected}");
        }
        assert_eq!(eyes(camera, Views::Mono), [camera], "one eye");
    }

    #[test]
    fn a_camera_is_a_name_or_numbers_or_a_file() {
        let read = |text: &str| text.parse::<CameraChoice>().expect("a camera");
        assert!(matches!(read("front"), CameraChoice::Named(_)), "a name");
        assert!(
            matches!(read("0,1,2:0,1,0"), CameraChoice::Exact(_)),
            "numbers"
        );
        assert_eq!(
            read("a/cameras.json"),
            CameraChoice::File("a/cameras.json".into()),
            "a file"
        );
    }

    #[test]
    fn exact_viewpoints_are_read() {
        let read: Viewpoint = "1,2,3:0,1,0:40".parse().expect("a full viewpoint");
        assert_eq!(read, Viewpoint::new([1.0, 2.0, 3.0], [0.0, 1.0, 0.0], 40.0));
        for (name, named) in NAMED {
            let written = named.to_string().parse();
            assert_eq!(written.ok(), Some(named), "{name} as it is written");
        }
    }

    #[test]
    fn orbiting_keeps_the_distance_and_stops_short_of_the_poles() {
        let mut view = Viewpoint::new([0.0, 1.0, 2.0], [0.0, 1.0, 0.0], 40.0);
        view.orbit(std::f32::consts::FRAC_PI_2, 0.0);
        assert!(
            view.eye.abs_diff_eq(Vec3::new(2.0, 1.0, 0.0), 1e-5),
            "a quarter turn: {}",
            view.eye
        );
        view.orbit(0.0, 100.0);
        assert!(
            (view.eye.distance(view.target) - 2.0).abs() < 1e-4,
            "the distance stays"
        );
        assert!(
            view.eye.y > 2.9 && view.eye.x > 0.1,
            "high up, but not at the pole: {}",
            view.eye
        );
    }

    #[test]
    fn backing_off_makes_room_and_never_comes_closer() {
        let mut view = Viewpoint::new([0.0, 1.0, 2.0], [0.0, 1.0, 0.0], 90.0);
        view.back_off(3.0);
        assert_eq!(view.eye, Vec3::new(0.0, 1.0, 2.0), "4 m are seen at 2 m");
        view.back_off(6.0);
        assert!(
            view.eye.abs_diff_eq(Vec3::new(0.0, 1.0, 3.0), 1e-5),
            "{}",
            view.eye
        );
    }

    #[test]
    fn mistaken_viewpoints_name_what_is_possible() {
        let error = "frnt"
            .parse::<Viewpoint>()
            .expect_err("no such name")
            .to_string();
        assert!(error.contains("three-quarter"), "{error}");
        assert!(
            "1,2:0,1,0".parse::<Viewpoint>().is_err(),
            "an eye of two numbers"
        );
        assert!(
            "1,2,3:0,1,0:900".parse::<Viewpoint>().is_err(),
            "a field of view beyond a hemisphere"
        );
    }
}
