//! The shell's colours such that pictures of the face are those of the scan: least squares over some views.
//!
//! Colours that were looked up along lines differ from the scan's wherever the registration is off by a millimetre, and where a line
//! grazes: the shell's rim shows as an outline, cheeks as patches. With the geometry given a picture is linear in the colours; its error is
//! spread back over the Gaussians that caused it (SIRT: Gilbert 1972), a few rounds.

use super::head::Head;
use crate::pinhole::Pinhole;
use crate::scan::Scan;
use crate::surface::raster;
use glam::Vec3;
use rayon::prelude::*;

/// Directions from which the face is looked at: to the person's left and up, degrees.
const DIRECTIONS: [(f64, f64); 9] = [
    (0.0, 0.0),
    (-28.0, 0.0),
    (28.0, 0.0),
    (-55.0, 0.0),
    (55.0, 0.0),
    (-15.0, 22.0),
    (15.0, 22.0),
    (-20.0, -22.0),
    (20.0, -22.0),
];

/// Distance of the cameras, metres, focal length and sides, pixels: a pixel is a millimetre.
const DISTANCE: f64 = 0.8;
const FOCAL: f64 = 800.0;
const SIZE: [u32; 2] = [260, 320];

/// The middle of the pictures is this far under the eyes, metres.
const UNDER_EYES: f64 = 0.02;

/// What is farther from the face's middle is not drawn, metres.
const REACH: f64 = 0.24;

/// Pixels through which more light of what is behind comes say nothing.
const CLEAR: f32 = 0.05;

/// Rounds, and how much of the error each takes back.
const ROUNDS: usize = 10;
const STEP: f32 = 1.0;

/// A Gaussian that weighs less than so many pixels in all views keeps its colour.
const LEAST: f32 = 0.4;

/// Pictures of the scan's own face.
#[derive(Debug)]
pub(crate) struct Pictures {
    centre: Vec3,
    reach: f32,
    views: Vec<(Pinhole, raster::Picture)>,
}

impl Pictures {
    /// Pictures of the scan before anything of it gives way.
    pub(crate) fn new(scan: &Scan, head: &Head) -> Self {
        let target = head.centre - UNDER_EYES * head.scale * head.axes.y_axis;
        #[expect(clippy::cast_possible_truncation, reason = "metres")]
        let reach = (REACH * head.scale) as f32;
        let centre = target.as_vec3();
        let own = scan.filtered(&near(scan, centre, reach));
        let views = (DIRECTIONS.par_iter())
            .map(|(aside, up)| {
                let (aside, up) = (aside.to_radians(), up.to_radians());
                let towards = head.axes.z_axis * (aside.cos() * up.cos())
                    + head.axes.x_axis * (aside.sin() * up.cos())
                    + head.axes.y_axis * up.sin();
                let view = Pinhole::look_at(
                    target + DISTANCE * head.scale * towards,
                    target,
                    head.axes.y_axis,
                    FOCAL,
                    SIZE[0],
                    SIZE[1],
                );
                (view, raster::draw(&own, &view))
            })
            .collect();
        Self {
            centre,
            reach,
            views,
        }
    }

    /// Changes the colours of the Gaussians that `may` chooses, such that pictures of `scan` are these.
    pub(crate) fn repaint(&self, scan: &mut Scan, may: &[bool]) {
        let near = near(scan, self.centre, self.reach);
        let mut own = scan.filtered(&near);
        let members: Vec<usize> = (0..scan.len()).filter(|at| near[*at]).collect();
        let free: Vec<bool> = members.iter().map(|at| may[*at]).collect();
        for _ in 0..ROUNDS {
            let gathered: Vec<Vec<(Vec3, f32)>> = (self.views.par_iter())
                .map(|(view, wanted)| {
                    let now = raster::draw(&own, view);
                    let error = (wanted.colours.iter().zip(&wanted.transmittance))
                        .zip(now.colours.iter().zip(&now.transmittance))
                        .map(|((wanted, clear), (now, now_clear))| {
                            (*clear < CLEAR && *now_clear < CLEAR).then(|| *wanted - *now)
                        })
                        .collect();
                    raster::gather(&own, view, error)
                })
                .collect();
            for at in (0..own.len()).filter(|at| free[*at]) {
                let (error, weight) = (gathered.iter())
                    .map(|view| view[at])
                    .fold((Vec3::ZERO, 0.0), |(e, w), (error, weight)| {
                        (e + error, w + weight)
                    });
                if weight > LEAST && error.is_finite() {
                    let colour = own.colours[at] + error * (STEP / weight);
                    own.colours[at] = colour.clamp(Vec3::ZERO, Vec3::ONE);
                }
            }
        }
        for (at, colour) in members.iter().zip(own.colours) {
            scan.colours[*at] = colour;
        }
    }
}

/// `[N_g]` which Gaussians are drawn.
fn near(scan: &Scan, centre: Vec3, reach: f32) -> Vec<bool> {
    (scan.positions.iter())
        .map(|position| position.distance_squared(centre) < reach * reach)
        .collect()
}
