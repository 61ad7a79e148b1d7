//! What moves or was never seen: face, hands, and the places that no view showed.
//!
//! The body model lends its surface, the scan its colours: lips and lids become a fine shell (`face`), the mouth gets a dark inside,
//! teeth and tongue (`mouth`), the eyes turn (`eyes`), hands move or are replaced (`hands`), and triangles that no view showed are
//! covered in the colours and the grain of what is around them (`unseen`).

mod additions;
mod cells;
mod eyes;
mod face;
mod hands;
pub mod harmonic;
mod head;
mod lines;
mod mouth;
mod normals;
mod place;
mod repaint;
mod shown;
mod skin;
mod stray;
mod textures;
mod unseen;

#[cfg(test)]
mod tests;

pub use eyes::Eye;
pub use hands::{Hand, HandReport, Hands};
pub use textures::Textures;
pub use unseen::CoverageReport;

use crate::RigError;
use crate::bind::Bound;
use crate::body::{BodyModel, Registered};
use additions::Additions;
use glam::DVec3;
use head::Head;
use repaint::Pictures;
use serde::Serialize;

/// Choices in completing an avatar.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct ShellOptions {
    /// Give the face a shell, the mouth an inside, and eyes that turn. Without, the face moves as it was scanned.
    pub face: bool,
    /// What becomes of the hands: left, right.
    pub hands: [Hands; 2],
    /// Cover what no view showed.
    pub unseen: bool,
}

impl Default for ShellOptions {
    fn default() -> Self {
        Self {
            face: true,
            hands: [Hands::AsSeen; 2],
            unseen: true,
        }
    }
}

/// What completing an avatar did.
#[derive(Debug, Clone, PartialEq, Default, Serialize)]
pub struct ShellReport {
    /// Gaussians of the face's shell, the mouth's inside among them.
    pub face: usize,
    /// Gaussians of the scan that gave way to it.
    pub dropped: usize,
    /// Gaussians of both eyeballs.
    pub eyes: usize,
    /// Gaussians of teeth and tongue.
    pub teeth: usize,
    /// How far teeth and tongue moved back behind the lips, metres.
    pub teeth_moved: f64,
    /// What became of the hands: left, right.
    pub hands: [HandReport; 2],
    /// How much of the body is covered.
    pub coverage: CoverageReport,
    /// The eyeballs, left and right, in the scan's pose: their centres are where the eyes' joints have to be.
    #[serde(skip)]
    pub eyeballs: [Option<Eye>; 2],
}

/// Completes an avatar that was bound: face, eyes, mouth, hands, and what no view showed.
///
/// # Errors
/// If the body model, its registration and what is bound are of different runs, or the mesh has no T-pose.
pub fn complete(
    bound: &mut Bound,
    model: &BodyModel,
    registered: &Registered,
    textures: &Textures,
    options: &ShellOptions,
) -> Result<ShellReport, RigError> {
    let count = model.rest.len();
    if registered.vertices.len() != count
        || bound.mesh.vertices.len() < count
        || bound.mesh.faces.len() < model.faces.len()
    {
        return Err(RigError::unsuited(
            "the body model, its registration and the bound scan are of different runs: run all steps again on one scan",
        ));
    }
    let mut report = ShellReport::default();
    let stray = stray::tidy(bound, model, registered)?;
    log::debug!(
        "between parts of the body: {} left out, {} repainted; {} shortened",
        stray.dropped,
        stray.repainted,
        stray.shortened
    );
    let mut additions = Additions::default();
    let mut drop = vec![false; bound.scan.len()];
    let mut painted = None;
    if options.face {
        painted = Some(complete_face(
            bound,
            model,
            registered,
            textures,
            &mut additions,
            &mut drop,
            &mut report,
        ));
    }
    report.hands = hands::complete(
        bound,
        model,
        registered,
        textures,
        options.hands,
        painted.as_ref().map(|painted| painted.cheek),
        &mut additions,
        &mut drop,
    );
    let keep: Vec<bool> = drop.iter().map(|drop| !drop).collect();
    bound.retain(&keep);
    let first = bound.scan.len();
    join(bound, additions);
    if let Some(painted) = painted {
        let mut may = vec![false; bound.scan.len()];
        for (may, shell) in may.iter_mut().skip(first).zip(painted.as_scanned) {
            *may = shell;
        }
        painted.pictures.repaint(&mut bound.scan, first, &may);
    }
    let is_stiff = |face| hands::is_rigid(model, &report.hands, face);
    let fill = options.unseen.then_some(stray.closed_in.as_slice());
    report.coverage = unseen::complete(bound, model, registered, fill, is_stiff)?;
    Ok(report)
}

/// A face that has its shell.
struct Painted {
    /// The face as it was scanned.
    pictures: Pictures,
    /// Which of the additions' Gaussians are to look like it.
    as_scanned: Vec<bool>,
    /// The usual colour of the cheeks.
    cheek: DVec3,
}

/// Covers the face, the eyes and the mouth's inside.
fn complete_face(
    bound: &mut Bound,
    model: &BodyModel,
    registered: &Registered,
    textures: &Textures,
    additions: &mut Additions,
    drop: &mut [bool],
    report: &mut ShellReport,
) -> Painted {
    let (shaped, joints) = model.shaped(&registered.shape);
    let mut vertices = bound.mesh.vertices[..model.rest.len()].to_vec();
    let first = Head::new(model, registered, &vertices);
    place::settle(model, registered, (&shaped, &joints), &mut vertices, |v| {
        !first.shows[v]
    });
    let head = Head::new(model, registered, &vertices);
    let pictures = Pictures::new(&bound.scan, &head);
    let face = face::cover(model, &head, &vertices, &bound.scan, &bound.triangles);
    for (drop, gives_way) in drop.iter_mut().zip(&face.drop) {
        *drop |= *gives_way;
    }
    report.dropped = face.drop.iter().filter(|drop| **drop).count();
    report.face = face.additions.len();
    additions.append(face.additions);
    let before = additions.len();
    report.eyeballs = eyes::cover(
        model,
        registered,
        (&shaped, &joints),
        &head,
        &mut vertices,
        &bound.scan,
        face.cheek,
        additions,
    );
    report.eyes = additions.len() - before;
    let before = additions.len();
    report.teeth_moved = mouth::cover(
        model,
        registered,
        &shaped,
        &head,
        &mut vertices,
        textures,
        face.cheek,
        additions,
    );
    report.teeth = additions.len() - before;
    bound.mesh.vertices[..vertices.len()].copy_from_slice(&vertices);
    Painted {
        pictures,
        as_scanned: face.as_scanned,
        cheek: face.cheek,
    }
}

/// Joins Gaussians to what is bound.
fn join(bound: &mut Bound, additions: Additions) {
    bound
        .accessory
        .resize(bound.accessory.len() + additions.len(), 0);
    bound.triangles.extend(additions.triangles);
    bound.scan.append(additions.scan);
}
