//! What is taken for true of several cameras' footage: the limbs' landmarks, triangulated and smoothed, and a skeleton of their lengths.

use super::super::score::LIMBS;
use super::super::table;
use ::capture::Camera;
use anyhow::Context;
use capture_completion::view_of;
use glam::{DVec2, DVec3, Vec3};
use motion_fit::body::{landmark_places, triangulate};
use motion_fit::landmarks::Observation;
use spmm3::{Joint, MotionParams, Skeleton};

/// BlazePose's landmark at each of the limbs' joints.
pub(super) const LANDMARKS: [usize; LIMBS.len()] = [23, 24, 25, 26, 27, 28, 11, 12, 13, 14, 15, 16];
/// Confidence of a camera that sees a landmark at all.
const LEAST: f64 = 0.1;

/// The places of the limbs' landmarks, metres; `None` of what cameras do not agree on.
pub(super) type Limbs = [Option<DVec3>; LIMBS.len()];

/// The limbs' landmarks in the room in frame `k`, those that cameras agree on. They are not joints (the hips lie centimetres above and before theirs), so a fit is
/// compared where the same landmarks are on its skeleton.
pub(super) fn limbs_of(cameras: &[Camera], seen: &[Vec<Observation>], k: usize) -> Limbs {
    let views: Vec<_> = cameras.iter().map(view_of).collect();
    LANDMARKS.map(|landmark| {
        let pixels: Vec<_> = (cameras.iter().zip(seen).zip(&views))
            .map(|((camera, frames), view)| {
                let point = frames.get(k).and_then(Observation::body_landmarks)?;
                let point = point.points[landmark];
                let slopes = camera.slopes(point.pixel.as_dvec2())?;
                let pixel = slopes * view.focal + DVec2::from(camera.centre);
                // A camera that is not sure says a little all the same.
                let confidence = f64::from(point.confidence).max(LEAST);
                Some(([pixel.x, pixel.y].into(), confidence))
            })
            .map(|seen| seen.unwrap_or(([0.0; 2].into(), 0.0)))
            .collect();
        let located = triangulate(&views, &pixels)?;
        Some(DVec3::from_array(located.place.into()))
    })
}

/// The middle of seven frames, then a Gaussian of two frames' deviation, of those that know a limb. One that a frame does not know it does not get.
pub(super) fn smooth(frames: &[Limbs]) -> Vec<Limbs> {
    let near = |k: usize, reach: usize| k.saturating_sub(reach)..(k + reach + 1).min(frames.len());
    let of_known = |of: &dyn Fn(usize, usize) -> DVec3| -> Vec<Limbs> {
        (0..frames.len())
            .map(|k| std::array::from_fn(|limb| frames[k][limb].map(|_| of(k, limb))))
            .collect()
    };
    let middle = of_known(&|k, limb| {
        let known: Vec<DVec3> = frames[near(k, 3)].iter().filter_map(|f| f[limb]).collect();
        DVec3::from_array(std::array::from_fn(|axis| {
            let mut values: Vec<f64> = known.iter().map(|place| place[axis]).collect();
            values.sort_by(f64::total_cmp);
            values[values.len() / 2]
        }))
    });
    of_known(&|k, limb| {
        let (mut sum, mut weights) = (DVec3::ZERO, 0.0);
        for other in near(k, 6) {
            if let Some(place) = middle[other][limb] {
                let away = other as f64 - k as f64;
                let weight = (-away * away / 8.0).exp();
                sum += weight * place;
                weights += weight;
            }
        }
        sum / weights
    })
}

