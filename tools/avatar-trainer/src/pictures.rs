//! The capture's pictures as steps take them: cut to the person, premultiplied, halved, in an order of their own.

use crate::error::TrainError;
use crate::random::mixed;
use capture::{Camera, Capture};
use glam::{Affine3A, Mat3A};
use rayon::prelude::*;
use splat_gradient::error::GradientError;
use splat_gradient::loss::Target;
use splat_gradient::view::MOST_PIXELS;
use splat_gradient::{Picture, View};
use std::sync::Arc;

/// Pictures are halved at most so often: a cut's sides and corners are multiples of 2 to the power of it.
pub const MOST_HALVINGS: u32 = 2;
/// Pixels of background around the person.
const MARGIN: usize = 12;
/// A picture is not halved below so many pixels of its longer side.
const LEAST_SIDE: usize = 96;
/// Where no person is seen, a piece of background this wide and high is looked at.
const NOBODY: usize = 64;

/// A pixel whose mask is at least this shows nothing but the person.
const INSIDE: u8 = 250;
/// Such pixels are looked for so many pixels around one that is shared with the background, the nearer first.
const NEAR: [usize; 3] = [1, 2, 4];

/// One camera's picture of one frame.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct Pair {
    /// Index of the camera.
    pub camera: usize,
    /// Number of the frame.
    pub frame: usize,
}

/// A photograph cut to the person.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Cut {
    corner: [usize; 2],
    size: [usize; 2],
    /// Row by row: the person's red, green and blue, and the mask.
    pixels: Vec<[u8; 4]>,
}

impl Cut {
    /// Cuts a photograph of `size`, rows of `rgb` [h, w, 3] and its `mask` [h, w].
    #[must_use]
    pub fn new(size: [usize; 2], rgb: &[u8], mask: &[u8]) -> Self {
        let [width, height] = size;
        let (mut columns, mut rows) = (width..0, height..0);
        for (y, row) in mask.chunks_exact(width.max(1)).enumerate() {
            let Some(first) = row.iter().position(|mask| *mask != 0) else {
                continue;
            };
            let last = row.iter().rposition(|mask| *mask != 0).unwrap_or(first);
            columns = columns.start.min(first)..columns.end.max(last + 1);
            rows = rows.start.min(y)..rows.end.max(y + 1);
        }
        if columns.is_empty() {
            let middle =
                |side: usize| side.saturating_sub(NOBODY) / 2..side.min(side / 2 + NOBODY / 2);
            (columns, rows) = (middle(width), middle(height));
        }
        let step = 1 << MOST_HALVINGS;
        // Corners and sides are multiples of `step`; a cut may reach beyond the picture's right and lower edge, where nothing is known.
        let start = |side: usize| side.saturating_sub(MARGIN) / step * step;
        let corner = [start(columns.start), start(rows.start)];
        let end = |side: usize, most: usize| (side + MARGIN).min(most);
        let cut_size = [
            (end(columns.end, width) - corner[0]).next_multiple_of(step),
            (end(rows.end, height) - corner[1]).next_multiple_of(step),
        ];
        let mut pixels = vec![[0; 4]; cut_size[0] * cut_size[1]];
        for (y, out) in pixels.chunks_exact_mut(cut_size[0].max(1)).enumerate() {
            let from = (corner[1] + y) * width;
            if corner[1] + y >= height {
                break;
            }
            let across = cut_size[0].min(width - corner[0]);
            for (x, out) in out.iter_mut().take(across).enumerate() {
                let at = from + corner[0] + x;
                if let (Some([r, g, b]), Some(mask)) = (rgb.get(3 * at..3 * at + 3), mask.get(at)) {
                    *out = [*r, *g, *b, *mask];
                }
            }
        }
        let mut cut = Self {
            corner,
            size: cut_size,
            pixels,
        };
        cut.clear_edges();
        cut
    }

