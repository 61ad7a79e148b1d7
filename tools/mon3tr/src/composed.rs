//! A camera's picture with the landmarks drawn over it, and beside it the avatar from the same camera: one picture, for files and windows.

use crate::size::Size;
use anyhow::Context;
use glam::{Affine3A, Vec2, Vec3};
use image::{ImageBuffer, Rgb, RgbImage, imageops};
use motion_fit::landmarks::{Camera, Observation};
use renderer_splat::camera;
use tracker::source::Picture;

/// Lines of the body between BlazePose's landmarks.
const BODY_LINES: [(usize, usize); 16] = [
    (11, 12),
    (11, 23),
    (12, 24),
    (23, 24),
    (11, 13),
    (13, 15),
    (12, 14),
    (14, 16),
    (23, 25),
    (25, 27),
    (24, 26),
    (26, 28),
    (27, 31),
    (28, 32),
    (7, 2),
    (8, 5),
];
const YELLOW: Rgb<u8> = Rgb([255, 230, 60]);
const BLUE: Rgb<u8> = Rgb([70, 150, 255]);
const ORANGE: Rgb<u8> = Rgb([255, 130, 40]);
const WHITE: Rgb<u8> = Rgb([255, 255, 255]);
/// Landmarks that the network holds for less likely are not drawn.
const DOUBTFUL: f32 = 0.5;

/// Which way round both halves are shown.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Facing {
    /// As the camera sees the person.
    AsSeen,
    /// As a mirror shows people themselves.
    Mirrored,
}

/// Where a camera's picture lies in a half of the composed one.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Composition {
    /// Of each half, pixels.
    half: Size,
    camera: Camera,
    /// Pixels of a half for one of the camera's.
    scale: f32,
    /// The upper left corner of the camera's picture in a half, pixels.
    corner: Vec2,
}

impl Composition {
    /// With halves of so many rows, which the camera's picture fills.
    pub(crate) fn of_height(camera: &Camera, height: u32) -> Self {
        Self::filled(camera, height as f32 / camera.size.y)
    }

    /// With halves whose longer side has so many pixels, which the camera's picture fills.
    pub(crate) fn of_side(camera: &Camera, side: u32) -> Self {
        Self::filled(camera, side as f32 / camera.size.max_element())
    }

    fn filled(camera: &Camera, scale: f32) -> Self {
        let [width, height] = (camera.size * scale).to_array().map(even);
        Self {
            half: Size { width, height },
            camera: *camera,
            scale,
            corner: Vec2::ZERO,
        }
    }

    /// With the same halves for another camera, whose picture lies in the middle.
    pub(crate) fn with_camera(&self, camera: &Camera) -> Self {
        if *camera == self.camera {
            return *self;
        }
        let half = Vec2::new(self.half.width as f32, self.half.height as f32);
        let scale = (half / camera.size).min_element();
        Self {
            half: self.half,
            camera: *camera,
            scale,
            corner: ((half - camera.size * scale) / 2.0).floor(),
        }
    }

    /// Size of each half, pixels.
    pub(crate) fn half(&self) -> Size {
        self.half
    }

    /// The renderer's camera where the picture's is.
    pub(crate) fn eye(&self, camera_from_room: Affine3A) -> camera::Camera {
        let focal = self.camera.focal * self.scale;
        let centre = self.camera.centre * self.scale + self.corner;
        camera::Camera {
            camera_from_world: Affine3A::from_scale(Vec3::new(1.0, -1.0, -1.0)) * camera_from_room,
            fx: focal,
            fy: focal,
            cx: centre.x,
            cy: centre.y,
            width: self.half.width,
            height: self.half.height,
            near: camera::DEFAULT_NEAR,
        }
    }

