//! The person cut out of a background that is known.
//!
//! A network's mask says roughly where the person is. Where the plate is known, a pixel that differs from it is the person's, and one that does not is not, unless the
//! person has the background's colours there. Both are weighed for each pixel; pixels that look alike pull each other to the same side (mean field of an Ising
//! model, whose contrast term is that of Boykov and Jolly, "Interactive graph cuts", 2001); and along the outline, a pixel's share of the person follows from the two
//! colours that it is mixed of.

use crate::grid::{box_mean, parts, signed_distance};
use crate::plate::Plate;
use capture::Photograph;

/// How far the network may be wrong, in its grains: what lies deeper inside its mask is the person's, what is farther outside is not.
const SURE_INSIDE: f32 = 4.0;
const SURE_OUTSIDE: f32 = 8.0;
/// The person's own colour is that of the pixels at least so deep inside the network's mask, within a reach, both in its grains.
const OWN_DEPTH: f32 = 2.4;
const OWN_REACH: f32 = 6.0;
/// Log-odds that the network is right, by grains of depth, and at most.
const NETWORK: f32 = 1.0;
const NETWORK_MOST: f32 = 5.0;
/// A pixel as different as this many deviations may be either; log-odds by deviations more or less, at least and at most.
const UNDECIDED: f32 = 4.0;
const PLATE: (f32, f32) = (-3.0, 4.0);
/// A shadow takes at most this share of the light.
const SHADOW: f32 = 0.2;
/// The person's own colour nearby is the plate's below the first of these, in deviations, and tells nothing; at the second it tells all.
const ALIKE: (f32, f32) = (3.0, 11.0);
/// The log-odds that a neighbour of the same colour gives, the difference of colours (of 255, rms of channels) at which that becomes 0.6 of it, and rounds.
const COUPLING: f32 = 1.0;
const CONTRAST: f32 = 10.0;
const ROUNDS: usize = 12;
/// Log-odds of what is sure.
const SURE: f32 = 10.0;
/// Holes of the mask with fewer pixels are filled.
const LEAST_HOLE: usize = 60;
/// Pixels inside of the outline that may be mixed, and outside.
const MIXED: (f32, f32) = (2.0, 1.5);
/// The colours that a pixel is mixed of must differ by so much (of 255, all channels together), else nothing can be said of its share.
const DISTINCT: f32 = 30.0;
/// Shares below the first are noise, above the second as well.
const SHARE: (f32, f32) = (0.1, 0.9);

/// The mask of a photograph, 255 = person, from the one that it has, which is a network's of this `grain`, and the camera's plate. Nothing of a
/// photograph that does not fit the plate, whose mask is empty or would become so, or around whose person nothing of the plate is known: it keeps the mask that it has.
pub(crate) fn cut_out(photograph: &Photograph, grain: f32, plate: &Plate) -> Option<Vec<u8>> {
    let mask = photograph.mask.as_ref()?;
    if photograph.check().is_err() || plate.size != photograph.size {
        return None;
    }
    let grain = grain.clamp(1.0, 64.0);
    let crop = Crop::around(photograph, mask, grain)?;
    let inside: Vec<bool> = crop.indices().map(|at| mask[at] >= 128).collect();
    let depth = signed_distance(&inside, crop.size);
    let colours = crop.colours(photograph, plate);
    if colours.noise.iter().all(Option::is_none) {
        return None;
    }
    let odds = odds(&colours, &depth, grain, crop.size);
    let decided = cleaned(&agreed(&colours, odds, crop.size), crop.size);
    if !decided.contains(&true) {
        return None;
    }
    let shares = shares(&colours, &decided, crop.size);
    let mut out = vec![0; mask.len()];
    for (at, share) in crop.indices().zip(shares) {
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "a share, 0..=1"
        )]
        {
            out[at] = (share * 255.0 + 0.5) as u8;
        }
    }
    Some(out)
}

/// The part of a picture that the person is in.
#[derive(Debug, Clone, Copy)]
struct Crop {
    left: usize,
    top: usize,
    size: [usize; 2],
    /// Of the picture.
    width: usize,
}