    /// Gives pixels that the person shares with the background the colour of the person beside them: the photograph's is a mixture, of which
    /// only the share is known.
    fn clear_edges(&mut self) {
        let [width, height] = self.size;
        let own = self.pixels.clone();
        for (at, pixel) in self.pixels.iter_mut().enumerate() {
            if !(1..INSIDE).contains(&pixel[3]) {
                continue;
            }
            let (x, y) = (at % width, at / width);
            for reach in NEAR {
                let columns = x.saturating_sub(reach)..(x + reach + 1).min(width);
                let (mut sums, mut count) = ([0u32; 3], 0);
                for row in y.saturating_sub(reach)..(y + reach + 1).min(height) {
                    for near in &own[row * width..][columns.clone()] {
                        if near[3] >= INSIDE {
                            count += 1;
                            for (sum, channel) in sums.iter_mut().zip(near) {
                                *sum += u32::from(*channel);
                            }
                        }
                    }
                }
                let mean = sums.map(|sum| (sum + count / 2).checked_div(count));
                if let [Some(red), Some(green), Some(blue)] = mean {
                    for (channel, mean) in pixel.iter_mut().zip([red, green, blue]) {
                        *channel = u8::try_from(mean).unwrap_or(u8::MAX);
                    }
                    break;
                }
            }
        }
    }

    /// Bytes that it takes.
    fn bytes(&self) -> usize {
        4 * self.pixels.len()
    }

    /// How often it is halved if `wanted` is asked for: less often where little would be left.
    #[must_use]
    pub fn halvings(&self, wanted: u32) -> u32 {
        let longer = self.size[0].max(self.size[1]);
        (0..=wanted.min(MOST_HALVINGS))
            .rev()
            .find(|halvings| longer >> halvings >= LEAST_SIDE)
            .unwrap_or(0)
    }

    /// What should be drawn: premultiplied by the mask, then each 2^halvings x 2^halvings pixels' mean.
    ///
    /// # Errors
    /// None for at most [`MOST_HALVINGS`].
    pub fn target(&self, halvings: u32) -> Result<Target, GradientError> {
        let side = 1usize << halvings;
        let [width, height] = self.size.map(|length| length / side);
        let mut numbers = vec![0.0f32; 4 * width * height];
        let (rgb, alpha) = numbers.split_at_mut(3 * width * height);
        let (red, rest) = rgb.split_at_mut(width * height);
        let (green, blue) = rest.split_at_mut(width * height);
        let planes = (
            red.par_chunks_mut(width.max(1)),
            green.par_chunks_mut(width.max(1)),
            blue.par_chunks_mut(width.max(1)),
            alpha.par_chunks_mut(width.max(1)),
        );
        let count = side * side;
        #[expect(clippy::cast_precision_loss, reason = "at most 16 pixels")]
        let share = 1.0 / count as f32;
        planes
            .into_par_iter()
            .enumerate()
            .for_each(|(y, (red, green, blue, alpha))| {
                for x in 0..width {
                    let mut sums = [0u32; 4];
                    for row in 0..side {
                        let from = (y * side + row) * self.size[0] + x * side;
                        for pixel in &self.pixels[from..from + side] {
                            let mask = u32::from(pixel[3]);
                            for (sum, channel) in sums.iter_mut().zip(pixel).take(3) {
                                *sum += u32::from(*channel) * mask;
                            }
                            sums[3] += mask;
                        }
                    }
                    #[expect(clippy::cast_precision_loss, reason = "sums of at most 16 x 2^16")]
                    let mean = |sum: u32, most: f32| sum as f32 * share / most;
                    red[x] = mean(sums[0], 255.0 * 255.0);
                    green[x] = mean(sums[1], 255.0 * 255.0);
                    blue[x] = mean(sums[2], 255.0 * 255.0);
                    alpha[x] = mean(sums[3], 255.0);
                }
            });
        Ok(Target::new(Picture::new(width, height, numbers)?))
    }

    /// The camera of [`Self::target`]: `camera` without its distortion, shifted to the cut's corner, its pixels as large as the target's.
    ///
    /// # Errors
    /// A camera by which nothing can be drawn.
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_precision_loss,
        reason = "drawn in single precision; pixel counts are small"
    )]
    pub fn view(&self, camera: &Camera, halvings: u32) -> Result<View, GradientError> {
        let side = f64::from(1u32 << halvings);
        let camera = camera.undistorted();
        let pose = camera.camera_from_world;
        let focal = camera.focal.map(|focal| (focal / side) as f32);
        let centre =
            [0, 1].map(|axis| ((camera.centre[axis] - self.corner[axis] as f64) / side) as f32);
        let rigid = Affine3A {
            matrix3: Mat3A::from(pose.matrix3.as_mat3()),
            translation: pose.translation.as_vec3().into(),
        };
        View::new(
            rigid,
            focal,
            centre,
            self.size.map(|length| length >> halvings),
        )
    }
}

