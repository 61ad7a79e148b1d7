//! JPEG and PNG files as pixels, within bounds.

use crate::camera::LARGEST_SIDE;
use crate::error::CaptureError;
use image::{ImageFormat, ImageReader, Limits};
use std::io::{Cursor, Read};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::Path;
use zune_jpeg::JpegDecoder;
use zune_jpeg::zune_core::bytestream::ZCursor;
use zune_jpeg::zune_core::colorspace::ColorSpace;
use zune_jpeg::zune_core::options::DecoderOptions;

/// Of one picture's file.
const MOST_BYTES: u64 = 256 << 20;

/// Which values of a picture are wanted.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Channels {
    /// Three bytes a pixel.
    Colour,
    /// One byte a pixel: the brightness.
    Grey,
}

/// Reads a picture that must have a size; [height, width, channels].
pub(crate) fn read(
    path: &Path,
    size: [u32; 2],
    channels: Channels,
) -> Result<Vec<u8>, CaptureError> {
    let mut bytes = Vec::new();
    std::fs::File::open(path)
        .and_then(|file| file.take(MOST_BYTES + 1).read_to_end(&mut bytes))
        .map_err(|source| CaptureError::read(path, source))?;
    if bytes.len() as u64 > MOST_BYTES {
        let reason = format!("has more than {} MiB", MOST_BYTES >> 20);
        return Err(CaptureError::picture(path, reason));
    }
    // By its contents: a name may lie.
    if bytes.starts_with(b"\xff\xd8") {
        jpeg(path, &bytes, size, channels)
    } else {
        png(path, &bytes, size, channels)
    }
}

fn check_size(path: &Path, found: [u32; 2], size: [u32; 2]) -> Result<(), CaptureError> {
    if found == size {
        return Ok(());
    }
    let ([w, h], [width, height]) = (found, size);
    let reason = format!("has {w} x {h} pixels where its camera has {width} x {height}");
    Err(CaptureError::picture(path, reason))
}

fn jpeg(
    path: &Path,
    bytes: &[u8],
    size: [u32; 2],
    channels: Channels,
) -> Result<Vec<u8>, CaptureError> {
    let refuse = |why: &dyn std::fmt::Display| {
        CaptureError::picture(path, format!("is a damaged JPEG: {why}"))
    };
    // A file that was cut short decodes into grey: its end is looked for before. Some cameras pad the file with zeros.
    let end = bytes.iter().rposition(|byte| *byte != 0).unwrap_or(0);
    if end < 1 || bytes[end - 1..=end] != *b"\xff\xd9" {
        return Err(refuse(&"it is cut short"));
    }
    let (kind, count) = match channels {
        Channels::Colour => (ColorSpace::RGB, 3),
        Channels::Grey => (ColorSpace::Luma, 1),
    };
    let side = LARGEST_SIDE as usize;
    let options = DecoderOptions::default()
        .set_strict_mode(false)
        .set_max_width(side)
        .set_max_height(side)
        .jpeg_set_out_colorspace(kind);
    // The decoder's authors take panics at damaged pictures for errors.
    catch_unwind(AssertUnwindSafe(|| {
        let mut decoder = JpegDecoder::new_with_options(ZCursor::new(bytes), options);
        decoder.decode_headers().map_err(|why| refuse(&why))?;
        let found = decoder.info().map_or([0, 0], |info| {
            [u32::from(info.width), u32::from(info.height)]
        });
        check_size(path, found, size)?;
        let length = size[0] as usize * size[1] as usize * count;
        if decoder.output_buffer_size() != Some(length) {
            return Err(refuse(&"its colours are of an unknown kind"));
        }
        let mut pixels = vec![0; length];
        decoder
            .decode_into(&mut pixels)
            .map_err(|why| refuse(&why))?;
        Ok(pixels)
    }))
    .unwrap_or_else(|_| Err(refuse(&"the decoder gave up")))
}

fn png(
    path: &Path,
    bytes: &[u8],
    size: [u32; 2],
    channels: Channels,
) -> Result<Vec<u8>, CaptureError> {
    let refuse = |why: image::ImageError| {
        CaptureError::picture(path, format!("is no PNG or JPEG, or damaged: {why}"))
    };
    let (width, height) = ImageReader::with_format(Cursor::new(bytes), ImageFormat::Png)
        .into_dimensions()
        .map_err(refuse)?;
    check_size(path, [width, height], size)?;
    let mut reader = ImageReader::with_format(Cursor::new(bytes), ImageFormat::Png);
    let mut limits = Limits::default();
    limits.max_image_width = Some(LARGEST_SIDE);
    limits.max_image_height = Some(LARGEST_SIDE);
    reader.limits(limits);
    let decoded = reader.decode().map_err(refuse)?;
    Ok(match channels {
        Channels::Colour => decoded.into_rgb8().into_raw(),
        Channels::Grey => decoded.into_luma8().into_raw(),
    })
}
