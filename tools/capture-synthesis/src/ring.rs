//! Cameras on a ring around the person, each framed as tightly as the whole performance allows.

use crate::draw::NEAR;
use crate::error::SynthesisError;
use crate::lens::Lens;
use glam::{DVec2, DVec3, Vec3};
use std::f64::consts::TAU;

/// What cameras' heights take turns of, metres above the floor: a little above the knees, the chest, above the head.
const HEIGHTS: [f64; 3] = [1.2, 0.7, 2.1];

/// The share of the picture that the performance fills, along the tighter side.
const FILLED: f64 = 0.94;

/// The least distance between a camera and the person, metres.
const LEAST_DISTANCE: f64 = 0.3;

/// A ring of cameras.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Ring {
    /// How many, spread evenly; the first stands before the person.
    pub cameras: usize,
    /// Width and height of every picture, pixels.
    pub size: [u32; 2],
    /// From the ring's axis to each camera, metres.
    pub radius: f64,
}

impl Ring {
    /// The name of a camera: `cam00`, `cam01`, ...
    #[must_use]
    pub fn name(camera: usize) -> String {
        format!("cam{camera:02}")
    }

    /// The cameras, aimed at the middle of `frames` (each a frame's points in the world, metres), with the focal length and the principal
    /// point of a crop in which all of them are seen.
    ///
    /// # Errors
    /// If a point is nearer to a camera than 0.3 m along its axis, or behind it.
    pub fn lenses(&self, frames: &[Vec<Vec3>]) -> Result<Vec<Lens>, SynthesisError> {
        let mut low = Vec3::INFINITY;
        let mut high = Vec3::NEG_INFINITY;
        for point in frames.iter().flatten() {
            low = low.min(*point);
            high = high.max(*point);
        }
        let middle = (0.5 * (low + high)).as_dvec3();
        (0..self.cameras)
            .map(|camera| self.lens(camera, middle, frames))
            .collect()
    }

    /// How high a camera stands, metres. The turns shift by one after each half of the ring, so that opposite cameras differ.
    fn height(&self, camera: usize) -> f64 {
        let half = self.cameras.div_ceil(2).max(1);
        HEIGHTS[(camera + camera / half) % HEIGHTS.len()]
    }

    fn lens(
        &self,
        camera: usize,
        middle: DVec3,
        frames: &[Vec<Vec3>],
    ) -> Result<Lens, SynthesisError> {
        let angle = TAU * camera as f64 / self.cameras as f64;
        let place = DVec3::new(angle.sin(), 0.0, angle.cos()) * self.radius;
        let eye = place + DVec3::Y * self.height(camera) + DVec3::new(middle.x, 0.0, middle.z);
        let mut lens = Lens::look_at(eye, middle, DVec3::Y, 1.0, self.size);
        // Where everything is on the plane at 1 m from the camera.
        let (mut low, mut high) = (DVec2::INFINITY, DVec2::NEG_INFINITY);
        for (frame, points) in frames.iter().enumerate() {
            for point in points {
                let seen = lens.camera_point(*point);
                if seen.z < LEAST_DISTANCE.max(NEAR) {
                    return Err(SynthesisError::TooNear {
                        camera: Self::name(camera),
                        frame,
                        distance: seen.z,
                        least: LEAST_DISTANCE,
                    });
                }
                let at = seen.truncate() / seen.z;
                low = low.min(at);
                high = high.max(at);
            }
        }
        let extent = (high - low).max(DVec2::splat(1e-3));
        let [width, height] = self.size.map(f64::from);
        let focal = FILLED * (width / extent.x).min(height / extent.y);
        let aim = 0.5 * (low + high);
        lens.focal = [focal; 2];
        lens.centre = [0.5 * width - aim.x * focal, 0.5 * height - aim.y * focal];
        Ok(lens)
    }

    /// Indices of `count` cameras to be held out, spread evenly over the ring; the first camera is never one.
    #[must_use]
    pub fn held_out(&self, count: usize) -> Vec<usize> {
        let others = self.cameras.saturating_sub(1);
        let count = count.min(others);
        (0..count)
            .map(|k| 1 + (2 * k + 1) * others / (2 * count))
            .collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn held_out_cameras_are_different_and_never_the_first() {
        for cameras in 1..20 {
            for count in 0..cameras {
                let ring = Ring {
                    cameras,
                    size: [64; 2],
                    radius: 3.0,
                };
                let held_out = ring.held_out(count);
                assert_eq!(held_out.len(), count, "of {cameras} cameras");
                assert!(
                    held_out.windows(2).all(|pair| pair[0] < pair[1]),
                    "{held_out:?}"
                );
                assert!(
                    held_out.iter().all(|camera| (1..cameras).contains(camera)),
                    "{held_out:?}"
                );
            }
        }
    }

    #[test]
    fn every_point_of_every_frame_is_in_every_picture_and_the_pictures_are_filled() {
        let frames = vec![
            vec![Vec3::new(-0.9, 1.4, 0.0), Vec3::new(0.9, 1.4, 0.1)],
            vec![Vec3::new(0.1, 0.0, -0.2), Vec3::new(0.0, 1.9, 0.3)],
        ];
        let ring = Ring {
            cameras: 7,
            size: [320, 240],
            radius: 2.5,
        };
        for lens in ring.lenses(&frames).expect("they are far enough") {
            let (mut low, mut high) = (DVec2::INFINITY, DVec2::NEG_INFINITY);
            for point in frames.iter().flatten() {
                let seen = lens.camera_point(*point);
                let at = DVec2::new(
                    seen.x / seen.z * lens.focal[0] + lens.centre[0],
                    seen.y / seen.z * lens.focal[1] + lens.centre[1],
                );
                low = low.min(at);
                high = high.max(at);
            }
            assert!(low.min_element() >= 0.0, "{low} is outside");
            assert!(high.x <= 320.0 && high.y <= 240.0, "{high} is outside");
            let filled = (high - low) / DVec2::new(320.0, 240.0);
            assert!(
                (filled.max_element() - FILLED).abs() < 1e-9,
                "{filled} is filled"
            );
        }
        let near = Ring {
            radius: 0.4,
            ..ring
        };
        assert!(
            matches!(near.lenses(&frames), Err(SynthesisError::TooNear { .. })),
            "the person reaches past the cameras"
        );
    }
}
