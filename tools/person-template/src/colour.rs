//! The first Gaussians' colours: photographs projected onto the posed template.
//!
//! A place takes the weighted median of what the pictures show of it, each where it is visible (by the depth of the drawn template), well within the
//! mask, and facing the camera. What no picture shows continues from what is around it on the mesh.

use crate::observe::around_person;
use crate::raster::draw;
use capture::{Camera, Photograph};
use glam::{DVec2, DVec3, Vec3};
use scan_rig::body::BodyPart;
use scan_rig::shell::harmonic::Edges;

/// Samples of one Gaussian at most: the best ones are kept.
const SAMPLES: usize = 24;

/// Least cosine between a surface and the way to the camera.
const FACING: f64 = 0.25;

/// How much deeper than what is drawn a visible place may be, metres.
const DEEPER: f64 = 0.012;

/// Pictures are drawn with at most so many pixels a side.
const SIDE: u32 = 800;

/// Pixels of the mask around a sample that must be the person's, each way.
const WITHIN: f64 = 1.5;

/// What a picture shows of a Gaussian.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Sample {
    pub(crate) weight: f32,
    pub(crate) colour: [u8; 3],
}

/// A place on a posed surface.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Spot {
    /// Metres.
    pub(crate) place: DVec3,
    /// Unit, outwards.
    pub(crate) normal: DVec3,
}

/// What a picture shows of each spot. `vertices` and `faces` are the posed mesh that hides what is behind it.
pub(crate) fn shown(
    photograph: &Photograph,
    pinhole: &Camera,
    vertices: &[DVec3],
    faces: &[[u32; 3]],
    spots: &[Spot],
) -> Vec<Option<Sample>> {
    let Some((corner, size)) = around_person(photograph) else {
        return vec![None; spots.len()];
    };
    let largest = size[0].max(size[1]);
    let side = |length: u32| {
        if largest <= SIDE {
            length
        } else {
            (length * SIDE).div_ceil(largest).max(2)
        }
    };
    let camera = pinhole.cropped(corner, size).scaled(size.map(side));
    let drawn = draw(&camera, vertices, faces);
    let eye = pinhole.position();
    let sample = |spot: &Spot| {
        let way = eye - spot.place;
        let distance = way.length();
        let facing = spot.normal.dot(way) / distance.max(1e-9);
        if facing < FACING {
            return None;
        }
        let depth = pinhole.camera_from_world.transform_point3(spot.place).z;
        let pixel = drawn.pixel(camera.project(spot.place)?)?;
        let nearness = f64::from(drawn.nearness[pixel]);
        if nearness <= 0.0 || depth - 1.0 / nearness > DEEPER {
            return None;
        }
        let at = pinhole.project(spot.place)?;
        let inside = [DVec2::ZERO, DVec2::X, DVec2::Y, DVec2::NEG_X, DVec2::NEG_Y]
            .iter()
            .all(|way| masked(photograph, at + *way * WITHIN));
        let colour = inside.then(|| bilinear(photograph, at)).flatten()?;
        // Square pixels of the picture for a square metre of the surface.
        let density = facing * pinhole.focal[0] * pinhole.focal[1] / (depth * depth);
        #[expect(clippy::cast_possible_truncation, reason = "a weight")]
        let weight = (facing * density) as f32;
        Some(Sample { weight, colour })
    };
    spots.iter().map(sample).collect()
}

fn masked(photograph: &Photograph, at: DVec2) -> bool {
    let pixel = pixel(photograph, at);
    let value = pixel.and_then(|pixel| photograph.mask.as_ref()?.get(pixel));
    value.is_some_and(|value| *value >= 250)
}

fn pixel(photograph: &Photograph, at: DVec2) -> Option<usize> {
    let size = DVec2::new(f64::from(photograph.size[0]), f64::from(photograph.size[1]));
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "within the picture"
    )]
    let pixel = || at.y as usize * photograph.size[0] as usize + at.x as usize;
    (at.cmpge(DVec2::ZERO).all() && at.cmplt(size).all()).then(pixel)
}

fn bilinear(photograph: &Photograph, at: DVec2) -> Option<[u8; 3]> {
    let low = (at - 0.5).floor();
    let share = at - 0.5 - low;
    let corner = |x: f64, y: f64| {
        let pixel = pixel(photograph, low + DVec2::new(x + 0.5, y + 0.5))?;
        let rgb = photograph.rgb.get(3 * pixel..3 * pixel + 3)?;
        Some(DVec3::new(rgb[0].into(), rgb[1].into(), rgb[2].into()))
    };
    let upper = corner(0.0, 0.0)?.lerp(corner(1.0, 0.0)?, share.x);
    let lower = corner(0.0, 1.0)?.lerp(corner(1.0, 1.0)?, share.x);
    let colour = upper.lerp(lower, share.y).round();
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "between display values"
    )]
    Some(colour.to_array().map(|value| value as u8))
}

/// Samples of Gaussians over many pictures.
#[derive(Debug)]
pub(crate) struct Samples {
    of: Vec<Vec<Sample>>,
}

impl Samples {
    pub(crate) fn none(gaussians: usize) -> Self {
        Self {
            of: vec![Vec::new(); gaussians],
        }
    }

    /// Adds one picture's.
    pub(crate) fn add(&mut self, shown: &[Option<Sample>]) {
        for (samples, sample) in self.of.iter_mut().zip(shown) {
            let Some(sample) = sample else { continue };
            if samples.len() < SAMPLES {
                samples.push(*sample);
                continue;
            }
            let least = (0..samples.len()).fold(0, |least, at| {
                if samples[at].weight < samples[least].weight {
                    at
                } else {
                    least
                }
            });
            if samples[least].weight < sample.weight {
                samples[least] = *sample;
            }
        }
    }

