//! The `meta.json` of a SOG scene: how many Gaussians there are, in which images, and what their bytes mean.

use std::path::{Component, Path};

use serde::Deserialize;

use crate::source::Source;
use crate::{Format, SceneError};

/// The description's name in a zip.
pub(super) const NAME: &str = "meta.json";

/// Numbers for the 256 values of a byte, in one table for all channels or one for each.
pub(super) struct Table(Vec<[f32; 256]>);

impl Table {
    pub(super) fn value(&self, channel: usize, byte: u8) -> f32 {
        self.0
            .get(channel)
            .or_else(|| self.0.first())
            .map_or(f32::NAN, |table| table[usize::from(byte)])
    }

    /// One table; values past its end are no number, which no scene takes.
    fn codebook(values: &[Option<f32>]) -> Self {
        let mut table = [f32::NAN; 256];
        for (to, from) in table.iter_mut().zip(values) {
            *to = from.unwrap_or(f32::NAN);
        }
        // Older writers left the first value out, as PlayCanvas' engine knows.
        if matches!(values.first(), Some(None)) {
            table[0] = table[1] + (table[1] - table[255]) / 255.0;
        }
        Self(vec![table])
    }

    /// A table for each channel, evenly from its lower to its upper bound.
    fn between(bounds: impl Iterator<Item = (f32, f32)>) -> Self {
        let table = |(low, high): (f32, f32)| {
            std::array::from_fn(|byte| {
                #[expect(clippy::cast_precision_loss, reason = "at most 255")]
                let share = byte as f32 / 255.0;
                low + (high - low) * share
            })
        };
        Self(bounds.map(table).collect())
    }
}

/// SH coefficients above degree 0.
pub(super) struct Harmonics {
    pub(super) centroids: String,
    pub(super) labels: String,
    /// Version 1 leaves it to the image's width.
    pub(super) sh_degree: Option<u8>,
    pub(super) table: Table,
}

/// A checked description.
pub(super) struct Meta {
    pub(super) format: Format,
    pub(super) count: usize,
    pub(super) antialiased: bool,
    /// Images of the lower and the upper bytes.
    pub(super) means: [String; 2],
    pub(super) scales: String,
    pub(super) quaternions: String,
    pub(super) colours: String,
    pub(super) scale_table: Table,
    pub(super) colour_table: Table,
    pub(super) harmonics: Option<Harmonics>,
    position_bounds: [[f64; 2]; 3],
    /// Bounds of the opacity before the sigmoid, in version 1.
    logit_bounds: Option<[f32; 2]>,
}

impl Meta {
    pub(super) fn parse(source: &Source<'_>, bytes: &[u8]) -> Result<Self, SceneError> {
        let Ok(file) = serde_json::from_slice::<Description>(bytes) else {
            return Err(not_one(source));
        };
        let version = file.version.unwrap_or(1);
        let format = Format::Sog { version };
        let damaged = |what: &str| source.damaged(format, format!("its meta.json {what}"));
        let count = match version {
            1 => file
                .means
                .shape
                .as_ref()
                .and_then(|shape| shape.first().copied()),
            2 => file.count,
            _ => {
                return Err(source.unsupported(
                    format,
                    format!("version {version}"),
                    "write it as version 2 with splat-transform, or as .ply",
                ));
            }
        };
        let count = count.ok_or_else(|| damaged("does not say how many Gaussians there are"))?;
        let count = source.checked_count(count)?;
        let name = |files: &[String], index: usize| {
            let name = files
                .get(index)
                .ok_or_else(|| damaged("names too few images"))?;
            // Not a path: a scene reads what lies beside it and nothing else.
            let mut parts = Path::new(name).components();
            match (parts.next(), parts.next()) {
                (Some(Component::Normal(part)), None) if part == name.as_str() => Ok(name.clone()),
                _ => Err(damaged(&format!(
                    "names the image {name:?}, which is no plain name"
                ))),
            }
        };
        let table = |attribute: &Attribute, channels: usize| {
            if version == 2 {
                let codebook = attribute.codebook.as_deref().unwrap_or_default();
                if codebook.is_empty() || codebook.len() > 256 {
                    let many = codebook.len();
                    return Err(damaged(&format!(
                        "has a codebook of {many} values, not 256"
                    )));
                }
                return Ok(Table::codebook(codebook));
            }
            let bounds = attribute.bounds(channels);
            let bounds = bounds.ok_or_else(|| damaged("lacks bounds of an attribute"))?;
            Ok(Table::between(
                bounds.into_iter().map(|[low, high]| (low, high)),
            ))
        };
        let harmonics = match &file.harmonics {
            None | Some(Attribute { bands: Some(0), .. }) => None,
            Some(harmonics) => {
                let sh_degree = if version == 2 {
                    let bands = harmonics.bands.unwrap_or(0);
                    if !(1..=3).contains(&bands) {
                        return Err(damaged(&format!("states SH degree {bands}")));
                    }
                    Some(bands)
                } else {
                    None
                };
                Some(Harmonics {
                    centroids: name(&harmonics.files, 0)?,
                    labels: name(&harmonics.files, 1)?,
                    sh_degree,
                    table: table(harmonics, 1)?,
                })
            }
        };
        let position_bounds = file.means.wide_bounds();
        let position_bounds =
            position_bounds.ok_or_else(|| damaged("lacks the bounds of the positions"))?;
        let logit_bounds = match version {
            1 => {
                let bounds = file.colours.bounds(4);
                let bounds = bounds.and_then(|bounds| bounds.get(3).copied());
                Some(bounds.ok_or_else(|| damaged("lacks the bounds of the opacities"))?)
            }
            _ => None,
        };
        Ok(Self {
            format,
            count,
            antialiased: file.antialias || file.model.as_deref() == Some("antialiased"),
            means: [name(&file.means.files, 0)?, name(&file.means.files, 1)?],
            scales: name(&file.scales.files, 0)?,
            quaternions: name(&file.quaternions.files, 0)?,
            colours: name(&file.colours.files, 0)?,
            scale_table: table(&file.scales, 3)?,
            colour_table: table(&file.colours, 3)?,
            harmonics,
            position_bounds,
            logit_bounds,
        })
    }

