//! Pictures on disk: single PNGs, and one animated WebP that every browser plays.

use anyhow::{Context, anyhow};
use image::{ExtendedColorType, ImageEncoder, RgbImage, codecs::png::PngEncoder, imageops};
use std::path::{Path, PathBuf};
use std::sync::mpsc::{Receiver, SyncSender, sync_channel};
use std::thread::JoinHandle;

/// Longest side of the animation in pixels: large enough to judge a motion, small enough to mail.
const ANIMATION_PIXELS: u32 = 640;

/// Quality of libwebp's lossy mode, 0..100.
const ANIMATION_QUALITY: f32 = 82.0;

/// Pictures waiting to be encoded: enough to keep the encoder busy, few enough to keep memory small.
const WAITING: usize = 3;

/// Writes 8-bit RGB rows as a PNG.
pub(crate) fn write_png(path: &Path, picture: &RgbImage) -> anyhow::Result<()> {
    let write = || -> anyhow::Result<()> {
        let file = std::io::BufWriter::new(std::fs::File::create(path)?);
        let (width, height) = picture.dimensions();
        Ok(PngEncoder::new(file).write_image(picture, width, height, ExtendedColorType::Rgb8)?)
    };
    write().with_context(|| format!("cannot write {}", path.display()))
}

/// An animation being encoded on its own thread, so that the next frame is drawn meanwhile.
#[derive(Debug)]
pub(crate) struct Film {
    frames: SyncSender<RgbImage>,
    encoder: JoinHandle<anyhow::Result<()>>,
}

impl Film {
    /// Starts an animation at `path` that shows `frame_rate` frames a second and repeats forever.
    pub(crate) fn start(path: PathBuf, frame_rate: f64) -> Self {
        let (frames, waiting) = sync_channel(WAITING);
        let encoder = std::thread::spawn(move || encode(&path, frame_rate, &waiting));
        Self { frames, encoder }
    }

    /// Adds a frame; waits while the encoder is behind.
    pub(crate) fn add(&self, picture: RgbImage) -> anyhow::Result<()> {
        self.frames
            .send(picture)
            .map_err(|_| anyhow!("the animation's encoder stopped"))
    }

    /// Ends the animation and writes its file.
    pub(crate) fn finish(self) -> anyhow::Result<()> {
        drop(self.frames);
        self.encoder
            .join()
            .map_err(|_| anyhow!("the animation's encoder failed"))?
    }
}

fn encode(path: &Path, frame_rate: f64, waiting: &Receiver<RgbImage>) -> anyhow::Result<()> {
    // All frames are kept until the end: libwebp's animation encoder borrows them.
    let small: Vec<RgbImage> = waiting.iter().map(|picture| shrink(&picture)).collect();
    let Some(first) = small.first() else {
        return Ok(());
    };
    let mut config =
        webp::WebPConfig::new().map_err(|()| anyhow!("libwebp refuses its default settings"))?;
    config.quality = ANIMATION_QUALITY;
    config.method = 3;
    config.thread_level = 1;
    let mut encoder = webp::AnimEncoder::new(first.width(), first.height(), &config);
    encoder.set_loop_count(0);
    for (k, picture) in small.iter().enumerate() {
        #[allow(
            clippy::cast_possible_truncation,
            reason = "an animation of 24 days would be needed to overflow"
        )]
        let shown_at_ms = (k as f64 * 1e3 / frame_rate).round() as i32;
        encoder.add_frame(webp::AnimFrame::from_rgb(
            picture,
            picture.width(),
            picture.height(),
            shown_at_ms,
        ));
    }
    let bytes = encoder
        .try_encode()
        .map_err(|e| anyhow!("libwebp cannot encode the animation: {e:?}"))?;
    std::fs::write(path, &*bytes).with_context(|| format!("cannot write {}", path.display()))
}

fn shrink(picture: &RgbImage) -> RgbImage {
    let (width, height) = picture.dimensions();
    let longest = width.max(height);
    if longest <= ANIMATION_PIXELS {
        return picture.clone();
    }
    let scaled = |side: u32| (side * ANIMATION_PIXELS / longest).max(1);
    imageops::resize(
        picture,
        scaled(width),
        scaled(height),
        imageops::FilterType::Triangle,
    )
}
