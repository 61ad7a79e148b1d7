//! The points of the feet that stand on the floor.

use super::chain::{Attachment, wide};
use nalgebra::Vector3;
use spmm3::{Joint, Skeleton};

/// A heel behind its ankle, metres.
const HEEL: f64 = 0.05;

/// Heel and ball of the left foot, then of the right: points of the template's floor, y = 0.
pub(crate) fn soles(skeleton: &Skeleton) -> [Attachment; 4] {
    let at = |joint: Joint| wide(skeleton.rest_positions()[joint.index()]);
    let sole = |ankle: Joint, under: Joint, back: f64| {
        let point = Vector3::new(at(under).x, 0.0, at(under).z - back);
        Attachment::new(ankle, point - at(ankle))
    };
    use Joint::{LeftAnkle, LeftFoot, RightAnkle, RightFoot};
    [
        sole(LeftAnkle, LeftAnkle, HEEL),
        sole(LeftAnkle, LeftFoot, 0.0),
        sole(RightAnkle, RightAnkle, HEEL),
        sole(RightAnkle, RightFoot, 0.0),
    ]
}