/// The capture's pictures; keeps as many decoded as fit its memory.
#[derive(Debug)]
pub struct Pictures<'a> {
    capture: &'a Capture,
    kept: Vec<Option<Arc<Cut>>>,
    bytes: usize,
    most_bytes: usize,
}

impl<'a> Pictures<'a> {
    /// Of a capture, with at most so many bytes kept decoded.
    #[must_use]
    pub fn new(capture: &'a Capture, most_bytes: usize) -> Self {
        Self {
            capture,
            kept: vec![None; capture.cameras().len() * capture.frames()],
            bytes: 0,
            most_bytes,
        }
    }

    /// The capture.
    #[must_use]
    pub fn capture(&self) -> &'a Capture {
        self.capture
    }

    /// A picture, from memory or its file. What is in memory stays there: with every picture asked for once a round, giving up an older one for a
    /// newer one would only mean that none is found.
    ///
    /// # Errors
    /// A picture that cannot be read, has no mask, or is not of its camera's size.
    pub fn cut(&mut self, pair: Pair) -> Result<Arc<Cut>, TrainError> {
        let index = pair.camera * self.capture.frames() + pair.frame;
        if let Some(Some(cut)) = self.kept.get(index) {
            return Ok(Arc::clone(cut));
        }
        let cut = Arc::new(self.read(pair)?);
        let bytes = self.bytes.saturating_add(cut.bytes());
        if let Some(kept) = self.kept.get_mut(index)
            && bytes <= self.most_bytes
        {
            *kept = Some(Arc::clone(&cut));
            self.bytes = bytes;
        }
        Ok(cut)
    }

    fn read(&self, Pair { camera, frame }: Pair) -> Result<Cut, TrainError> {
        let photograph = self.capture.photograph(camera, frame)?;
        let name = || {
            let camera = self.capture.cameras().get(camera);
            camera.map_or_else(String::new, |camera| camera.name.clone())
        };
        let Some(mask) = &photograph.mask else {
            return Err(TrainError::NoMask {
                camera: name(),
                frame,
            });
        };
        let size = photograph.size.map(|side| side as usize);
        let pixels = size[0].saturating_mul(size[1]);
        for (what, got, expected) in [
            (
                "the picture",
                photograph.rgb.len(),
                pixels.saturating_mul(3),
            ),
            ("the mask", mask.len(), pixels),
        ] {
            if got != expected {
                return Err(TrainError::PictureSize {
                    camera: name(),
                    frame,
                    what,
                    got,
                    expected,
                });
            }
        }
        Ok(Cut::new(size, &photograph.rgb, mask))
    }
}

/// Refuses a capture with a camera for which nothing can be drawn, before anything is made of it. Held-out cameras count: avatars are measured on them.
///
/// # Errors
/// Names the first such camera.
pub fn check_cameras(capture: &Capture) -> Result<(), TrainError> {
    let large = |side: &u32| *side as usize > MOST_PIXELS;
    match capture
        .cameras()
        .iter()
        .find(|camera| camera.size.iter().any(large))
    {
        None => Ok(()),
        Some(camera) => Err(TrainError::CameraSize {
            camera: camera.name.clone(),
            width: camera.size[0],
            height: camera.size[1],
            most: MOST_PIXELS,
        }),
    }
}

/// Which pictures are learnt from, and which are held back from them.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Split {
    /// Learnt from, by camera and frame.
    pub training: Vec<Pair>,
    /// Held back, to tell which package is the best so far.
    pub validation: Vec<Pair>,
}

impl Split {
    /// Of the capture's cameras and frames that `eval` does not measure on, `validation` pictures are held back: at most a tenth, and none of
    /// fewer than ten.
    ///
    /// # Errors
    /// Nothing to learn from, or a camera that cannot be drawn for.
    pub fn new(capture: &Capture, validation: usize, seed: u64) -> Result<Self, TrainError> {
        let held_out = capture.held_out();
        check_cameras(capture)?;
        let cameras = held_out.kept_cameras(capture.cameras().len());
        let frames = held_out.kept_frames(capture.frames());
        let mut training: Vec<Pair> = (cameras.iter())
            .flat_map(|camera| {
                frames.iter().map(|frame| Pair {
                    camera: *camera,
                    frame: *frame,
                })
            })
            .collect();
        if training.is_empty() {
            return Err(TrainError::NoPictures(format!(
                "{} of {} cameras and {} of {} frames are held out",
                held_out.cameras.len(),
                capture.cameras().len(),
                held_out.frames.len(),
                capture.frames()
            )));
        }
        let count = validation.min(training.len() / 10);
        fastrand::Rng::with_seed(mixed(seed, u64::MAX)).shuffle(&mut training);
        let validation = training.split_off(training.len() - count);
        training.sort_unstable_by_key(|pair| (pair.camera, pair.frame));
        Ok(Self {
            training,
            validation,
        })
    }