impl Crop {
    /// Around all pixels of the mask; nothing of an empty one.
    fn around(photograph: &Photograph, mask: &[u8], grain: f32) -> Option<Self> {
        let [width, height] = photograph.size.map(|side| side as usize);
        let (mut low, mut high) = ([width, height], [0, 0]);
        for (k, _) in mask.iter().enumerate().filter(|(_, value)| **value >= 128) {
            for (axis, at) in [k % width, k / width].into_iter().enumerate() {
                low[axis] = low[axis].min(at);
                high[axis] = high[axis].max(at + 1);
            }
        }
        if high[0] <= low[0] {
            return None;
        }
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "a grain was clamped"
        )]
        let margin = (SURE_OUTSIDE * grain).ceil() as usize + 2;
        let low = low.map(|at| at.saturating_sub(margin));
        let high = [
            (high[0] + margin).min(width),
            (high[1] + margin).min(height),
        ];
        Some(Self {
            left: low[0],
            top: low[1],
            size: [high[0] - low[0], high[1] - low[1]],
            width,
        })
    }

    /// Where its pixels are in the picture, row by row.
    fn indices(self) -> impl Iterator<Item = usize> {
        let columns = self.left..self.left + self.size[0];
        (self.top..self.top + self.size[1])
            .flat_map(move |y| columns.clone().map(move |x| y * self.width + x))
    }

    fn colours(self, photograph: &Photograph, plate: &Plate) -> Colours {
        let pixel = |rgb: &[u8], at: usize| -> [f32; 3] {
            std::array::from_fn(|channel| f32::from(rgb[3 * at + channel]))
        };
        Colours {
            seen: (self.indices())
                .map(|at| pixel(&photograph.rgb, at))
                .collect(),
            plate: self.indices().map(|at| pixel(&plate.rgb, at)).collect(),
            noise: self.indices().map(|at| plate.noise[at]).collect(),
        }
    }
}

/// Colours of a crop's pixels, 0..=255.
#[derive(Debug)]
struct Colours {
    seen: Vec<[f32; 3]>,
    plate: Vec<[f32; 3]>,
    /// Deviation of a channel; none where the plate is not known.
    noise: Vec<Option<f32>>,
}

/// The most that two colours differ in a channel.
fn apart(a: [f32; 3], b: [f32; 3]) -> f32 {
    (a.iter().zip(b)).fold(0.0, |most, (a, b)| (a - b).abs().max(most))
}

fn dot(a: [f32; 3], b: [f32; 3]) -> f32 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

fn minus(a: [f32; 3], b: [f32; 3]) -> [f32; 3] {
    std::array::from_fn(|channel| a[channel] - b[channel])
}

/// Indices of a pixel and of its neighbours within one step, within the grid.
fn around(k: usize, [width, height]: [usize; 2]) -> impl Iterator<Item = usize> {
    let (x, y) = (k % width, k / width);
    (y.saturating_sub(1)..(y + 2).min(height))
        .flat_map(move |y| (x.saturating_sub(1)..(x + 2).min(width)).map(move |x| y * width + x))
}

/// Each pixel's log-odds of being the person's, before neighbours are asked.
fn odds(colours: &Colours, depth: &[f32], grain: f32, size: [usize; 2]) -> Vec<f32> {
    let surely: Vec<bool> = (depth.iter())
        .map(|depth| *depth > OWN_DEPTH * grain)
        .collect();
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "a grain was clamped"
    )]
    let own = means(
        &colours.seen,
        &surely,
        size,
        (OWN_REACH * grain).ceil() as usize,
    );
    (0..depth.len())
        .map(|k| {
            let grains = depth[k] / grain;
            if grains > SURE_INSIDE {
                return SURE;
            }
            if grains < -SURE_OUTSIDE {
                return -SURE;
            }
            let network = (NETWORK * grains).clamp(-NETWORK_MOST, NETWORK_MOST);
            network + of_plate(colours, own[k], k, size)
        })
        .collect()
}

/// The log-odds that the plate gives to pixel `k`, near which the person's own colour is `own`.
fn of_plate(colours: &Colours, own: Option<[f32; 3]>, k: usize, size: [usize; 2]) -> f32 {
    let Some(noise) = colours.noise[k] else {
        return 0.0;
    };
    let seen = colours.seen[k];
    // Encoded pictures and lenses that were undistorted put an edge up to a pixel aside; a shadow leaves the hue.
    let nearest = around(k, size)
        .filter(|other| colours.noise[*other].is_some())
        .map(|other| {
            let plate = colours.plate[other];
            let light = dot(seen, plate) / dot(plate, plate).max(1.0);
            let light = light.clamp(1.0 - SHADOW, 1.0);
            apart(seen, plate.map(|channel| light * channel))
        })
        .fold(f32::INFINITY, f32::min);
    let evidence = (nearest / noise - UNDECIDED).clamp(PLATE.0, PLATE.1);
    match own {
        Some(own) if evidence < 0.0 => {
            let distinct = apart(own, colours.plate[k]) / noise;
            evidence * ((distinct - ALIKE.0) / (ALIKE.1 - ALIKE.0)).clamp(0.0, 1.0)
        }
        _ => evidence,
    }
}

