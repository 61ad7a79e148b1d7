//! How well the template fits, for people and programs.

use serde::Serialize;

/// Figures of a first avatar.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
pub struct TemplateReport {
    /// Frames that the template was fitted to.
    pub frames: Vec<usize>,
    /// Names of the cameras that it was fitted to.
    pub cameras: Vec<String>,
    /// Pictures with the person in them.
    pub views: usize,
    /// Frames whose poses were fitted, those of [`Self::frames`] included.
    pub posed: usize,
    /// Height of the body in T-pose, metres.
    pub height: f64,
    /// Uniform scale of the body model.
    pub scale: f64,
    /// How thick clothes were found to be on average, metres.
    pub cloth: f64,
    /// Intersection over union of the masks with the registered body, 0..=1.
    pub body_overlap: f64,
    /// The same with the dressed one.
    pub dressed_overlap: f64,
    /// How far all captured poses had to be shifted, metres, and the largest turn of a joint, radians.
    pub shared_shift: f64,
    /// See [`Self::shared_shift`].
    pub shared_turn: f64,
    /// Mean shift of the pelvis and mean turn of a joint in single frames of the template, in addition: metres and radians.
    pub own_shift: f64,
    /// See [`Self::own_shift`].
    pub own_turn: f64,
    /// The largest distance of the dressed surface from the body, metres.
    pub thickest: f64,
    /// Vertices that were held back so that no face is inside out.
    pub held_back: usize,
    /// Share of the Gaussians on the outside whose colour a picture shows.
    pub coloured: f64,
    /// What the user should look at, in words.
    pub warnings: Vec<String>,
}
