//! A network's coarse probabilities as a mask on the picture's edges.
//!
//! The largest connected part is kept, then a guided filter (He, Sun and Tang, "Guided image filtering", 2010) brings its edge to where the picture has
//! one, within the network's grain.

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

/// Sets everything to 0 that is not connected to the largest part above [`PART`].
fn keep_largest(shares: &mut [f32], [width, height]: [usize; 2]) {
    // Below PART a soft edge belongs to the part it touches: parts are grown down to nothing.
    const EDGE: f32 = 0.02;
    let mut label = vec![0_u32; shares.len()];
    let (mut next, mut best) = (0, (0, 0));
    let mut stack = Vec::new();
    for seed in 0..shares.len() {
        if label[seed] != 0 || shares[seed] <= PART {
            continue;
        }
        next += 1;
        let mut size = 0;
        label[seed] = next;
        stack.push(seed);
        while let Some(k) = stack.pop() {
            size += usize::from(shares[k] > PART);
            let (x, y) = (k % width, k / width);
            let mut visit = |other: usize| {
                if label[other] == 0 && shares[other] > EDGE {
                    label[other] = next;
                    stack.push(other);
                }
            };
            if x > 0 {
                visit(k - 1);
            }
            if x + 1 < width {
                visit(k + 1);
            }
            if y > 0 {
                visit(k - width);
            }
            if y + 1 < height {
                visit(k + width);
            }
        }
        if size > best.0 {
            best = (size, next);
        }
    }
    for (share, label) in shares.iter_mut().zip(label) {
        if label != best.1 || best.1 == 0 {
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

/// Means over squares of `2 * reach + 1` pixels, as far as they are within.
fn box_mean(values: &[f32], [width, height]: [usize; 2], reach: usize) -> Vec<f32> {
    let mut rows = vec![0.0_f32; values.len()];
    let mut sums = vec![0.0_f64; width.max(height) + 1];
    for (row, out) in values.chunks_exact(width).zip(rows.chunks_exact_mut(width)) {
        for (x, value) in row.iter().enumerate() {
            sums[x + 1] = sums[x] + f64::from(*value);
        }
        spread(&sums, width, reach, |x, mean| out[x] = mean);
    }
    let mut out = vec![0.0; values.len()];
    for x in 0..width {
        for y in 0..height {
            sums[y + 1] = sums[y] + f64::from(rows[y * width + x]);
        }
        spread(&sums, height, reach, |y, mean| out[y * width + x] = mean);
    }
    out
}

fn spread(sums: &[f64], length: usize, reach: usize, mut set: impl FnMut(usize, f32)) {
    for k in 0..length {
        let (from, to) = (k.saturating_sub(reach), (k + reach + 1).min(length));
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_precision_loss,
            reason = "a mean of single precision"
        )]
        set(k, ((sums[to] - sums[from]) / (to - from) as f64) as f32);
    }
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
