//! Which parameters learn when, and how fast: a function of the training's progress alone.
//!
//! The stages overlap: (a) the template's Gaussians, colours first; (b) the mesh under them and the poses; (c) F_attr; (d) all
//! of them together, at rates that decay. Gaussians come and go while the template and the mesh settle.

use crate::options::Options;
use std::ops::Range;

/// Nothing but colours learns before.
const ALL_ATTRIBUTES_FROM: f32 = 0.02;
/// F_mesh and poses learn from here on.
const MESH_FROM: f32 = 0.08;
/// F_attr learns from here on.
const ATTRIBUTES_FROM: f32 = 0.2;
/// A rate rises from 0 over so much of the progress.
const RAMP: f32 = 0.01;
/// Gaussians come and go in this part of the progress.
pub(crate) const DENSIFY: Range<f32> = 0.05..0.6;
/// Pictures are quartered up to the first of these, and halved up to the second.
const FINER_AT: [f32; 2] = [0.06, 0.3];

/// Pictures are whole and everything learns: from here on, the better of two avatars is the one that meets the held-back pictures better.
pub(crate) const SETTLED_FROM: f32 = FINER_AT[1];

/// Learning rates of one step: about how far a number moves in it. At 0 it stays.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Rates {
    /// Offsets of Gaussians in their triangle's frame, metres.
    pub offset: f32,
    /// Quaternions.
    pub rotation: f32,
    /// Natural logarithms of scales.
    pub log_scale: f32,
    /// Logits of opacities.
    pub opacity: f32,
    /// Coefficients of spherical harmonics of degree 0.
    pub colour: f32,
    /// Vertices' mean offsets, metres.
    pub mesh_mean: f32,
    /// F_mesh's offset fields, metres.
    pub mesh_fields: f32,
    /// F_mesh's layers.
    pub mesh_layers: f32,
    /// Pose corrections: radians.
    pub pose: f32,
    /// Pose corrections: metres.
    pub shift: f32,
    /// The controllers' layers.
    pub controllers: f32,
    /// F_attr's bases, in units of the template's rates: a basis of offsets moves by this times a template offset's first rate.
    pub bases: f32,
}

/// How one step learns.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Phase {
    /// Pictures are halved so often, if they stay large enough to tell limbs apart.
    pub halvings: u32,
    /// Rates of every kind of parameter.
    pub rates: Rates,
    /// Whether F_attr's residuals are added to the Gaussians.
    pub attributes: bool,
    /// Whether Gaussians may come and go after it.
    pub densify: bool,
}

/// Template rates before they decay; F_attr's bases are measured in these.
pub const FIRST: Rates = Rates {
    offset: 2e-4,
    rotation: 4e-3,
    log_scale: 8e-3,
    opacity: 3e-2,
    colour: 1.5e-2,
    mesh_mean: 5e-5,
    mesh_fields: 3e-6,
    mesh_layers: 2e-4,
    pose: 1e-3,
    shift: 5e-4,
    controllers: 2e-3,
    bases: 0.1,
};

/// The phase of a step after `progress` (0..=1) of the training.
#[must_use]
pub fn phase(progress: f32, options: &Options) -> Phase {
    let progress = if progress.is_nan() {
        0.0
    } else {
        progress.clamp(0.0, 1.0)
    };
    let since = |start: f32| ((progress - start) / RAMP).clamp(0.0, 1.0);
    let decayed = |first: f32, last_share: f32| first * last_share.powf(progress);
    let all = since(ALL_ATTRIBUTES_FROM);
    let mesh = if options.learn_mesh {
        since(MESH_FROM)
    } else {
        0.0
    };
    let pose = if options.refine_poses {
        since(MESH_FROM)
    } else {
        0.0
    };
    let attributes = if options.learn_attributes {
        since(ATTRIBUTES_FROM)
    } else {
        0.0
    };
    let rates = Rates {
        offset: all * decayed(FIRST.offset, 0.02),
        rotation: all * decayed(FIRST.rotation, 0.1),
        log_scale: all * decayed(FIRST.log_scale, 0.1),
        opacity: all * decayed(FIRST.opacity, 0.1),
        colour: decayed(FIRST.colour, 0.05),
        mesh_mean: mesh * decayed(FIRST.mesh_mean, 0.02),
        mesh_fields: mesh * decayed(FIRST.mesh_fields, 0.02),
        mesh_layers: mesh * decayed(FIRST.mesh_layers, 0.1),
        pose: pose * decayed(FIRST.pose, 0.02),
        shift: pose * decayed(FIRST.shift, 0.02),
        controllers: attributes * decayed(FIRST.controllers, 0.05),
        bases: attributes * decayed(FIRST.bases, 0.05),
    };
    let [half_from, whole_from] = FINER_AT;
    Phase {
        halvings: u32::from(progress < half_from) + u32::from(progress < whole_from),
        rates,
        attributes: options.learn_attributes && progress >= ATTRIBUTES_FROM,
        densify: options.densify && DENSIFY.contains(&progress),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn colours_learn_first_then_the_template_then_the_mesh_then_attributes() {
        let options = Options::default();
        let at = |progress| phase(progress, &options).rates;
        assert!(at(0.0).colour > 0.0 && at(0.0).offset == 0.0, "colours");
        assert!(at(0.06).offset > 0.0 && at(0.06).pose == 0.0, "template");
        assert!(
            at(0.15).mesh_mean > 0.0 && at(0.15).pose > 0.0 && at(0.15).bases == 0.0,
            "mesh and poses"
        );
        assert!(at(0.5).bases > 0.0 && at(0.5).colour > 0.0, "all together");
        assert!(
            at(1.0).offset < 0.03 * FIRST.offset,
            "rates decay to the end"
        );
    }

    #[test]
    fn what_is_switched_off_never_learns() {
        let options = Options {
            learn_mesh: false,
            learn_attributes: false,
            refine_poses: false,
            densify: false,
            ..Options::default()
        };
        for hundredth in 0..=100u8 {
            let Phase {
                rates,
                attributes,
                densify,
                ..
            } = phase(f32::from(hundredth) / 100.0, &options);
            let off = [
                rates.mesh_mean,
                rates.mesh_fields,
                rates.mesh_layers,
                rates.pose,
                rates.shift,
                rates.controllers,
                rates.bases,
            ];
            assert!(off.iter().all(|rate| *rate == 0.0), "{rates:?}");
            assert!(!attributes && !densify, "neither");
        }
    }

    #[test]
    fn a_progress_that_is_no_number_is_the_start() {
        let options = Options::default();
        assert_eq!(phase(f32::NAN, &options), phase(0.0, &options), "the start");
        assert_eq!(phase(7.0, &options), phase(1.0, &options), "the end");
    }
}
