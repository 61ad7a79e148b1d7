//! What masks are made with: means, distances and connected parts on a grid of `[width, height]` values, row by row.

/// Means over squares of `2 * reach + 1` values, as far as they are within.
pub(crate) fn box_mean(values: &[f32], [width, height]: [usize; 2], reach: usize) -> Vec<f32> {
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

/// From each value to the nearest value of the other kind, less half a step, by steps of 1 and sqrt(2): positive inside, negative outside. 8 % too long at
/// most. All infinite where all values are of one kind.
pub(crate) fn signed_distance(inside: &[bool], size: [usize; 2]) -> Vec<f32> {
    let within = distance(inside, false, size);
    let without = distance(inside, true, size);
    let pairs = inside.iter().zip(within.iter().zip(&without));
    pairs
        .map(
            |(inside, (within, without))| {
                if *inside { within - 0.5 } else { 0.5 - without }
            },
        )
        .collect()
}

/// From each value to the nearest one that is `to`.
fn distance(of: &[bool], to: bool, [width, height]: [usize; 2]) -> Vec<f32> {
    let mut out: Vec<f32> = (of.iter())
        .map(|value| if *value == to { 0.0 } else { f32::INFINITY })
        .collect();
    let relax = |out: &mut [f32], x: usize, y: usize, below: bool| {
        let mut least = out[y * width + x];
        let mut of = |dx: isize, dy: isize, step: f32| {
            let (Some(x), Some(y)) = (x.checked_add_signed(dx), y.checked_add_signed(dy)) else {
                return;
            };
            if x < width && y < height {
                least = least.min(out[y * width + x] + step);
            }
        };
        let sign = if below { 1 } else { -1 };
        of(sign, 0, 1.0);
        of(0, sign, 1.0);
        of(-1, sign, std::f32::consts::SQRT_2);
        of(1, sign, std::f32::consts::SQRT_2);
        out[y * width + x] = least;
    };
    for y in 0..height {
        for x in 0..width {
            relax(&mut out, x, y, false);
        }
    }
    for y in (0..height).rev() {
        for x in (0..width).rev() {
            relax(&mut out, x, y, true);
        }
    }
    out
}

/// The parts of the values that `belong`, connected along rows and columns: for each value the number of its part from 1 on, 0 for none; and the parts'
/// sizes, of which the first is that of none.
pub(crate) fn parts(
    belong: impl Fn(usize) -> bool,
    [width, height]: [usize; 2],
) -> (Vec<u32>, Vec<usize>) {
    let mut label = vec![0_u32; width * height];
    let mut sizes = vec![0];
    let mut stack = Vec::new();
    for seed in 0..label.len() {
        if label[seed] != 0 || !belong(seed) {
            continue;
        }
        #[expect(
            clippy::cast_possible_truncation,
            reason = "no more parts than a picture has pixels"
        )]
        let part = sizes.len() as u32;
        let mut size = 0;
        label[seed] = part;
        stack.push(seed);
        while let Some(k) = stack.pop() {
            size += 1;
            let (x, y) = (k % width, k / width);
            let mut visit = |other: usize| {
                if label[other] == 0 && belong(other) {
                    label[other] = part;
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
        sizes.push(size);
    }
    (label, sizes)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_distance_is_that_of_an_exhaustive_search_but_for_8_percent() {
        let size = [23, 17];
        let inside: Vec<bool> = (0_usize..size[0] * size[1])
            .map(|k| (k * k * 7 + k / 5) % 31 < 3 || (k % size[0]).abs_diff(12_usize) < 5)
            .collect();
        let found = signed_distance(&inside, size);
        let at = |k: usize| [(k % size[0]) as f32, (k / size[0]) as f32];
        for (k, found) in found.iter().enumerate() {
            let others = (0..inside.len()).filter(|other| inside[*other] != inside[k]);
            let nearest = others
                .map(|other| (at(k)[0] - at(other)[0]).hypot(at(k)[1] - at(other)[1]))
                .fold(f32::INFINITY, f32::min);
            let told = found.abs() + 0.5;
            assert_eq!(*found > 0.0, inside[k], "the sign at {k}");
            assert!(
                told > nearest - 1e-4 && told < 1.083 * nearest,
                "{told} for {nearest} at {k}"
            );
        }
    }

    #[test]
    fn parts_are_connected_along_rows_and_columns_alone() {
        let rows = ["##..#", "#..#.", "...##"];
        let cells: Vec<bool> = rows
            .iter()
            .flat_map(|row| row.chars().map(|c| c == '#'))
            .collect();
        let (label, sizes) = parts(|k| cells[k], [5, 3]);
        assert_eq!(sizes, [0, 3, 1, 3], "three parts");
        assert_eq!(label[4], 2, "a corner does not connect");
    }
}
