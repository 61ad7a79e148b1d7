//! The LPIPS term (paper, section IV-C): a network of a fixed size looks at a part of the picture as it is, so that each derivative belongs to one pixel.

use crate::backdrop::Backdrop;
use crate::random::mixed;
use crate::score::PERSON;
use splat_gradient::Picture;
use splat_gradient::error::GradientError;
use splat_gradient::loss::{PerceptualLoss, Target};

/// The part of what a seed decides that windows are.
const WINDOW: u64 = u64::MAX - 4;

/// The term costs as much as the rest of a step: it is taken in one step of so many, with a weight as many times as large. Backdrops take turns of four, so
/// that it meets all of them.
const EVERY: u8 = 3;

/// A network and its pictures' memory.
#[derive(Debug)]
pub(super) struct Perceptual {
    network: Box<dyn PerceptualLoss>,
    drawn: Vec<f32>,
    wanted: Vec<f32>,
    by_drawn: Vec<f32>,
}

impl Perceptual {
    pub(super) fn new(network: Box<dyn PerceptualLoss>) -> Self {
        let [width, height] = network.size();
        let picture = vec![0.0; 3 * width * height];
        Self {
            network,
            drawn: picture.clone(),
            wanted: picture.clone(),
            by_drawn: picture,
        }
    }

    /// What tells the network from others.
    pub(super) fn identity(&self) -> &str {
        self.network.identity()
    }

    /// The term of a step, of a picture before the step's backdrop. Adds its derivatives by the picture's colours to `by_pixel`.
    ///
    /// # Errors
    /// A network that fails; nothing was added then.
    pub(super) fn add(
        &mut self,
        (seed, step): (u64, u64),
        (shown, wanted): (&Picture, &Target),
        backdrop: &Backdrop,
        share: f32,
        by_pixel: &mut Picture,
    ) -> Result<f64, GradientError> {
        if share == 0.0 || !step.is_multiple_of(u64::from(EVERY)) {
            return Ok(0.0);
        }
        let mut rng = fastrand::Rng::with_seed(mixed(mixed(seed, WINDOW), step));
        let window = Window::over_person(wanted.picture(), self.network.size(), &mut rng);
        window.cut(shown, backdrop.colour(), &mut self.drawn);
        window.cut(wanted.picture(), backdrop.colour(), &mut self.wanted);
        let distance = (self.network).compare(&self.drawn, &self.wanted, &mut self.by_drawn)?;
        let share = f32::from(EVERY) * share;
        window.add(&self.by_drawn, share, by_pixel);
        Ok(f64::from(share) * distance)
    }
}

/// Where a network's picture lies on a larger or smaller one. Beyond the smaller one's edges there is backdrop.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct Window {
    /// Width and height of the network's picture.
    size: [usize; 2],
    /// The first column and row of the larger picture that the network sees.
    from: [usize; 2],
    /// Where they are in the network's.
    to: [usize; 2],
    /// Columns and rows that it sees.
    both: [usize; 2],
}

impl Window {
    /// With a pixel of the person in its middle, any as likely as another, as far as the window does not reach beyond the picture. Along a side that is shorter than the
    /// window's, the picture lies somewhere within it.
    fn over_person(wanted: &Picture, size: [usize; 2], rng: &mut fastrand::Rng) -> Self {
        let picture = [wanted.width(), wanted.height()];
        let mask = wanted.plane(3);
        let persons = || mask.iter().enumerate().filter(|(_, mask)| **mask >= PERSON);
        let chosen = match persons().count() {
            0 => None,
            count => persons().nth(rng.usize(..count)),
        };
        let middle = match chosen {
            Some((at, _)) => [at % picture[0], at / picture[0]],
            None => picture.map(|side| side / 2),
        };
        let (mut from, mut to, mut both) = ([0; 2], [0; 2], [0; 2]);
        for axis in 0..2 {
            both[axis] = size[axis].min(picture[axis]);
            let most = picture[axis] - both[axis];
            from[axis] = middle[axis].saturating_sub(size[axis] / 2).min(most);
            to[axis] = rng.usize(..=size[axis] - both[axis]);
        }
        Self {
            size,
            from,
            to,
            both,
        }
    }

    /// The pixels of a row of both: of the picture that is `width` wide, then of the network's.
    fn rows(&self, width: usize) -> impl Iterator<Item = [std::ops::Range<usize>; 2]> + use<> {
        let Self {
            size,
            from,
            to,
            both,
        } = *self;
        (0..both[1]).map(move |row| {
            let starts = [
                (from[1] + row) * width + from[0],
                (to[1] + row) * size[0] + to[0],
            ];
            starts.map(|start| start..start + both[0])
        })
    }

