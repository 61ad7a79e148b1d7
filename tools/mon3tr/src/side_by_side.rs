//! A video with what the networks saw in it, and beside it the avatar that follows, from the same camera.

use crate::device_options::DeviceOptions;
use crate::film::Film;
use crate::progress;
use crate::recording::{DRAWN, TrackedRecording};
use crate::size::{Size, Views};
use crate::stills::{RenderSettings, StillRenderer};
use anyhow::Context;
use app_session::display::Still;
use glam::{Affine3A, Vec2, Vec3};
use image::{Rgb, RgbImage, imageops};
use motion_fit::landmarks::{Camera, Observation};
use renderer_splat::camera;
use renderer_splat::options::Filter;
use spmm3::Avatar;
use std::path::Path;
use std::sync::Arc;
use std::time::Duration;
use tracker::source::{self, Picture, SourceChoice, Wanted};

/// Height of the animation, pixels.
const HEIGHT: u32 = 480;

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

/// Reads the recording again and draws it beside the avatar into the animation `file`.
pub(crate) fn draw(
    choice: &SourceChoice,
    recording: &TrackedRecording,
    avatar: &Arc<Avatar>,
    device: &DeviceOptions,
    file: &Path,
) -> anyhow::Result<()> {
    let TrackedRecording { seen, camera, .. } = recording;
    let mut source = source::open(choice, &Wanted::default())?;
    let scale = HEIGHT as f32 / camera.size.y;
    let size = Size {
        width: even(camera.size.x * scale),
        height: HEIGHT,
    };
    let shown = &seen[..seen.len().min(DRAWN)];
    let stills = (shown.iter())
        .map(|seen| Still {
            motion: seen.fitted.motion.clone(),
            cameras: vec![eye(camera, scale, size, seen.fitted.camera_from_room)],
        })
        .collect();
    let setting = RenderSettings {
        size,
        views: Views::Mono,
        background: None,
        filter: Filter::Dilation,
    };
    let (gpu, runtime) = (device.gpu()?, device.runtime()?);
    let renderer = StillRenderer {
        gpu: &gpu,
        runtime: &runtime,
        avatar,
    };
    let mut film = Film::start(file.to_owned());
    let bar = progress::bar("drawing side by side", shown.len());
    let mut picture = Picture::empty();
    let first = shown.first().map_or(0.0, |seen| seen.seconds);
    renderer.draw(&setting, stills, |k, views| {
        let seen = shown
            .get(k)
            .context("the renderer drew more than was asked for")?;
        anyhow::ensure!(
            source.next(&mut picture)?,
            "the video is shorter when it is read again"
        );
        let view = views.first().context("the renderer returned no picture")?;
        let mut both = RgbImage::new(2 * size.width, size.height);
        let left = RgbImage::from_raw(picture.width, picture.height, picture.rgb.clone())
            .context("the video's picture has another size")?;
        let mut left = imageops::thumbnail(&left, size.width, size.height);
        if let Some(observation) = &seen.observation {
            overlay(&mut left, observation, scale);
        }
        imageops::replace(&mut both, &left, 0, 0);
        imageops::replace(&mut both, view, i64::from(size.width), 0);
        film.add(
            both,
            Duration::from_secs_f64((seen.seconds - first).max(0.0)),
        );
        bar.inc(1);
        Ok(())
    })?;
    bar.finish_and_clear();
    film.finish()?;
    Ok(())
}

#[allow(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "a picture's side"
)]
fn even(pixels: f32) -> u32 {
    ((pixels / 2.0).round() as u32 * 2).max(16)
}

/// The renderer's camera where the picture's is.
fn eye(camera: &Camera, scale: f32, size: Size, camera_from_room: Affine3A) -> camera::Camera {
    camera::Camera {
        camera_from_world: Affine3A::from_scale(Vec3::new(1.0, -1.0, -1.0)) * camera_from_room,
        fx: camera.focal * scale,
        fy: camera.focal * scale,
        cx: camera.centre.x * scale,
        cy: camera.centre.y * scale,
        width: size.width,
        height: size.height,
        near: camera::DEFAULT_NEAR,
    }
}

/// Draws the landmarks over a picture that was scaled.
pub(crate) fn overlay(picture: &mut RgbImage, seen: &Observation, scale: f32) {
    if let Some(body) = seen.body_landmarks() {
        for (a, b) in BODY_LINES {
            let (a, b) = (&body.points[a], &body.points[b]);
            if a.confidence.min(b.confidence) >= DOUBTFUL {
                line(picture, a.pixel * scale, b.pixel * scale, YELLOW);
            }
        }
    }
    for (hand, colour) in seen.hand_landmarks().into_iter().zip([BLUE, ORANGE]) {
        let Some(hand) = hand else { continue };
        for k in 1..hand.pixels.len() {
            // Each finger begins at the wrist.
            let from = if k % 4 == 1 { 0 } else { k - 1 };
            line(
                picture,
                hand.pixels[from] * scale,
                hand.pixels[k] * scale,
                colour,
            );
        }
    }
    if let Some(face) = seen.face_landmarks() {
        for point in face.points.iter() {
            dot(picture, point.truncate() * scale, WHITE);
        }
    }
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
