//! One finger's chain: the angles of its joints from the directions of its bones, and back.
//!
//! The four fingers bend in one plane: all three joints flex about one axis, square to the first bone at rest, and the first
//! joint also tilts that plane sideways (abduction). Each bone's direction measures the plane, so a bent finger shows its
//! abduction by its outer bones. The thumb's first two joints have two axes each, and its last one flexes.

use glam::{DQuat, DVec3};
use std::f64::consts::{PI, TAU};

/// Pull of the abduction towards none, against bones of length 1 that measure it: for a finger that points straight out of
/// the palm, whose bones do not.
const ABDUCTION_PRIOR: f64 = 1e-5;

/// Smallest and largest angle, radians.
pub(super) type Range = [f64; 2];

/// Angles of one finger's joints, radians; zero is T-pose. Positive flexion closes the hand.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(super) struct Angles {
    pub(super) flexion: [f64; 3],
    /// Of the first joint, and of the thumb's second.
    pub(super) abduction: [f64; 2],
}

/// What a finger's joints can do.
#[derive(Debug, Clone, Copy)]
pub(super) struct Limits {
    pub(super) flexion: [Range; 3],
    pub(super) abduction: [Range; 2],
    /// Share of the second joint's flexion that the third has, and how far it may be from that; the thumb's joints are free.
    pub(super) coupling: Option<(f64, f64)>,
}

/// A finger at rest, in the avatar's T-pose.
#[derive(Debug, Clone, Copy)]
pub(super) struct Finger {
    /// Directions of the three bones.
    bones: [DVec3; 3],
    /// Axis of flexion, square to the first bone.
    curl: DVec3,
    thumb: bool,
}

impl Finger {
    /// `joints` are the rest positions of the three joints; the last bone, whose end no joint marks, continues the second.
    /// `towards` is where the finger goes when it flexes. Nothing if the joints lie on each other.
    pub(super) fn new(joints: [DVec3; 3], towards: DVec3, thumb: bool) -> Option<Self> {
        let [first, second, third] = joints;
        let along = (second - first).try_normalize()?;
        let next = (third - second).try_normalize()?;
        let inward = towards.reject_from_normalized(along).try_normalize()?;
        Some(Self {
            bones: [along, next, next],
            curl: along.cross(inward),
            thumb,
        })
    }

    /// Angles that lay the bones along `directions` (unit vectors in the axes of the palm at rest); without any limit.
    pub(super) fn angles(&self, directions: [DVec3; 3]) -> Angles {
        if self.thumb {
            self.thumb_angles(directions)
        } else {
            self.planar_angles(directions)
        }
    }

    /// Rotations of the three joints, each relative to its parent.
    pub(super) fn rotations(&self, angles: &Angles) -> [DQuat; 3] {
        let [first, second, third] = angles.flexion;
        if self.thumb {
            let joint = |bone: usize, abduction: f64, flexion: f64| {
                self.axes(bone).map_or(DQuat::IDENTITY, |[across, curl]| {
                    DQuat::from_axis_angle(across, abduction)
                        * DQuat::from_axis_angle(curl, flexion)
                })
            };
            [
                joint(0, angles.abduction[0], first),
                joint(1, angles.abduction[1], second),
                joint(2, 0.0, third),
            ]
        } else {
            let flex = |angle: f64| DQuat::from_axis_angle(self.curl, angle);
            let across = self.bones[0].cross(self.curl);
            [
                DQuat::from_axis_angle(across, angles.abduction[0]) * flex(first),
                flex(second),
                flex(third),
            ]
        }
    }

    /// Axes of abduction and flexion of the joint before `bone`, both square to it.
    fn axes(&self, bone: usize) -> Option<[DVec3; 2]> {
        let along = self.bones[bone];
        let curl = self.curl.reject_from_normalized(along).try_normalize()?;
        Some([along.cross(curl), curl])
    }

