//! A Gaussian as callers state it, and as it is uploaded each frame.

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
const SCALE_STEPS: f32 = 2048.0;
/// `log2(scale)` of the least scale, 60 nm; `SCALE_LEAST` in the shader.
const SCALE_LEAST: f32 = -24.0;
/// `log2(scale)` that no scale reaches: 256 m.
const SCALE_END: f32 = 8.0;
/// Greatest step of one of the quaternion's numbers, which lie in -1/sqrt(2) ..= 1/sqrt(2); 15 bits, even so that 0 is one of the steps.
const ROTATION_MOST: f32 = 32_766.0;

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
            sum.is_finite() && length > 0.0 && log2_scale.iter().all(|log| *log < SCALE_END);
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

    /// World position, metres.
    #[must_use]
    pub fn position(&self) -> [f32; 3] {
        let [x, y, z, ..] = self.words;
        [x, y, z].map(f32::from_bits)
    }

    /// Whether it is opaque enough to be drawn: above 1/255 at its centre.
    #[must_use]
    pub fn shows(&self) -> bool {
        self.words[4] >> 16 > 65_535 / 255
    }

    /// The greatest of the three scales as it is stored: 2,048 steps an octave.
    #[must_use]
    #[expect(clippy::cast_possible_truncation, reason = "16 bits each")]
    pub const fn greatest_scale_step(&self) -> u16 {
        let [_, _, _, xy, z, ..] = self.words;
        let (x, y, z) = (xy as u16, (xy >> 16) as u16, z as u16);
        let most = if x > y { x } else { y };
        if most > z { most } else { z }
    }

    /// The opacity as it is stored: 65,535 steps.
    #[must_use]
    pub const fn opacity_step(&self) -> u16 {
        (self.words[4] >> 16) as u16
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
    const LEAST: f32 = 6.103_515_6e-5;
    const MOST: f32 = 65_504.0;
    // From a float's exponent to a half's, and half of the last bit that stays.
    const REBIAS: u32 = 112 << 23;
    const HALF_STEP: u32 = 0x1000;
    if value < LEAST {
        return 0;
    }
    (value.min(MOST).to_bits() + HALF_STEP - REBIAS) >> 13
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
    fn values_beyond_what_the_layout_holds_are_held_at_its_ends() {
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