    /// The picture of a step: every one once a round, in an order that differs from round to round. A function of seed and step alone.
    #[must_use]
    pub fn at(&self, step: u64, seed: u64) -> Pair {
        let count = self.training.len() as u64;
        let (round, place) = (step / count, step % count);
        let mut order: Vec<usize> = (0..self.training.len()).collect();
        fastrand::Rng::with_seed(mixed(seed, round)).shuffle(&mut order);
        let place = usize::try_from(place).unwrap_or(0);
        self.training[order[place]]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::{DAffine3, DVec3};

    /// A red square of 40 x 60 pixels at (30, 20) in front of a green wall, its edge half covered.
    fn photograph() -> ([usize; 2], Vec<u8>, Vec<u8>) {
        let size = [120, 100];
        let (mut rgb, mut mask) = (Vec::new(), Vec::new());
        for y in 0..size[1] {
            for x in 0..size[0] {
                let inside = (30..70).contains(&x) && (20..80).contains(&y);
                let within = (31..69).contains(&x) && (21..79).contains(&y);
                let (colour, cover) = match (inside, within) {
                    (_, true) => ([200, 0, 0], 255),
                    (true, false) => ([100, 60, 0], 128),
                    _ => ([0, 120, 0], 0),
                };
                rgb.extend(colour);
                mask.push(cover);
            }
        }
        (size, rgb, mask)
    }

    #[test]
    fn a_cut_holds_the_person_without_the_wall() {
        let (size, rgb, mask) = photograph();
        let cut = Cut::new(size, &rgb, &mask);
        assert_eq!(cut.corner, [16, 8], "margin, and a multiple of four");
        let target = cut.target(0).expect("a picture");
        let picture = target.picture();
        let at = |channel: usize, x: usize, y: usize| {
            picture.plane(channel)[(y - 8) * picture.width() + x - 16]
        };
        assert!(
            picture.plane(1).iter().all(|green| *green == 0.0),
            "no wall"
        );
        assert!((at(0, 50, 50) - 200.0 / 255.0).abs() < 1e-6, "red inside");
        let edge = at(0, 30, 50);
        assert!(
            (edge - 128.0 / 255.0 * 200.0 / 255.0).abs() < 1e-3,
            "its own red at the edge, by its cover: {edge}"
        );
        let half = cut.target(1).expect("a picture");
        assert_eq!(half.picture().width() * 2, picture.width(), "halved");
    }

    #[test]
    fn the_cuts_camera_sees_what_the_photographs_camera_saw() {
        let (size, rgb, mask) = photograph();
        let cut = Cut::new(size, &rgb, &mask);
        let camera = Camera {
            name: "a".to_owned(),
            size: [120, 100],
            focal: [90.0, 95.0],
            centre: [61.0, 48.0],
            distortion: [0.0; 5],
            camera_from_world: DAffine3::from_translation(DVec3::new(0.1, -0.2, 3.0)),
        };
        let place = DVec3::new(0.3, 0.4, 0.5);
        let seen = camera.project(place).expect("before the camera");
        for halvings in 0..=MOST_HALVINGS {
            let view = cut.view(&camera, halvings).expect("a camera");
            let there = view.camera_from_world().transform_point3(place.as_vec3());
            for axis in 0..2 {
                let at =
                    f64::from(view.focal()[axis] * there[axis] / there.z + view.centre()[axis]);
                let expected = (seen[axis] - cut.corner[axis] as f64) / f64::from(1u32 << halvings);
                assert!((at - expected).abs() < 1e-4, "{at}, {expected}");
            }
        }
    }

    #[test]
    fn nobody_in_the_picture_is_a_piece_of_background() {
        let cut = Cut::new([300, 200], &[7; 3 * 300 * 200], &[0; 300 * 200]);
        let target = cut.target(0).expect("a picture");
        assert!(target.picture().width() >= NOBODY, "something to look at");
        assert!(
            target.picture().numbers().iter().all(|x| *x == 0.0),
            "nothing to see"
        );
        let tiny = Cut::new([1, 1], &[7; 3], &[0]);
        assert!(tiny.target(MOST_HALVINGS).is_ok(), "a picture of one pixel");
    }
}