    /// The picture with what was `seen` in it, and the `avatar` as [`Self::eye`] sees it.
    ///
    /// # Errors
    /// If the picture's bytes are not as many as its size says.
    pub(crate) fn compose(
        &self,
        picture: &Picture,
        seen: Option<&Observation>,
        avatar: &RgbImage,
        facing: Facing,
    ) -> anyhow::Result<RgbImage> {
        let Size { width, height } = self.half;
        let mut both = RgbImage::new(2 * width, height);
        let mut left = RgbImage::new(width, height);
        let whole = ImageBuffer::<Rgb<u8>, &[u8]>::from_raw(
            picture.width,
            picture.height,
            picture.rgb.as_slice(),
        );
        let whole = whole.context("a picture's bytes are not as many as its size says")?;
        let shown = self.camera.size * self.scale;
        let [across, down] = shown.to_array().map(whole_pixels);
        let (across, down) = (across.clamp(1, width), down.clamp(1, height));
        let small = imageops::thumbnail(&whole, across, down);
        let [x, y] = self.corner.to_array().map(whole_pixels);
        imageops::replace(&mut left, &small, i64::from(x), i64::from(y));
        if let Some(seen) = seen {
            self.overlay(&mut left, seen);
        }
        imageops::replace(&mut both, &left, 0, 0);
        imageops::replace(&mut both, avatar, i64::from(width), 0);
        if facing == Facing::Mirrored {
            for from in [0, width] {
                let mut half = imageops::crop_imm(&both, from, 0, width, height).to_image();
                imageops::flip_horizontal_in_place(&mut half);
                imageops::replace(&mut both, &half, i64::from(from), 0);
            }
        }
        Ok(both)
    }

    /// Draws the landmarks over the camera's picture in its half.
    fn overlay(&self, picture: &mut RgbImage, seen: &Observation) {
        let at = |pixel: Vec2| pixel * self.scale + self.corner;
        if let Some(body) = seen.body_landmarks() {
            for (a, b) in BODY_LINES {
                let (a, b) = (&body.points[a], &body.points[b]);
                if a.confidence.min(b.confidence) >= DOUBTFUL {
                    line(picture, at(a.pixel), at(b.pixel), YELLOW);
                }
            }
        }
        for (hand, colour) in seen.hand_landmarks().into_iter().zip([BLUE, ORANGE]) {
            let Some(hand) = hand else { continue };
            for k in 1..hand.pixels.len() {
                // Each finger begins at the wrist.
                let from = if k % 4 == 1 { 0 } else { k - 1 };
                line(picture, at(hand.pixels[from]), at(hand.pixels[k]), colour);
            }
        }
        if let Some(face) = seen.face_landmarks() {
            for point in face.points.iter() {
                dot(picture, at(point.truncate()), WHITE);
            }
        }
    }
}

#[allow(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "a picture's side"
)]
fn even(pixels: f32) -> u32 {
    ((pixels / 2.0).round() as u32 * 2).max(16)
}

#[allow(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "a picture's side"
)]
fn whole_pixels(pixels: f32) -> u32 {
    pixels.round() as u32
}

fn line(picture: &mut RgbImage, from: Vec2, to: Vec2, colour: Rgb<u8>) {
    /// Longest line, pixels: what the networks say may be anywhere.
    const LONGEST: f32 = 2000.0;
    let steps = (to - from).abs().max_element();
    if steps.is_finite() && steps <= LONGEST {
        #[allow(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "at most 2000"
        )]
        let steps = steps.ceil().max(1.0) as u16;
        for k in 0..=steps {
            let at = from.lerp(to, f32::from(k) / f32::from(steps));
            dot(picture, at, colour);
            dot(picture, at + Vec2::X, colour);
        }
    }
}

