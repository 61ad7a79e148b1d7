//! SOG, `PlayCanvas`' format: lossless WebP images, whose pixel number i holds one attribute of Gaussian i, and a `meta.json`
//! that says how bytes become numbers. In a zip (`.sog`), or as files in a folder. Version 2 looks values up in
//! codebooks, version 1 spreads them between bounds. The axes are COLMAP's. Layout after playcanvas/splat-transform,
//! `src/lib/readers/read-sog.ts` and `read-sog-v1.ts`.

mod archive;
mod meta;
mod picture;

use std::path::Path;

use archive::Bundle;
use meta::Meta;
use picture::Picture;

use crate::source::Source;
use crate::source::read_bounded;
use crate::{Format, Scene, SceneBuilder, SceneError, Splat, frame, rest_coefficients};

pub(crate) use archive::ZIP_MAGIC;
pub use archive::is_sog;

/// A description holds three tables of 256 numbers.
const MAX_META_BYTES: u64 = 1 << 20;
/// This value of the fourth byte, and the three above it, say which part of the quaternion is the greatest.
const FIRST_TAG: u8 = 252;
/// Palette entries in each row of the image of centroids.
const PALETTE_ROW: usize = 64;
/// Labels have 16 bits.
const MAX_PALETTE: usize = 1 << 16;

/// Whether content begins as a JSON object does.
pub(crate) fn is_json_object(bytes: &[u8]) -> bool {
    bytes
        .trim_ascii_start()
        .strip_prefix(b"{")
        .is_some_and(|rest| rest.trim_ascii_start().starts_with(b"\""))
}

/// Reads the zip that `source` is.
pub(crate) fn read_bundle(source: &Source<'_>) -> Result<Scene, SceneError> {
    let mut bundle = Bundle::open(source)?;
    let meta = bundle.member(meta::NAME, MAX_META_BYTES)?;
    read(source, &meta, &mut |name, limit| bundle.member(name, limit))
}

/// Reads the `meta.json` at `path` that `source` is, and the images beside it.
pub(crate) fn read_folder(source: &Source<'_>, path: &Path) -> Result<Scene, SceneError> {
    let folder = path.parent().unwrap_or(Path::new(""));
    if source.bytes.len() as u64 > MAX_META_BYTES {
        return Err(meta::not_one(source));
    }
    read(source, source.bytes, &mut |name, limit| {
        let image = folder.join(name);
        // A pipe could block the reader for ever.
        if image.metadata().is_ok_and(|about| !about.is_file()) {
            return Err(source.damaged(Format::Sog { version: 0 }, format!("{name} is not a file")));
        }
        read_bounded(&image, limit)
    })
}

type Load<'a> = &'a mut dyn FnMut(&str, u64) -> Result<Vec<u8>, SceneError>;

/// Reads a scene whose images `load` fetches by name, up to a number of bytes.
fn read(source: &Source<'_>, meta: &[u8], load: Load<'_>) -> Result<Scene, SceneError> {
    let meta = Meta::parse(source, meta)?;
    let format = meta.format;
    let most = picture::most_pixels(meta.count);
    let mut fetch = |name: &str, most_pixels: usize| {
        let file = load(name, picture::most_bytes(most_pixels))?;
        Picture::decode(source, format, name, &file, most_pixels)
    };
    let mut attribute = |name: &str| {
        let picture = fetch(name, most)?;
        picture.holds(source, format, name, meta.count)?;
        Ok::<_, SceneError>(picture)
    };
    let [low, high] = &meta.means;
    let (low, high) = (attribute(low)?, attribute(high)?);
    let scales = attribute(&meta.scales)?;
    let quaternions = attribute(&meta.quaternions)?;
    let colours = attribute(&meta.colours)?;
    let harmonics = match &meta.harmonics {
        None => None,
        Some(harmonics) => {
            let labels = attribute(&harmonics.labels)?;
            let widest = PALETTE_ROW * rest_coefficients(3);
            let palette = fetch(&harmonics.centroids, widest * MAX_PALETTE / PALETTE_ROW)?;
            Some(Palette::new(source, format, harmonics, labels, palette)?)
        }
    };

    let sh_degree = harmonics.as_ref().map_or(0, |palette| palette.sh_degree);
    let mut builder = SceneBuilder::new(sh_degree)?;
    builder.reserve(meta.count)?;
    let mut sh_rest = vec![0.0; 3 * rest_coefficients(sh_degree)];
    for index in 0..meta.count {
        let (low, high) = (low.pixel(index), high.pixel(index));
        let scale = scales.pixel(index);
        let colour = colours.pixel(index);
        let mut splat = Splat {
            position: std::array::from_fn(|axis| {
                meta.position(axis, u16::from_le_bytes([low[axis], high[axis]]))
            }),
            rotation: quaternion(quaternions.pixel(index)),
            log_scale: std::array::from_fn(|axis| meta.scale_table.value(axis, scale[axis])),
            opacity: meta.opacity(colour[3]),
            colour: std::array::from_fn(|channel| {
                meta.colour_table.value(channel, colour[channel])
            }),
        };
        if let Some(palette) = &harmonics {
            palette
                .look_up(index, &mut sh_rest)
                .map_err(|what| source.damaged(format, what))?;
        }
        frame::turn(&mut splat, &mut sh_rest);
        builder.push(&splat, &sh_rest)?;
    }
    Ok(builder.finish_as(format, meta.antialiased))
}

