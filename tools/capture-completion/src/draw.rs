//! Photographs with the mask and the skeleton over them, small, and pages of many.

use capture::{Camera, FramePose, Photograph};
use glam::{DVec2, DVec3};
use motion_fit::landmarks::BodyLandmarks;
use spmm3::{Joint, Skeleton};

/// An RGB picture: [height, width, 3].
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Drawing {
    /// Width and height, pixels.
    pub size: [usize; 2],
    /// Colours.
    pub rgb: Vec<u8>,
}

/// Colours of the person's left and right, of the trunk, of landmarks and of the mask's edge.
const LEFT: [u8; 3] = [255, 150, 40];
const RIGHT: [u8; 3] = [60, 170, 255];
const TRUNK: [u8; 3] = [120, 235, 110];
const LANDMARK: [u8; 3] = [255, 255, 255];
const EDGE: [u8; 3] = [255, 40, 160];

/// What lies over a photograph.
#[derive(Debug, Clone, Copy)]
pub struct Over<'a> {
    /// The pose and the skeleton that has it.
    pub pose: Option<(&'a FramePose, &'a Skeleton)>,
    /// What a network saw, pixels of the photograph.
    pub landmarks: Option<&'a BodyLandmarks>,
}

/// The photograph `height` pixels high, dark where its mask is 0, with the mask's edge, bones and landmarks.
#[must_use]
pub fn draw(photograph: &Photograph, camera: &Camera, over: Over<'_>, height: usize) -> Drawing {
    let [w, h] = photograph.size.map(|side| side as usize);
    let size = [(w * height).div_ceil(h.max(1)).max(1), height.max(1)];
    let mut drawing = Drawing {
        size,
        rgb: vec![0; 3 * size[0] * size[1]],
    };
    let from = |k: usize, to: usize, of: usize| k * of / to;
    let inside = |x: usize, y: usize| {
        let at = from(y, size[1], h) * w + from(x, size[0], w);
        photograph
            .mask
            .as_ref()
            .map(|mask| mask.get(at).copied().unwrap_or(0))
    };
    for y in 0..size[1] {
        for x in 0..size[0] {
            // The mean of the pixels that become one.
            let (x0, x1) = (
                from(x, size[0], w),
                from(x + 1, size[0], w).max(from(x, size[0], w) + 1),
            );
            let (y0, y1) = (
                from(y, size[1], h),
                from(y + 1, size[1], h).max(from(y, size[1], h) + 1),
            );
            let mut sum = [0_usize; 3];
            let mut count = 0;
            for row in y0..y1.min(h) {
                for column in x0..x1.min(w) {
                    let at = 3 * (row * w + column);
                    if let Some(rgb) = photograph.rgb.get(at..at + 3) {
                        for (sum, value) in sum.iter_mut().zip(rgb) {
                            *sum += usize::from(*value);
                        }
                        count += 1;
                    }
                }
            }
            let mask = inside(x, y);
            let shade = if mask.is_some_and(|mask| mask < 128) {
                3
            } else {
                1
            };
            let mut colour = sum.map(|sum| byte(sum / count.max(1) / shade));
            let is_in = |x: usize, y: usize| inside(x, y).is_some_and(|mask| mask >= 128);
            if is_in(x, y) != is_in((x + 1).min(size[0] - 1), y)
                || is_in(x, y) != is_in(x, (y + 1).min(size[1] - 1))
            {
                colour = EDGE;
            }
            drawing.set(x, y, colour);
        }
    }
    let scale = height as f64 / h.max(1) as f64;
    if let Some((pose, skeleton)) = over.pose {
        let motion = pose.on(skeleton);
        let joints = skeleton.pose(&motion);
        let at = |joint: Joint| -> Option<DVec2> {
            let place: DVec3 = (joints.position(joint) + motion.root_translation).as_dvec3();
            Some(camera.project(place)? * scale)
        };
        for joint in Joint::ALL {
            let face = matches!(joint, Joint::Jaw | Joint::LeftEye | Joint::RightEye);
            let Some(parent) = joint.parent().filter(|_| !face) else {
                continue;
            };
            let colour = if joint.name().starts_with("left") {
                LEFT
            } else if joint.name().starts_with("right") {
                RIGHT
            } else {
                TRUNK
            };
            if let (Some(from), Some(to)) = (at(parent), at(joint)) {
                drawing.line(from, to, colour);
            }
        }
    }
    if let Some(body) = over.landmarks {
        for point in body.points.iter().filter(|point| point.confidence > 0.5) {
            let at = point.pixel.as_dvec2() * scale;
            drawing.line(at - DVec2::X, at + DVec2::X, LANDMARK);
        }
    }
    drawing
}

impl Drawing {
    fn set(&mut self, x: usize, y: usize, colour: [u8; 3]) {
        if x < self.size[0] && y < self.size[1] {
            let at = 3 * (y * self.size[0] + x);
            if let Some(to) = self.rgb.get_mut(at..at + 3) {
                to.copy_from_slice(&colour);
            }
        }
    }

    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "within the picture, checked above; steps are bounded"
    )]
    fn line(&mut self, from: DVec2, to: DVec2, colour: [u8; 3]) {
        let steps = (to - from).abs().max_element().clamp(1.0, 4000.0).ceil();
        for k in 0..=steps as usize {
            let at = from.lerp(to, k as f64 / steps);
            for aside in [DVec2::ZERO, DVec2::X, DVec2::Y] {
                let at = at + aside;
                if at.x >= 0.0 && at.y >= 0.0 && at.x < 1e5 && at.y < 1e5 {
                    self.set(at.x as usize, at.y as usize, colour);
                }
            }
        }
    }

    /// Rows of drawings, side by side and one below the other.
    #[must_use]
    pub fn page(rows: &[Vec<Self>]) -> Self {
        const GAP: usize = 4;
        let width = |row: &Vec<Self>| row.iter().map(|d| d.size[0] + GAP).sum::<usize>();
        let height = |row: &Vec<Self>| row.iter().map(|d| d.size[1]).max().unwrap_or(0) + GAP;
        let size = [
            rows.iter().map(width).max().unwrap_or(1).max(1),
            rows.iter().map(height).sum::<usize>().max(1),
        ];
        let mut page = Self {
            size,
            rgb: vec![24; 3 * size[0] * size[1]],
        };
        let mut top = 0;
        for row in rows {
            let mut left = 0;
            for drawing in row {
                for y in 0..drawing.size[1] {
                    let from = 3 * y * drawing.size[0];
                    let to = 3 * ((top + y) * size[0] + left);
                    let length = 3 * drawing.size[0];
                    page.rgb[to..to + length].copy_from_slice(&drawing.rgb[from..from + length]);
                }
                left += drawing.size[0] + GAP;
            }
            top += height(row);
        }
        page
    }
}

fn byte(value: usize) -> u8 {
    u8::try_from(value).unwrap_or(u8::MAX)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_page_holds_every_drawing_where_it_belongs() {
        let one = |colour: u8, size: [usize; 2]| Drawing {
            size,
            rgb: vec![colour; 3 * size[0] * size[1]],
        };
        let page = Drawing::page(&[vec![one(1, [3, 2]), one(2, [2, 4])], vec![one(3, [5, 1])]]);
        assert_eq!(page.size, [13, 13], "with gaps");
        let at = |x: usize, y: usize| page.rgb[3 * (y * 13 + x)];
        assert_eq!(
            [at(0, 0), at(7, 3), at(4, 8), at(12, 12)],
            [1, 2, 3, 24],
            "places"
        );
    }
}
