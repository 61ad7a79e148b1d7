//! What is told of an avatar.

use crate::bind::BindReport;
use crate::body::{Heeded, Registered};
use crate::figures::coverage::Coverage;
use crate::prepare;
use crate::shell::ShellReport;
use crate::stopwatch::StepSeconds;
use serde::Serialize;
use spmm3::Joint;
use std::fmt;

/// What is known of one joint.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct JointFigures {
    /// SMPL-X's name.
    pub name: &'static str,
    /// Where it is in the scan, metres, in the person's space.
    pub position: [f64; 3],
    /// How sure that is, 0..=1.
    pub confidence: f64,
}

/// What one of the user's joints did.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct HintFigures {
    /// SMPL-X's name of the joint.
    pub name: &'static str,
    /// How far it is from where it is found without any hint, metres; nothing where it is not found.
    pub apart: Option<f64>,
    /// How far the joint ended from it, metres.
    pub missed: f64,
}

/// How the person stands in the file.
#[derive(Debug, Clone, PartialEq, Default, Serialize)]
pub struct Placement {
    /// Up, of unit length, in the file's axes.
    pub up: [f32; 3],
    /// Where the person faces, of unit length, in the file's axes.
    pub facing: [f32; 3],
    /// Metres for one unit of the file.
    pub metres_per_unit: f64,
    /// The person's height, metres.
    pub height: f64,
    /// Whether the user gave it; otherwise it is an adult's mean.
    pub height_given: bool,
}

/// How well the body model fits.
#[derive(Debug, Clone, PartialEq, Default, Serialize)]
pub struct FitFigures {
    /// Root mean square distance of the surface from the posed and shaped model, metres.
    pub surface: f64,
    /// Root mean square miss of the body's landmarks, metres.
    pub key_points: f64,
    /// Median distance of the displaced model from the surface, metres.
    pub displaced: f64,
    /// Median distance of the face's landmarks from their vertices, metres; none without a face.
    pub face: Option<f64>,
}

/// How good the avatar is: measured on demand, by [`super::measure`].
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Quality {
    /// Peak signal-to-noise ratio of the avatar in the scan's pose against the scan, over the person, dB: six views from the front on, counter-
    /// clockwise seen from above.
    pub scan_db: Vec<f64>,
    /// How the Gaussians cover the body in the scan's pose.
    pub scan_pose: Coverage,
    /// How they cover it in T-pose.
    pub t_pose: Coverage,
}

impl fmt::Display for Quality {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let views: Vec<String> = self.scan_db.iter().map(|db| format!("{db:.1}")).collect();
        let mean = self.scan_db.iter().sum::<f64>() / self.scan_db.len().max(1) as f64;
        write!(
            f,
            "in the scan's pose {mean:.1} dB against the scan (from six sides: {})",
            views.join(" ")
        )?;
        for (pose, covers) in [("there", &self.scan_pose), ("in T-pose", &self.t_pose)] {
            let Coverage { spill, holes } = covers;
            let (spill, holes) = (spill * 100.0, holes * 100.0);
            write!(f, "; {pose} spill {spill:.2} %, holes {holes:.2} %")?;
        }
        f.write_str(" (spill is drawn outside the body, holes are seen through)")
    }
}

/// What a rig found and measured.
#[derive(Debug, Clone, Default, Serialize)]
pub struct RigReport {
    /// Gaussians of the scene.
    pub scene_gaussians: usize,
    /// Gaussians before the least important ones were left out.
    pub all_gaussians: usize,
    /// Gaussians of the avatar.
    pub gaussians: usize,
    /// Vertices of the template.
    pub vertices: usize,
    /// The joints of the body, without the fingers'.
    pub joints: Vec<JointFigures>,
    /// How the person stands in the file.
    pub placement: Placement,
    /// What was measured while the person was found.
    pub prepare: prepare::Figures,
    /// How well the body model fits.
    pub fit: FitFigures,
    /// What the user's joints did.
    pub hints: Vec<HintFigures>,
    /// What binding did.
    pub bind: BindReport,
    /// What completing did.
    pub shell: ShellReport,
    /// How good the avatar is, where that was measured.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub quality: Option<Quality>,
    /// What the user should look at, in words.
    pub warnings: Vec<String>,
    /// What each of [`super::STEPS`] took. Never in a package, which is the same whenever it is made.
    #[serde(skip)]
    pub steps: Vec<StepSeconds>,
}

impl JointFigures {
    /// Those of the body, without the fingers'.
    pub(super) fn of(registered: &Registered) -> Vec<Self> {
        (Joint::ALL.into_iter().take(Joint::Jaw.index()))
            .map(|joint| Self {
                name: joint.name(),
                position: registered.joints[joint.index()].to_array(),
                confidence: registered.confidence[joint.index()],
            })
            .collect()
    }
}

impl HintFigures {
    pub(super) fn of(heeded: &Heeded) -> Self {
        Self {
            name: heeded.joint.name(),
            apart: heeded.apart,
            missed: heeded.missed,
        }
    }
}
