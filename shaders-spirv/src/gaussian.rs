//! A Gaussian in plain numbers, and packed for the upload of each frame.

use bytemuck::{Pod, Zeroable};

/// One Gaussian in world space, in plain numbers.
///
/// Values are activated: an avatar's opacity logit has been through the sigmoid, its log-scale through `exp`,
/// its colour coefficient through `0.5 + 0.2821 c` (spherical harmonics of degree 0).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Gaussian {
    /// World position, metres.
    pub position: [f32; 3],
    /// Unit quaternion x, y, z, w: world from the Gaussian's own axes.
    pub rotation: [f32; 4],
    /// Standard deviation along each own axis, metres.
    pub scale: [f32; 3],
    /// Opacity at the centre, 0..=1.
    pub opacity: f32,
    /// Display colour, red, green, blue. May leave 0..=1: below 0 is drawn as 0 (as 3DGS does), above 1 is kept.
    pub colour: [f32; 3],
}

/// One Gaussian as it is uploaded, 32 bytes; read by `shaders/project_foreground.comp`.
///
/// The position keeps its 32 bits, since a millimetre matters at any distance from the origin. Scales are 16-bit
/// logarithms (steps of 0.03 %), the rotation 47 bits (the quaternion's three smallest numbers, steps of 0.005
/// degrees), the opacity 16 bits, the colour halves.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Pod, Zeroable)]
#[repr(C)]
pub struct PackedGaussian {
    words: [u32; 8],
}

/// Steps of `log2(scale)` in one octave; `SCALE_STEPS` in the shader.
pub(crate) const SCALE_STEPS: f32 = 2048.0;
/// `log2(scale)` of the least scale, 60 nm; `SCALE_LEAST` in the shader.
pub(crate) const SCALE_LEAST: f32 = -24.0;
/// `log2(scale)` that no scale reaches: 256 m.
pub const LOG2_SCALE_END: f32 = 8.0;
/// Greatest step of one of the quaternion's numbers, which lie in -1/sqrt(2) ..= 1/sqrt(2); 15 bits, even so that 0 is one of the steps.
pub(crate) const ROTATION_MOST: f32 = 32_766.0;

/// `log2` of the largest standard deviation of a person's Gaussians, metres: larger ones are held at it where they are interpolated; in the shader too.
pub const LOG2_MOST_SCALE: f32 = -1.0;

/// The least half that is not subnormal.
pub(crate) const HALF_LEAST: f32 = 6.103_515_6e-5;
/// The greatest half.
pub(crate) const HALF_MOST: f32 = 65_504.0;
/// From a float's exponent to a half's.
pub(crate) const HALF_REBIAS: u32 = 112 << 23;
/// Half of a half's last bit, in a float's bits.
pub(crate) const HALF_STEP: u32 = 0x1000;

impl PackedGaussian {
    /// Packs one Gaussian from the logarithms (base 2) of its scales; for the rest see [`Gaussian`].
    ///
    /// A Gaussian with a number that is not finite becomes one that is never drawn, as does one whose rotation
    /// is all zero or whose scale is 256 m or more.
    #[must_use]
    pub fn new(
        position: [f32; 3],
        rotation: [f32; 4],
        log2_scale: [f32; 3],
        opacity: f32,
        colour: [f32; 3],
    ) -> Self {
        let length = rotation.iter().map(|number| number * number).sum::<f32>();
        // Sums and differences of anything that is not finite are not finite: one test for all.
        let sum = position.iter().chain(&colour).sum::<f32>() + opacity + length;
        let drawn =
            sum.is_finite() && length > 0.0 && log2_scale.iter().all(|log| *log < LOG2_SCALE_END);
        if !drawn {
            return Self::zeroed();
        }
        let [x, y, z] =
            log2_scale.map(|log| quantised((log - SCALE_LEAST) * SCALE_STEPS, 65_535.0));
        let inverse_length = length.sqrt().recip();
        let unit = rotation.map(|number| number * inverse_length);
        let (largest, [a, b, c]) = smallest_three(unit, ROTATION_MOST);
        let alpha = quantised(opacity * 65_535.0, 65_535.0);
        let [red, green, blue] = colour.map(half_bits);
        Self {
            words: [
                position[0].to_bits(),
                position[1].to_bits(),
                position[2].to_bits(),
                x | (y << 16),
                z | (alpha << 16),
                a | (b << 15) | (largest << 30),
                c | (red << 16),
                green | (blue << 16),
            ],
        }
    }

