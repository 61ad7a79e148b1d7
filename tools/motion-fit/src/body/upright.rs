//! Which way is up for the camera and how high it is above the floor, learnt while a person stands and walks before it.
//!
//! One camera cannot tell a leaning person from a tilted camera. On average people stand upright and cameras are rolled little: a slowly
//! forgetting mean of standing bodies' axes, with a prior. The floor is where soles stand, and follows the person's place. Where a person
//! walks to and fro, the slope of the floor along the line of sight tells the pitch, too; soles err in depth along their rays, and what that
//! does to the slope is subtracted (errors in variables), so it is only taken where they walk further than they err.

use nalgebra::{Matrix3, Rotation3, Vector2, Vector3};

/// How long a stance counts, seconds.
const MEMORY: f64 = 60.0;
/// How long a sole on the floor counts, seconds.
const SOLE_MEMORY: f64 = 0.5;
/// How long the way over the floor counts, seconds.
const WAY_MEMORY: f64 = 30.0;
/// Standard deviation of a sole's depth, and of its height above the floor's plane, metres; the time after which the next is news, seconds.
const SOLE_DEPTH: f64 = 0.10;
const SOLE_HEIGHT: f64 = 0.06;
const SOLE_NEWS: f64 = 0.5;
/// The slope counts at most as much as that of a camera of known pitch with this standard deviation, radians.
const SLOPE: f64 = 0.025;
/// Information of the sideways parts x and z of the up axis before anything is seen: roll and pitch of 0.03 and 0.15 radians.
const PRIOR: Vector2<f64> = Vector2::new(1.0 / (0.03 * 0.03), 1.0 / (0.15 * 0.15));
/// Standard deviation of a standing body's axis, radians, and the time after which its next look is news, seconds: the depth of a network's
/// landmarks errs alike for a while.
const STANCE: f64 = 0.12;
const STANCE_NEWS: f64 = 0.7;
/// So many looks count at most: what a network errs in depth stays with a person, and no number of looks undoes it.
const STANCE_LOOKS: f64 = 2.0;
/// Steepest slope that is believed, as the up axis' part sideways.
const STEEPEST: f64 = 0.6;
/// Height of the camera above the floor before a sole is seen, metres.
const USUAL_HEIGHT: f64 = 1.2;

/// The estimate. Axes: the camera's with y up and z towards it, not yet level.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Upright {
    /// Information of the stances, and their weighted sum.
    information: f64,
    sum: Vector2<f64>,
    up: Vector3<f64>,
    /// Weight and weighted sum of points of the floor, lately.
    soles: (f64, Vector3<f64>),
    way: Way,
    /// Whether all is known, and follows no more.
    is_held: bool,
}

/// Where soles stood: seconds of looking, and means of their heights, depths and products.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
struct Way {
    seconds: f64,
    y: f64,
    z: f64,
    zz: f64,
    zy: f64,
}

impl Way {
    fn touch(&mut self, point: &Vector3<f64>, seconds: f64) {
        self.seconds = self.seconds * (-seconds / WAY_MEMORY).exp() + seconds;
        let part = seconds / self.seconds;
        self.y += (point.y - self.y) * part;
        self.z += (point.z - self.z) * part;
        self.zz += (point.z * point.z - self.zz) * part;
        self.zy += (point.z * point.y - self.zy) * part;
    }

    /// The up axis' part along z and its information.
    fn up(&self) -> Option<(f64, f64)> {
        let error = SOLE_DEPTH * SOLE_DEPTH;
        let spread = self.zz - self.z * self.z - error;
        if spread < 3.0 * error || self.z > -0.3 {
            return None;
        }
        // A wrong depth moves a sole along its ray.
        let slope = (self.zy - self.z * self.y - error * self.y / self.z) / spread;
        let looks = self.seconds / SOLE_NEWS;
        let variance = SOLE_HEIGHT * SOLE_HEIGHT / (looks * spread) + SLOPE * SLOPE;
        Some((-slope / slope.hypot(1.0), 1.0 / variance))
    }
}

impl Default for Upright {
    fn default() -> Self {
        Self {
            information: 0.0,
            sum: Vector2::zeros(),
            up: Vector3::y(),
            soles: (1e-6, Vector3::new(0.0, -USUAL_HEIGHT, 0.0) * 1e-6),
            way: Way::default(),
            is_held: false,
        }
    }
}

impl Upright {
    /// Takes the up axis and the camera's height for known, and follows no more.
    pub(super) fn hold(&mut self, up: &Vector3<f64>, height: f64) {
        self.up = *up;
        self.soles = (1.0, up * -height);
        self.is_held = true;
    }

    /// The camera's height above the floor where the person is, metres.
    pub(super) fn height(&self) -> f64 {
        -self.up.dot(&self.soles.1) / self.soles.0
    }

    /// The rotation into level axes, the smallest that stands the up axis on y.
    pub(super) fn level(&self) -> Matrix3<f64> {
        Rotation3::rotation_between(&self.up, &Vector3::y())
            .unwrap_or_else(Rotation3::identity)
            .into_inner()
    }

    /// Forgets a little.
    pub(super) fn forget(&mut self, seconds: f64) {
        let keep = (-seconds / MEMORY).exp();
        self.information *= keep;
        self.sum *= keep;
    }

    /// A standing body's axis from the feet to the shoulders, in `seconds` of looking.
    pub(super) fn stance(&mut self, axis: &Vector3<f64>, seconds: f64) {
        if self.is_held {
            return;
        }
        let Some(axis) = axis.try_normalize(1e-6) else {
            return;
        };
        let worth = seconds / STANCE_NEWS / (STANCE * STANCE);
        self.information += worth;
        self.sum += Vector2::new(axis.x, axis.z) * worth;
        let most = STANCE_LOOKS / (STANCE * STANCE);
        if self.information > most {
            self.sum *= most / self.information;
            self.information = most;
        }
        let (slope, steep) = self.way.up().unwrap_or_default();
        let sum = self.sum + Vector2::new(0.0, slope * steep);
        let information = PRIOR.add_scalar(self.information) + Vector2::new(0.0, steep);
        let mean = sum.component_div(&information);
        let [x, z] = [mean.x, mean.y].map(|v| v.clamp(-STEEPEST, STEEPEST));
        self.up = Vector3::new(x, (1.0 - x * x - z * z).max(0.1).sqrt(), z).normalize();
    }

    /// A point of the floor, seen for `seconds` with `trust` 0..=1.
    pub(super) fn touch(&mut self, point: &Vector3<f64>, seconds: f64, trust: f64) {
        if self.is_held {
            return;
        }
        self.way.touch(point, seconds * trust);
        let keep = (-seconds * trust / SOLE_MEMORY).exp();
        self.soles.0 = self.soles.0 * keep + seconds * trust;
        self.soles.1 = self.soles.1 * keep + point * (seconds * trust);
    }
}