    /// The weighted median of each Gaussian's samples, display values 0..=1; nothing where there is none.
    pub(crate) fn medians(&self) -> Vec<Option<DVec3>> {
        self.of.iter().map(|samples| median(samples)).collect()
    }
}

fn median(samples: &[Sample]) -> Option<DVec3> {
    if samples.is_empty() {
        return None;
    }
    let channel = |channel: usize| {
        let mut values: Vec<(u8, f32)> = (samples.iter())
            .map(|sample| (sample.colour[channel], sample.weight))
            .collect();
        values.sort_by(|a, b| a.0.cmp(&b.0).then(a.1.total_cmp(&b.1)));
        let half = 0.5 * values.iter().map(|(_, weight)| weight).sum::<f32>();
        let mut passed = 0.0;
        let middle = values.iter().find(|(_, weight)| {
            passed += weight;
            passed >= half
        });
        f64::from(middle.or(values.last()).map_or(0, |(value, _)| *value)) / 255.0
    };
    Some(DVec3::new(channel(0), channel(1), channel(2)))
}

/// Colours of parts that pictures hardly show, display values: as teeth, tongues and the inside of mouths are.
fn usual(part: BodyPart) -> Option<DVec3> {
    match part {
        BodyPart::Teeth => Some(DVec3::new(0.80, 0.76, 0.69)),
        BodyPart::Tongue => Some(DVec3::new(0.62, 0.33, 0.31)),
        BodyPart::InnerMouth => Some(DVec3::new(0.28, 0.12, 0.11)),
        BodyPart::Eyes => Some(DVec3::new(0.70, 0.68, 0.66)),
        _ => None,
    }
}

/// Every Gaussian's colour: its own, or that of the parts that are never seen, or what is around it on the mesh.
pub(crate) fn continued(
    found: &[Option<DVec3>],
    on: (&[u32], &[[f32; 2]]),
    vertices: &[DVec3],
    faces: &[[u32; 3]],
    parts: &[BodyPart],
) -> Vec<Vec3> {
    let shares = |[v, w]: [f32; 2]| [1.0 - v - w, v, w].map(f64::from);
    let mut sums = vec![(DVec3::ZERO, 0.0); vertices.len()];
    let mut all = (DVec3::ZERO, 0.0);
    for ((colour, face), barycentric) in found.iter().zip(on.0).zip(on.1) {
        let Some(colour) = colour else { continue };
        all = (all.0 + *colour, all.1 + 1.0);
        for (v, share) in faces[*face as usize].iter().zip(shares(*barycentric)) {
            let sum = &mut sums[*v as usize];
            *sum = (sum.0 + *colour * share, sum.1 + share);
        }
    }
    let mean = all.0 / f64::max(all.1, 1.0);
    let mut values = vec![mean; vertices.len()];
    let mut known = vec![false; vertices.len()];
    for (face, part) in faces.iter().zip(parts) {
        let Some(usual) = usual(*part) else { continue };
        for v in face {
            values[*v as usize] = usual;
            known[*v as usize] = true;
        }
    }
    for (v, (sum, weight)) in sums.iter().enumerate() {
        if *weight > 1e-3 {
            values[v] = *sum / *weight;
            known[v] = true;
        }
    }
    let filled = Edges::new(vertices, faces.iter().copied()).fill(&values, &known);
    ((found.iter().zip(on.0)).zip(on.1))
        .map(|((colour, face), barycentric)| {
            let around = || {
                (faces[*face as usize].iter().zip(shares(*barycentric)))
                    .map(|(v, share)| filled[*v as usize] * share)
                    .sum()
            };
            colour.unwrap_or_else(around).as_vec3()
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_median_leaves_out_what_few_pictures_show() {
        let sample = |value: u8, weight: f32| Sample {
            weight,
            colour: [value, 255 - value, 7],
        };
        let mut samples = Samples::none(2);
        for value in [100, 102, 101, 250, 99] {
            samples.add(&[Some(sample(value, 1.0)), None]);
        }
        let medians = samples.medians();
        let first = medians[0].expect("it was seen") * 255.0;
        assert!(
            first.distance(DVec3::new(101.0, 154.0, 7.0)) < 1e-6,
            "{first}"
        );
        assert_eq!(medians[1], None, "it was not seen");
        for weight in 0..40_u8 {
            samples.add(&[Some(sample(20, f32::from(weight))), None]);
        }
        assert_eq!(samples.of[0].len(), SAMPLES, "only the best are kept");
    }

    #[test]
    fn what_is_not_seen_continues_from_what_is_around_it() {
        let vertices: Vec<DVec3> = (0..12)
            .map(|at| DVec3::new(f64::from(at / 2), f64::from(at % 2), 0.0))
            .collect();
        let faces: Vec<[u32; 3]> = (0..5)
            .flat_map(|k| [[2 * k, 2 * k + 2, 2 * k + 3], [2 * k, 2 * k + 3, 2 * k + 1]])
            .collect();
        let parts = [BodyPart::Skin; 10];
        let on: Vec<u32> = (0..10).collect();
        let barycentrics = [[1.0 / 3.0; 2]; 10];
        let mut found = vec![None; 10];
        found[0] = Some(DVec3::ZERO);
        found[9] = Some(DVec3::ONE);
        let colours = continued(&found, (&on, &barycentrics), &vertices, &faces, &parts);
        assert!(
            colours.windows(3).all(|w| w[2].x >= w[0].x - 1e-4),
            "{colours:?}"
        );
        assert!((colours[4].x - 0.5).abs() < 0.2, "{}", colours[4]);
    }
}
