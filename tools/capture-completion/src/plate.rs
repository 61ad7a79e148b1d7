//! What a camera that stands still sees behind the person: at each pixel the median of the pictures in which the person is elsewhere.

use crate::grid::box_mean;
use capture::Photograph;

/// Pictures that a plate is made of, if memory allows, and at least.
const MOST_SAMPLES: usize = 48;
const LEAST_SAMPLES: usize = 8;
/// Bytes of pictures kept for it, where these are enough for the least number of pictures.
const MEMORY: usize = 512 << 20;
/// A pixel is known from so many pictures, and from this share of them: the person's shadow and what a mask missed are fewer.
const LEAST_SEEN: usize = 4;
const LEAST_SHARE: usize = 8;
/// So far from a mask, in the network's grains, nothing of the person is feared.
const CLEAR: f32 = 4.0;
/// Pixels that vary more than this (median deviation of a channel, of 255) are taken for not known: the camera moved, or what it saw did.
const RESTLESS: u8 = 12;
/// A median deviation of normally distributed values, as a standard deviation.
const NORMAL: f32 = 1.4826;
/// The least deviation that is believed, of 255: what an encoder leaves of noise.
const LEAST_NOISE: f32 = 4.0;

/// The plate of a camera.
#[derive(Debug)]
pub(crate) struct Plate {
    /// Width and height, pixels.
    pub(crate) size: [u32; 2],
    /// [height, width, 3], 0..=255.
    pub(crate) rgb: Vec<u8>,
    /// [height, width]: the standard deviation of a channel, of 255; none where the plate is not known.
    pub(crate) noise: Vec<Option<f32>>,
}

/// Collects the pictures that a plate is made of.
#[derive(Debug)]
pub(crate) struct PlateBuilder {
    size: [u32; 2],
    every: usize,
    /// Pictures, and which of their pixels are clear of the person.
    samples: Vec<(Vec<u8>, Vec<bool>)>,
}

impl PlateBuilder {
    /// Of a camera with pictures of `size` and so many frames.
    pub(crate) fn new(size: [u32; 2], frames: usize) -> Self {
        let pixels = (size[0] as usize).saturating_mul(size[1] as usize).max(1);
        let most = (MEMORY / pixels.saturating_mul(4)).clamp(LEAST_SAMPLES, MOST_SAMPLES);
        Self {
            size,
            every: frames.div_ceil(most).max(1),
            samples: Vec::new(),
        }
    }

    /// Shows the picture of a frame, whose mask has this grain. Pictures of another size, or without a mask, are not looked at.
    pub(crate) fn add(&mut self, frame: usize, photograph: &Photograph, grain: f32) {
        let Some(mask) = (photograph.mask.as_ref()).filter(|_| frame.is_multiple_of(self.every))
        else {
            return;
        };
        if photograph.size != self.size || photograph.check().is_err() {
            return;
        }
        let person: Vec<f32> = mask
            .iter()
            .map(|value| f32::from(u8::from(*value > 0)))
            .collect();
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "a few pixels; casts saturate"
        )]
        let reach = ((CLEAR * grain).ceil() as usize).clamp(2, 128);
        let size = photograph.size.map(|side| side as usize);
        let near = box_mean(&person, size, reach);
        let clear = near.into_iter().map(|share| share <= 0.0).collect();
        self.samples.push((photograph.rgb.clone(), clear));
    }

    /// The plate.
    pub(crate) fn finish(self) -> Plate {
        let pixels = self.size[0] as usize * self.size[1] as usize;
        let needed = LEAST_SEEN.max(self.samples.len().div_ceil(LEAST_SHARE));
        let mut rgb = vec![0; 3 * pixels];
        let mut noise = vec![None; pixels];
        let mut values = [[0_u8; MOST_SAMPLES]; 3];
        for (pixel, (rgb, noise)) in rgb.chunks_exact_mut(3).zip(&mut noise).enumerate() {
            let mut count = 0;
            for (picture, clear) in &self.samples {
                if clear[pixel] && count < MOST_SAMPLES {
                    for (values, value) in values.iter_mut().zip(&picture[3 * pixel..]) {
                        values[count] = *value;
                    }
                    count += 1;
                }
            }
            if count < needed {
                continue;
            }
            let mut most = 0;
            for (values, median) in values.iter_mut().zip(rgb) {
                let values = &mut values[..count];
                *median = middle(values);
                for value in &mut *values {
                    *value = value.abs_diff(*median);
                }
                most = most.max(middle(values));
            }
            if most <= RESTLESS {
                *noise = Some((NORMAL * f32::from(most)).max(LEAST_NOISE));
            }
        }
        Plate {
            size: self.size,
            rgb,
            noise,
        }
    }
}

/// The median of some values, which are ordered anew.
fn middle(values: &mut [u8]) -> u8 {
    let half = values.len() / 2;
    *values.select_nth_unstable(half).1
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A room of stripes, before which a bright square stands from column `left` on.
    fn picture(left: usize, shift: usize) -> Photograph {
        let (width, height) = (60, 40);
        let person = |k: usize| (left..left + 8).contains(&(k % width)) && k / width > 20;
        let room = |k: usize| [20, 60, 100, 140][((k % width + shift) / 5) % 4];
        let value = |k: usize| if person(k) { 250 } else { room(k) };
        Photograph {
            size: [60, 40],
            rgb: (0..width * height).flat_map(|k| [value(k); 3]).collect(),
            mask: Some(
                (0..width * height)
                    .map(|k| if person(k) { 255 } else { 0 })
                    .collect(),
            ),
        }
    }

    #[test]
    fn what_a_person_uncovers_is_known_and_what_he_always_hides_is_not() {
        let mut builder = PlateBuilder::new([60, 40], 16);
        for frame in 0..16 {
            // Half of the time at 10, then at 14: columns 14 to 17 are always hidden, those beside them in turn.
            let left = if frame < 8 { 10 } else { 14 };
            builder.add(frame, &picture(left, 0), 1.0);
        }
        let plate = builder.finish();
        let at = |x: usize, y: usize| (plate.rgb[3 * (60 * y + x)], plate.noise[60 * y + x]);
        assert_eq!(at(50, 30), (100, Some(LEAST_NOISE)), "the room");
        for (x, room) in [(6, 60), (24, 20)] {
            let known = (room, Some(LEAST_NOISE));
            assert_eq!(
                at(x, 30),
                known,
                "column {x}, near the person half of the time"
            );
        }
        assert_eq!(at(15, 30).1, None, "behind the person");
        assert_eq!(at(15, 5), (140, Some(LEAST_NOISE)), "above the person");
    }

    #[test]
    fn a_camera_that_moves_knows_nothing() {
        let mut builder = PlateBuilder::new([60, 40], 16);
        for frame in 0..16 {
            builder.add(frame, &picture(10, 3 * frame), 1.0);
        }
        let known = builder.finish().noise.iter().flatten().count();
        assert_eq!(known, 0, "pixels are taken for known");
    }
}