/// The skeleton with the limbs' lengths of the footage's person, as an avatar of theirs would have.
///
/// # Errors
/// If a length is known in no frame.
pub(super) fn as_long_as(skeleton: &Skeleton, truth: &[Limbs]) -> anyhow::Result<Skeleton> {
    let median = |of: &dyn Fn(&Limbs) -> Option<f64>| {
        table::median(truth.iter().filter_map(of).collect())
            .context("a length of the person is not known: in no frame do two cameras agree on both of its ends; check the footage and its calibration")
    };
    let length = |a: usize, b: usize| {
        median(&|limbs| {
            let side = |side: usize| Some(limbs[a + side]?.distance(limbs[b + side]?));
            Some((side(0)? + side(1)?) / 2.0)
        })
    };
    let apart = |a: usize| median(&|limbs| Some(limbs[a]?.distance(limbs[a + 1]?)));
    let (thigh, shank) = (length(0, 2)?, length(2, 4)?);
    let (upper_arm, forearm) = (length(6, 8)?, length(8, 10)?);
    let torso = median(&|limbs| {
        let trunk = limbs[6]? + limbs[7]? - limbs[0]? - limbs[1]?;
        Some(trunk.length() / 2.0)
    })?;
    let (hips, shoulders) = (apart(0)?, apart(6)?);
    let rest = skeleton.rest_positions();
    use Joint::*;
    // The skeleton's own landmarks, so that like is compared with like.
    let landmarks = limbs_on(skeleton, &MotionParams::default());
    let at = |joint: Joint| {
        let limb = LIMBS.iter().position(|limb| *limb == joint);
        limb.map_or(DVec3::ZERO, |limb| landmarks[limb])
    };
    let own_torso =
        (at(LeftShoulder).y + at(RightShoulder).y - at(LeftHip).y - at(RightHip).y) / 2.0;
    let own = |a: Joint, b: Joint| at(a).distance(at(b));
    let mut offsets: Vec<DVec3> = Joint::ALL
        .iter()
        .map(|joint| skeleton.rest_offset(*joint).as_dvec3())
        .collect();
    let mut stretch = |joints: [Joint; 2], share: f64| {
        for joint in joints {
            offsets[joint.index()] *= share;
        }
    };
    stretch([LeftHip, RightHip], hips / own(LeftHip, RightHip));
    stretch([LeftKnee, RightKnee], thigh / own(LeftHip, LeftKnee));
    stretch([LeftAnkle, RightAnkle], shank / own(LeftKnee, LeftAnkle));
    stretch(
        [LeftElbow, RightElbow],
        upper_arm / own(LeftShoulder, LeftElbow),
    );
    stretch([LeftWrist, RightWrist], forearm / own(LeftElbow, LeftWrist));
    for joint in [Spine1, Spine2, Spine3] {
        offsets[joint.index()] *= torso / own_torso;
    }
    for joint in [LeftCollar, RightCollar, LeftShoulder, RightShoulder] {
        let offset = &mut offsets[joint.index()];
        offset.x *= shoulders / own(LeftShoulder, RightShoulder);
        offset.y *= torso / own_torso;
    }
    let mut positions = [Vec3::ZERO; spmm3::JOINTS];
    for joint in Joint::ALL {
        let parent = joint.parent().map_or(Vec3::ZERO, |p| positions[p.index()]);
        positions[joint.index()] = parent + offsets[joint.index()].as_vec3();
    }
    // The legs' length decides how high the pelvis is over the floor.
    let lift = rest[LeftAnkle.index()].y - positions[LeftAnkle.index()].y;
    for position in &mut positions {
        position.y += lift;
    }
    Ok(Skeleton::new(positions)?)
}

/// The limbs' landmarks on a person, in the motion's room.
pub(super) fn limbs_on(skeleton: &Skeleton, motion: &MotionParams) -> [DVec3; LIMBS.len()] {
    let places = landmark_places(skeleton, motion);
    LANDMARKS.map(|landmark| places[landmark].map_or(DVec3::ZERO, |place| place.as_dvec3()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_limb_that_is_not_located_stays_so_and_moves_no_other() {
        let place = |k: usize| DVec3::new(0.01 * k as f64, 1.0, 5.0);
        let mut frames: Vec<Limbs> = (0..20).map(|k| [Some(place(k)); LIMBS.len()]).collect();
        for frame in &mut frames[8..11] {
            frame[3] = None;
        }
        let smoothed = smooth(&frames);
        for (k, limbs) in smoothed.iter().enumerate() {
            for (limb, at) in limbs.iter().enumerate() {
                let known = limb != 3 || !(8..11).contains(&k);
                assert_eq!(at.is_some(), known, "limb {limb} of frame {k}");
                // An even movement is smoothed to itself, but for the ends and the gap's, where one side is missing.
                let off = at.map_or(0.0, |at| at.distance(place(k)));
                assert!(off < 0.03, "limb {limb} of frame {k} is {off} m off");
            }
        }
        assert!(
            smooth(&[[None; LIMBS.len()]; 3])
                .iter()
                .flatten()
                .all(Option::is_none)
        );
    }

    #[test]
    fn lengths_that_no_frame_knows_are_refused_with_what_to_check() {
        let skeleton = Skeleton::new([Vec3::ZERO; spmm3::JOINTS]).expect("finite");
        let error = as_long_as(&skeleton, &[[None; LIMBS.len()]; 4]).expect_err("nothing");
        assert!(error.to_string().contains("calibration"), "{error}");
    }
}
