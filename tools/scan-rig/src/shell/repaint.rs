//! The shell's colours such that pictures of the face are those of the scan: least squares over some views.
//!
//! Colours that were looked up along lines differ from the scan's wherever the registration is off by a millimetre, and where a line
//! grazes: the shell's rim shows as an outline, cheeks as patches. With the geometry given a picture is linear in the colours: its error is
//! spread back over the Gaussians that caused it, some rounds (SIRT: Gilbert 1972; weights by rows and columns as van der Sluis and van der
//! Vorst 1990 give them).

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

/// Rounds. More would only paint the scan's noise.
const ROUNDS: usize = 10;

/// Pixels in which the Gaussians to be painted weigh less say nothing.
const FAINT: f32 = 0.02;

/// Pixels in which what the shell adds and is not painted (closed lids, eyes, lips' inside) weighs more say nothing: what is painted beside it would make up for
/// it, as a ring of specks.
const OTHERS: f32 = 0.08;

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

    /// Changes the colours of the Gaussians that `may` chooses, which are of those from `first_added` on, the shell's, such that pictures of `scan` are these.
    pub(crate) fn repaint(&self, scan: &mut Scan, first_added: usize, may: &[bool]) {
        let near = near(scan, self.centre, self.reach);
        let own = scan.filtered(&near);
        let members: Vec<usize> = (0..scan.len()).filter(|at| near[*at]).collect();
        let added: Vec<bool> = members.iter().map(|at| *at >= first_added).collect();
        let free: Vec<bool> = (members.iter())
            .map(|at| may[*at] && *at >= first_added)
            .collect();
        let systems: Vec<System> = (self.views.par_iter())
            .map(|(view, wanted)| {
                let unpainted = raster::draw_unpainted(&own, view, &added);
                System::new(&unpainted, wanted, &own.colours, &free)
            })
            .collect();
        let mut weights = vec![0.0_f32; own.len()];
        for (gaussian, weight) in systems.iter().flat_map(|system| &system.shares) {
            weights[*gaussian as usize] += weight;
        }
        let mut colours = own.colours;
        for _ in 0..ROUNDS {
            let spread: Vec<Vec<Vec3>> = (systems.par_iter())
                .map(|system| system.spread(&colours))
                .collect();
            for (at, colour) in colours.iter_mut().enumerate() {
                if weights[at] > LEAST {
                    let change: Vec3 = spread.iter().map(|spread| spread[at]).sum();
                    *colour = (*colour + change / weights[at]).clamp(Vec3::ZERO, Vec3::ONE);
                }
            }
        }
        for (at, colour) in members.into_iter().zip(colours) {
            scan.colours[at] = colour;
        }
    }
}

/// What the pixels of one view ask of the Gaussians that are painted.
struct System {
    /// For each pixel the light that is missing, and where its shares end.
    rows: Vec<(Vec3, usize)>,
    /// Gaussians and their blending weights.
    shares: Vec<(u32, f32)>,
}

impl System {
    /// `unpainted` is without the shell, of which `free` is painted.
    fn new(
        unpainted: &raster::Unpainted,
        wanted: &raster::Picture,
        colours: &[Vec3],
        free: &[bool],
    ) -> Self {
        let mut system = Self {
            rows: Vec::new(),
            shares: Vec::new(),
        };
        let now = &unpainted.picture;
        for (pixel, ends) in unpainted.starts.windows(2).enumerate() {
            let shares = &unpainted.shares[ends[0]..ends[1]];
            let opaque = wanted.transmittance[pixel] < CLEAR && now.transmittance[pixel] < CLEAR;
            let mut missing = wanted.colours[pixel] - now.colours[pixel];
            let (mut weight, mut others) = (0.0, 0.0);
            for (gaussian, share) in shares {
                if free[*gaussian as usize] {
                    weight += share;
                } else {
                    others += share;
                    missing -= colours[*gaussian as usize] * *share;
                }
            }
            if opaque && weight > FAINT && others < OTHERS && missing.is_finite() {
                let painted = shares
                    .iter()
                    .filter(|(gaussian, _)| free[*gaussian as usize]);
                system.shares.extend(painted);
                system.rows.push((missing, system.shares.len()));
            }
        }
        system
    }

