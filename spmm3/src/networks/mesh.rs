//! F_mesh: motion parameters -> canonical vertex offsets (paper, section IV-A, non-rigid deformation learning).

use super::Dense;
use crate::{PARAMS, PersonError, Template};
use half::f16;

/// The last layer of F_mesh: `rank` offset fields over the vertices, 8 bits a value with one scale a coordinate.
#[derive(Debug, Clone, PartialEq)]
pub struct QuantisedDecoder {
    rank: usize,
    unit: f32,
    scales: Vec<f16>,
    values: Vec<i8>,
    mean: Vec<f32>,
}

impl QuantisedDecoder {
    /// Quantises `fields` (row-major [rank, 3 N_v], planes x|y|z, metres) around the mean offsets `mean` [3 N_v].
    ///
    /// # Errors
    /// If the counts do not fit each other, a field is not finite or beyond 10 m, or a mean offset beyond 1 m.
    pub fn quantise(rank: usize, fields: &[f32], mean: Vec<f32>) -> Result<Self, PersonError> {
        let columns = mean.len();
        PersonError::check_count("decoder fields", fields.len(), rank * columns)?;
        PersonError::check_range("decoder field", fields, -10.0, 10.0, "-10..10 m")?;
        Self::check_mean(&mean)?;
        let peak = |column: usize| {
            (0..rank)
                .map(|r| fields[r * columns + column].abs())
                .fold(0.0f32, f32::max)
        };
        let unit = (0..columns).map(peak).fold(1e-9f32, f32::max) / 127.0;
        let scales: Vec<f16> = (0..columns)
            .map(|c| f16::from_f32(peak(c) / 127.0 / unit))
            .collect();
        let values = fields
            .iter()
            .enumerate()
            .map(|(at, v)| super::attributes::to_step(*v, unit * scales[at % columns].to_f32()))
            .collect();
        Ok(Self {
            rank,
            unit,
            scales,
            values,
            mean,
        })
    }

    /// A worn garment rests centimetres from the template. A mean of metres is another person's rest shape.
    fn check_mean(mean: &[f32]) -> Result<(), PersonError> {
        PersonError::check_range("mean offset", mean, -1.0, 1.0, "-1..1 m")
    }

    /// Takes numbers that a graph stored, all finite.
    pub(super) fn from_stored(
        rank: usize,
        unit: Vec<f32>,
        scales: Vec<f16>,
        values: Vec<i8>,
        mean: Vec<f32>,
    ) -> Result<Self, PersonError> {
        PersonError::check_count("decoder unit", unit.len(), 1)?;
        PersonError::check_count("decoder scales", scales.len(), mean.len())?;
        PersonError::check_count("decoder fields", values.len(), rank * mean.len())?;
        // The largest step that quantising makes: 127 steps reach 10 m.
        PersonError::check_range("decoder unit", &unit, 0.0, 10.0 / 127.0, "0..10 m / 127")?;
        super::attributes::check_scales("decoder scale", &scales)?;
        Self::check_mean(&mean)?;
        Ok(Self {
            rank,
            unit: unit[0],
            scales,
            values,
            mean,
        })
    }

    /// Number of offset fields.
    #[must_use]
    pub fn rank(&self) -> usize {
        self.rank
    }

    /// Metres per relative scale step.
    #[must_use]
    pub fn unit(&self) -> f32 {
        self.unit
    }

    /// Relative scale of each coordinate, [3 N_v].
    #[must_use]
    pub fn scales(&self) -> &[f16] {
        &self.scales
    }

    /// Quantised fields, row-major [rank, 3 N_v].
    #[must_use]
    pub fn values(&self) -> &[i8] {
        &self.values
    }

    /// Mean offsets, [3 N_v], metres.
    #[must_use]
    pub fn mean(&self) -> &[f32] {
        &self.mean
    }

    /// The fields as the graph sees them, row-major [rank, 3 N_v], metres.
    #[must_use]
    pub fn dequantise(&self) -> Vec<f32> {
        let columns = self.mean.len();
        let scale = |at: usize| self.scales[at % columns].to_f32() * self.unit;
        self.values
            .iter()
            .enumerate()
            .map(|(at, v)| f32::from(*v) * scale(at))
            .collect()
    }
}

/// F_mesh: 215 -> hidden -> hidden -> rank -> [3, N_v], SiLU between.
#[derive(Debug, Clone, PartialEq)]
pub struct MeshNetwork {
    /// 215 -> hidden, followed by SiLU.
    pub first: Dense,
    /// hidden -> hidden, followed by SiLU.
    pub second: Dense,
    /// hidden -> rank, linear.
    pub code: Dense,
    /// rank -> [3, N_v], linear.
    pub decoder: QuantisedDecoder,
}

impl MeshNetwork {
    /// The canonical vertices where the code is 0: the template and the mean offsets, planes x|y|z, [3, N_v], metres.
    #[must_use]
    pub fn rest_shape(&self, template: &Template) -> Vec<f32> {
        (0..3)
            .flat_map(|axis| template.vertices().iter().map(move |v| v[axis]))
            .zip(&self.decoder.mean)
            .map(|(rest, mean)| rest + mean)
            .collect()
    }

    /// Refuses layers that do not follow one another, or that do not end at `vertices` vertices.
    ///
    /// # Errors
    /// Names the layer and the counts.
    pub fn check(&self, vertices: usize) -> Result<(), PersonError> {
        PersonError::check_count("F_mesh inputs", self.first.inputs(), PARAMS)?;
        PersonError::check_count(
            "F_mesh second layer inputs",
            self.second.inputs(),
            self.first.outputs(),
        )?;
        PersonError::check_count(
            "F_mesh code inputs",
            self.code.inputs(),
            self.second.outputs(),
        )?;
        PersonError::check_count(
            "F_mesh decoder rank",
            self.decoder.rank,
            self.code.outputs(),
        )?;
        PersonError::check_count("F_mesh outputs", self.decoder.mean.len(), 3 * vertices)
    }
}
