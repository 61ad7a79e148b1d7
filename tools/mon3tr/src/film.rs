//! Pictures on disk: single PNGs, and one animated WebP that every browser plays.

use anyhow::{Context, anyhow};
use image::{
    DynamicImage, ExtendedColorType, ImageEncoder, RgbImage, codecs::png::PngEncoder, imageops,
};
use std::path::{Path, PathBuf};
use std::sync::mpsc::{Receiver, SyncSender, sync_channel};
use std::thread::JoinHandle;
use std::time::Duration;
use webp_animation::{
    AnimParams, Encoder, EncoderOptions, EncodingConfig, EncodingType, LossyEncodingConfig,
};

/// Longest side of the animation in pixels: large enough to judge a motion, small enough to mail.
pub(crate) const ANIMATION_PIXELS: u32 = 640;

/// Quality of libwebp's lossy mode, 0..100.
const ANIMATION_QUALITY: f32 = 82.0;

/// Longest animation, frames: 20 s. The PNGs of `render` have the rest.
const ANIMATION_FRAMES: usize = 600;

/// Pictures waiting to be encoded: enough to keep the encoder busy, few enough to keep memory small.
const WAITING: usize = 3;

/// Writes 8-bit RGB rows as a PNG.
pub fn write_png(path: &Path, picture: &RgbImage) -> anyhow::Result<()> {
    let write = || -> anyhow::Result<()> {
        let file = std::io::BufWriter::new(std::fs::File::create(path)?);
        let (width, height) = picture.dimensions();
        Ok(PngEncoder::new(file).write_image(picture, width, height, ExtendedColorType::Rgb8)?)
    };
    write().with_context(|| format!("cannot write {}", path.display()))
}

/// A picture and when it is shown, from the animation's beginning.
type Shown = (RgbImage, Duration);

/// An animation being encoded on its own thread, so that the next frame is drawn meanwhile.
#[derive(Debug)]
pub(crate) struct Film {
    path: PathBuf,
    frames: SyncSender<Shown>,
    encoder: JoinHandle<anyhow::Result<()>>,
    added: usize,
}

impl Film {
    /// Starts an animation at `path` that repeats forever.
    pub(crate) fn start(path: PathBuf) -> Self {
        let (frames, waiting) = sync_channel(WAITING);
        let file = path.clone();
        let encoder = std::thread::spawn(move || encode(&file, &waiting));
        Self {
            path,
            frames,
            encoder,
            added: 0,
        }
    }

    /// Adds a frame that is shown at `time`, unless the animation is at its longest; waits while the encoder is behind.
    pub(crate) fn add(&mut self, picture: RgbImage, time: Duration) {
        self.added += 1;
        // A closed channel means that the encoder failed; finishing tells why.
        if self.added <= ANIMATION_FRAMES && self.frames.send((picture, time)).is_err() {
            log::debug!("the animation's encoder no longer takes frames");
        }
    }

    /// The same for a frame that is live: it is left out where the encoder is behind.
    pub(crate) fn offer(&mut self, picture: &RgbImage, time: Duration) {
        let is_full = self.added >= ANIMATION_FRAMES;
        if is_full || self.frames.try_send((picture.clone(), time)).is_ok() {
            self.added += 1;
        }
    }

    /// Ends the animation and returns its file.
    pub(crate) fn finish(self) -> anyhow::Result<PathBuf> {
        drop(self.frames);
        self.encoder
            .join()
            .map_err(|_| anyhow!("the animation's encoder failed"))??;
        if self.added > ANIMATION_FRAMES {
            println!(
                "{} shows the first {ANIMATION_FRAMES} of {} frames",
                self.path.display(),
                self.added
            );
        }
        Ok(self.path)
    }
}

fn encode(path: &Path, waiting: &Receiver<Shown>) -> anyhow::Result<()> {
    let Ok((first, begun)) = waiting.recv() else {
        return Ok(());
    };
    let first = shrink(&first);
    let lossy = LossyEncodingConfig::default();
    let options = EncoderOptions {
        anim_params: AnimParams { loop_count: 0 },
        // Key frames only: partial frames leave the lossy coder's errors behind, block by block.
        kmin: 0,
        kmax: 1,
        encoding_config: Some(EncodingConfig {
            encoding_type: EncodingType::Lossy(lossy),
            quality: ANIMATION_QUALITY,
            method: 3,
        }),
        ..EncoderOptions::default()
    };
    let failed = |e: webp_animation::Error| anyhow!("libwebp cannot encode the animation: {e:?}");
    let mut encoder = Encoder::new_with_options(first.dimensions(), options).map_err(failed)?;
    #[allow(
        clippy::cast_possible_truncation,
        reason = "an animation of 24 days would be needed to overflow"
    )]
    let ms = |time: Duration| (time.as_secs_f64() * 1e3).round() as i32;
    let (mut last, mut step) = (-1, 1);
    let rest = waiting
        .iter()
        .map(|(picture, time)| (shrink(&picture), time));
    for (picture, time) in std::iter::once((first, begun)).chain(rest) {
        // libwebp wants every frame later than the one before.
        let shown_at = ms(time.saturating_sub(begun)).max(last + 1);
        let rgba = DynamicImage::ImageRgb8(picture).into_rgba8();
        encoder.add_frame(&rgba, shown_at).map_err(failed)?;
        if last >= 0 {
            step = shown_at - last;
        }
        last = shown_at;
    }
    // The last frame is shown as long as the one before it.
    let bytes = encoder.finalize(last + step).map_err(failed)?;
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
