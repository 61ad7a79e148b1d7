//! Motions to be photographed: moments spread evenly over clips, kept within the cameras' reach.

use crate::error::SynthesisError;
use glam::{Quat, Vec3};
use reconstruct::Person;
use reconstruct::simulate::PoseSampler;
use spmm3::{ExpressionBasis, Joint, LOOP_SECONDS, MotionClip, MotionParams, Playback};
use std::f32::consts::TAU;

/// How far the person travels from the middle of a motion at most, metres: cameras on a ring have to see them the whole time.
const REACH: f32 = 0.3;

/// Of clips that are made here.
const RATE: f64 = 30.0;

/// Poses that a made motion leads through, and seconds from one to the next.
const POSES: usize = 24;
const STEP_SECONDS: f64 = 1.0;

/// Photographs of one motion, in order.
#[derive(Debug, Clone, PartialEq)]
pub struct Performance {
    /// The motion's name.
    pub name: String,
    /// When each moment is in the clip, seconds.
    pub seconds: Vec<f64>,
    /// The moments; root translations are within 0.3 m of the motion's middle over the floor.
    pub motions: Vec<MotionParams>,
}

impl Performance {
    /// `count` moments of a clip, spread evenly over its whole length. The travel over the floor is measured from its mean and bent, so that
    /// it never leaves a circle of 0.3 m: what walks through a room walks on the spot.
    #[must_use]
    pub fn of(clip: &MotionClip, count: usize) -> Self {
        let length = (clip.frames.len().max(1) - 1) as f64 * clip.frame_seconds;
        let seconds: Vec<f64> = (0..count)
            .map(|k| length * (k as f64 + 0.5) / count as f64)
            .collect();
        let mut motions: Vec<MotionParams> = (seconds.iter())
            .map(|at| clip.sample(*at, Playback::Clamp))
            .collect();
        let over_floor = |motion: &MotionParams| motion.root_translation * Vec3::new(1.0, 0.0, 1.0);
        let sum: Vec3 = motions.iter().map(over_floor).sum();
        let mean = sum / motions.len().max(1) as f32;
        for motion in &mut motions {
            let travel = over_floor(motion) - mean;
            let bent = travel * (REACH / (REACH + travel.length()));
            motion.root_translation = bent + Vec3::Y * motion.root_translation.y;
        }
        Self {
            name: clip.name.clone(),
            seconds,
            motions,
        }
    }

    /// The same moments, in which the person turns once about the vertical through the pelvis, evenly: a camera that stands still sees every side.
    #[must_use]
    pub fn turning(mut self) -> Self {
        let count = self.motions.len().max(1) as f32;
        for (k, motion) in self.motions.iter_mut().enumerate() {
            let turn = Quat::from_rotation_y(TAU * k as f32 / count);
            motion.set_rotation(Joint::Pelvis, turn * motion.rotation(Joint::Pelvis));
        }
        self
    }
}

/// The motions of a capture for which no files were given: the built-in performance; poses sampled from the joints' ranges; and other ones
/// of these.
///
/// # Errors
/// If the built-in performance cannot be made.
pub fn built_in(person: &Person) -> Result<Vec<MotionClip>, SynthesisError> {
    let mut talk = MotionClip::built_in(person.skeleton(), person.presets(), LOOP_SECONDS, RATE)?;
    talk.expression_basis = Some(ExpressionBasis::MAKEHUMAN_1);
    Ok(vec![
        talk,
        sampled("sampled-1", 1, person),
        sampled("sampled-2", 2, person),
    ])
}

