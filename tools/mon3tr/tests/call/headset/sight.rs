//! Whom a headset's pictures show, and where: found without the renderer, by what the studio behind them would look like.

use super::viewer::EYE;
use glam::DVec3;
use image::RgbImage;
use std::path::Path;
use test_support::headset_reference::{View, studio};
use test_support::monado::Scripted;

/// How far a colour is from the studio's, of 255, where it is somebody's.
const OTHER: f64 = 40.0;

/// Metres from the viewer to whoever they talk to.
pub(super) const DISTANCE: f64 = 1.6;

/// Height of a standing person's chest, and how far from its axis there is nothing of them: arms that are held out, metres.
const CHEST: f64 = 1.25;
const REACH: f64 = 1.1;

/// Half the side of the square around a chest that is looked at, pixels: as many on each side, wherever its middle lies.
const HALF: f64 = 4.0;

/// What is somebody's in both eyes' pictures.
pub(super) struct Sight {
    views: [View; 2],
    /// The middles of pixels that are not the studio's, from the upper left corner.
    theirs: [Vec<[f64; 2]>; 2],
}

impl Sight {
    /// The last pictures in `folder`, seen from where `scripted` has the head.
    pub(super) fn of(folder: impl AsRef<Path>, scripted: &Scripted) -> Self {
        let views = View::of(scripted, EYE);
        let theirs = ["left", "right"].map(|eye| {
            let file = folder.as_ref().join(format!("{eye}.png"));
            let picture = image::open(&file);
            picture
                .unwrap_or_else(|why| panic!("{}: {why}", file.display()))
                .into_rgb8()
        });
        let theirs = [0, 1].map(|eye| others_than_studio(&theirs[eye], &views[eye]));
        Self { views, theirs }
    }

    /// How many pixels show somebody, in each eye.
    pub(super) fn pixels(&self) -> [usize; 2] {
        [0, 1].map(|eye| self.theirs[eye].len())
    }

    /// What share of the pixels around the chest of somebody who stands there (x, z; metres) is theirs, in the eye that shows less.
    pub(super) fn at(&self, spot: [f64; 2]) -> f64 {
        let chest = DVec3::new(spot[0], CHEST, spot[1]);
        let shares = [0, 1].map(|eye| {
            let middle = self.views[eye].pixel(chest).map(f64::round);
            let near = |one: &&[f64; 2]| (0..2).all(|axis| (one[axis] - middle[axis]).abs() < HALF);
            let near = self.theirs[eye].iter().filter(near).count();
            near as f64 / (4.0 * HALF * HALF)
        });
        shares[0].min(shares[1])
    }

    /// Demands that somebody stands there and that all of it is theirs: that nothing is seen where they cannot be.
    pub(super) fn assert_stands_alone(&self, spot: [f64; 2]) {
        let share = self.at(spot);
        assert!(share > 0.9, "{share:.2} of the chest is somebody's");
        for (eye, view) in self.views.iter().enumerate() {
            let top = view.pixel(DVec3::new(spot[0] - REACH, 2.2, spot[1]));
            let below = view.pixel(DVec3::new(spot[0] + REACH, -0.2, spot[1]));
            for at in &self.theirs[eye] {
                let inside = [0, 1].map(|axis| (top[axis]..below[axis]).contains(&at[axis]));
                assert_eq!(inside, [true; 2], "eye {eye}: somebody at {at:?}");
            }
        }
    }

    /// The middle of what is somebody's, pixels from the left edge of each eye's picture.
    pub(super) fn middles(&self) -> [f64; 2] {
        [0, 1].map(|eye| {
            let columns = self.theirs[eye].iter().map(|one| one[0]);
            columns.sum::<f64>() / self.theirs[eye].len() as f64
        })
    }

    /// By geometry, how much farther to the right the left eye has what is so far away (metres) than the right one has.
    pub(super) fn disparity(&self, metres: f64) -> f64 {
        let ahead = DVec3::new(0.0, CHEST, -metres);
        let [left, right] = self.views.map(|view| view.pixel(ahead)[0]);
        left - right
    }
}

/// The middles of pixels that have another colour than the studio has there.
fn others_than_studio(picture: &RgbImage, view: &View) -> Vec<[f64; 2]> {
    assert_eq!([picture.width(), picture.height()], EYE, "an eye's picture");
    let others = picture.enumerate_pixels().filter(|(x, y, pixel)| {
        let way = view.floor_from_eye * view.toward(*x, *y);
        let wanted = studio(view.place, way);
        let off = pixel.0.iter().zip(wanted);
        let off = off.map(|(got, wanted)| (f64::from(*got) - 255.0 * wanted).abs());
        off.fold(0.0, f64::max) > OTHER
    });
    others
        .map(|(x, y, _)| [x, y].map(|at| f64::from(at) + 0.5))
        .collect()
}
