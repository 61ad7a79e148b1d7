//! F_attr: motion parameters -> per-Gaussian attribute residuals (paper, section IV-B).
//!
//! Controller j is a small MLP: u_j = SiLU(P A_j + a_j) C_j + c_j, its *displacement potential* of B numbers. A Gaussian's
//! *dragging force* F is its three controllers' potentials mixed by virtual mass, and F weighs B bases of 14 attributes.

use super::Dense;
use crate::{ATTRIBUTES, PARAMS, PersonError};
use half::f16;

/// Bases Delta G_i^b of every Gaussian: 8 bits a value, one scale per Gaussian and attribute.
#[derive(Debug, Clone, PartialEq)]
pub struct QuantisedBases {
    bases: usize,
    units: [f32; ATTRIBUTES],
    scales: Vec<f16>,
    values: Vec<i8>,
}

impl QuantisedBases {
    /// Quantises row-major [14, bases, N_g] values.
    ///
    /// # Errors
    /// If the count does not fit or a value is not finite (or beyond 1000).
    pub fn quantise(bases: usize, gaussians: usize, full: &[f32]) -> Result<Self, PersonError> {
        PersonError::check_count(
            "deformation bases",
            full.len(),
            ATTRIBUTES * bases * gaussians,
        )?;
        PersonError::check_range("deformation basis", full, -1000.0, 1000.0, "-1000..1000")?;
        let peak = |plane: usize, gaussian: usize| {
            (0..bases)
                .map(|b| full[(plane * bases + b) * gaussians + gaussian].abs())
                .fold(0.0f32, f32::max)
        };
        let mut units = [0.0; ATTRIBUTES];
        let mut scales = Vec::with_capacity(ATTRIBUTES * gaussians);
        for (plane, unit) in units.iter_mut().enumerate() {
            *unit = (0..gaussians)
                .map(|g| peak(plane, g))
                .fold(1e-9f32, f32::max)
                / 127.0;
            scales.extend((0..gaussians).map(|g| f16::from_f32(peak(plane, g) / 127.0 / *unit)));
        }
        let mut values = Vec::with_capacity(full.len());
        for plane in 0..ATTRIBUTES {
            for basis in 0..bases {
                for gaussian in 0..gaussians {
                    let scale = units[plane] * scales[plane * gaussians + gaussian].to_f32();
                    values.push(to_step(
                        full[(plane * bases + basis) * gaussians + gaussian],
                        scale,
                    ));
                }
            }
        }
        Ok(Self {
            bases,
            units,
            scales,
            values,
        })
    }

    /// Takes numbers that a graph stored, all finite.
    pub(super) fn from_stored(
        bases: usize,
        units: [f32; ATTRIBUTES],
        scales: Vec<f16>,
        values: Vec<i8>,
    ) -> Result<Self, PersonError> {
        let gaussians = scales.len() / ATTRIBUTES;
        PersonError::check_count("basis scales", scales.len(), ATTRIBUTES * gaussians)?;
        PersonError::check_count("deformation bases", values.len(), scales.len() * bases)?;
        // The largest step that quantising makes: 127 steps reach 1000.
        PersonError::check_range("basis unit", &units, 0.0, 1000.0 / 127.0, "0..1000 / 127")?;
        check_scales("basis scale", &scales)?;
        Ok(Self {
            bases,
            units,
            scales,
            values,
        })
    }

    /// Number of bases B.
    #[must_use]
    pub fn bases(&self) -> usize {
        self.bases
    }

    /// Number of Gaussians N_g.
    #[must_use]
    pub fn gaussians(&self) -> usize {
        self.scales.len() / ATTRIBUTES
    }

    /// Attribute units per relative scale step, one per plane.
    #[must_use]
    pub fn units(&self) -> &[f32; ATTRIBUTES] {
        &self.units
    }

    /// Relative scales, row-major [14, N_g].
    #[must_use]
    pub fn scales(&self) -> &[f16] {
        &self.scales
    }

    /// Quantised bases, row-major [14, B, N_g].
    #[must_use]
    pub fn values(&self) -> &[i8] {
        &self.values
    }

    /// The bases as the graph sees them, row-major [14, B, N_g].
    #[must_use]
    pub fn dequantise(&self) -> Vec<f32> {
        let gaussians = self.gaussians();
        let per_plane = self.bases * gaussians;
        let scale = |at: usize| {
            let plane = at / per_plane;
            self.units[plane] * self.scales[plane * gaussians + at % gaussians].to_f32()
        };
        self.values
            .iter()
            .enumerate()
            .map(|(at, v)| f32::from(*v) * scale(at))
            .collect()
    }
}

/// Scales are relative to their unit: 0..=1.
pub(super) fn check_scales(what: &'static str, scales: &[f16]) -> Result<(), PersonError> {
    let outside = |scale: &f16| !(0.0..=1.0).contains(&scale.to_f32());
    match scales.iter().position(outside) {
        None => Ok(()),
        Some(at) => Err(PersonError::Value {
            what,
            at,
            value: scales[at].to_f32(),
            range: "0..1",
        }),
    }
}

/// Nearest of the 255 symmetric steps of size `step`; zero where the whole row is zero.
pub(super) fn to_step(value: f32, step: f32) -> i8 {
    #[allow(
        clippy::cast_possible_truncation,
        reason = "clamped to the range of i8 first"
    )]
    if step > 0.0 {
        (value / step).round().clamp(-127.0, 127.0) as i8
    } else {
        0
    }
}

/// F_attr without the Gaussians' neighbourhoods, which [`crate::Controllers`] holds.
#[derive(Debug, Clone, PartialEq)]
pub struct AttributeNetwork {
    /// First layer of all controllers side by side, 215 -> controllers x hidden, followed by SiLU.
    pub first: Dense,
    /// Second layers, row-major [controllers, hidden, B].
    pub second: Vec<f16>,
    /// Second layers' bias, row-major [controllers, B].
    pub second_bias: Vec<f32>,
    /// What the forces weigh.
    pub bases: QuantisedBases,
}

impl AttributeNetwork {
    /// Hidden units of one controller.
    #[must_use]
    pub fn hidden(&self, controllers: usize) -> usize {
        self.first.outputs().checked_div(controllers).unwrap_or(0)
    }

    /// Refuses layers that do not fit `controllers` controllers and `gaussians` Gaussians.
    ///
    /// # Errors
    /// Names the layer and the counts.
    pub fn check(&self, controllers: usize, gaussians: usize) -> Result<(), PersonError> {
        let bases = self.bases.bases();
        PersonError::check_count("F_attr inputs", self.first.inputs(), PARAMS)?;
        let hidden = self.hidden(controllers);
        PersonError::check_count(
            "F_attr hidden units",
            self.first.outputs(),
            controllers * hidden,
        )?;
        PersonError::check_count(
            "F_attr second layer",
            self.second.len(),
            controllers * hidden * bases,
        )?;
        PersonError::check_count(
            "F_attr second bias",
            self.second_bias.len(),
            controllers * bases,
        )?;
        PersonError::check_count("F_attr bases", self.bases.gaussians(), gaussians)
    }
}
