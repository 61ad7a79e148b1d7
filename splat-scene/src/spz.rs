//! `.spz`, Niantic's packed format, versions 2 and 3: a gzip stream of a header and one block for each attribute. Its axes
//! are the house's (right, up, back). Version 1 was never released, version 4 is another container. Layout after
//! nianticlabs/spz, `src/cc/load-spz.cc`.

use std::borrow::Cow;
use std::io::{self, Read};

use flate2::bufread::GzDecoder;

use crate::source::{Source, bytes_at, u32_at};
use crate::{Format, Scene, SceneBuilder, SceneError, Splat, rest_coefficients};

const HEADER: usize = 16;
const MAGIC: &[u8] = b"NGSP";
/// What a coefficient of degree 0 is multiplied by before it becomes a byte.
const COLOUR_SCALE: f32 = 0.15;
const FLAG_ANTIALIASED: u8 = 1;
const FLAG_EXTENSIONS: u8 = 2;
/// Extensions after the blocks are passed over up to this size.
const MAX_EXTENSIONS: u64 = 1 << 24;

pub(crate) fn read(source: &Source<'_>) -> Result<Scene, SceneError> {
    if let Some(body) = source.bytes.strip_prefix(MAGIC) {
        // Some tools leave the payload out of gzip.
        let header = source.bytes.first_chunk().ok_or_else(|| {
            let (need, have) = (HEADER as u64, body.len() + MAGIC.len());
            source.truncated(Format::Spz { version: 0 }, "its header", need, have)
        })?;
        let header = Header::parse(source, header)?;
        let blocks = source.bytes.get(HEADER..).unwrap_or_default();
        return unpack(source, &header, Cow::Borrowed(blocks));
    }
    let mut stream = GzDecoder::new(source.bytes);
    let mut first = Vec::with_capacity(HEADER);
    let broken = |version, error: io::Error| {
        source.damaged(
            Format::Spz { version },
            format!("its gzip stream cannot be unpacked ({error})"),
        )
    };
    stream
        .by_ref()
        .take(HEADER as u64)
        .read_to_end(&mut first)
        .map_err(|error| broken(0, error))?;
    let header = match first.first_chunk() {
        Some(header) if header.starts_with(MAGIC) => Header::parse(source, header)?,
        _ => {
            return Err(SceneError::UnknownFormat {
                name: source.name.to_owned(),
                what: "it is a gzip stream, but not of an .spz scene".to_owned(),
            });
        }
    };
    // Grows with what the stream yields, and no further than the header's count, which is checked.
    let mut blocks = Vec::new();
    let need = header.block_bytes();
    stream
        .by_ref()
        .take(need)
        .read_to_end(&mut blocks)
        .map_err(|error| broken(header.version, error))?;
    if blocks.len() as u64 == need {
        // To the end, where gzip's checksum is.
        let rest = io::copy(&mut stream.take(MAX_EXTENSIONS + 1), &mut io::sink())
            .map_err(|error| broken(header.version, error))?;
        if rest > MAX_EXTENSIONS {
            return Err(source.damaged(
                header.format(),
                "its gzip stream goes on after the last Gaussian",
            ));
        }
    }
    unpack(source, &header, Cow::Owned(blocks))
}

struct Header {
    version: u32,
    count: usize,
    sh_degree: u8,
    position_step: f32,
    flags: u8,
}

impl Header {
    fn parse(source: &Source<'_>, bytes: &[u8; HEADER]) -> Result<Self, SceneError> {
        let version = u32_at(bytes, 4);
        let format = Format::Spz { version };
        if !(2..=3).contains(&version) {
            return Err(source.unsupported(
                format,
                format!("version {version}"),
                "write it as version 3 with Niantic's tools or splat-transform, or as .ply",
            ));
        }
        let count = source.checked_count(u64::from(u32_at(bytes, 8)))?;
        let [sh_degree, fractional_bits, flags, _] = bytes_at(bytes, 12);
        match sh_degree {
            0..=3 => {}
            4 => {
                return Err(source.unsupported(
                    format,
                    "SH degree 4",
                    "cut its spherical harmonics to degree 3",
                ));
            }
            _ => return Err(source.damaged(format, format!("it states SH degree {sh_degree}"))),
        }
        // Coordinates have 24 bits in all.
        if fractional_bits > 24 {
            return Err(source.damaged(
                format,
                format!("it states {fractional_bits} fractional bits of the 24 of a coordinate"),
            ));
        }
        if flags & FLAG_EXTENSIONS != 0 {
            log::warn!(
                "{}: its extensions are not read; if they state other axes, the scene lies turned",
                source.name
            );
        }
        Ok(Self {
            version,
            count,
            sh_degree,
            position_step: (-f32::from(fractional_bits)).exp2(),
            flags,
        })
    }

