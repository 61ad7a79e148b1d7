//! The whole way from a scene to an avatar, and what is told of it.

use crate::RigError;
use crate::finish::FinishOptions;
use crate::scan::Scan;
use glam::DVec3;
use serde::Serialize;
use splat_scene::{Scene, UpAxis};
use spmm3::{Avatar, JOINTS, Joint};
use std::path::PathBuf;
use std::time::Instant;

/// What an avatar's hands are made of.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Hands {
    /// The scan's own Gaussians, whatever the hands do.
    Keep,
    /// The body model's, in the colour of the scan's skin.
    Replace,
}

/// What a user may decide about a rig.
#[derive(Debug, Clone)]
pub struct RigOptions {
    /// The folder of MakeHuman's raw material.
    pub makehuman: PathBuf,
    /// The folder of the networks that see body and face.
    pub networks: PathBuf,
    /// The person's height, metres; nothing: an adult's mean.
    pub height: Option<f64>,
    /// Low and high corner of the box that holds the person, in the scene's coordinates; nothing: found.
    pub cut: Option<[DVec3; 2]>,
    /// Which axis of the scene points up; nothing: found.
    pub up: Option<UpAxis>,
    /// Joints whose places are known, in the scene's coordinates.
    pub joints: Vec<(Joint, DVec3)>,
    /// Whether what the person holds or wears is recognised, and moves as one piece.
    pub accessories: bool,
    /// The hands; nothing: by what is seen of them.
    pub hands: Option<Hands>,
    /// Name, licence and size of the avatar.
    pub finish: FinishOptions,
}

/// The steps of a rig, in their order.
pub const STEPS: [&str; 7] = [
    "finding the person",
    "looking at body and face",
    "measuring the surface",
    "fitting the body model",
    "binding the Gaussians",
    "completing face and hands",
    "assembling the avatar",
];

/// What is known of one joint.
#[derive(Debug, Clone, Serialize)]
pub struct JointFigures {
    /// SMPL-X's name.
    pub name: &'static str,
    /// Where it is in the scan, metres, in the person's space.
    pub position: [f64; 3],
    /// How sure that is, 0..=1.
    pub confidence: f64,
}

/// The time of one step.
#[derive(Debug, Clone, Serialize)]
pub struct StepSeconds {
    /// Its name, of [`STEPS`].
    pub step: &'static str,
    /// Seconds.
    pub seconds: f64,
}

/// What a rig found and measured.
#[derive(Debug, Clone, Default, Serialize)]
pub struct RigReport {
    /// Gaussians of the scene.
    pub scene_gaussians: usize,
    /// Gaussians of the avatar.
    pub gaussians: usize,
    /// Vertices of the template.
    pub vertices: usize,
    /// The joints of the body, without the fingers'.
    pub joints: Vec<JointFigures>,
    /// What the user should look at, in words.
    pub warnings: Vec<String>,
    /// The steps' times.
    pub steps: Vec<StepSeconds>,
}

/// An avatar, the pose of its scan, and what is told of it.
#[derive(Debug, Clone)]
pub struct Rigged {
    /// The avatar.
    pub avatar: Avatar,
    /// The motion that poses it as the scan stands.
    pub scan_motion: spmm3::MotionParams,
    /// The person's own Gaussians, cut out and upright, as they were before they were bound.
    pub scan: Scan,
    /// The joints in the pose of the scan, metres, in the person's space.
    pub joints: [DVec3; JOINTS],
    /// What was found and measured.
    pub report: RigReport,
}

/// Tells which step begins, and how long each took.
struct Steps<'a> {
    told: &'a dyn Fn(&'static str),
    current: Option<(&'static str, Instant)>,
    done: Vec<StepSeconds>,
}

impl<'a> Steps<'a> {
    fn new(told: &'a dyn Fn(&'static str)) -> Self {
        Self {
            told,
            current: None,
            done: Vec::new(),
        }
    }

    fn begin(&mut self, step: usize) {
        self.end();
        if let Some(step) = STEPS.get(step).copied() {
            (self.told)(step);
            self.current = Some((step, Instant::now()));
        }
    }

    fn end(&mut self) {
        if let Some((step, began)) = self.current.take() {
            let seconds = began.elapsed().as_secs_f64();
            log::debug!("{step}: {seconds:.2} s");
            self.done.push(StepSeconds { step, seconds });
        }
    }
}

/// Makes an avatar of the one person in `scene`. `told` is called with the name of each step (of [`STEPS`]) as it begins.
///
/// # Errors
/// If the scene is no scan of one whole person (the error says what to do), or a network or the renderer fails.
pub fn rig(
    scene: &Scene,
    options: &RigOptions,
    told: &dyn Fn(&'static str),
) -> Result<Rigged, RigError> {
    let mut steps = Steps::new(told);
    steps.begin(0);
    let _ = (scene, options);
    steps.end();
    Err(RigError::unsuited(
        "the parts of the rig are not joined yet",
    ))
}
