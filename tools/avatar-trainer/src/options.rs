//! What a user may choose of a training.

use crate::error::TrainError;
use serde::{Deserialize, Serialize};

/// The fewest Gaussians that an avatar is trained with.
const LEAST_GAUSSIANS: usize = 16;

/// The most, with room for the largest networks beside them: of the graph that they are in, a package's reader takes no more than
/// [`spmm3::networks::MAX_NUMBERS`] numbers.
pub const MOST_GAUSSIANS: usize = 500_000;

/// Options of a training. A checkpoint keeps them: a training goes on with those it was begun with.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Options {
    /// Orders the pictures, holds some of them back and scatters new Gaussians.
    pub seed: u64,
    /// The most Gaussians: until there are as many, they are split and cloned where pictures need it.
    pub gaussians: usize,
    /// Pictures of training cameras and frames that are held back, to tell which package is the best so far.
    pub validation: usize,
    /// Most bytes of pictures kept decoded; further ones are decoded whenever they are needed.
    pub picture_memory: usize,
    /// Shares of the losses.
    pub weights: Weights,
    /// How much of a pose as the networks see it is chance, so that they learn no pose by heart: a standard deviation, as a share of each parameter's spread over
    /// the frames that are learnt from, 0..=1.
    pub jitter: f32,
    /// Whether each camera has an affine correction of colours: real cameras differ, and their exposure does.
    pub colour_correction: bool,
    /// Whether poses are refined.
    pub refine_poses: bool,
    /// Whether F_mesh learns, vertices' mean offsets included.
    pub learn_mesh: bool,
    /// Whether F_attr learns.
    pub learn_attributes: bool,
    /// Whether Gaussians come and go.
    pub densify: bool,
}

impl Default for Options {
    fn default() -> Self {
        Self {
            seed: 1,
            gaussians: 40_000,
            validation: 16,
            picture_memory: 2 << 30,
            weights: Weights::default(),
            jitter: 0.4,
            colour_correction: false,
            refine_poses: true,
            learn_mesh: true,
            learn_attributes: true,
            densify: true,
        }
    }
}

/// Shares of the losses: (1 - `ssim` - `lpips`) L_1 + `ssim` L_SSIM + `lpips` L_LPIPS + `alpha` L1 of alpha + the regularising terms of the paper's section
/// IV-C, which states none of the shares. The sums over Gaussians or pairs of controllers are taken as means, so that the shares do not depend on
/// how many there are.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Weights {
    /// alpha of L_photo: the share of 1 - SSIM, 0..=1.
    pub ssim: f32,
    /// beta of L_photo: the share of LPIPS, where a network for it is given, 0..=1 with alpha. Checkpoints of before there was one have none.
    #[serde(default)]
    pub lpips: f32,
    /// The share of the silhouette's L1.
    pub alpha: f32,
    /// lambda_g: of the guide coherence loss, by square metres.
    pub guide: f32,
    /// lambda_s: of the scale regularisation, by metres.
    pub scale: f32,
    /// s_thresh of the scale regularisation, metres.
    pub scale_threshold: f32,
    /// lambda_b: of the binding regularisation, by square metres.
    pub bind: f32,
    /// Pull of refined poses towards the capture's, by radians of every joint and decimetres of the root.
    pub pose: f32,
}

impl Default for Weights {
    fn default() -> Self {
        Self {
            ssim: 0.2,
            // As in MMLPHuman's training.
            lpips: 0.1,
            alpha: 0.1,
            guide: 20.0,
            scale: 1.0,
            scale_threshold: 0.03,
            bind: 20.0,
            pose: 0.02,
        }
    }
}

impl Options {
    /// Refuses what no training can be made with.
    ///
    /// # Errors
    /// Names the option and its range.
    pub fn check(&self) -> Result<(), TrainError> {
        let refused = |what, value: String, range| Err(TrainError::Option { what, value, range });
        if !(LEAST_GAUSSIANS..=MOST_GAUSSIANS).contains(&self.gaussians) {
            let range = "16 to 500,000, as a package's reader takes no more with their bases";
            return refused("the number of Gaussians", self.gaussians.to_string(), range);
        }
        if !(0.0..=1.0).contains(&self.jitter) {
            return refused("the poses' jitter", self.jitter.to_string(), "0 to 1");
        }
        let Weights {
            ssim,
            lpips,
            alpha,
            guide,
            scale,
            scale_threshold,
            bind,
            pose,
        } = self.weights;
        if !(0.0..=1.0).contains(&ssim) {
            return refused("the share of SSIM", ssim.to_string(), "0 to 1");
        }
        if !(0.0..=1.0 - ssim).contains(&lpips) {
            let range = "0 to 1 less the share of SSIM";
            return refused("the share of LPIPS", lpips.to_string(), range);
        }
        for (what, share) in [
            ("the share of alpha", alpha),
            ("the share of the guide loss", guide),
            ("the share of the scale loss", scale),
            ("the scale threshold", scale_threshold),
            ("the share of the binding loss", bind),
            ("the pull towards the capture's poses", pose),
        ] {
            if !(0.0..=1e6).contains(&share) {
                return refused(what, share.to_string(), "0 to 1,000,000");
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fresh::{BASES, CONTROLLER_HIDDEN};
    use spmm3::networks::MAX_NUMBERS;
    use spmm3::{ATTRIBUTES, JOINTS, NEIGHBOURS, PARAMS};

    #[test]
    fn options_out_of_their_range_are_refused_by_name() {
        assert!(Options::default().check().is_ok(), "the default ones");
        let few = Options {
            gaussians: 3,
            ..Options::default()
        };
        let said = few.check().expect_err("too few").to_string();
        assert!(said.contains("number of Gaussians is 3"), "{said}");
        let shaken = Options {
            jitter: f32::NAN,
            ..Options::default()
        };
        let said = shaken.check().expect_err("no number").to_string();
        assert!(said.contains("jitter is NaN"), "{said}");
        let mut wild = Options::default();
        wild.weights.bind = f32::NAN;
        let said = wild.check().expect_err("no number").to_string();
        assert!(said.contains("binding loss is NaN"), "{said}");
        let mut photo = Options::default();
        photo.weights.lpips = 0.9;
        let said = photo
            .check()
            .expect_err("L1 has less than none")
            .to_string();
        assert!(said.contains("LPIPS is 0.9"), "{said}");
    }

    #[test]
    fn the_most_gaussians_fit_into_a_graph_that_a_reader_takes() {
        // Bases and their scales, three neighbours and masses; then vertices with their joints and more fields than any F_mesh here, and controllers.
        let each = ATTRIBUTES * (BASES + 1) + 2 * NEIGHBOURS;
        let mesh = 30_000 * (JOINTS + 3 * (2 + 100));
        let controllers = 1_000 * CONTROLLER_HIDDEN * (PARAMS + BASES + 2);
        assert!(
            MOST_GAUSSIANS * each + mesh + controllers <= MAX_NUMBERS,
            "all of it"
        );
    }

    #[test]
    fn options_survive_json() {
        let text = serde_json::to_string(&Options::default()).expect("text");
        let back: Options = serde_json::from_str(&text).expect("read");
        assert_eq!(back, Options::default(), "the same");
        let before = text.replace(r#""lpips":0.1,"#, "");
        assert_ne!(before, text, "as it was before there was LPIPS");
        let back: Options = serde_json::from_str(&before).expect("read");
        assert_eq!(back.weights.lpips, 0.0, "it had no share");
    }
}