    fn format(&self) -> Format {
        Format::Spz {
            version: self.version,
        }
    }

    fn rotation_bytes(&self) -> usize {
        if self.version == 2 { 3 } else { 4 }
    }

    /// The bytes of each Gaussian in each block: position, opacity, colour, scale, rotation, SH.
    fn strides(&self) -> [usize; 6] {
        let rest = 3 * rest_coefficients(self.sh_degree);
        [9, 1, 3, 3, self.rotation_bytes(), rest]
    }

    fn block_bytes(&self) -> u64 {
        self.count as u64 * self.strides().iter().sum::<usize>() as u64
    }
}

fn unpack(
    source: &Source<'_>,
    header: &Header,
    blocks: Cow<'_, [u8]>,
) -> Result<Scene, SceneError> {
    let need = header.block_bytes();
    if (blocks.len() as u64) < need {
        let what = format!("the attributes of {} Gaussians", header.count);
        return Err(source.truncated(header.format(), what, need, blocks.len()));
    }
    let strides = header.strides();
    let mut start = 0;
    let [positions, opacities, colours, scales, rotations, harmonics] = strides.map(|stride| {
        let block = blocks.get(start..start + stride * header.count);
        start += stride * header.count;
        block.unwrap_or_default()
    });

    let mut builder = SceneBuilder::new(header.sh_degree)?;
    builder.reserve(header.count)?;
    let mut sh_rest = vec![0.0; strides[5]];
    for index in 0..header.count {
        let rotation = if header.version == 2 {
            first_three(bytes_at(rotations, 3 * index))
        } else {
            smallest_three(u32_at(rotations, 4 * index))
        };
        let splat = Splat {
            position: std::array::from_fn(|axis| {
                fixed(bytes_at(positions, 9 * index + 3 * axis)) * header.position_step
            }),
            rotation,
            log_scale: bytes_at(scales, 3 * index).map(|byte: u8| f32::from(byte) / 16.0 - 10.0),
            opacity: f32::from(bytes_at::<1>(opacities, index)[0]) / 255.0,
            colour: bytes_at(colours, 3 * index)
                .map(|byte: u8| (f32::from(byte) / 255.0 - 0.5) / COLOUR_SCALE),
        };
        let bytes = harmonics.get(index * sh_rest.len()..).unwrap_or_default();
        for (value, &byte) in sh_rest.iter_mut().zip(bytes) {
            *value = (f32::from(byte) - 128.0) / 128.0;
        }
        builder.push(&splat, &sh_rest)?;
    }
    let antialiased = header.flags & FLAG_ANTIALIASED != 0;
    Ok(builder.finish_as(header.format(), antialiased))
}

/// A signed number of 24 bits.
fn fixed([low, middle, high]: [u8; 3]) -> f32 {
    // In the upper three bytes, so that the shift back extends the sign.
    let number = i32::from_le_bytes([0, low, middle, high]) >> 8;
    #[expect(clippy::cast_precision_loss, reason = "24 bits fit exactly")]
    let number = number as f32;
    number
}

/// Version 2: x, y and z as bytes; w is what is missing to unit length.
fn first_three(bytes: [u8; 3]) -> [f32; 4] {
    let [x, y, z] = bytes.map(|byte| f32::from(byte) / 127.5 - 1.0);
    [x, y, z, (1.0 - (x * x + y * y + z * z)).max(0.0).sqrt()]
}

/// Version 3: two bits for which of x, y, z and w is the greatest; for each of the others, the last one lowest, a sign and
/// nine bits of its magnitude, of sqrt(1/2) at most.
fn smallest_three(word: u32) -> [f32; 4] {
    let greatest = word >> 30;
    let mut rest = word;
    let mut rotation = [0.0; 4];
    let mut squares = 0.0;
    for (index, value) in (0..4_u32).zip(&mut rotation).rev() {
        if index == greatest {
            continue;
        }
        #[expect(clippy::cast_precision_loss, reason = "nine bits")]
        let magnitude = (rest & 511) as f32 / 511.0 * std::f32::consts::FRAC_1_SQRT_2;
        *value = if rest & 512 == 0 {
            magnitude
        } else {
            -magnitude
        };
        squares += magnitude * magnitude;
        rest >>= 10;
    }
    for (index, value) in (0..4_u32).zip(&mut rotation) {
        if index == greatest {
            *value = (1.0 - squares).max(0.0).sqrt();
        }
    }
    rotation
}
