//! Rotations and their tangent vectors (radians), in f64.

use nalgebra::{Matrix3, Quaternion, UnitQuaternion, Vector3};

/// The matrix of `v x`.
#[must_use]
pub fn skew(v: &Vector3<f64>) -> Matrix3<f64> {
    Matrix3::new(0.0, -v.z, v.y, v.z, 0.0, -v.x, -v.y, v.x, 0.0)
}

/// The rotation by |v| radians about v.
#[must_use]
pub fn exp(v: &Vector3<f64>) -> UnitQuaternion<f64> {
    let angle = v.norm();
    // sin(a/2)/a, by its series where the quotient would lose digits.
    let factor = if angle < 1e-4 {
        0.5 - angle * angle / 48.0
    } else {
        (angle / 2.0).sin() / angle
    };
    let v = v * factor;
    UnitQuaternion::new_normalize(Quaternion::new((angle / 2.0).cos(), v.x, v.y, v.z))
}

/// The shortest tangent vector of a rotation, of length 0..=pi.
#[must_use]
pub fn log(rotation: &UnitQuaternion<f64>) -> Vector3<f64> {
    let (w, v) = if rotation.w < 0.0 {
        (-rotation.w, -rotation.imag())
    } else {
        (rotation.w, rotation.imag())
    };
    let sine = v.norm();
    if sine < 1e-6 {
        return v * 2.0;
    }
    v * (2.0 * sine.atan2(w) / sine)
}

/// How `log(R)` moves when R is turned by a small vector from the left: the inverse of SO(3)'s left Jacobian at `log(R)`
/// (Solà, Deray and Atchuthan, "A micro Lie theory", equation 146).
#[must_use]
pub fn log_by_left_turn(log: &Vector3<f64>) -> Matrix3<f64> {
    let angle = log.norm();
    let cross = skew(log);
    // 1/a^2 - (1 + cos a) / (2 a sin a), by its series near zero; the angle stays below the pole at 2 pi.
    let factor = if angle < 1e-3 {
        1.0 / 12.0 + angle * angle / 720.0
    } else {
        let half = angle.min(std::f64::consts::PI) / 2.0;
        (1.0 - half * half.cos() / half.sin()) / (angle * angle)
    };
    Matrix3::identity() - cross * 0.5 + cross * cross * factor
}
