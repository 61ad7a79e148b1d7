//! How hard pictures pull at each Gaussian.

use glam::Vec3A;
use splat_gradient::{Attributes, View};

/// Sums over the steps since Gaussians last came or went.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Statistics {
    /// Of the loss' derivative by each centre's place in the picture: its length times the picture's pixels, so that it is a sum over
    /// pixels as the picture's size is changed.
    pub pull: Vec<f32>,
    /// Steps in which the picture had a derivative by the Gaussian.
    pub seen: Vec<u32>,
}

impl Statistics {
    /// Nothing gathered yet, of so many Gaussians.
    #[must_use]
    pub fn new(count: usize) -> Self {
        Self {
            pull: vec![0.0; count],
            seen: vec![0; count],
        }
    }

    /// Adds a step: the photometric loss' derivatives by `gaussians` as `view` saw them. A metre at depth z is focal / z pixels.
    #[expect(clippy::cast_precision_loss, reason = "pixel counts are small")]
    pub fn add(&mut self, gaussians: &Attributes, by_gaussians: &Attributes, view: &View) {
        let pose = view.camera_from_world();
        let (forwards, shift) = (pose.matrix3.row(2), pose.translation.z);
        let [width, height] = view.size();
        let focal = 0.5 * (view.focal()[0] + view.focal()[1]);
        // The loss is a mean over pixels.
        let pixels = (width * height) as f32;
        let [x, y, z] = [0, 1, 2].map(|plane| gaussians.plane(plane));
        let [by_x, by_y, by_z] = [0, 1, 2].map(|plane| by_gaussians.plane(plane));
        let places = x.iter().zip(y).zip(z);
        let derivatives = by_x.iter().zip(by_y).zip(by_z);
        let sums = self.pull.iter_mut().zip(&mut self.seen);
        for ((((x, y), z), ((by_x, by_y), by_z)), (pull, seen)) in places.zip(derivatives).zip(sums)
        {
            let by_place = Vec3A::new(*by_x, *by_y, *by_z);
            // What moves it along the view moves nothing in the picture.
            let across = by_place - forwards * by_place.dot(forwards);
            let length = across.length();
            if length > 0.0 && length.is_finite() {
                let depth = forwards.dot(Vec3A::new(*x, *y, *z)) + shift;
                *pull += length * depth.max(0.0) / focal * pixels;
                *seen = seen.saturating_add(1);
            }
        }
    }

    /// The mean pull on a Gaussian where it was seen; 0 where it never was.
    #[must_use]
    #[expect(clippy::cast_precision_loss, reason = "counts of steps")]
    pub fn mean(&self, index: usize) -> f32 {
        match (self.pull.get(index), self.seen.get(index)) {
            (Some(pull), Some(seen)) if *seen > 0 => pull / *seen as f32,
            _ => 0.0,
        }
    }

    /// Forgets everything; of so many Gaussians from now on.
    pub fn reset(&mut self, count: usize) {
        *self = Self::new(count);
    }
}
