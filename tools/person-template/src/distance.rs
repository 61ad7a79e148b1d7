//! Signed distances from the outline of a mask.
//!
//! Exact Euclidean distances between the centres of pixels (Felzenszwalb and Huttenlocher, "Distance transforms of sampled functions", 2012), moved by half
//! a pixel: the outline runs between a pixel that is the person and one that is not.

use glam::DVec2;

/// Distances in pixels, negative within the mask.
#[derive(Debug, Clone)]
pub(crate) struct SignedDistance {
    width: usize,
    height: usize,
    values: Vec<f32>,
}

impl SignedDistance {
    /// Of a mask, row by row from the top; nothing where it has no outline (all or nothing is the person).
    pub(crate) fn new(inside: &[bool], width: usize, height: usize) -> Option<Self> {
        let within = inside.iter().filter(|i| **i).count();
        if within == 0 || within == inside.len() || inside.len() != width * height {
            return None;
        }
        let to_inside = squared_distances(inside, true, width, height);
        let to_outside = squared_distances(inside, false, width, height);
        let values = (to_inside.iter().zip(&to_outside).zip(inside))
            .map(|((to_inside, to_outside), inside)| {
                if *inside {
                    0.5 - to_outside.sqrt()
                } else {
                    to_inside.sqrt() - 0.5
                }
            })
            .collect();
        Some(Self {
            width,
            height,
            values,
        })
    }

    /// The distance at a point (the first pixel's centre is at 0.5) and its gradient, bilinear; nothing outside of the picture.
    pub(crate) fn at(&self, point: DVec2) -> Option<(f64, DVec2)> {
        let place = point - 0.5;
        let most = DVec2::new(self.width as f64 - 1.0, self.height as f64 - 1.0);
        if !(place.cmpge(DVec2::ZERO).all() && place.cmplt(most).all()) {
            return None;
        }
        let cell = place.floor();
        let share = place - cell;
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "within the picture"
        )]
        let first = cell.y as usize * self.width + cell.x as usize;
        let value = |at: usize| f64::from(self.values[at]);
        let (a, b) = (value(first), value(first + 1));
        let (c, d) = (value(first + self.width), value(first + self.width + 1));
        let (upper, lower) = (a + (b - a) * share.x, c + (d - c) * share.x);
        let gradient = DVec2::new((b - a) + ((d - c) - (b - a)) * share.y, lower - upper);
        Some((upper + (lower - upper) * share.y, gradient))
    }

    /// Whether a pixel, counted row by row, is within the mask.
    pub(crate) fn inside(&self, pixel: usize) -> bool {
        self.values.get(pixel).is_some_and(|value| *value < 0.0)
    }

    /// How many pixels there are.
    pub(crate) fn pixels(&self) -> usize {
        self.values.len()
    }
}

/// Squared distance of every pixel's centre from the nearest one that is `wanted`.
fn squared_distances(inside: &[bool], wanted: bool, width: usize, height: usize) -> Vec<f32> {
    // More than the squared diagonal of any picture.
    const FAR: f32 = 1e9;
    let mut values: Vec<f32> = (inside.iter())
        .map(|i| if *i == wanted { 0.0 } else { FAR })
        .collect();
    let mut envelope = Envelope::default();
    for row in values.chunks_exact_mut(width) {
        envelope.transform(row);
    }
    let mut column = vec![0.0; height];
    for x in 0..width {
        for (y, value) in column.iter_mut().enumerate() {
            *value = values[y * width + x];
        }
        envelope.transform(&mut column);
        for (y, value) in column.iter().enumerate() {
            values[y * width + x] = *value;
        }
    }
    values
}

/// The lower envelope of parabolas.
#[derive(Default)]
struct Envelope {
    /// Where each parabola has its vertex, how low, and from where on it is the lowest.
    parabolas: Vec<(f32, f32, f32)>,
}

impl Envelope {
    /// Replaces values by the least of value plus squared distance.
    fn transform(&mut self, values: &mut [f32]) {
        self.parabolas.clear();
        for (at, value) in values.iter().enumerate() {
            let at = at as f32;
            let mut from = f32::NEG_INFINITY;
            while let Some((other, low, other_from)) = self.parabolas.last().copied() {
                from = ((value + at * at) - (low + other * other)) / (2.0 * (at - other));
                if from > other_from {
                    break;
                }
                self.parabolas.pop();
                from = f32::NEG_INFINITY;
            }
            self.parabolas.push((at, *value, from));
        }
        let mut current = 0;
        for (at, value) in values.iter_mut().enumerate() {
            let at = at as f32;
            while (self.parabolas.get(current + 1)).is_some_and(|(_, _, from)| *from < at) {
                current += 1;
            }
            let (vertex, low, _) = self.parabolas[current];
            *value = low + (at - vertex) * (at - vertex);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn distances_are_those_of_a_search_through_all_pixels() {
        let (width, height) = (37, 29);
        let mut random = fastrand::Rng::with_seed(7);
        let inside: Vec<bool> = (0..width * height).map(|_| random.u8(0..12) == 0).collect();
        let field = SignedDistance::new(&inside, width, height).expect("an outline");
        let place = |at: usize| DVec2::new((at % width) as f64, (at / width) as f64);
        for at in 0..inside.len() {
            let nearest = (0..inside.len())
                .filter(|other| inside[*other] != inside[at])
                .map(|other| place(other).distance(place(at)))
                .fold(f64::INFINITY, f64::min);
            let expected = if inside[at] {
                0.5 - nearest
            } else {
                nearest - 0.5
            };
            let got = f64::from(field.values[at]);
            assert!(
                (got - expected).abs() < 1e-3,
                "pixel {at}: {got} is not {expected}"
            );
        }
    }

    #[test]
    fn the_outline_of_a_disc_is_found_to_a_third_of_a_pixel_with_gradients_outwards() {
        let (size, radius, centre) = (101_usize, 31.3, DVec2::new(50.2, 49.6));
        let inside: Vec<bool> = (0..size * size)
            .map(|at| {
                let place = DVec2::new((at % size) as f64 + 0.5, (at / size) as f64 + 0.5);
                place.distance(centre) < radius
            })
            .collect();
        let field = SignedDistance::new(&inside, size, size).expect("an outline");
        for step in 0..90 {
            let outwards = DVec2::from_angle(f64::from(step) * 0.0698);
            let (value, gradient) = field
                .at(centre + outwards * (radius + 4.0))
                .expect("inside");
            assert!((value - 4.0).abs() < 0.6, "{value} pixels at step {step}");
            assert!(
                gradient.normalize().dot(outwards) > 0.9,
                "{gradient} at step {step}"
            );
        }
        assert!(
            field.at(DVec2::new(-1.0, 5.0)).is_none(),
            "outside of the picture"
        );
        assert!(
            SignedDistance::new(&[true; 12], 4, 3).is_none(),
            "a mask without an outline"
        );
    }
}
