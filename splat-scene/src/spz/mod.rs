//! `.spz`, Niantic's packed format, versions 2 to 4: a header and one block of bytes for each attribute. Versions 2 and 3
//! keep all of it in one gzip stream, version 4 each block in a Zstandard stream of its own. Version 1 was never released.
//! By the format's definition its axes are OpenXR's (right, up, back), unless an extension states others. Layout after
//! nianticlabs/spz, `src/cc/load-spz.cc`.

mod extensions;
mod gzip;
mod zstandard;

use crate::source::{Source, bytes_at, u32_at};
use crate::{Format, Scene, SceneBuilder, SceneError, Splat, rest_coefficients};

pub(crate) const MAGIC: &[u8] = b"NGSP";
/// Bytes of the header that all versions have.
const HEADER: usize = 16;
/// From this version on each attribute has a Zstandard stream.
const FIRST_ZSTANDARD: u32 = 4;
/// What a coefficient of degree 0 is multiplied by before it becomes a byte.
const COLOUR_SCALE: f32 = 0.15;
const FLAG_ANTIALIASED: u8 = 1;
const FLAG_EXTENSIONS: u8 = 2;
/// The attributes in the order of their blocks.
const ATTRIBUTES: [&str; 6] = [
    "positions",
    "opacities",
    "colours",
    "scales",
    "rotations",
    "spherical harmonics",
];

pub(crate) fn read(source: &Source<'_>) -> Result<Scene, SceneError> {
    let version = u32_at(source.bytes, 4);
    if source.bytes.starts_with(MAGIC) && version >= FIRST_ZSTANDARD {
        zstandard::read(source)
    } else {
        gzip::read(source)
    }
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
        if !(2..=4).contains(&version) {
            return Err(source.unsupported(
                format,
                format!("version {version}"),
                "write it as version 3 or 4 with Niantic's tools or splat-transform, or as .ply",
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

    fn has_extensions(&self) -> bool {
        self.flags & FLAG_EXTENSIONS != 0
    }

    /// Bytes of one Gaussian's rotation.
    fn rotation_bytes(&self) -> usize {
        if self.version == 2 { 3 } else { 4 }
    }

    /// The bytes of each Gaussian in each block, in the order of [`ATTRIBUTES`].
    fn strides(&self) -> [usize; 6] {
        let rest = 3 * rest_coefficients(self.sh_degree);
        [9, 1, 3, 3, self.rotation_bytes(), rest]
    }

    fn block_bytes(&self) -> u64 {
        self.count as u64 * self.strides().iter().sum::<usize>() as u64
    }
}

/// The Gaussians of the six blocks, each as long as the header's count and strides say, and turned from the axes that
/// `extensions` state.
fn unpack(
    source: &Source<'_>,
    header: &Header,
    [positions, opacities, colours, scales, rotations, harmonics]: [&[u8]; 6],
    extensions: &[u8],
) -> Result<Scene, SceneError> {
    let axes = if header.has_extensions() {
        extensions::stated_axes(source, header.format(), extensions)?
    } else {
        None
    };
    let mut builder = SceneBuilder::new(header.sh_degree)?;
    builder.reserve(header.count)?;
    let mut sh_rest = vec![0.0; 3 * rest_coefficients(header.sh_degree)];
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
    let mut scene = builder.finish_as(header.format(), antialiased);
    if let Some(axes) = axes {
        scene.turn_from(axes);
        scene.axes = axes;
        scene.axes_stated = true;
    }
    Ok(scene)
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

/// Versions 3 and 4: two bits for which of x, y, z and w is the greatest; for each of the others, the last one lowest, a sign and
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
