//! JPEG pictures one after another, as motion JPEG has them: cut apart by their markers, and decoded.

use std::fmt;
use std::io::{self, BufRead};
use std::mem::swap;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::time::Instant;

use zune_jpeg::JpegDecoder;
use zune_jpeg::zune_core::bytestream::ZCursor;
use zune_jpeg::zune_core::colorspace::ColorSpace;
use zune_jpeg::zune_core::options::DecoderOptions;

use super::error::SourceError;
use super::picture::{
    LARGEST_SIDE, MOST_DAMAGED, Picture, RATE_HZ, Source, SourceInfo, bytes_of, within_limits,
};

/// Of one picture; a camera's of the largest size has fewer.
const MOST_BYTES: usize = 64 << 20;
/// Between two pictures: the headers of an HTTP stream, the chunks of an AVI file.
const MOST_BETWEEN: usize = 1 << 20;

/// Tells the decoder to use the tables of ITU-T T.81 annex K, which motion JPEG may leave out: an `APP0` segment of AVI files.
const STANDARD_TABLES: [u8; 18] = *b"\xff\xe0\x00\x10AVI1\0\0\0\0\0\0\0\0\0\0";

/// Decodes JPEG pictures.
#[derive(Debug, Default)]
pub(super) struct JpegPictures {
    whole: Vec<u8>,
}

impl JpegPictures {
    /// Decodes one picture, whose bytes may go on after its end, into `into`'s size and pixels.
    pub(super) fn decode(
        &mut self,
        name: &str,
        mut bytes: &[u8],
        into: &mut Picture,
    ) -> Result<(), SourceError> {
        match next_picture(&mut bytes, &mut self.whole) {
            Ok(Found::Whole) => self.decode_whole(name, into),
            Ok(Found::Cut | Found::End) => {
                Err(malformed(name, "its JPEG picture is cut short".to_owned()))
            }
            Ok(Found::OtherBytes) => Err(malformed(name, other_bytes())),
            Ok(Found::TooLong) => Err(malformed(name, too_long())),
            Err(source) => Err(SourceError::Read {
                name: name.to_owned(),
                source,
            }),
        }
    }

    fn decode_whole(&self, name: &str, into: &mut Picture) -> Result<(), SourceError> {
        let refuse =
            |why: &dyn fmt::Display| malformed(name, format!("its JPEG picture is damaged: {why}"));
        let side = LARGEST_SIDE as usize;
        let options = DecoderOptions::default()
            .set_strict_mode(false)
            .set_max_width(side)
            .set_max_height(side)
            .jpeg_set_out_colorspace(ColorSpace::RGB);
        let bytes = self.whole.as_slice();
        // The decoder's authors take panics at damaged pictures for errors: they must not end a call.
        catch_unwind(AssertUnwindSafe(|| {
            let mut decoder = JpegDecoder::new_with_options(ZCursor::new(bytes), options);
            decoder.decode_headers().map_err(|why| refuse(&why))?;
            let (width, height) = decoder.info().map_or((0, 0), |info| {
                (u32::from(info.width), u32::from(info.height))
            });
            within_limits(name, width, height)?;
            if decoder.output_buffer_size() != Some(bytes_of(width, height)) {
                return Err(refuse(&"its colours are of an unknown kind"));
            }
            into.resize(width, height);
            decoder
                .decode_into(&mut into.rgb)
                .map_err(|why| refuse(&why))
        }))
        .unwrap_or_else(|_| Err(refuse(&"the decoder gave up")))
    }
}

fn malformed(name: &str, why: String) -> SourceError {
    SourceError::Malformed {
        name: name.to_owned(),
        why,
    }
}

fn too_long() -> String {
    format!(
        "a JPEG picture of it has more than {} MiB",
        MOST_BYTES >> 20
    )
}

fn other_bytes() -> String {
    format!(
        "{} MiB of it are no JPEG picture: is it damaged, or something else than motion JPEG?",
        MOST_BETWEEN >> 20
    )
}

#[derive(Debug, PartialEq, Eq)]
enum Found {
    Whole,
    /// The input ends in a picture.
    Cut,
    /// The input ends without another picture.
    End,
    /// The input goes on, but there is no picture in [`MOST_BETWEEN`] of it.
    OtherBytes,
    /// The picture does not end within [`MOST_BYTES`].
    TooLong,
}