fn dot(picture: &mut RgbImage, at: Vec2, colour: Rgb<u8>) {
    if at.is_finite() && at.min_element() >= 0.0 {
        #[allow(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "not negative, and out of the picture where it is too large"
        )]
        let (x, y) = (at.x as u32, at.y as u32);
        if let Some(pixel) = picture.get_pixel_mut_checked(x, y) {
            *pixel = colour;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use motion_fit::landmarks::{HAND_LANDMARKS, HandLandmarks};

    fn picture(width: u32, height: u32, pixel: impl Fn(u32, u32) -> [u8; 3]) -> Picture {
        let rgb = (0..height)
            .flat_map(|y| (0..width).flat_map(move |x| [(x, y)]))
            .flat_map(|(x, y)| pixel(x, y))
            .collect();
        Picture {
            width,
            height,
            rgb,
            ..Picture::empty()
        }
    }

    #[test]
    fn a_mirror_exchanges_the_sides_of_each_half_and_not_the_halves() {
        let camera = Camera::of_view(Vec2::new(320.0, 240.0), 60.0);
        let composition = Composition::of_height(&camera, 120);
        let Size { width, height } = composition.half();
        assert_eq!((width, height), (160, 120), "half of the camera's");
        let red_left = |x: u32, _| if x < 160 { [200, 0, 0] } else { [0, 0, 200] };
        let seen = picture(320, 240, red_left);
        let avatar = RgbImage::from_fn(width, height, |x, _| {
            Rgb(if x < 80 { [0, 200, 0] } else { [90, 90, 90] })
        });
        let compose = |facing| {
            let both = composition.compose(&seen, None, &avatar, facing);
            let both = both.expect("a picture");
            [20, 140, 180, 300].map(|x| both.get_pixel(x, 60).0)
        };
        let (red, blue, green, grey) = ([200, 0, 0], [0, 0, 200], [0, 200, 0], [90, 90, 90]);
        assert_eq!(compose(Facing::AsSeen), [red, blue, green, grey]);
        assert_eq!(compose(Facing::Mirrored), [blue, red, grey, green]);
    }

    #[test]
    fn a_picture_of_another_size_lies_in_the_middle_and_the_eye_with_it() {
        let wide = Camera::of_view(Vec2::new(640.0, 360.0), 60.0);
        let tall = Camera::of_view(Vec2::new(360.0, 640.0), 60.0);
        let composition = Composition::of_side(&wide, 320).with_camera(&tall);
        assert_eq!(
            (composition.half().width, composition.half().height),
            (320, 180),
            "the halves stay"
        );
        let black = RgbImage::new(320, 180);
        let white = picture(360, 640, |_, _| [255; 3]);
        let both = composition
            .compose(&white, None, &black, Facing::AsSeen)
            .expect("a picture");
        let lit: Vec<u32> = (0..320)
            .filter(|x| both.get_pixel(*x, 90).0[0] > 128)
            .collect();
        let (first, last) = (lit[0], lit[lit.len() - 1]);
        assert!(first.abs_diff(320 - 1 - last) <= 1, "{first}..{last}");
        assert!(lit.len().abs_diff(101) <= 1, "{} columns", lit.len());
        let eye = composition.eye(Affine3A::IDENTITY);
        assert!(
            (eye.cx - 160.0).abs() <= 1.0 && (eye.cy - 90.0).abs() <= 1.0,
            "{eye:?}"
        );
        assert!(
            (eye.fx - tall.focal * 180.0 / 640.0).abs() < 1e-3,
            "{eye:?}"
        );
    }

    #[test]
    fn landmarks_that_are_anywhere_are_no_harm() {
        let camera = Camera::of_view(Vec2::new(64.0, 48.0), 60.0);
        let composition = Composition::of_height(&camera, 48);
        let wild = [f32::NAN, f32::INFINITY, -1e9, 1e9, 0.0];
        let pixels =
            std::array::from_fn(|k| Vec2::new(wild[k % wild.len()], wild[(k / 2) % wild.len()]));
        let seen = Observation {
            hands: [
                Some(
                    HandLandmarks {
                        pixels,
                        metres: [Vec3::ZERO; HAND_LANDMARKS],
                        confidence: 1.0,
                    }
                    .into(),
                ),
                None,
            ],
            ..Observation::default()
        };
        let avatar = RgbImage::new(64, 48);
        let shown = picture(64, 48, |_, _| [1; 3]);
        let both = composition.compose(&shown, Some(&seen), &avatar, Facing::AsSeen);
        assert!(both.is_ok(), "{both:?}");
        let short = Picture {
            width: 100,
            ..shown
        };
        let both = composition.compose(&short, None, &avatar, Facing::AsSeen);
        assert!(both.is_err(), "too few bytes");
    }
}
