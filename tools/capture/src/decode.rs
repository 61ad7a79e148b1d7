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
    // A file that was cut short decodes into grey: its end is looked for before. Cameras write more after it: zeros, previews, a film's sound.
    if !jpeg_ends(bytes) {
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

/// Whether a JPEG's end mark is there: not one of a preview within it, and whatever follows (ITU T.81, B.1.1).
fn jpeg_ends(bytes: &[u8]) -> bool {
    /// End of image, start of scan.
    const END: u8 = 0xd9;
    const SCAN: u8 = 0xda;
    // Within a scan, a byte of 255 is followed by 0; restarts are no end either.
    let is_marker = |pair: &[u8]| pair[0] == 0xff && !matches!(pair[1], 0 | 0xd0..=0xd7 | 0xff);
    let mut at = 2;
    while let Some(rest) = bytes.get(at..) {
        let Some(found) = rest.windows(2).position(is_marker) else {
            return false;
        };
        at += found + 2;
        if rest[found + 1] == END {
            return true;
        }
        let Some([high, low]) = bytes.get(at..at + 2) else {
            return false;
        };
        let length = usize::from(u16::from_be_bytes([*high, *low]));
        // A segment says its own length; after a scan's header its bytes follow, up to the next marker.
        at += if rest[found + 1] == SCAN {
            2
        } else {
            length.max(2)
        };
    }
    false
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

#[cfg(test)]
mod tests {
    use super::*;

    /// 16 x 16 pixels of ffmpeg's `testsrc`, without its comments, in hexadecimal.
    const JPEG: &str = "\
        ffd8ffdb004300083e3e493e49555555555555645d6468686864646464686868707070838383707070686870707c7c83838f938f8787838793939b9b\
        9bbabab2b2d9d9e0ffffffffc40067000101010000000000000000000000000006030501010100000000000000000000000000000102100100020201\
        0305010000000000000000011102030091131221d161a1412231110001030403010100000000000000000012013111004121510222825232ffc00011\
        080010001003012200021100031100ffda000c03010002110311003f00330e3c758614993dff009f0eb6c97e8d84009f207d6e5256f8ebfa080388f4\
        d8e62d92c9daf13b2bd806c456d6de84fd27157cccfa1cb7cc57ffd9";

    fn bytes_of(hex: &str) -> Vec<u8> {
        let digits = hex.as_bytes().chunks_exact(2);
        let text = digits.map(|pair| std::str::from_utf8(pair).expect("digits"));
        text.map(|pair| u8::from_str_radix(pair, 16).expect("a byte"))
            .collect()
    }

    fn written(folder: &Path, change: impl Fn(&mut Vec<u8>)) -> Result<Vec<u8>, CaptureError> {
        let mut bytes = bytes_of(JPEG);
        change(&mut bytes);
        let path = folder.join("a.jpg");
        std::fs::write(&path, bytes).expect("written");
        read(&path, [16, 16], Channels::Colour)
    }

    #[test]
    fn what_follows_a_jpegs_end_does_not_matter_and_a_previews_end_is_not_its_own() {
        let folder = tempfile::tempdir().expect("a folder");
        let plain = written(folder.path(), |_| {}).expect("a picture");
        for tail in [vec![0; 7], b"a film's sound".to_vec(), vec![0xff; 3]] {
            let followed = written(folder.path(), |bytes| bytes.extend(&tail));
            assert!(followed.expect("a picture") == plain, "the same pixels");
        }
        // An APP1 segment with a preview's end mark in it, and the rest of the file missing.
        let cut = written(folder.path(), |bytes| {
            bytes.truncate(bytes.len() - 40);
            bytes.splice(2..2, *b"\xff\xe1\x00\x06\xff\xd8\xff\xd9");
        });
        let said = cut.expect_err("cut").to_string();
        assert!(said.contains("cut short"), "{said}");
        for length in 2..40 {
            assert!(!jpeg_ends(&vec![0xff; length]), "{length} bytes of 255");
        }
    }
}
