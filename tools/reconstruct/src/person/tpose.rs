//! From MakeHuman's rest pose (arms down and forward, legs apart) to SMPL-X's T-pose, with all 163 bones, before the
//! weights are collapsed: fingers and forearm twist straighten where the flesh is.

use crate::makehuman::{BoneWeights, Rig};
use glam::{Affine3A, Quat, Vec3};

/// How far the collar bones rise with the arms, radians: about what a shoulder does by itself.
const COLLAR_LIFT: f32 = 4.0 * std::f32::consts::PI / 180.0;

/// How far the straight legs spread, radians: SMPL-X's do, and trouser legs stay apart.
const LEG_SPREAD: f32 = 2.0 * std::f32::consts::PI / 180.0;

/// How straight the fingers become: 1 aligns the phalanges, 0 keeps the rest pose's curl.
const FINGER_STRAIGHTNESS: f32 = 0.75;

/// The T-pose: where each bone begins, and how it carries its flesh there.
pub(super) struct TPose {
    /// Joint positions, one a bone.
    pub(super) heads: Vec<Vec3>,
    /// Rest to T-pose, one a bone.
    pub(super) posed_from_rest: Vec<Affine3A>,
}

/// Straightens the rig whose bones rest between `heads` and `tails`.
pub(super) fn straighten(rig: &Rig, heads: &[Vec3], tails: &[Vec3]) -> TPose {
    let mut turned: Vec<Quat> = Vec::with_capacity(heads.len());
    let mut posed: Vec<Vec3> = Vec::with_capacity(heads.len());
    let chain = Chain { rig, heads, tails };
    for (index, bone) in rig.bones().iter().enumerate() {
        let (inherited, head) = match bone.parent {
            Some(p) => (turned[p], posed[p] + turned[p] * (heads[index] - heads[p])),
            None => (Quat::IDENTITY, heads[index]),
        };
        turned.push(chain.turn(&bone.name, inherited));
        posed.push(head);
    }
    let posed_from_rest = turned
        .iter()
        .zip(&posed)
        .zip(heads)
        .map(|((turn, to), from)| {
            Affine3A::from_rotation_translation(*turn, *to) * Affine3A::from_translation(-*from)
        })
        .collect();
    TPose {
        heads: posed,
        posed_from_rest,
    }
}

/// The rest pose, for directions of bones.
struct Chain<'a> {
    rig: &'a Rig,
    heads: &'a [Vec3],
    tails: &'a [Vec3],
}

