//! A room in f64: image sources (Allen and Berkley, "Image method for efficiently simulating small-room acoustics", 1979), convolution, and a
//! device whose clock runs at another rate.

use std::f64::consts::PI;

pub(crate) const RATE: f64 = 48_000.0;
const SPEED_OF_SOUND: f64 = 343.0;
/// Metres.
const ROOM: [f64; 3] = [4.0, 3.0, 2.5];
/// After so many seconds, echoes are 60 dB down.
const RT60: f64 = 0.3;

/// What the room makes of an impulse at `from`, heard at `to`, metres: amplitude 1 at a distance of 1 m.
pub(crate) fn impulse_response(from: [f64; 3], to: [f64; 3]) -> Vec<f64> {
    let [x, y, z] = ROOM;
    let (volume, surface) = (x * y * z, 2.0 * (x * y + y * z + z * x));
    // Sabine's formula.
    let absorbed = 0.161 * volume / (surface * RT60);
    let reflected = (1.0 - absorbed).sqrt();
    let mut response = vec![0.0; (RT60 * RATE) as usize];
    let reach = |axis: usize| (RT60 * SPEED_OF_SOUND / (2.0 * ROOM[axis])).ceil() as i32;
    // On each axis: how far away an image is, and by how many walls its sound has come.
    let images = |axis: usize| -> Vec<(f64, i32)> {
        (-reach(axis)..=reach(axis))
            .flat_map(|room| {
                [(1.0, 0), (-1.0, 1)].map(|(side, turned)| {
                    let image = side * from[axis] + 2.0 * f64::from(room) * ROOM[axis];
                    (image - to[axis], (room - turned).abs() + room.abs())
                })
            })
            .collect()
    };
    let [along_x, along_y, along_z] = [0, 1, 2].map(images);
    for (x, walls_x) in &along_x {
        for (y, walls_y) in &along_y {
            for (z, walls_z) in &along_z {
                let distance = (x * x + y * y + z * z).sqrt();
                let arrives = (distance / SPEED_OF_SOUND * RATE).round() as usize;
                if let Some(at) = response.get_mut(arrives) {
                    *at += reflected.powi(walls_x + walls_y + walls_z) / distance;
                }
            }
        }
    }
    response
}

/// `signal` through `response`, as long as the signal.
pub(crate) fn convolve(signal: &[f64], response: &[f64]) -> Vec<f64> {
    let size = (signal.len() + response.len()).next_power_of_two();
    let padded = |of: &[f64]| {
        let mut padded: Vec<Complex> = of.iter().map(|value| (*value, 0.0)).collect();
        padded.resize(size, (0.0, 0.0));
        transform(&mut padded, 1.0);
        padded
    };
    let mut product: Vec<Complex> = (padded(signal).iter().zip(&padded(response)))
        .map(|(a, b)| times(*a, *b))
        .collect();
    transform(&mut product, -1.0);
    (product.iter().take(signal.len()))
        .map(|value| value.0 / size as f64)
        .collect()
}

type Complex = (f64, f64);

fn times(a: Complex, b: Complex) -> Complex {
    (a.0 * b.0 - a.1 * b.1, a.0 * b.1 + a.1 * b.0)
}

/// The Fourier transform in place, by Cooley and Tukey; `sign` -1 is the inverse but for the scale.
fn transform(values: &mut [Complex], sign: f64) {
    let size = values.len();
    let bits = size.trailing_zeros();
    for index in 0..size {
        let other = index.reverse_bits() >> (usize::BITS - bits);
        if other > index {
            values.swap(index, other);
        }
    }
    let mut half = 1;
    while half < size {
        let twiddles: Vec<Complex> = (0..half)
            .map(|k| {
                let angle = -sign * PI * k as f64 / half as f64;
                (angle.cos(), angle.sin())
            })
            .collect();
        for block in values.chunks_mut(2 * half) {
            let (low, high) = block.split_at_mut(half);
            for ((a, b), twiddle) in low.iter_mut().zip(high).zip(&twiddles) {
                let turned = times(*b, *twiddle);
                (*a, *b) = (
                    (a.0 + turned.0, a.1 + turned.1),
                    (a.0 - turned.0, a.1 - turned.1),
                );
            }
        }
        half *= 2;
    }
}

/// `signal` later by so many samples.
pub(crate) fn delayed(signal: &[f64], samples: usize) -> Vec<f64> {
    let silence = std::iter::repeat_n(0.0, samples);
    silence
        .chain(signal.iter().copied())
        .take(signal.len())
        .collect()
}

/// `signal` as a device samples it whose samples are `1 + slower` apart: by a sinc of 64 samples in Hann's window.
pub(crate) fn sampled(signal: &[f64], slower: f64) -> Vec<f64> {
    if slower == 0.0 {
        return signal.to_vec();
    }
    let at = |position: f64| -> f64 {
        let whole = position.floor();
        (-31..=32)
            .map(|k| {
                let index = whole + f64::from(k);
                let x = position - index;
                let sinc = if x == 0.0 {
                    1.0
                } else {
                    (PI * x).sin() / (PI * x)
                };
                let window = 0.5 + 0.5 * (PI * x / 33.0).cos();
                let sample = if index < 0.0 {
                    None
                } else {
                    signal.get(index as usize)
                };
                sample.map_or(0.0, |sample| sample * sinc * window)
            })
            .sum()
    };
    (0..signal.len())
        .map(|n| at(n as f64 * (1.0 + slower)))
        .collect()
}

#[test]
fn the_room_decays_as_its_reverberation_time_says() {
    let response = impulse_response([1.0, 1.2, 0.8], [1.5, 1.4, 0.9]);
    // Schroeder's backward integration: the energy that is still to come.
    let after = |seconds: f64| -> f64 {
        let begin = (seconds * RATE) as usize;
        response[begin..].iter().map(|value| value * value).sum()
    };
    let decay = 10.0 * (after(0.05) / after(0.15)).log10();
    println!("{decay:.1} dB in 100 ms");
    // 20 dB in 100 ms by Sabine, whose formula is for diffuse sound.
    assert!((14.0..26.0).contains(&decay), "{decay} dB in 100 ms");
}

#[test]
fn a_convolution_by_transforms_is_the_sum_that_defines_it() {
    let signal: Vec<f64> = (0..37).map(|k| f64::from(k * 7 % 11) - 5.0).collect();
    let response = [0.5, 0.0, -0.25, 1.0];
    let fast = convolve(&signal, &response);
    for (n, fast) in fast.iter().enumerate() {
        let slow: f64 = (response.iter().enumerate())
            .filter(|(k, _)| *k <= n)
            .map(|(k, value)| value * signal[n - k])
            .sum();
        assert!((fast - slow).abs() < 1e-9, "{fast} is not {slow}");
    }
}