/// The mean colours of the pixels that are `counted`, within `reach` of each pixel; none where there are hardly any.
fn means(
    colours: &[[f32; 3]],
    counted: &[bool],
    size: [usize; 2],
    reach: usize,
) -> Vec<Option<[f32; 3]>> {
    const HARDLY: f32 = 0.02;
    let plane = |of: &dyn Fn(usize) -> f32| {
        let values: Vec<f32> = (counted.iter().enumerate())
            .map(|(k, counted)| if *counted { of(k) } else { 0.0 })
            .collect();
        box_mean(&values, size, reach)
    };
    let weights = plane(&|_| 1.0);
    let sums = [0, 1, 2].map(|channel| plane(&|k| colours[k][channel]));
    (0..colours.len())
        .map(|k| {
            let weight = weights[k];
            (weight > HARDLY).then(|| std::array::from_fn(|channel| sums[channel][k] / weight))
        })
        .collect()
}

/// Expectations, -1..=1, after neighbours agreed.
fn agreed(colours: &Colours, odds: Vec<f32>, size: [usize; 2]) -> Vec<f32> {
    let open: Vec<usize> = (odds.iter().enumerate())
        .filter(|(_, odds)| odds.abs() < SURE)
        .map(|(k, _)| k)
        .collect();
    let width = size[0];
    // Eight neighbours; at the edges those that there are not weigh nothing.
    let weights: Vec<[(usize, f32); 8]> = (open.iter().copied())
        .map(|k| {
            let mut weights = [(k, 0.0); 8];
            let others = around(k, size).filter(|other| *other != k);
            for (weight, other) in weights.iter_mut().zip(others) {
                let difference = minus(colours.seen[k], colours.seen[other]);
                let contrast = dot(difference, difference) / (6.0 * CONTRAST * CONTRAST);
                let aside = k % width != other % width && k / width != other / width;
                let step = if aside { std::f32::consts::SQRT_2 } else { 1.0 };
                *weight = (other, COUPLING * (-contrast).exp() / step);
            }
            weights
        })
        .collect();
    let mut expected: Vec<f32> = odds.iter().map(|odds| (0.5 * odds).tanh()).collect();
    let mut next = expected.clone();
    for _ in 0..ROUNDS {
        for (k, weights) in open.iter().zip(&weights) {
            let pull: f32 = weights
                .iter()
                .map(|(other, weight)| weight * expected[*other])
                .sum();
            next[*k] = (0.5 * (odds[*k] + pull)).tanh();
        }
        expected.copy_from_slice(&next);
    }
    expected
}

/// The largest part of what is expected to be the person, without small holes.
fn cleaned(expected: &[f32], size: [usize; 2]) -> Vec<bool> {
    let (label, sizes) = parts(|k| expected[k] > 0.0, size);
    let most = (1..sizes.len()).max_by_key(|part| sizes[*part]);
    let mut person: Vec<bool> = (label.iter())
        .map(|label| *label != 0 && Some(*label as usize) == most)
        .collect();
    let (holes, sizes) = parts(|k| !person[k], size);
    for (person, hole) in person.iter_mut().zip(holes) {
        *person |= hole != 0 && sizes[hole as usize] < LEAST_HOLE;
    }
    person
}

/// Each pixel's share of the person, 0..=1.
fn shares(colours: &Colours, person: &[bool], size: [usize; 2]) -> Vec<f32> {
    let depth = signed_distance(person, size);
    let inner: Vec<bool> = depth.iter().map(|depth| *depth > MIXED.0).collect();
    let own = means(&colours.seen, &inner, size, 5);
    let plain: Vec<f32> = (person.iter())
        .map(|person| f32::from(u8::from(*person)))
        .collect();
    let smooth = box_mean(&plain, size, 1);
    (0..person.len())
        .map(|k| {
            if depth[k] > MIXED.0 || depth[k] < -MIXED.1 {
                return plain[k];
            }
            let known = own[k].filter(|_| colours.noise[k].is_some());
            let Some(own) = known else {
                return smooth[k];
            };
            let across = minus(own, colours.plate[k]);
            let length = dot(across, across);
            if length < DISTINCT * DISTINCT {
                return smooth[k];
            }
            let share = dot(minus(colours.seen[k], colours.plate[k]), across) / length;
            ((share - SHARE.0) / (SHARE.1 - SHARE.0)).clamp(0.0, 1.0)
        })
        .collect()
}

#[cfg(test)]
mod tests;
