//! A headset's wearer: what their head and hands did is what the avatar does, by a forward kinematics of the tests' own.

#![allow(
    clippy::unwrap_used,
    clippy::expect_used,
    clippy::cast_possible_truncation,
    clippy::cast_precision_loss,
    reason = "tests fail by panicking; poses are narrowed for OpenXR's f32"
)]

mod body;
#[path = "../common/mod.rs"]
mod common;
mod errors;
mod face;
mod truth;

use common::{frames, recording, skeleton};
use errors::{check, check_slides, follow, print};
use truth::Truth;

#[test]
fn a_real_walk_and_real_punches_are_the_avatars_by_head_and_hands_alone() {
    let skeleton = skeleton();
    for name in ["mocap/cmu_02_01_walk.bvh", "mocap/cmu_02_05_punch.bvh"] {
        let Some(clip) = recording(name) else {
            return;
        };
        for size in [1.0, 1.08] {
            let truth = Truth {
                skeleton: &skeleton,
                size,
            };
            let errors = follow(&truth, &frames(&clip, 72.0), 72.0, |_| {});
            print(&format!("{name}, wearer of {size}"), &errors);
            check(&errors);
            check_slides(&errors);
        }
    }
}