impl Chain<'_> {
    /// Rotation of a bone from rest to T-pose, given what it inherits from its parent.
    fn turn(&self, name: &str, inherited: Quat) -> Quat {
        let Some((bare, side)) = name.split_once('.') else {
            return inherited;
        };
        let outward = if side == "L" { Vec3::X } else { -Vec3::X };
        let down = Quat::from_rotation_z(LEG_SPREAD * outward.x) * -Vec3::Y;
        let align = |turn: Quat, direction: Vec3, to: Vec3| {
            Quat::from_rotation_arc((turn * direction).normalize_or(to), to) * turn
        };
        let between = |from: &str, to: &str| self.between(from, to, side);
        match bare {
            "clavicle" => Quat::from_rotation_z(COLLAR_LIFT * outward.x) * inherited,
            "upperarm01" => {
                let upper = between("upperarm01", "lowerarm01");
                let straight = align(inherited, upper, outward);
                // The elbow bends forward: its hinge must stand upright. Half the roll here, the rest past the
                // deltoid.
                let roll = self.elbow_roll(straight, side, outward);
                Quat::from_axis_angle(outward, 0.5 * roll) * straight
            }
            "upperarm02" => {
                let roll = self.elbow_roll(inherited, side, outward);
                Quat::from_axis_angle(outward, roll) * inherited
            }
            "lowerarm01" => align(inherited, between("lowerarm01", "wrist"), outward),
            "lowerarm02" => {
                let roll = self.palm_roll(inherited, side, outward);
                Quat::from_axis_angle(outward, 0.5 * roll) * inherited
            }
            "wrist" => {
                let straight = align(inherited, between("wrist", "finger3-1"), outward);
                let roll = self.palm_roll(straight, side, outward);
                Quat::from_axis_angle(outward, roll) * straight
            }
            "upperleg01" => align(inherited, between("upperleg01", "lowerleg01"), down),
            "lowerleg01" => align(inherited, between("lowerleg01", "foot"), down),
            // The rest pose stands with flat soles.
            "foot" => Quat::IDENTITY,
            _ => self.finger(bare, side, inherited).unwrap_or(inherited),
        }
    }

    /// Fingers reach outward in the plane of the hand; the thumb keeps its angle to it.
    fn finger(&self, bare: &str, side: &str, inherited: Quat) -> Option<Quat> {
        let (finger, phalanx) = bare.strip_prefix("finger")?.split_once('-')?;
        if finger == "1" {
            return None;
        }
        let tail = |phalanx: &str| self.tail(&format!("finger{finger}-{phalanx}"), side);
        let head = |phalanx: &str| self.head(&format!("finger{finger}-{phalanx}"), side);
        let first = (tail("1") - head("1")).normalize_or_zero();
        let own = inherited * (tail(phalanx) - head(phalanx)).normalize_or_zero();
        let target = if phalanx == "1" {
            Vec3::new(own.x, 0.25 * own.y, 0.8 * own.z)
        } else {
            // Straight: in the direction that the rotation of the bone before it gives.
            inherited
                * if phalanx == "2" {
                    first
                } else {
                    (tail("2") - head("2")).normalize_or_zero()
                }
        };
        let target = own.lerp(
            target.normalize_or(own),
            if phalanx == "1" {
                1.0
            } else {
                FINGER_STRAIGHTNESS
            },
        );
        Some(
            Quat::from_rotation_arc(own.normalize_or(Vec3::X), target.normalize_or(Vec3::X))
                * inherited,
        )
    }

    /// Angle about `outward` that brings the elbow's hinge upright.
    fn elbow_roll(&self, turn: Quat, side: &str, outward: Vec3) -> f32 {
        let upper = self.between("upperarm01", "lowerarm01", side);
        let fore = self.between("lowerarm01", "wrist", side);
        // Bending forward moves the forearm from outward to +z.
        roll_between(turn * upper.cross(fore), outward.cross(Vec3::Z), outward)
    }

    /// Angle about `outward` that turns the palm down: index finger in front of the little one.
    fn palm_roll(&self, turn: Quat, side: &str, outward: Vec3) -> f32 {
        let across = self.head("finger2-1", side) - self.head("finger5-1", side);
        roll_between(turn * across, Vec3::Z, outward)
    }

    fn index(&self, bare: &str, side: &str) -> Option<usize> {
        self.rig.find(&format!("{bare}.{side}"))
    }

    fn head(&self, bare: &str, side: &str) -> Vec3 {
        self.index(bare, side).map_or(Vec3::ZERO, |i| self.heads[i])
    }

    fn tail(&self, bare: &str, side: &str) -> Vec3 {
        self.index(bare, side).map_or(Vec3::ZERO, |i| self.tails[i])
    }

    fn between(&self, from: &str, to: &str, side: &str) -> Vec3 {
        (self.head(to, side) - self.head(from, side)).normalize_or_zero()
    }
}

/// Angle about `axis` from `from` to `to`, seen along the axis; zero where one of them lies along it.
fn roll_between(from: Vec3, to: Vec3, axis: Vec3) -> f32 {
    let (from, to) = (from.reject_from(axis), to.reject_from(axis));
    if from.length_squared() < 1e-8 || to.length_squared() < 1e-8 {
        return 0.0;
    }
    from.cross(to).dot(axis).atan2(from.dot(to))
}

/// Linear blend skinning over the rig's bones: each vertex' map from rest to T-pose.
pub(super) fn blend(pose: &TPose, weights: &[BoneWeights]) -> Vec<Affine3A> {
    weights
        .iter()
        .map(|row| {
            let mut sum = Affine3A::from_mat3(glam::Mat3::ZERO);
            for (bone, weight) in row {
                if let Some(map) = pose.posed_from_rest.get(usize::from(*bone)) {
                    sum.matrix3 += map.matrix3 * *weight;
                    sum.translation += map.translation * *weight;
                }
            }
            sum
        })
        .collect()
}