/// Three parts of a quaternion, in the order w x y z without the greatest, and which one that is. An unknown tag gives
/// zeros, which no scene takes.
fn quaternion([a, b, c, tag]: [u8; 4]) -> [f32; 4] {
    let [a, b, c] =
        [a, b, c].map(|byte| (f32::from(byte) / 127.5 - 1.0) * std::f32::consts::FRAC_1_SQRT_2);
    let greatest = (1.0 - (a * a + b * b + c * c)).max(0.0).sqrt();
    let [w, x, y, z] = match tag.checked_sub(FIRST_TAG) {
        Some(0) => [greatest, a, b, c],
        Some(1) => [a, greatest, b, c],
        Some(2) => [a, b, greatest, c],
        Some(3) => [a, b, c, greatest],
        _ => [0.0; 4],
    };
    [x, y, z, w]
}

/// Sets of SH coefficients, and which of them each Gaussian has.
struct Palette<'a> {
    table: &'a meta::Table,
    labels: Picture,
    centroids: Picture,
    sh_degree: u8,
}

impl<'a> Palette<'a> {
    fn new(
        source: &Source<'_>,
        format: Format,
        harmonics: &'a meta::Harmonics,
        labels: Picture,
        centroids: Picture,
    ) -> Result<Self, SceneError> {
        let of_width =
            (1..=3).find(|&degree| centroids.width == PALETTE_ROW * rest_coefficients(degree));
        match (of_width, harmonics.sh_degree) {
            (Some(sh_degree), stated) if stated.is_none_or(|stated| stated == sh_degree) => {
                Ok(Self {
                    table: &harmonics.table,
                    labels,
                    centroids,
                    sh_degree,
                })
            }
            (_, stated) => {
                let degree = stated.map_or("1 to 3".to_owned(), |degree| degree.to_string());
                Err(source.damaged(
                    format,
                    format!(
                        "{} is {} pixels wide, which is not 64 entries of SH degree {degree}",
                        harmonics.centroids, centroids.width
                    ),
                ))
            }
        }
    }

    /// The coefficients of one Gaussian, or what is wrong with its label.
    fn look_up(&self, index: usize, sh_rest: &mut [f32]) -> Result<(), String> {
        let [low, high, ..] = self.labels.pixel(index);
        let label = usize::from(u16::from_le_bytes([low, high]));
        let coefficients = rest_coefficients(self.sh_degree);
        // Row by row, so that an entry's pixels lie side by side.
        let first = label * coefficients;
        if first + coefficients > self.centroids.pixels() {
            return Err(format!(
                "Gaussian {index} has the SH label {label}, which is not in the palette"
            ));
        }
        for (coefficient, values) in sh_rest.chunks_exact_mut(3).enumerate() {
            let bytes = self.centroids.pixel(first + coefficient);
            for (value, byte) in values.iter_mut().zip(bytes) {
                *value = self.table.value(0, byte);
            }
        }
        Ok(())
    }
}
