//! Pictures without their lens' distortion: each pixel of the pinhole is looked up where its ray is seen, bilinearly.

use crate::camera::Camera;
use crate::error::CaptureError;
use crate::lens;
use crate::photograph::Photograph;
use glam::DVec2;

impl Camera {
    /// A picture that this camera took ([height, width, 3]), and its mask if there is one ([height, width]), as the [`Photograph`] that
    /// [`Self::undistorted`] would have taken: each pixel is looked up where its ray is seen, bilinearly. What the camera did not see is 0.
    ///
    /// # Errors
    /// [`CaptureError::Request`] if the arrays are not of the camera's size.
    pub fn photograph(
        &self,
        rgb: Vec<u8>,
        mask: Option<Vec<u8>>,
    ) -> Result<Photograph, CaptureError> {
        let taken = Photograph {
            size: self.size,
            rgb,
            mask,
        };
        taken.check()?;
        Ok(Photograph {
            size: self.size,
            rgb: undistort(self, taken.rgb, 3),
            mask: taken.mask.map(|mask| undistort(self, mask, 1)),
        })
    }
}

/// The picture that `camera.undistorted()` would have taken; [height, width, channels] in and out. What the camera did not see is 0.
fn undistort(camera: &Camera, pixels: Vec<u8>, channels: usize) -> Vec<u8> {
    if camera.distortion == [0.0; 5] {
        return pixels;
    }
    let [width, height] = camera.size.map(|side| side as usize);
    let (focal, centre) = (DVec2::from(camera.focal), DVec2::from(camera.centre));
    let mut out = vec![0; pixels.len()];
    let rows = out.chunks_exact_mut((width * channels).max(1));
    for (y, row) in rows.enumerate().take(height) {
        for (x, pixel) in row.chunks_exact_mut(channels).enumerate() {
            #[expect(clippy::cast_precision_loss, reason = "pixel counts are small")]
            let at = DVec2::new(x as f64 + 0.5, y as f64 + 0.5);
            let Some(seen) = lens::distort(&camera.distortion, (at - centre) / focal) else {
                continue;
            };
            let seen = seen * focal + centre;
            if let Some((corners, shares)) = corners(seen, [width, height]) {
                for (channel, value) in pixel.iter_mut().enumerate() {
                    let at = |k: usize| f64::from(pixels[corners[k] * channels + channel]);
                    let sum: f64 = (0..4).map(|k| shares[k] * at(k)).sum();
                    #[expect(
                        clippy::cast_possible_truncation,
                        clippy::cast_sign_loss,
                        reason = "a mean of bytes is a byte"
                    )]
                    {
                        *value = (sum + 0.5) as u8;
                    }
                }
            }
        }
    }
    out
}

/// Indices of the four pixels about a place, and their shares; `None` outside the picture. The outermost half pixel repeats the edge.
fn corners(place: DVec2, [width, height]: [usize; 2]) -> Option<([usize; 4], [f64; 4])> {
    #[expect(clippy::cast_precision_loss, reason = "pixel counts are small")]
    let sides = DVec2::new(width as f64, height as f64);
    if !(place.cmpge(DVec2::ZERO).all() && place.cmple(sides).all()) {
        return None;
    }
    let from = (place - 0.5).clamp(DVec2::ZERO, sides - 1.0);
    let share = from - from.floor();
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "clamped to the picture"
    )]
    let (left, top) = (from.x as usize, from.y as usize);
    let (right, below) = ((left + 1).min(width - 1), (top + 1).min(height - 1));
    let index = |x: usize, y: usize| y * width + x;
    Some((
        [
            index(left, top),
            index(right, top),
            index(left, below),
            index(right, below),
        ],
        [
            (1.0 - share.x) * (1.0 - share.y),
            share.x * (1.0 - share.y),
            (1.0 - share.x) * share.y,
            share.x * share.y,
        ],
    ))
}
