//! YUV4MPEG2 (`.y4m`): a line of text, then for each picture a line of text and its planes. 4:2:0, 4:2:2, 4:4:4 and luma alone,
//! 8, 10 and 12 bits. Chroma is that of the nearest sample. The format does not name its matrix: see [`Matrix::of_size`].

use std::io::{self, BufRead, Read};
use std::time::Instant;

use super::colour::{Conversion, Matrix, Range};
use super::error::SourceError;
use super::picture::{Picture, Source, SourceInfo, within_limits};

/// Of the first line and of each picture's: far above what programs write.
const LONGEST_LINE: u64 = 4096;

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Chroma {
    None,
    /// Half as wide, and half as high.
    C420,
    /// Half as wide.
    C422,
    C444,
}

#[derive(Debug, Clone, Copy, PartialEq)]
struct Header {
    width: u32,
    height: u32,
    rate_hz: Option<f64>,
    chroma: Chroma,
    bits: u32,
    range: Range,
}

impl Header {
    /// Columns and rows of a plane of chroma.
    fn chroma_size(&self) -> (usize, usize) {
        let (width, height) = (self.width as usize, self.height as usize);
        match self.chroma {
            Chroma::None => (0, 0),
            Chroma::C420 => (width.div_ceil(2), height.div_ceil(2)),
            Chroma::C422 => (width.div_ceil(2), height),
            Chroma::C444 => (width, height),
        }
    }

    fn sample_bytes(&self) -> usize {
        if self.bits > 8 { 2 } else { 1 }
    }

    fn picture_bytes(&self) -> usize {
        let (columns, rows) = self.chroma_size();
        (self.width as usize * self.height as usize + 2 * columns * rows) * self.sample_bytes()
    }
}

/// `W`, `H`, `F`, `C` and `XCOLORRANGE`; other parameters are passed over.
fn parse(name: &str, line: &[u8]) -> Result<Header, SourceError> {
    let refuse = |why: String| SourceError::Malformed {
        name: name.to_owned(),
        why,
    };
    let line = String::from_utf8_lossy(line);
    let mut words = line.split_ascii_whitespace();
    if words.next() != Some("YUV4MPEG2") {
        return Err(refuse(
            "it does not start as y4m does, with YUV4MPEG2".to_owned(),
        ));
    }
    let (mut width, mut height, mut rate_hz) = (None, None, None);
    let (mut chroma, mut bits, mut range) = (Chroma::C420, 8, Range::Limited);
    for word in words {
        let (key, value) = word.split_at(word.chars().next().map_or(0, char::len_utf8));
        match key {
            "W" => width = value.parse::<u32>().ok(),
            "H" => height = value.parse::<u32>().ok(),
            "F" => {
                rate_hz = value
                    .split_once(':')
                    .and_then(|(above, below)| {
                        Some((above.parse::<u32>().ok()?, below.parse::<u32>().ok()?))
                    })
                    .filter(|(above, below)| *above > 0 && *below > 0)
                    .map(|(above, below)| f64::from(above) / f64::from(below));
            }
            "C" => {
                (chroma, bits) =
                    layout(value).ok_or_else(|| refuse(format!("its pixels are {value:.32}: 420, 422, 444 and mono of 8, 10 or 12 bits are read")))?;
            }
            "X" => match value {
                "COLORRANGE=FULL" => range = Range::Full,
                "COLORRANGE=LIMITED" => range = Range::Limited,
                _ => {}
            },
            _ => {}
        }
    }
    let (Some(width), Some(height)) = (width, height) else {
        return Err(refuse(
            "its first line does not give its width and height".to_owned(),
        ));
    };
    within_limits(name, width, height)?;
    Ok(Header {
        width,
        height,
        rate_hz,
        chroma,
        bits,
        range,
    })
}

/// Of the tag after `C`: `420jpeg`, `422p10`, `mono12`, ...
fn layout(tag: &str) -> Option<(Chroma, u32)> {
    let (chroma, rest) = if let Some(rest) = tag.strip_prefix("420") {
        (Chroma::C420, rest)
    } else if let Some(rest) = tag.strip_prefix("422") {
        (Chroma::C422, rest)
    } else if let Some(rest) = tag.strip_prefix("444") {
        (Chroma::C444, rest)
    } else {
        (Chroma::None, tag.strip_prefix("mono")?)
    };
    let bits = match rest {
        "" => 8,
        "jpeg" | "mpeg2" | "paldv" if chroma == Chroma::C420 => 8,
        "p10" | "10" => 10,
        "p12" | "12" => 12,
        _ => return None,
    };
    Some((chroma, bits))
}

/// The pictures of a y4m stream.
#[derive(Debug)]
pub(super) struct Y4m<R> {
    info: SourceInfo,
    header: Header,
    conversion: Conversion,
    period_seconds: f64,
    input: R,
    planes: Vec<u8>,
    rows: [Vec<u16>; 3],
    number: u64,
    ended: bool,
}