/// A motion through sampled poses, which stands at each for a moment.
fn sampled(name: &str, seed: u64, person: &Person) -> MotionClip {
    let mut sampler = PoseSampler::new(seed, person.presets(), person.expressions().len());
    let poses: Vec<MotionParams> = (0..POSES)
        .map(|_| on_floor(sampler.sample(), person))
        .collect();
    let keys = MotionClip {
        name: name.to_owned(),
        frames: poses,
        frame_seconds: STEP_SECONDS,
        expression_basis: None,
        notes: Vec::new(),
        unmapped: Vec::new(),
    };
    let frames = (0..)
        .map(|k| f64::from(k) / RATE)
        .take_while(|at| *at <= (POSES - 1) as f64 * STEP_SECONDS)
        .map(|at| {
            let key = (at / STEP_SECONDS).floor();
            let past = at / STEP_SECONDS - key;
            let eased = past * past * (3.0 - 2.0 * past);
            keys.sample((key + eased) * STEP_SECONDS, Playback::Clamp)
        })
        .collect();
    MotionClip {
        name: name.to_owned(),
        frames,
        frame_seconds: RATE.recip(),
        expression_basis: Some(ExpressionBasis::MAKEHUMAN_1),
        notes: Vec::new(),
        unmapped: Vec::new(),
    }
}

/// The pose with its lowest point on the floor: sampled poses crouch and sit, and their root does not know.
fn on_floor(mut pose: MotionParams, person: &Person) -> MotionParams {
    let lowest = (person.posed(&pose).iter())
        .map(|vertex| vertex.y)
        .fold(f32::INFINITY, f32::min);
    pose.root_translation.y -= lowest;
    pose
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn moments_are_spread_over_the_clip_and_stay_near_its_middle() {
        let frames = (0..101u8)
            .map(|k| {
                let mut motion = MotionParams::default();
                motion.root_translation = Vec3::new(f32::from(k) * 0.1, 0.02, 3.0);
                motion
            })
            .collect();
        let clip = MotionClip {
            name: "a walk".to_owned(),
            frames,
            frame_seconds: 0.1,
            expression_basis: None,
            notes: Vec::new(),
            unmapped: Vec::new(),
        };
        let performance = Performance::of(&clip, 4);
        assert_eq!(performance.seconds, [1.25, 3.75, 6.25, 8.75], "evenly");
        let roots: Vec<Vec3> = (performance.motions.iter())
            .map(|motion| motion.root_translation)
            .collect();
        assert!(
            roots.iter().all(|root| root.length() < REACH + 0.02),
            "{roots:?}"
        );
        assert!(
            roots.windows(2).all(|pair| pair[0].x < pair[1].x),
            "the order of the travel is kept: {roots:?}"
        );
        assert!(
            roots.iter().all(|root| (root.y - 0.02).abs() < 1e-6),
            "heights are kept: {roots:?}"
        );
    }

    #[test]
    fn who_turns_is_seen_from_every_side_and_bends_as_before() {
        let mut bent = MotionParams::default();
        bent.set_axis_angle(Joint::Pelvis, Vec3::X * 0.4);
        bent.set_axis_angle(Joint::LeftKnee, Vec3::X * 0.7);
        bent.root_translation = Vec3::new(0.1, 0.2, 0.3);
        let still = Performance {
            name: "a bow".to_owned(),
            seconds: vec![0.0; 8],
            motions: vec![bent.clone(); 8],
        };
        let turning = still.turning();
        for (motion, eighth) in turning.motions.iter().zip(0u8..) {
            let angle = f32::from(eighth) * std::f32::consts::FRAC_PI_4;
            // Where the person looks, and where the head is: the bow's own direction goes along.
            let facing = motion.rotation(Joint::Pelvis) * Vec3::Z;
            let upwards = motion.rotation(Joint::Pelvis) * Vec3::Y;
            let around = |v: Vec3| Vec3::new(angle.sin() * v.z, v.y, angle.cos() * v.z);
            let bow = |v: Vec3| {
                Vec3::new(
                    0.0,
                    0.4f32.cos() * v.y - 0.4f32.sin() * v.z,
                    0.4f32.sin() * v.y + 0.4f32.cos() * v.z,
                )
            };
            assert!(facing.distance(around(bow(Vec3::Z))) < 1e-5, "{facing}");
            assert!(upwards.distance(around(bow(Vec3::Y))) < 1e-5, "{upwards}");
            assert_eq!(
                motion.axis_angle(Joint::LeftKnee),
                bent.axis_angle(Joint::LeftKnee),
                "the knee"
            );
            assert_eq!(motion.root_translation, bent.root_translation, "the place");
        }
    }
}
