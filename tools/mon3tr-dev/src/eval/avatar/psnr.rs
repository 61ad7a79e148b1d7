//! Peak signal-to-noise ratios, and where they are measured.

use super::canvas::Canvas;

/// Pixels around the person's mask that count as well: what an avatar paints beside the person is an error.
pub(super) const DILATION: usize = 5;

/// Of pictures that do not differ, dB: a mean would be infinite. Pictures of 8 bits that differ in one value of a million pixels have 113.
pub(super) const MOST_DB: f64 = 120.0;

/// Peak signal-to-noise ratio of two pictures over the pixels that `counts` says, dB; nothing where none does.
pub(super) fn psnr(a: &Canvas, b: &Canvas, counts: impl Fn(usize) -> bool) -> Option<f64> {
    let (mut sum, mut values) = (0.0, 0u32);
    for (pixel, (a, b)) in a.pixels.iter().zip(&b.pixels).enumerate() {
        if counts(pixel) {
            for (a, b) in a.iter().zip(b) {
                sum += (f64::from(*a) - f64::from(*b)).powi(2);
            }
            values += 3;
        }
    }
    let mean = sum / f64::from(values);
    (values > 0).then(|| (-10.0 * mean.log10()).min(MOST_DB))
}

/// The pixels within [`DILATION`] of one that the mask covers at all, along rows and columns.
pub(super) fn dilated(mask: &[u8], width: usize) -> Vec<bool> {
    let width = width.max(1);
    let height = mask.len() / width;
    let grown = |inside: &[bool], step: usize, count: usize, line: usize, lines: usize| {
        let mut grown = vec![false; inside.len()];
        for of in 0..lines {
            for at in 0..count {
                let (from, to) = (at.saturating_sub(DILATION), (at + DILATION + 1).min(count));
                grown[of * line + at * step] = (from..to).any(|k| inside[of * line + k * step]);
            }
        }
        grown
    };
    let inside: Vec<bool> = mask.iter().map(|value| *value > 0).collect();
    let rows = grown(&inside, 1, width, width, height);
    grown(&rows, width, height, 1, width)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_difference_of_a_tenth_is_20_db_and_what_does_not_count_changes_nothing() {
        let a = Canvas::new(2, vec![[0.5; 3]; 4]);
        let mut b = Canvas::new(2, vec![[0.6; 3]; 4]);
        b.pixels[3] = [0.0; 3];
        let db = psnr(&a, &b, |pixel| pixel != 3).expect("three pixels");
        assert!((db - 20.0).abs() < 1e-5, "{db}");
        assert_eq!(psnr(&a, &a, |_| true), Some(MOST_DB), "no difference");
        assert_eq!(psnr(&a, &b, |_| false), None, "no pixel counts");
    }

    #[test]
    fn a_dilated_mask_is_a_square_around_each_pixel() {
        let (width, height) = (30, 20);
        let mut mask = vec![0; width * height];
        mask[7 * width + 3] = 9;
        let dilated = dilated(&mask, width);
        for (pixel, inside) in dilated.iter().enumerate() {
            let (x, y) = (pixel % width, pixel / width);
            let near = x.abs_diff(3) <= DILATION && y.abs_diff(7) <= DILATION;
            assert_eq!(*inside, near, "at {x}, {y}");
        }
    }
}
