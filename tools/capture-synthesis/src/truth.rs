//! What is true of a synthetic capture, beside it: cameras without errors, motion, joints, and the person's template.
//!
//! `truth.json` has `cameras` (as `capture.json` has them), `expression_basis`, `joint_names` (55) and `frames`, each with the motion's name and time,
//! the 215 parameters, the root's translation, and the joints' places in the world (metres). `truth/template.obj` is the mesh in T-pose with its
//! texture coordinates.

use crate::error::SynthesisError;
use crate::lens::Lens;
use crate::performance::Performance;
use crate::ring::Ring;
use glam::Vec3;
use reconstruct::Person;
use serde::Serialize;
use spmm3::{ExpressionBasis, Joint};
use std::fmt::Write as _;
use std::path::Path;

/// The folder of the larger parts, below the capture's.
const FOLDER: &str = "truth";

#[derive(Debug, Serialize)]
struct Truth<'a> {
    cameras: Vec<TrueCamera>,
    expression_basis: &'a str,
    joint_names: Vec<&'static str>,
    frames: Vec<TrueFrame<'a>>,
}

#[derive(Debug, Serialize)]
struct TrueCamera {
    name: String,
    size: [u32; 2],
    focal: [f64; 2],
    centre: [f64; 2],
    distortion: [f64; 5],
    camera_from_world: [[f64; 4]; 3],
}

#[derive(Debug, Serialize)]
struct TrueFrame<'a> {
    motion: &'a str,
    seconds: f64,
    parameters: &'a [f32],
    root_translation: [f32; 3],
    joints: Vec<[f32; 3]>,
}

impl TrueCamera {
    fn new(camera: usize, lens: &Lens) -> Self {
        let pose = lens.camera_from_world;
        Self {
            name: Ring::name(camera),
            size: lens.size,
            focal: lens.focal,
            centre: lens.centre,
            distortion: [0.0; 5],
            camera_from_world: [0, 1, 2].map(|row| {
                let turn = pose.matrix3.row(row);
                [turn.x, turn.y, turn.z, pose.translation[row]]
            }),
        }
    }
}

/// Writes `truth.json` and `truth/template.obj` into a capture's folder. `joints` gives the 55 joints' places of each frame, motion after motion.
///
/// # Errors
/// If a file cannot be written.
pub fn write(
    folder: &Path,
    person: &Person,
    lenses: &[Lens],
    performances: &[Performance],
    joints: &[Vec<Vec3>],
) -> Result<(), SynthesisError> {
    let moments = performances.iter().flat_map(|performance| {
        let moments = performance.motions.iter().zip(&performance.seconds);
        moments.map(|(motion, seconds)| (&performance.name, motion, *seconds))
    });
    let truth = Truth {
        cameras: (lenses.iter().enumerate())
            .map(|(camera, lens)| TrueCamera::new(camera, lens))
            .collect(),
        expression_basis: ExpressionBasis::MAKEHUMAN_1.name(),
        joint_names: Joint::ALL.map(Joint::name).to_vec(),
        frames: moments
            .zip(joints)
            .map(|((motion_name, motion, seconds), joints)| TrueFrame {
                motion: motion_name,
                seconds,
                parameters: motion.values(),
                root_translation: motion.root_translation.to_array(),
                joints: joints.iter().map(Vec3::to_array).collect(),
            })
            .collect(),
    };
    let json = serde_json::to_vec(&truth).unwrap_or_default();
    save(&folder.join("truth.json"), &json)?;
    let parts = folder.join(FOLDER);
    std::fs::create_dir_all(&parts).map_err(|source| SynthesisError::Write {
        path: parts.clone(),
        source,
    })?;
    save(&parts.join("template.obj"), object(person).as_bytes())
}

/// The template as a Wavefront file: positions in metres, texture coordinates for each corner.
fn object(person: &Person) -> String {
    let mut text = String::from("# The template in T-pose; metres, y up\n");
    // Writing to a String cannot fail.
    for vertex in person.template().vertices() {
        let _ = writeln!(text, "v {} {} {}", vertex.x, vertex.y, vertex.z);
    }
    for uv in person.uvs().iter().flatten() {
        let _ = writeln!(text, "vt {} {}", uv.x, uv.y);
    }
    for (face, corners) in person.template().faces().iter().enumerate() {
        let [a, b, c] = corners.map(|corner| corner + 1);
        let first = 3 * face;
        let _ = writeln!(
            text,
            "f {a}/{} {b}/{} {c}/{}",
            first + 1,
            first + 2,
            first + 3
        );
    }
    text
}

fn save(path: &Path, bytes: &[u8]) -> Result<(), SynthesisError> {
    std::fs::write(path, bytes).map_err(|source| SynthesisError::Write {
        path: path.to_owned(),
        source,
    })
}
