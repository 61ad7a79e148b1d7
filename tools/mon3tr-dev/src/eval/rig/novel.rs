//! Avatars of synthetic people in poses that their scans do not show, against the true person.
//!
//! The true person takes a pose as the avatar does: every joint is turned from where it was in the scan, in the person's space, as far as the avatar turned
//! it. What straight arms mean, where the person's origin is and how tall the person is are conventions; half a centimetre of them along
//! every outline would hide how flesh and Gaussians follow the joints. How far joints are from the truth is a figure of its own.

use glam::{DMat3, Quat, Vec3};
use reconstruct::simulate::PoseSampler;
use scan_rig::figures::likeness::{person_psnr, six_views};
use scan_rig::finish::Poser;
use scan_rig::pinhole::Pinhole;
use scan_rig::pipeline::Rigged;
use scan_rig::scan::Scan;
use scan_rig::synthetic::{ScanOptions, SyntheticPerson};
use spmm3::{
    Expressions, JOINTS, Joint, JointTransforms, LOOP_SECONDS, MotionClip, MotionParams, Playback,
};

/// Sampled poses, besides T-pose and moments of the built-in motion.
const SAMPLED: usize = 3;

/// Moments of the built-in motion, seconds.
const MOMENTS: [f64; 3] = [1.0, 4.0, 7.0];

/// Seed of the sampled poses.
const SEED: u64 = 5;

/// Mean signal-to-noise ratio of six views of each pose over the person, dB. `seen` gets each pose's number, the true person and the avatar in it, and a view.
pub(super) fn compare(
    person: &SyntheticPerson,
    rigged: &Rigged,
    options: &ScanOptions,
    seen: impl Fn(usize, &Scan, &Scan, &Pinhole) -> anyhow::Result<()>,
) -> anyhow::Result<Vec<f64>> {
    let avatar = &rigged.avatar;
    let poser = Poser::new(avatar)?;
    let clip = MotionClip::built_in(&avatar.skeleton, &avatar.expressions, LOOP_SECONDS, 30.0)?;
    let mut motions = vec![MotionParams::default()];
    motions.extend(MOMENTS.map(|seconds| clip.sample(seconds, Playback::Clamp)));
    let faces = Expressions::new();
    let mut sampler = PoseSampler::new(SEED, &faces, 0);
    motions.extend((0..SAMPLED).map(|_| sampler.sample()));
    let views = six_views(rigged.height);
    let truth = Truth::new(person, rigged, options);
    (motions.iter_mut().enumerate())
        .map(|(pose, motion)| {
            still_face(motion);
            let person = truth.posed(motion);
            let avatar = poser.scan(motion)?;
            if let Some(view) = views.first() {
                seen(pose, &person, &avatar, view)?;
            }
            let db = person_psnr(&person, &avatar, &views);
            Ok(db.iter().sum::<f64>() / db.len().max(1) as f64)
        })
        .collect()
}

/// The true person, who follows an avatar's joints.
struct Truth<'a> {
    person: &'a SyntheticPerson,
    rigged: &'a Rigged,
    options: &'a ScanOptions,
    /// The avatar's joints as it stood in the scan.
    then: JointTransforms,
    /// Metres of the avatar for one of the person's.
    scale: f64,
}

impl<'a> Truth<'a> {
    fn new(person: &'a SyntheticPerson, rigged: &'a Rigged, options: &'a ScanOptions) -> Self {
        Self {
            person,
            rigged,
            options,
            then: rigged.avatar.skeleton.pose(&rigged.scan_motion),
            scale: rigged.person_from_scene.scale * f64::from(options.unit),
        }
    }

    /// The person's Gaussians, in the avatar's space.
    fn posed(&self, motion: &MotionParams) -> Scan {
        let now = self.rigged.avatar.skeleton.pose(motion);
        let (new, old) = (rotations(&now), rotations(&self.then));
        let turns: [DMat3; JOINTS] = std::array::from_fn(|j| new[j] * old[j].transpose());
        let stance = self.person.stance();
        let person_from_scene = &self.rigged.person_from_scene;
        let upright = DMat3::from_quat(person_from_scene.rotation);
        let turned = std::array::from_fn(|j| turns[j] * upright * stance.rotations[j]);
        let [pelvis, ..] = stance.joints;
        let pelvis = person_from_scene.point(pelvis * f64::from(self.options.unit));
        let old = self.then.position(Joint::Pelvis) + self.rigged.scan_motion.root_translation;
        let new = now.position(Joint::Pelvis) + motion.root_translation;
        let pelvis = new.as_dvec3() + turns[0] * (pelvis - old.as_dvec3());
        let pose = self.person.standing(&turned, pelvis / self.scale);
        let mut scan = self.person.reposed(self.options, &pose);
        #[expect(clippy::cast_possible_truncation, reason = "about 1")]
        scan.transform(self.scale as f32, Quat::IDENTITY, Vec3::ZERO);
        scan
    }
}

/// World rotations of the joints.
fn rotations(joints: &JointTransforms) -> [DMat3; JOINTS] {
    joints.person_from_joint.map(|frame| {
        let axes = [
            frame.matrix3.x_axis,
            frame.matrix3.y_axis,
            frame.matrix3.z_axis,
        ];
        let [x, y, z] = axes.map(|axis| Vec3::from(axis).as_dvec3());
        DMat3::from_cols(x, y, z)
    })
}

/// The motion of the body alone, on the spot: the truth has no face that moves, and its fingers are not the question.
fn still_face(motion: &mut MotionParams) {
    motion.expression_mut().fill(0.0);
    for joint in Joint::ALL.into_iter().skip(Joint::Jaw.index()) {
        motion.set_axis_angle(joint, Vec3::ZERO);
    }
    motion.root_translation = Vec3::ZERO;
}