impl<R: BufRead> Y4m<R> {
    /// Reads the first line.
    pub(super) fn open(name: String, mut input: R) -> Result<Self, SourceError> {
        let mut line = Vec::new();
        match read_line(&mut input, &mut line) {
            Ok(Line::Whole) => {}
            Ok(Line::None) => {
                return Err(SourceError::NoPicture {
                    name,
                    why: "it is empty".to_owned(),
                });
            }
            Ok(Line::Cut) => {
                return Err(SourceError::Malformed {
                    name,
                    why: "its first line does not end".to_owned(),
                });
            }
            Err(source) => return Err(SourceError::Read { name, source }),
        }
        let header = parse(&name, &line)?;
        Ok(Self {
            info: SourceInfo {
                name,
                width: header.width,
                height: header.height,
                rate_hz: header.rate_hz,
                frames: None,
            },
            header,
            conversion: Conversion::new(
                Matrix::of_size(header.width, header.height),
                header.range,
                header.bits,
            ),
            period_seconds: header.rate_hz.map_or(1.0 / 30.0, f64::recip),
            input,
            planes: Vec::new(),
            rows: Default::default(),
            number: 0,
            ended: false,
        })
    }

    /// Whether there was another whole picture.
    fn read_planes(&mut self) -> Result<bool, SourceError> {
        let failed = |source| SourceError::Read {
            name: self.info.name.clone(),
            source,
        };
        self.planes.clear();
        let line = read_line(&mut self.input, &mut self.planes).map_err(failed)?;
        let cut = match line {
            Line::None => false,
            Line::Cut => true,
            Line::Whole => {
                if !self.planes.starts_with(b"FRAME") {
                    return Err(SourceError::Malformed {
                        name: self.info.name.clone(),
                        why: format!("picture {} does not start with FRAME", self.number),
                    });
                }
                self.planes.clear();
                let bytes = self.header.picture_bytes();
                // Grows with what comes, not with what the header promises.
                let mut input = (&mut self.input).take(bytes as u64);
                if input.read_to_end(&mut self.planes).map_err(failed)? == bytes {
                    return Ok(true);
                }
                true
            }
        };
        if self.number == 0 {
            return Err(SourceError::NoPicture {
                name: self.info.name.clone(),
                why: if cut {
                    "the first one is cut short"
                } else {
                    "nothing follows its first line"
                }
                .to_owned(),
            });
        }
        if cut {
            log::warn!(
                "{} breaks off in picture {}: it ends there",
                self.info.name,
                self.number
            );
        }
        Ok(false)
    }

    fn convert(&mut self, rgb: &mut [u8]) {
        let (width, height) = (self.header.width as usize, self.header.height as usize);
        let (columns, chroma_rows) = self.header.chroma_size();
        let bytes = self.header.sample_bytes();
        let (luma, rest) = self.planes.split_at(width * height * bytes);
        let (cb, cr) = rest.split_at(columns * chroma_rows * bytes);
        let halved = usize::from(self.header.chroma == Chroma::C420);
        for (row, rgb) in rgb.chunks_exact_mut(3 * width).enumerate() {
            let y = line_of(luma, row, width * bytes);
            let cb = line_of(cb, row >> halved, columns * bytes);
            let cr = line_of(cr, row >> halved, columns * bytes);
            if self.header.bits > 8 {
                for (samples, bytes) in self.rows.iter_mut().zip([y, cb, cr]) {
                    widen(bytes, self.header.bits, samples);
                }
                let [y, cb, cr] = &self.rows;
                put(&self.conversion, self.header.chroma, [y, cb, cr], rgb);
            } else {
                put(&self.conversion, self.header.chroma, [y, cb, cr], rgb);
            }
        }
    }
}

fn put<T: Copy + Into<u16>>(
    conversion: &Conversion,
    chroma: Chroma,
    [y, cb, cr]: [&[T]; 3],
    rgb: &mut [u8],
) {
    match chroma {
        Chroma::None => conversion.row_grey(y, rgb),
        Chroma::C420 | Chroma::C422 => conversion.row_422(y, cb, cr, rgb),
        Chroma::C444 => conversion.row_444(y, cb, cr, rgb),
    }
}

fn line_of(plane: &[u8], row: usize, bytes: usize) -> &[u8] {
    plane
        .get(row * bytes..(row + 1) * bytes)
        .unwrap_or_default()
}

/// Little-endian samples; bits above the format's are taken for white.
fn widen(bytes: &[u8], bits: u32, samples: &mut Vec<u16>) {
    let largest = (1u16 << bits) - 1;
    samples.clear();
    samples.extend(
        bytes
            .chunks_exact(2)
            .map(|two| u16::from_le_bytes([two[0], two[1]]).min(largest)),
    );
}

enum Line {
    Whole,
    /// Longer than allowed, or the input ends in it.
    Cut,
    /// The input has ended.
    None,
}

fn read_line(input: &mut impl BufRead, line: &mut Vec<u8>) -> io::Result<Line> {
    let read = input.take(LONGEST_LINE).read_until(b'\n', line)?;
    Ok(match line.last() {
        _ if read == 0 => Line::None,
        Some(b'\n') => Line::Whole,
        _ => Line::Cut,
    })
}

impl<R: BufRead + Send> Source for Y4m<R> {
    fn info(&self) -> &SourceInfo {
        &self.info
    }

    fn next(&mut self, into: &mut Picture) -> Result<bool, SourceError> {
        if self.ended {
            return Ok(false);
        }
        self.ended = true;
        if !self.read_planes()? {
            return Ok(false);
        }
        self.ended = false;
        into.at = Instant::now();
        into.resize(self.header.width, self.header.height);
        self.convert(&mut into.rgb);
        into.number = self.number;
        #[allow(clippy::cast_precision_loss, reason = "below 2^53 pictures")]
        {
            into.seconds = self.number as f64 * self.period_seconds;
        }
        self.number += 1;
        Ok(true)
    }
}

#[cfg(test)]
mod tests;