    /// For each Gaussian the sum of the pixels' errors, each over the weight of all that are painted there, times its own weight.
    fn spread(&self, colours: &[Vec3]) -> Vec<Vec3> {
        let mut spread = vec![Vec3::ZERO; colours.len()];
        let mut start = 0;
        for (missing, end) in &self.rows {
            let shares = &self.shares[start..*end];
            start = *end;
            let (mut error, mut sum) = (*missing, 0.0);
            for (gaussian, weight) in shares {
                error -= colours[*gaussian as usize] * *weight;
                sum += weight;
            }
            for (gaussian, weight) in shares {
                spread[*gaussian as usize] += error * (*weight / sum);
            }
        }
        spread
    }
}

/// `[N_g]` which Gaussians are drawn.
fn near(scan: &Scan, centre: Vec3, reach: f32) -> Vec<bool> {
    (scan.positions.iter())
        .map(|position| position.distance_squared(centre) < reach * reach)
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::{DVec3, Quat};

    /// A board of Gaussians, 2 mm apart, at a height.
    fn board(z: f32, opacity: f32, colour: Vec3) -> Scan {
        let mut scan = Scan::default();
        for at in 0..900_u16 {
            let (x, y) = (f32::from(at % 30), f32::from(at / 30));
            scan.positions
                .push(Vec3::new(x * 0.002 - 0.03, y * 0.002 - 0.03, z));
            scan.rotations.push(Quat::IDENTITY);
            scan.scales.push(Vec3::new(0.0015, 0.0015, 0.0002));
            scan.opacities.push(opacity);
            scan.colours.push(colour);
        }
        scan
    }

    /// Pictures of a scan from three sides.
    fn pictures(scan: &Scan) -> Pictures {
        let views = [-0.2, 0.0, 0.2]
            .map(|aside: f64| {
                let eye = 0.8 * DVec3::new(aside.sin(), 0.0, aside.cos());
                let view = Pinhole::look_at(eye, DVec3::ZERO, DVec3::Y, FOCAL, 100, 100);
                (view, raster::draw(scan, &view))
            })
            .to_vec();
        Pictures {
            centre: Vec3::ZERO,
            reach: 0.2,
            views,
        }
    }

    /// In the board's middle.
    const MIDDLE: usize = 15 * 30 + 15;

    #[test]
    fn skin_under_thin_hair_gets_its_colour_although_little_of_it_shows() {
        let skin = Vec3::new(0.8, 0.6, 0.5);
        let mut scan = board(0.004, 0.4, Vec3::splat(0.1));
        scan.append(board(0.0, 0.99, skin));
        let pictures = pictures(&scan);
        let free: Vec<bool> = (0..scan.len()).map(|at| at >= 900).collect();
        for colour in &mut scan.colours[900..] {
            *colour = Vec3::splat(0.3);
        }
        pictures.repaint(&mut scan, 900, &free);
        // Away from the border.
        let off = (scan.colours[900 + MIDDLE] - skin).abs().max_element();
        println!("{} for {skin}", scan.colours[900 + MIDDLE]);
        assert!(off < 0.02, "{off} off");
        assert_eq!(scan.colours[0], Vec3::splat(0.1), "the hair's");
    }

    #[test]
    fn skin_does_not_make_up_for_a_lid_beside_it() {
        let skin = Vec3::new(0.8, 0.6, 0.5);
        let scanned = board(0.0, 0.99, skin);
        let pictures = pictures(&scanned);
        // The right half is a lid, which is darker than the eye that was scanned there.
        let is_lid = |at: usize| at % 30 >= 15;
        let mut scan = scanned.clone();
        for (at, colour) in scan.colours.iter_mut().enumerate() {
            *colour = Vec3::splat(if is_lid(at) { 0.1 } else { 0.5 });
        }
        let free: Vec<bool> = (0..scan.len()).map(|at| !is_lid(at)).collect();
        pictures.repaint(&mut scan, 0, &free);
        let row = &scan.colours[15 * 30..16 * 30];
        assert!(
            row[15..].iter().all(|c| *c == Vec3::splat(0.1)),
            "the lid's"
        );
        for (at, colour) in row[5..15].iter().enumerate() {
            // What is too near to the lid keeps its colour, and nothing overshoots by much.
            let is_between =
                colour.cmpge(Vec3::splat(0.49)).all() && colour.cmple(skin + 0.06).all();
            assert!(is_between, "{colour} at {}", 5 + at);
        }
        println!("{row:.2?}");
        assert!((row[8] - skin).abs().max_element() < 0.02, "{}", row[8]);
    }
}