    /// The Gaussian as it is drawn: what [`Self::new`] was given, rounded to the layout's steps. One that is never drawn
    /// comes back with an opacity of 0 and no rotation.
    #[must_use]
    pub fn unpacked(&self) -> Gaussian {
        let [_, _, _, scale_xy, scale_z_alpha, ab, c_red, green_blue] = self.words;
        let low = |word: u32| f32::from(u16::try_from(word & 0xFFFF).unwrap_or_default());
        let high = |word: u32| low(word >> 16);
        let scale = |steps: f32| (steps / SCALE_STEPS + SCALE_LEAST).exp2();
        let drawn = ab != 0 || c_red & 0xFFFF != 0;
        let others = [low(ab & 0x7FFF), low((ab >> 15) & 0x7FFF), low(c_red)]
            .map(|steps| (steps / ROTATION_MOST - 0.5) * std::f32::consts::SQRT_2);
        let [a, b, c] = others;
        let left_out = (1.0 - (a * a + b * b + c * c)).max(0.0).sqrt();
        let rotation = match ab >> 30 {
            _ if !drawn => [0.0; 4],
            0 => [left_out, a, b, c],
            1 => [a, left_out, b, c],
            2 => [a, b, left_out, c],
            _ => [a, b, c, left_out],
        };
        Gaussian {
            position: self.position(),
            rotation,
            scale: [low(scale_xy), high(scale_xy), low(scale_z_alpha)].map(scale),
            opacity: high(scale_z_alpha) / 65_535.0,
            colour: [c_red >> 16, green_blue & 0xFFFF, green_blue >> 16].map(half_value),
        }
    }

    /// World position, metres.
    #[must_use]
    pub fn position(&self) -> [f32; 3] {
        let [x, y, z, ..] = self.words;
        [x, y, z].map(f32::from_bits)
    }
}

impl From<&Gaussian> for PackedGaussian {
    fn from(gaussian: &Gaussian) -> Self {
        Self::new(
            gaussian.position,
            gaussian.rotation,
            gaussian.scale.map(f32::log2),
            gaussian.opacity,
            gaussian.colour,
        )
    }
}

/// Which of a unit quaternion's numbers has the greatest magnitude, and the other three in order, each in
/// `0..=most` for -1/sqrt(2) ..= 1/sqrt(2), with the sign that makes the left-out one positive: it follows from the
/// unit length.
#[must_use]
pub fn smallest_three(rotation: [f32; 4], most: f32) -> (u32, [u32; 3]) {
    let [x, y, z, w] = rotation;
    let [ax, ay, az, aw] = rotation.map(f32::abs);
    let (largest, left_out, others) = if ax >= ay && ax >= az && ax >= aw {
        (0, x, [y, z, w])
    } else if ay >= az && ay >= aw {
        (1, y, [x, z, w])
    } else if az >= aw {
        (2, z, [x, y, w])
    } else {
        (3, w, [x, y, z])
    };
    let scale = std::f32::consts::FRAC_1_SQRT_2.copysign(left_out);
    let step = |number: f32| quantised((number * scale + 0.5) * most, most);
    (largest, others.map(step))
}

/// A value held within `0..=most` and rounded, halves up; 0 for NaN.
#[expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "held within 0..=most first"
)]
#[must_use]
pub fn quantised(value: f32, most: f32) -> u32 {
    // Not `round`, which is a call into libm on processors as old as x86-64 allows.
    (value.clamp(0.0, most) + 0.5) as u32
}

/// The nearest half to a colour that is finite; below 0 and below the least normal half (0.00006) it is black.
fn half_bits(value: f32) -> u32 {
    if value < HALF_LEAST {
        return 0;
    }
    (value.min(HALF_MOST).to_bits() + HALF_STEP - HALF_REBIAS) >> 13
}

/// The value of a half that [`half_bits`] made.
fn half_value(bits: u32) -> f32 {
    const REBIAS: u32 = 112 << 23;
    if bits == 0 {
        return 0.0;
    }
    f32::from_bits((bits << 13) + REBIAS)
}

#[cfg(test)]
mod tests {
    use super::*;

    const PLAIN: Gaussian = Gaussian {
        position: [1.0, -2.0, 3.0],
        rotation: [0.0, 0.0, 0.0, 1.0],
        scale: [0.01, 0.02, 0.03],
        opacity: 0.5,
        colour: [0.2, 0.4, 0.6],
    };