/// Reads the input to the end of its next picture, and leaves the picture in `whole`.
fn next_picture(input: &mut impl BufRead, whole: &mut Vec<u8>) -> io::Result<Found> {
    whole.clear();
    if let Some(found) = skip_to_start(input)? {
        return Ok(found);
    }
    whole.extend([0xff, 0xd8]);
    let mut has_tables = false;
    let mut fill = 0;
    // The last marker read; entropy-coded bytes may follow it.
    loop {
        let Some(marker) = read_marker(input, whole, &mut fill)? else {
            return Ok(if whole.len() + fill > MOST_BYTES {
                Found::TooLong
            } else {
                Found::Cut
            });
        };
        match marker {
            END => break,
            START | 0x01 | 0xd0..=0xd7 => {}
            _ => {
                has_tables |= marker == HUFFMAN_TABLES;
                let mut length = [0; 2];
                if !read_exact(input, &mut length)? {
                    return Ok(Found::Cut);
                }
                whole.extend(length);
                let rest = usize::from(u16::from_be_bytes(length)).saturating_sub(2);
                if !copy(input, rest, whole)? {
                    return Ok(Found::Cut);
                }
            }
        }
        if whole.len() + fill > MOST_BYTES {
            return Ok(Found::TooLong);
        }
    }
    if !has_tables {
        whole.splice(2..2, STANDARD_TABLES);
    }
    Ok(Found::Whole)
}

const START: u8 = 0xd8;
const END: u8 = 0xd9;
const HUFFMAN_TABLES: u8 = 0xc4;

/// Passes over what is no picture. What was found instead of a picture's start, or nothing where there is one.
fn skip_to_start(input: &mut impl BufRead) -> io::Result<Option<Found>> {
    let mut passed = 0;
    let mut before = 0;
    while passed <= MOST_BETWEEN {
        let Some(byte) = read_byte(input)? else {
            return Ok(Some(Found::End));
        };
        if before == 0xff && byte == START {
            return Ok(None);
        }
        before = byte;
        passed += 1;
    }
    Ok(Some(Found::OtherBytes))
}

/// Copies up to the next marker and gives it: passes over entropy-coded bytes with their stuffed zeros and restart markers.
/// `None` where the input ends, or the picture is too long with its `fill`, which is not copied.
fn read_marker(
    input: &mut impl BufRead,
    whole: &mut Vec<u8>,
    fill: &mut usize,
) -> io::Result<Option<u8>> {
    while whole.len() + *fill <= MOST_BYTES {
        let buffer = input.fill_buf()?;
        if buffer.is_empty() {
            return Ok(None);
        }
        let Some(at) = buffer.iter().position(|byte| *byte == 0xff) else {
            let all = buffer.len();
            whole.extend_from_slice(buffer);
            input.consume(all);
            continue;
        };
        whole.extend_from_slice(&buffer[..=at]);
        input.consume(at + 1);
        // Any number of 0xff may stand before a marker.
        let marker = loop {
            match read_byte(input)? {
                None => return Ok(None),
                Some(0xff) => {
                    *fill += 1;
                    if whole.len() + *fill > MOST_BYTES {
                        return Ok(None);
                    }
                }
                Some(marker) => break marker,
            }
        };
        whole.push(marker);
        if marker != 0 && !(0xd0..=0xd7).contains(&marker) {
            return Ok(Some(marker));
        }
    }
    Ok(None)
}

fn read_byte(input: &mut impl BufRead) -> io::Result<Option<u8>> {
    let byte = input.fill_buf()?.first().copied();
    if byte.is_some() {
        input.consume(1);
    }
    Ok(byte)
}

fn read_exact(input: &mut impl BufRead, bytes: &mut [u8]) -> io::Result<bool> {
    for byte in bytes {
        let Some(read) = read_byte(input)? else {
            return Ok(false);
        };
        *byte = read;
    }
    Ok(true)
}

/// False where the input ends before.
fn copy(input: &mut impl BufRead, mut count: usize, whole: &mut Vec<u8>) -> io::Result<bool> {
    while count > 0 {
        let buffer = input.fill_buf()?;
        if buffer.is_empty() {
            return Ok(false);
        }
        let part = buffer.len().min(count);
        whole.extend_from_slice(&buffer[..part]);
        input.consume(part);
        count -= part;
    }
    Ok(true)
}

/// The pictures of a motion JPEG stream. It has no times: they come at the rate that is asked for.
#[derive(Debug)]
pub(super) struct MotionJpeg<R> {
    info: SourceInfo,
    changing_size: bool,
    input: R,
    jpeg: JpegPictures,
    first: Option<Picture>,
    number: u64,
    /// Damaged pictures, which have a number and a time as the others have.
    damaged: u64,
    /// Whether there was a warning of them.
    has_warned: bool,
    ended: bool,
}

