//! Which way is up for the camera and how high it is above the floor, learnt while a person stands and walks before it.
//!
//! One camera cannot tell a leaning person from a tilted camera. On average people stand upright, feet that touch the floor lie in one
//! plane, and cameras are rolled little: three linear observations of the up axis and the height, with slow forgetting.

use nalgebra::{Matrix3, Rotation3, Vector3};

/// How long what was seen counts, seconds.
const MEMORY: f64 = 60.0;
/// Standard deviations of a camera's roll and pitch before anything is seen, radians.
const ROLL: f64 = 0.03;
const PITCH: f64 = 0.15;
/// Of its height above the floor, metres, about [`USUAL_HEIGHT`].
const HEIGHT: f64 = 1.0;
const USUAL_HEIGHT: f64 = 1.2;
/// Standard deviation of a standing body's axis, radians, and the time after which its next look is news, seconds: the depth of a network's
/// landmarks errs alike for a while.
const STANCE: f64 = 0.12;
const STANCE_NEWS: f64 = 0.7;
/// Of a sole's height above the floor, metres, likewise.
const SOLE: f64 = 0.03;
const SOLE_NEWS: f64 = 0.2;
/// Steepest slope that is believed, as the up axis' part sideways.
const STEEPEST: f64 = 0.6;

/// The estimate. Axes: the camera's with y up and z towards it, not yet level.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Upright {
    /// Sideways parts x and z of the up axis, and the camera's height.
    information: Matrix3<f64>,
    vector: Vector3<f64>,
    value: Vector3<f64>,
}

fn prior() -> (Matrix3<f64>, Vector3<f64>) {
    let information = Vector3::new(ROLL, PITCH, HEIGHT).map(|s| 1.0 / (s * s));
    (
        Matrix3::from_diagonal(&information),
        Vector3::new(0.0, 0.0, USUAL_HEIGHT * information.z),
    )
}

impl Default for Upright {
    fn default() -> Self {
        Self {
            information: Matrix3::zeros(),
            vector: Vector3::zeros(),
            value: Vector3::new(0.0, 0.0, USUAL_HEIGHT),
        }
    }
}

impl Upright {
    /// The up axis.
    pub(super) fn up(&self) -> Vector3<f64> {
        let (x, z) = (self.value.x, self.value.y);
        Vector3::new(x, (1.0 - x * x - z * z).max(0.1).sqrt(), z).normalize()
    }

    /// The camera's height above the floor, metres.
    pub(super) fn height(&self) -> f64 {
        self.value.z
    }

    /// The rotation into level axes, the smallest that stands the up axis on y.
    pub(super) fn level(&self) -> Matrix3<f64> {
        Rotation3::rotation_between(&self.up(), &Vector3::y())
            .unwrap_or_else(Rotation3::identity)
            .into_inner()
    }

    /// Forgets a little.
    pub(super) fn pass(&mut self, seconds: f64) {
        let keep = (-seconds / MEMORY).exp();
        self.information *= keep;
        self.vector *= keep;
    }

    /// A standing body's axis from the feet to the shoulders, in `seconds` of looking.
    pub(super) fn stance(&mut self, axis: &Vector3<f64>, seconds: f64) {
        let Some(axis) = axis.try_normalize(1e-6) else {
            return;
        };
        let worth = seconds / STANCE_NEWS / (STANCE * STANCE);
        self.observe(&Vector3::new(1.0, 0.0, 0.0), axis.x, worth);
        self.observe(&Vector3::new(0.0, 1.0, 0.0), axis.z, worth);
    }

    /// A point of the floor, seen for `seconds` with `trust` 0..=1.
    pub(super) fn touch(&mut self, point: &Vector3<f64>, seconds: f64, trust: f64) {
        let up = self.up();
        let worth = trust * seconds / SOLE_NEWS / (SOLE * SOLE);
        self.observe(
            &Vector3::new(point.x, point.z, 1.0),
            -point.y * up.y,
            worth,
        );
    }

    /// Sets the camera's height, certain for now.
    pub(super) fn begin(&mut self, height: f64) {
        let information = 1.0 / (0.1 * 0.1);
        self.information[(2, 2)] += information;
        self.vector.z += information * height;
    }

    fn observe(&mut self, row: &Vector3<f64>, value: f64, information: f64) {
        self.information += row * row.transpose() * information;
        self.vector += row * (value * information);
    }

    /// Takes the observations into the estimate.
    pub(super) fn settle(&mut self) {
        let (information, vector) = prior();
        let Some(factor) = (self.information + information).cholesky() else {
            return;
        };
        let value = factor.solve(&(self.vector + vector));
        if value.iter().all(|v| v.is_finite()) {
            self.value = Vector3::new(
                value.x.clamp(-STEEPEST, STEEPEST),
                value.y.clamp(-STEEPEST, STEEPEST),
                value.z.clamp(-1.0, 5.0),
            );
        }
    }
}