    #[test]
    fn a_number_that_is_not_finite_makes_a_gaussian_that_is_never_drawn() {
        let broken = [
            Gaussian {
                position: [f32::NAN, 0.0, 0.0],
                ..PLAIN
            },
            Gaussian {
                position: [f32::INFINITY, f32::NEG_INFINITY, 0.0],
                ..PLAIN
            },
            Gaussian {
                rotation: [0.0, f32::NAN, 0.0, 1.0],
                ..PLAIN
            },
            Gaussian {
                rotation: [0.0; 4],
                ..PLAIN
            },
            Gaussian {
                scale: [0.01, f32::NAN, 0.01],
                ..PLAIN
            },
            Gaussian {
                scale: [0.01, 256.0, 0.01],
                ..PLAIN
            },
            Gaussian {
                opacity: f32::INFINITY,
                ..PLAIN
            },
            Gaussian {
                colour: [0.0, f32::NAN, 0.0],
                ..PLAIN
            },
        ];
        for gaussian in &broken {
            assert_eq!(
                PackedGaussian::from(gaussian),
                PackedGaussian::zeroed(),
                "{gaussian:?}"
            );
        }
        assert_ne!(
            PackedGaussian::from(&PLAIN),
            PackedGaussian::zeroed(),
            "a plain one"
        );
    }

    #[test]
    fn colours_become_the_nearest_half() {
        for step in 1u16..2_000 {
            let value = f32::from(step) / 777.0;
            let expected = half::f16::from_f32(value).to_f32();
            let got = half::f16::from_bits(u16::try_from(half_bits(value)).expect("16 bits"));
            let worst = expected * 2f32.powi(-11);
            assert!((got.to_f32() - value).abs() <= worst, "{value}: {got}");
        }
        for (value, bits) in [
            (-1.0, 0),
            (0.0, 0),
            (1.0, 0x3C00),
            (65_504.0, 0x7BFF),
            (1e9, 0x7BFF),
        ] {
            assert_eq!(half_bits(value), bits, "{value}");
        }
    }

    #[test]
    fn packed_gaussians_unpack_within_the_layouts_steps() {
        for seed in 1u16..500 {
            let wave = |k: f32| (f32::from(seed) * k).sin();
            let rotation = [wave(1.1), wave(1.7), wave(2.3), wave(3.1)];
            let length = rotation.iter().map(|q| q * q).sum::<f32>().sqrt();
            let gaussian = Gaussian {
                position: [wave(0.3), wave(0.7), wave(0.9)],
                rotation: rotation.map(|q| q / length),
                scale: [wave(0.5), wave(0.6), wave(0.8)].map(f32::exp2),
                opacity: wave(0.2).abs(),
                colour: [wave(0.35), wave(0.45), wave(0.55)].map(f32::abs),
            };
            let got = PackedGaussian::from(&gaussian).unpacked();
            assert_eq!(got.position, gaussian.position, "position");
            let turned = got.rotation.iter().zip(&gaussian.rotation);
            let cosine: f32 = turned.map(|(got, want)| got * want).sum();
            assert!(1.0 - cosine.abs() < 1e-6, "rotation: {cosine}");
            assert!((got.opacity - gaussian.opacity).abs() < 1e-5, "opacity");
            for (got, want) in got.scale.iter().zip(&gaussian.scale) {
                assert!((got / want - 1.0).abs() < 2e-4, "scale {got} for {want}");
            }
            for (got, want) in got.colour.iter().zip(&gaussian.colour) {
                assert!((got - want).abs() <= want * 5e-4 + 7e-5, "{got} for {want}");
            }
        }
        let never = PackedGaussian::zeroed().unpacked();
        assert_eq!((never.opacity, never.rotation), (0.0, [0.0; 4]), "never");
    }

    #[test]
    fn a_rotation_and_its_negative_are_packed_alike() {
        let rotation = [0.1, -0.7, 0.3, 0.64];
        let other = rotation.map(|number: f32| -number);
        assert_eq!(
            PackedGaussian::from(&Gaussian { rotation, ..PLAIN }),
            PackedGaussian::from(&Gaussian {
                rotation: other,
                ..PLAIN
            }),
            "one rotation"
        );
    }

    #[test]
    fn values_beyond_the_layouts_range_are_clamped() {
        let flat = Gaussian {
            scale: [0.0, 255.99, 1.0],
            opacity: 7.0,
            colour: [1e9, -1e9, 0.0],
            ..PLAIN
        };
        let packed = PackedGaussian::from(&flat);
        assert_eq!(packed.words[3], 0xFFFF_0000, "scales");
        assert_eq!(packed.words[4] >> 16, 0xFFFF, "opacity");
        assert_eq!(packed.words[6] >> 16, 0x7BFF, "red: the largest half");
    }
}