impl<R: BufRead> MotionJpeg<R> {
    /// Reads the first picture. `changing_size` says whether the others may be of another size, as live ones may.
    pub(super) fn open(name: String, input: R, changing_size: bool) -> Result<Self, SourceError> {
        let mut stream = Self {
            changing_size,
            info: SourceInfo {
                name,
                width: 0,
                height: 0,
                rate_hz: Some(RATE_HZ),
                frames: None,
            },
            input,
            jpeg: JpegPictures::default(),
            first: None,
            number: 0,
            damaged: 0,
            has_warned: false,
            ended: false,
        };
        let mut first = Picture::empty();
        if !stream.read(&mut first)? {
            return Err(SourceError::NoPicture {
                name: stream.info.name,
                why: "it has no whole JPEG picture".to_owned(),
            });
        }
        (stream.info.width, stream.info.height) = (first.width, first.height);
        stream.first = Some(first);
        Ok(stream)
    }

    /// The next picture that is not damaged.
    fn read(&mut self, into: &mut Picture) -> Result<bool, SourceError> {
        let mut damaged = 0;
        // Of the last picture, which is returned or logged, once it is known what follows.
        let mut last = None;
        loop {
            let name = &self.info.name;
            let found = next_picture(&mut self.input, &mut self.jpeg.whole).map_err(|source| {
                SourceError::Read {
                    name: name.clone(),
                    source,
                }
            })?;
            into.at = Instant::now();
            match found {
                Found::Whole => {
                    let decoded = self.jpeg.decode_whole(name, into);
                    if let Some(why) = last.take() {
                        self.leave_out(&why);
                    }
                    let Err(why) = decoded else {
                        return Ok(true);
                    };
                    damaged += 1;
                    if damaged == MOST_DAMAGED {
                        return Err(why);
                    }
                    self.damaged += 1;
                    self.number += 1;
                    last = Some(why);
                }
                Found::TooLong => return Err(malformed(name, too_long())),
                // Where all were damaged, that is why there is no picture.
                Found::Cut | Found::OtherBytes | Found::End if self.damaged == self.number => {
                    return match (last, found) {
                        (Some(why), _) => Err(why),
                        (None, Found::OtherBytes) => Err(malformed(name, other_bytes())),
                        (None, _) => Ok(false),
                    };
                }
                Found::Cut | Found::OtherBytes | Found::End => {
                    let number = self.number;
                    if found == Found::Cut {
                        log::warn!("{name} breaks off in picture {number}: it ends there");
                    } else if found == Found::OtherBytes {
                        let why = other_bytes();
                        log::warn!("{name} ends before picture {number}: {why}");
                    }
                    if let Some(why) = last {
                        self.leave_out(&why);
                    }
                    return Ok(false);
                }
            }
        }
    }

    /// Logs why a picture is left out: of the first as a warning.
    fn leave_out(&mut self, why: &SourceError) {
        if self.has_warned {
            log::debug!("a picture is left out: {why}");
        } else {
            let name = &self.info.name;
            log::warn!("{name} has damaged pictures, which are left out: {why}");
            self.has_warned = true;
        }
    }
}

impl<R: BufRead + Send> Source for MotionJpeg<R> {
    fn info(&self) -> &SourceInfo {
        &self.info
    }

    fn next(&mut self, into: &mut Picture) -> Result<bool, SourceError> {
        if self.ended {
            return Ok(false);
        }
        self.ended = true;
        if let Some(mut first) = self.first.take() {
            swap(&mut into.rgb, &mut first.rgb);
            (into.width, into.height, into.at) = (first.width, first.height, first.at);
        } else if !self.read(into)? {
            return Ok(false);
        }
        if !self.changing_size && (into.width, into.height) != (self.info.width, self.info.height) {
            return Err(SourceError::SizeChanged {
                name: self.info.name.clone(),
                number: self.number,
                width: into.width,
                height: into.height,
                first_width: self.info.width,
                first_height: self.info.height,
            });
        }
        self.ended = false;
        into.number = self.number;
        #[allow(clippy::cast_precision_loss, reason = "below 2^53 pictures")]
        {
            into.seconds = self.number as f64 / RATE_HZ;
        }
        self.number += 1;
        Ok(true)
    }
}

#[cfg(test)]
pub(super) mod tests;
