//! What a person's Gaussians cost those who look at them, bounded before they are used: how large each is, and how many screen tiles all of them cover.
//!
//! A file of kilobytes can hold Gaussians of metres, each of which covers a whole picture. What residuals of the networks add is bounded where it is drawn
//! (`app/kernels/src/interpolate.rs`), and what a picture really costs is counted there too (`xr-renderer/splat/src/cost.rs`).

use crate::{BoundGaussians, MOST_SCALE, attribute};

/// The most screen tiles that a person's Gaussians cover, seen as [`BoundGaussians::tiles`] says. The demo person's 40,079 cover 0.45 million.
pub const MOST_TILES: u64 = 1 << 23;

/// Tiles along a metre, one metre away: 16 pixels each, with a focal length of 1,024.
const TILES_PER_METRE: f32 = 64.0;
/// Tiles of the picture, of 1024x1024 pixels.
const PICTURE_TILES: f32 = 4096.0;
/// What is less opaque than one step of 255 is not drawn.
const VISIBLE: f32 = 1.0 / 255.0;

/// An avatar that costs those who look at it too much.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum CostError {
    /// A Gaussian is larger than any of a person.
    #[error(
        "Gaussian number {at} has a standard deviation of {metres} m, and a person's may have {MOST_SCALE} m: such an avatar stops every viewer's pictures; build it anew without that Gaussian"
    )]
    Large {
        /// Which one.
        at: usize,
        /// Its largest standard deviation.
        metres: f32,
    },
    /// Together they cover too many tiles.
    #[error(
        "the avatar's Gaussians cover {tiles} screen tiles from 1 m away, and a person's may cover {MOST_TILES}: such an avatar stops every viewer's pictures; build it anew with smaller or fewer Gaussians"
    )]
    Tiles {
        /// As [`BoundGaussians::tiles`] counts them.
        tiles: u64,
    },
}

impl BoundGaussians {
    /// Tiles of 16x16 pixels that the Gaussians cover, each by itself and at rest, from one metre away and face on, in a picture of 1024x1024 pixels with a
    /// focal length of 1,024: about what a picture that the person fills costs.
    #[must_use]
    pub fn tiles(&self) -> u64 {
        (0..self.len()).fold(0, |sum, at| sum.saturating_add(self.tiles_of(at)))
    }

    /// Refuses Gaussians that no viewer's device draws in time.
    ///
    /// # Errors
    /// A standard deviation of more than [`MOST_SCALE`], or more than [`MOST_TILES`] tiles.
    pub fn check_cost(&self) -> Result<(), CostError> {
        for at in 0..self.len() {
            let [.., largest] = self.scales(at);
            // What is no number is refused too.
            if largest.is_nan() || largest > MOST_SCALE {
                return Err(CostError::Large {
                    at,
                    metres: largest,
                });
            }
        }
        match self.tiles() {
            0..=MOST_TILES => Ok(()),
            tiles => Err(CostError::Tiles { tiles }),
        }
    }

    /// The Gaussian's standard deviations, metres, the least first.
    fn scales(&self, at: usize) -> [f32; 3] {
        let first = attribute::LOG_SCALE.start;
        let mut scales = [first, first + 1, first + 2].map(|plane| self.number(plane, at).exp());
        scales.sort_by(f32::total_cmp);
        scales
    }

    fn tiles_of(&self, at: usize) -> u64 {
        let opacity = 1.0 / (1.0 + (-self.number(attribute::OPACITY, at)).exp());
        if opacity <= VISIBLE {
            return 0;
        }
        // Where it is as transparent as what is not drawn.
        let reach = (2.0 * (opacity / VISIBLE).ln()).sqrt();
        let [_, middle, largest] = self
            .scales(at)
            .map(|scale| 2.0 * reach * scale * TILES_PER_METRE);
        let tiles = ((middle + 1.0) * (largest + 1.0)).min(PICTURE_TILES);
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "at most the picture's"
        )]
        let whole = tiles.ceil() as u64;
        whole
    }

    fn number(&self, plane: usize, at: usize) -> f32 {
        let numbers = self.attributes();
        numbers
            .get(plane * self.len() + at)
            .copied()
            .unwrap_or_default()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{GaussianSet, INFLUENCES, SkinWeights, Template};
    use glam::{Quat, Vec3};

    /// `count` Gaussians of these standard deviations and this opacity's logit.
    fn bound(count: usize, metres: Vec3, opacity_logit: f32) -> BoundGaussians {
        let corners = vec![Vec3::ZERO, Vec3::X, Vec3::Y];
        let on_root = SkinWeights {
            joints: [0; INFLUENCES],
            weights: [1.0, 0.0, 0.0, 0.0],
        };
        let template =
            Template::new(corners, vec![[0, 1, 2]], vec![on_root; 3]).expect("a triangle");
        let log = Vec3::from_array(metres.to_array().map(f32::ln));
        let gaussians = GaussianSet {
            positions: vec![Vec3::ZERO; count],
            rotations: vec![Quat::IDENTITY; count],
            log_scales: vec![log; count],
            opacity_logits: vec![opacity_logit; count],
            colours: vec![Vec3::ZERO; count],
        };
        BoundGaussians::bind(&template, &gaussians, vec![0; count], vec![[0.0; 2]; count])
            .expect("they are bound")
    }

    #[test]
    fn large_gaussians_are_refused_and_many_that_cover_much() {
        let metre = bound(3, Vec3::new(0.001, 7.0, 0.001), 0.0).check_cost();
        assert!(
            matches!(metre, Err(CostError::Large { at: 0, metres }) if (metres - 7.0).abs() < 1e-4),
            "{metre:?}"
        );
        let most = bound(2_000, Vec3::splat(0.49), 4.0);
        assert_eq!(most.tiles(), 2_000 * 4_096, "each covers the picture");
        most.check_cost().expect("a few may");
        let many = bound(3_000, Vec3::splat(0.49), 4.0).check_cost();
        assert_eq!(
            many,
            Err(CostError::Tiles {
                tiles: 3_000 * 4_096
            }),
            "3,000"
        );
        let unseen = bound(3_000, Vec3::splat(0.49), -9.0);
        assert_eq!(unseen.tiles(), 0, "not drawn");
    }

    #[test]
    fn tiles_are_counted_from_a_metre_away() {
        // Opacity 1/2: alpha is 1/255 at sqrt(2 ln 127.5) = 3.114 standard deviations. 20 and 5 mm: 7.97 and 1.99 tiles across.
        let one = bound(1, Vec3::new(0.02, 0.005, 0.001), 0.0);
        assert_eq!(one.tiles(), 27, "8.97 x 2.99 = 26.8");
    }
}