    /// Cuts a picture's red, green and blue out, as [3, height, width].
    fn cut(&self, picture: &Picture, backdrop: [f32; 3], out: &mut [f32]) {
        let planes = out.chunks_exact_mut(self.size[0] * self.size[1]);
        for ((channel, plane), colour) in planes.enumerate().zip(backdrop) {
            plane.fill(colour);
            for [there, here] in self.rows(picture.width()) {
                plane[here].copy_from_slice(&picture.plane(channel)[there]);
            }
        }
    }

    /// Adds derivatives by what was cut out to those by the picture.
    fn add(&self, by_cut: &[f32], share: f32, by_pixel: &mut Picture) {
        let width = by_pixel.width();
        let planes = by_cut.chunks_exact(self.size[0] * self.size[1]);
        for (channel, plane) in planes.enumerate() {
            for [there, here] in self.rows(width) {
                let sums = by_pixel.plane_mut(channel)[there].iter_mut();
                for (sum, by) in sums.zip(&plane[here]) {
                    *sum += share * by;
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A picture whose numbers are all different, with a person in its lower right corner.
    fn picture(width: usize, height: usize) -> Picture {
        let pixels = width * height;
        let mut numbers: Vec<f32> = (0..4 * pixels).map(|at| at as f32 / 1e4).collect();
        for (at, mask) in numbers[3 * pixels..].iter_mut().enumerate() {
            let within = at % width >= width / 2 && at / width >= height / 2;
            *mask = f32::from(u8::from(within));
        }
        Picture::new(width, height, numbers).expect("as many")
    }

    #[test]
    fn windows_lie_over_the_person_and_within_the_picture() {
        let wanted = picture(40, 30);
        let (mut columns, mut rows) = (Vec::new(), Vec::new());
        for seed in 0..200 {
            let mut rng = fastrand::Rng::with_seed(seed);
            let window = Window::over_person(&wanted, [8, 6], &mut rng);
            assert_eq!(window.both, [8, 6], "all of it is picture");
            assert!(window.from[0] >= 16 && window.from[1] >= 12, "{window:?}");
            columns.push(window.from[0]);
            rows.push(window.from[1]);
        }
        for (places, span) in [(columns, 16..=32), (rows, 12..=24)] {
            for place in span {
                assert!(places.contains(&place), "one begins at {place}");
            }
        }
    }

    #[test]
    fn derivatives_come_back_to_the_pixels_that_were_cut_out() {
        let wanted = picture(12, 5);
        for (size, seed) in [
            ([4, 3], 1),
            ([12, 5], 2),
            ([20, 3], 3),
            ([4, 9], 4),
            ([20, 9], 5),
        ] {
            let mut rng = fastrand::Rng::with_seed(seed);
            let window = Window::over_person(&wanted, size, &mut rng);
            let mut cut = vec![f32::NAN; 3 * size[0] * size[1]];
            window.cut(&wanted, [7.0, 8.0, 9.0], &mut cut);
            let backdrop = cut.iter().filter(|number| **number >= 7.0).count();
            let seen = window.both[0] * window.both[1];
            assert_eq!(backdrop, 3 * (size[0] * size[1] - seen), "around it");
            // Of numbers that are their own derivatives, each pixel gets its own.
            let mut by = Picture::transparent(12, 5);
            window.add(&cut, 2.0, &mut by);
            for channel in 0..3 {
                let pairs = by.plane(channel).iter().zip(wanted.plane(channel));
                for (by, number) in pairs.clone() {
                    assert!(*by == 0.0 || *by == 2.0 * number, "{by} of {number}");
                }
                let met = pairs.filter(|(by, _)| **by != 0.0).count();
                let zero = usize::from(channel == 0 && window.from == [0, 0]);
                assert_eq!(met, seen - zero, "all that were seen");
            }
            assert!(by.plane(3).iter().all(|by| *by == 0.0), "not alpha");
        }
    }

    #[test]
    fn nobody_is_looked_at_in_the_middle() {
        let wanted = Picture::transparent(30, 20);
        let window = Window::over_person(&wanted, [6, 4], &mut fastrand::Rng::with_seed(1));
        assert_eq!((window.from, window.both), ([12, 8], [6, 4]), "the middle");
        let none = Window::over_person(
            &Picture::transparent(0, 0),
            [6, 4],
            &mut fastrand::Rng::with_seed(1),
        );
        assert_eq!(none.both, [0, 0], "of no pixels");
    }
}
