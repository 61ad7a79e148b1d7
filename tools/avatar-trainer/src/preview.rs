//! A picture for people: the photograph, what is drawn, and how they differ.

use splat_gradient::Picture;
use splat_gradient::loss::Target;

/// Differences are shown so many times as bright.
const BRIGHTER: f32 = 4.0;
/// Pixels between the pictures.
const GAP: usize = 4;

/// Three pictures side by side, 8-bit display values.
#[derive(Clone, PartialEq, Eq)]
pub struct Preview {
    /// Width and height, pixels.
    pub size: [u32; 2],
    /// [height, width, 3].
    pub rgb: Vec<u8>,
}

/// Without the pixels.
impl std::fmt::Debug for Preview {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Preview")
            .field("size", &self.size)
            .finish_non_exhaustive()
    }
}

impl Preview {
    /// The photograph and the drawn picture before black, and four times their difference; `drawn` has the photograph's size.
    #[must_use]
    pub fn new(target: &Target, drawn: &Picture) -> Self {
        let (width, height) = (drawn.width(), drawn.height());
        let across = 3 * width + 2 * GAP;
        let mut rgb = vec![0u8; 3 * across * height];
        for channel in 0..3 {
            let wanted = target.picture().plane(channel);
            let pixels = wanted.iter().zip(drawn.plane(channel)).enumerate();
            for (at, (wanted, drawn)) in pixels {
                let (x, y) = (at % width.max(1), at / width.max(1));
                let differs = (wanted - drawn).abs() * BRIGHTER;
                for (place, value) in [*wanted, *drawn, differs].into_iter().enumerate() {
                    let pixel = y * across + place * (width + GAP) + x;
                    if let Some(out) = rgb.get_mut(3 * pixel + channel) {
                        *out = byte(value);
                    }
                }
            }
        }
        let size = [across, height].map(|side| u32::try_from(side).unwrap_or(u32::MAX));
        Self { size, rgb }
    }

    /// Several previews, one below the other.
    #[must_use]
    pub fn stacked(previews: &[Self]) -> Self {
        let width = previews.iter().map(|one| one.size[0]).max().unwrap_or(0);
        let height = previews.iter().map(|one| one.size[1]).sum();
        let mut rgb = Vec::with_capacity(3 * width as usize * height as usize);
        for one in previews {
            for row in one.rgb.chunks_exact(3 * (one.size[0] as usize).max(1)) {
                rgb.extend_from_slice(row);
                rgb.resize(rgb.len() + 3 * (width - one.size[0]) as usize, 0);
            }
        }
        Self {
            size: [width, height],
            rgb,
        }
    }
}

fn byte(value: f32) -> u8 {
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "held within 0..=255 first"
    )]
    let byte = (value * 255.0).round().clamp(0.0, 255.0) as u8;
    byte
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn truth_is_left_then_what_is_drawn_then_the_difference() {
        let grey = |value: f32| Picture::new(1, 1, vec![value, value, value, 1.0]).expect("one");
        let preview = Preview::new(&Target::new(grey(0.8)), &grey(0.7));
        assert_eq!(preview.size, [3 + 8, 1], "three pixels and two gaps");
        let at = |x: usize| preview.rgb[3 * x];
        assert_eq!(
            [at(0), at(1 + 4), at(2 * (1 + 4))],
            [204, 179, 102],
            "side by side"
        );
        let two = Preview::stacked(&[preview.clone(), preview]);
        assert_eq!((two.size, two.rgb.len()), ([11, 2], 66), "below each other");
    }
}
