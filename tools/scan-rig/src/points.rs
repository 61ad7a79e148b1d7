//! Points of a person that networks found in several views.

use glam::DVec3;

/// A triangulated landmark.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct KeyPoint {
    /// Where it is, metres.
    pub position: DVec3,
    /// Weighted root mean square distance of the rays from it, metres.
    pub residual: f64,
    /// How many views agree, weighted: 0 where it was not seen.
    pub support: f64,
}