    fn planar_angles(&self, directions: [DVec3; 3]) -> Angles {
        let along = self.bones[0];
        // The axis tilted by the abduction a is cos(a) curl - sin(a) along, and each bone keeps its angle to it.
        let seen = directions.map(|d| [d.dot(self.curl), -d.dot(along)]);
        let kept = self.bones.map(|bone| bone.dot(self.curl));
        let (mut uu, mut uv, mut vv) = (0.0, 0.0, ABDUCTION_PRIOR);
        for [u, v] in seen {
            uu += u * u;
            uv += u * v;
            vv += v * v;
        }
        // The least of the quadratic form, which has none of `kept` yet; Gauss-Newton brings it in.
        let mut abduction = 0.5 * (-2.0 * uv).atan2(vv - uu);
        for _ in 0..8 {
            let (sin, cos) = abduction.sin_cos();
            let (mut slope, mut square) = (ABDUCTION_PRIOR * sin * cos, ABDUCTION_PRIOR);
            for ([u, v], kept) in seen.into_iter().zip(kept) {
                let step = v * cos - u * sin;
                slope += step * (u * cos + v * sin - kept);
                square += step * step;
            }
            abduction -= (slope / square).clamp(-0.3, 0.3);
        }
        let abduction = wrap(abduction, 0.0);
        let upright = DQuat::from_axis_angle(along.cross(self.curl), -abduction);
        let inward = self.curl.cross(along);
        let turn = |d: DVec3| d.dot(inward).atan2(d.dot(along));
        let mut before = 0.0;
        let mut flexion = [0.0; 3];
        for ((angle, d), bone) in flexion.iter_mut().zip(directions).zip(self.bones) {
            let total = turn(upright * d) - turn(bone);
            *angle = wrap(total - before, PI / 3.0);
            before = total;
        }
        Angles {
            flexion,
            abduction: [abduction, 0.0],
        }
    }

    fn thumb_angles(&self, directions: [DVec3; 3]) -> Angles {
        let mut angles = Angles::default();
        let mut parent = DQuat::IDENTITY;
        for (bone, direction) in directions.into_iter().enumerate() {
            let Some([across, curl]) = self.axes(bone) else {
                continue;
            };
            let along = self.bones[bone];
            let local = parent.inverse() * direction;
            let (ahead, inward) = (local.dot(along), local.dot(curl.cross(along)));
            // Abduction first, by where the bone points square to the curl's plane; flexion is what is left.
            let side = local.dot(across.cross(along));
            let abduction = if bone < 2 { side.atan2(ahead) } else { 0.0 };
            let flexion = if bone < 2 {
                inward.atan2(ahead.hypot(side))
            } else {
                inward.atan2(ahead)
            };
            angles.flexion[bone] = flexion;
            if let Some(place) = angles.abduction.get_mut(bone) {
                *place = abduction;
            }
            parent *=
                DQuat::from_axis_angle(across, abduction) * DQuat::from_axis_angle(curl, flexion);
        }
        angles
    }
}

impl Angles {
    /// The nearest angles that a finger can have.
    pub(super) fn limited(mut self, limits: &Limits) -> Self {
        for (angle, [low, high]) in self.flexion.iter_mut().zip(limits.flexion) {
            *angle = angle.clamp(low, high);
        }
        for (angle, [low, high]) in self.abduction.iter_mut().zip(limits.abduction) {
            *angle = angle.clamp(low, high);
        }
        if let Some((share, band)) = limits.coupling {
            let [_, second, third] = &mut self.flexion;
            let [low, high] = limits.flexion[2];
            *third = third
                .clamp(share * *second - band, share * *second + band)
                .clamp(low, high);
        }
        self
    }

    /// From these angles to `other`'s by `share` (0..=1).
    pub(super) fn blend(&self, other: &Self, share: f64) -> Self {
        let mix = |a: f64, b: f64| a + (b - a) * share;
        Self {
            flexion: std::array::from_fn(|k| mix(self.flexion[k], other.flexion[k])),
            abduction: std::array::from_fn(|k| mix(self.abduction[k], other.abduction[k])),
        }
    }
}

/// `angle` plus whole turns, within half a turn of `about`.
fn wrap(angle: f64, about: f64) -> f64 {
    about + (angle - about + PI).rem_euclid(TAU) - PI
}
