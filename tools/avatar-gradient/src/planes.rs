//! Planar arrays, cut into runs that threads take: always at the same places, so that no result depends on the number of threads.

/// Numbers of a plane in one run.
pub(crate) const RUN: usize = 1024;

/// Calls `run` with the first index and the parts of all planes, run by run, on rayon's current pool. All planes have one length.
pub(crate) fn for_each_run<const K: usize>(
    planes: [&mut [f32]; K],
    run: &(impl Fn(usize, [&mut [f32]; K]) + Sync),
) {
    in_halves(0, planes, run);
}

fn in_halves<const K: usize>(
    start: usize,
    planes: [&mut [f32]; K],
    run: &(impl Fn(usize, [&mut [f32]; K]) + Sync),
) {
    let length = planes.first().map_or(0, |plane| plane.len());
    if length <= RUN {
        if length > 0 {
            run(start, planes);
        }
        return;
    }
    let half = (length / 2).next_multiple_of(RUN);
    let mut second: [&mut [f32]; K] = std::array::from_fn(|_| Default::default());
    let mut planes = planes.into_iter();
    let first: [&mut [f32]; K] = std::array::from_fn(|k| {
        let (first, rest) = planes.next().unwrap_or_default().split_at_mut(half);
        second[k] = rest;
        first
    });
    rayon::join(
        || in_halves(start, first, run),
        || in_halves(start + half, second, run),
    );
}

/// The K planes of a row-major [K, N] array.
pub(crate) fn planes_mut<const K: usize>(numbers: &mut [f32]) -> [&mut [f32]; K] {
    let count = numbers.len() / K;
    let mut rest = numbers;
    std::array::from_fn(|_| {
        let (plane, others) = std::mem::take(&mut rest).split_at_mut(count);
        rest = others;
        plane
    })
}

/// The K planes of a row-major [K, N] array.
pub(crate) fn planes<const K: usize>(numbers: &[f32]) -> [&[f32]; K] {
    let count = numbers.len() / K;
    std::array::from_fn(|k| &numbers[k * count..(k + 1) * count])
}

/// Lanes of a sum that the compiler lays out for the processor's vectors.
const LANES: usize = 16;

/// The scalar product, in an order that depends on the length alone.
#[inline(always)]
pub(crate) fn dot(a: &[f32], b: &[f32]) -> f32 {
    let mut sums = [0.0f32; LANES];
    let (mut left, mut right) = (a.chunks_exact(LANES), b.chunks_exact(LANES));
    for (a, b) in (&mut left).zip(&mut right) {
        for lane in 0..LANES {
            sums[lane] += a[lane] * b[lane];
        }
    }
    let rest = left.remainder().iter().zip(right.remainder());
    let rest: f32 = rest.map(|(a, b)| a * b).sum();
    sums.iter().sum::<f32>() + rest
}

/// `sum += k x`.
#[inline(always)]
pub(crate) fn add_scaled(sum: &mut [f32], x: &[f32], k: f32) {
    for (sum, x) in sum.iter_mut().zip(x) {
        *sum += k * x;
    }
}

/// `sum += a b`, number by number.
#[inline(always)]
pub(crate) fn add_products(sum: &mut [f32], a: &[f32], b: &[f32]) {
    for ((sum, a), b) in sum.iter_mut().zip(a).zip(b) {
        *sum += a * b;
    }
}