    /// A coordinate of which the file has 16 bits of the logarithm.
    pub(super) fn position(&self, axis: usize, word: u16) -> f32 {
        let [low, high] = self.position_bounds.get(axis).copied().unwrap_or_default();
        let logarithm = low + (high - low) * f64::from(word) / 65535.0;
        #[expect(
            clippy::cast_possible_truncation,
            reason = "what is beyond f32 becomes infinite, and is left out"
        )]
        let coordinate = logarithm.abs().exp_m1().copysign(logarithm) as f32;
        coordinate
    }

    pub(super) fn opacity(&self, byte: u8) -> f32 {
        let share = f32::from(byte) / 255.0;
        match self.logit_bounds {
            Some([low, high]) => 1.0 / (1.0 + (-(low + (high - low) * share)).exp()),
            None => share,
        }
    }
}

pub(super) fn not_one(source: &Source<'_>) -> SceneError {
    SceneError::UnknownFormat {
        name: source.name.to_owned(),
        what: "its JSON is not the meta.json of a SOG scene".to_owned(),
    }
}

/// As the file has it, in either version.
#[derive(Deserialize)]
struct Description {
    version: Option<u32>,
    count: Option<u64>,
    #[serde(default)]
    antialias: bool,
    model: Option<String>,
    means: Attribute,
    scales: Attribute,
    #[serde(rename = "quats")]
    quaternions: Attribute,
    #[serde(rename = "sh0")]
    colours: Attribute,
    #[serde(rename = "shN")]
    harmonics: Option<Attribute>,
}

#[derive(Deserialize)]
struct Attribute {
    files: Vec<String>,
    shape: Option<Vec<u64>>,
    bands: Option<u8>,
    codebook: Option<Vec<Option<f32>>>,
    mins: Option<OneOrMany>,
    maxs: Option<OneOrMany>,
}

/// Bounds of several channels, or of all in one.
#[derive(Deserialize)]
#[serde(untagged)]
enum OneOrMany {
    One(f64),
    Many(Vec<f64>),
}

impl OneOrMany {
    fn values(&self) -> &[f64] {
        match self {
            Self::One(value) => std::slice::from_ref(value),
            Self::Many(values) => values,
        }
    }
}

impl Attribute {
    /// Lower and upper bound of each channel.
    fn bounds(&self, channels: usize) -> Option<Vec<[f32; 2]>> {
        let (low, high) = (self.mins.as_ref()?.values(), self.maxs.as_ref()?.values());
        let pairs = low.get(..channels)?.iter().zip(high.get(..channels)?);
        #[expect(
            clippy::cast_possible_truncation,
            reason = "what is beyond f32 becomes infinite, and is left out"
        )]
        Some(
            pairs
                .map(|(&low, &high)| [low as f32, high as f32])
                .collect(),
        )
    }

    /// The same for three channels in double precision.
    fn wide_bounds(&self) -> Option<[[f64; 2]; 3]> {
        let (low, high) = (self.mins.as_ref()?.values(), self.maxs.as_ref()?.values());
        let (&[a, b, c], &[d, e, f]) = (low.first_chunk()?, high.first_chunk()?);
        Some([[a, d], [b, e], [c, f]])
    }
}
