//! A network's coarse probabilities as a mask on the picture's edges.
//!
//! The largest connected part is kept, then a guided filter (He, Sun and Tang, "Guided image filtering", 2010) brings its edge to where the picture has
//! one, within the network's grain.

use crate::grid::{box_mean, parts};
use capture::Photograph;
use tracker::mediapipe::Mask;

/// From where on a pixel belongs to the part that is kept.
const PART: f32 = 0.5;
/// The filter's window reaches this many grains, and its regularisation is this squared deviation of the brightness, 0..=1.
const REACH: f32 = 2.0;
const FLAT: f32 = 1e-4;
/// The filtered values that become 0 and 255.
const SHARP: (f32, f32) = (0.25, 0.75);

/// The mask of a photograph from what the network says: [height, width], 255 = person.
#[must_use]
pub fn refine(photograph: &Photograph, coarse: &Mask) -> Vec<u8> {
    let width = photograph.size[0] as usize;
    let mut out = vec![0; width * photograph.size[1] as usize];
    if coarse.probabilities.len() != out.len() || photograph.rgb.len() != 3 * out.len() {
        return out;
    }
    let [left, top, right, bottom] = coarse.bounds;
    let size = [right.saturating_sub(left), bottom.saturating_sub(top)];
    if size[0] == 0 || size[1] == 0 {
        return out;
    }
    let at = |k: usize| (top + k / size[0]) * width + left + k % size[0];
    let count = size[0] * size[1];
    let mut shares: Vec<f32> = (0..count).map(|k| coarse.probabilities[at(k)]).collect();
    keep_largest(&mut shares, size);
    let guide: Vec<f32> = (0..count)
        .map(|k| {
            let rgb = &photograph.rgb[3 * at(k)..3 * at(k) + 3];
            (0.299 * f32::from(rgb[0]) + 0.587 * f32::from(rgb[1]) + 0.114 * f32::from(rgb[2]))
                / 255.0
        })
        .collect();
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "a few pixels; casts saturate"
    )]
    let reach = ((REACH * coarse.grain).round() as usize).clamp(1, 64);
    let around = box_mean(&shares, size, reach);
    let filtered = guided(&guide, &shares, size, reach);
    for (k, (filtered, around)) in filtered.into_iter().zip(&around).enumerate() {
        // Far inside and far outside the network is right and the picture's texture is not asked.
        let value = if *around > 0.98 {
            1.0
        } else if *around < 0.02 {
            0.0
        } else {
            ((filtered - SHARP.0) / (SHARP.1 - SHARP.0)).clamp(0.0, 1.0)
        };
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "clamped to a byte's range"
        )]
        {
            out[at(k)] = (value * 255.0 + 0.5) as u8;
        }
    }
    out
}

/// Sets everything to 0 that is not connected to the largest part above [`PART`]. Below that a soft edge belongs to the part it touches.
fn keep_largest(shares: &mut [f32], size: [usize; 2]) {
    const EDGE: f32 = 0.02;
    let (label, sizes) = parts(|k| shares[k] > EDGE, size);
    let mut sure = vec![0_usize; sizes.len()];
    for (share, label) in shares.iter().zip(&label) {
        sure[*label as usize] += usize::from(*label != 0 && *share > PART);
    }
    let most = (1..sure.len()).max_by_key(|part| sure[*part]);
    for (share, label) in shares.iter_mut().zip(label) {
        if label == 0 || Some(label as usize) != most {
            *share = 0.0;
        }
    }
}

/// The guided filter of `input` by `guide`.
fn guided(guide: &[f32], input: &[f32], size: [usize; 2], reach: usize) -> Vec<f32> {
    let mean = |values: &[f32]| box_mean(values, size, reach);
    let product =
        |a: &[f32], b: &[f32]| -> Vec<f32> { a.iter().zip(b).map(|(a, b)| a * b).collect() };
    let (mean_i, mean_p) = (mean(guide), mean(input));
    let (ii, ip) = (mean(&product(guide, guide)), mean(&product(guide, input)));
    let mut a = vec![0.0; guide.len()];
    let mut b = vec![0.0; guide.len()];
    for k in 0..guide.len() {
        let variance = (ii[k] - mean_i[k] * mean_i[k]).max(0.0);
        a[k] = (ip[k] - mean_i[k] * mean_p[k]) / (variance + FLAT);
        b[k] = mean_p[k] - a[k] * mean_i[k];
    }
    let (a, b) = (mean(&a), mean(&b));
    (0..guide.len()).map(|k| a[k] * guide[k] + b[k]).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_edge_that_the_network_has_a_grain_aside_comes_to_the_pictures_edge() {
        let (width, height) = (80_usize, 60_usize);
        // The person is bright and right of x = 40; the network puts the edge at 43, four pixels wide, and sees a second, small person.
        let rgb = (0..width * height)
            .flat_map(|k| [if k % width >= 40 { 200 } else { 30 }; 3])
            .collect();
        let photograph = Photograph {
            size: [80, 60],
            rgb,
            mask: None,
        };
        let mut probabilities: Vec<f32> = (0..width * height)
            .map(|k| (((k % width) as f32 - 41.0) / 4.0).clamp(0.0, 1.0))
            .collect();
        for y in 5..9 {
            for x in 5..9 {
                probabilities[y * width + x] = 1.0;
            }
        }
        let coarse = Mask {
            probabilities,
            grain: 4.0,
            bounds: [0, 0, width, height],
        };
        let mask = refine(&photograph, &coarse);
        let row = &mask[30 * width..31 * width];
        assert!(
            row[38] < 64 && row[41] > 128,
            "the edge: {:?}",
            &row[34..48]
        );
        assert_eq!(mask[6 * width + 6], 0, "the second person is left out");
        assert!(row[60] == 255 && row[10] == 0, "inside and outside");
    }
}
