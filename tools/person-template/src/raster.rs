//! Triangles drawn into a calibrated camera without distortion: how far the nearest one is in each pixel, and which it is.

use capture::Camera;
use glam::{DVec2, DVec3};

/// Nothing is drawn nearer than this, metres.
const NEAR: f64 = 0.05;

/// A picture of a mesh, row by row from the top.
#[derive(Debug, Clone)]
pub struct Drawn {
    /// Pixels.
    pub width: usize,
    /// Pixels.
    pub height: usize,
    /// One over the depth along the camera's axis, 1 / metres; 0 where nothing is.
    pub nearness: Vec<f32>,
    /// Which of the faces is seen; `u32::MAX` where none is.
    pub face: Vec<u32>,
}

/// Draws triangles; a pixel is covered if its centre is. A triangle with a corner behind the camera is left out.
#[must_use]
pub fn draw(camera: &Camera, vertices: &[DVec3], faces: &[[u32; 3]]) -> Drawn {
    let [width, height] = camera.size.map(|side| side as usize);
    let mut drawn = Drawn {
        width,
        height,
        nearness: vec![0.0; width * height],
        face: vec![u32::MAX; width * height],
    };
    let (focal, centre) = (DVec2::from(camera.focal), DVec2::from(camera.centre));
    let seen: Vec<Option<(DVec2, f64)>> = (vertices.iter())
        .map(|vertex| {
            let sight = camera.camera_from_world.transform_point3(*vertex);
            (sight.z > NEAR).then(|| (sight.truncate() / sight.z * focal + centre, 1.0 / sight.z))
        })
        .collect();
    for (name, face) in (0_u32..).zip(faces) {
        let [Some(a), Some(b), Some(c)] = face.map(|v| seen.get(v as usize).copied().flatten())
        else {
            continue;
        };
        drawn.triangle(name, [a, b, c]);
    }
    drawn
}

impl Drawn {
    /// Whether something is drawn at a point; nothing is outside of the picture.
    #[must_use]
    pub fn covers(&self, point: DVec2) -> bool {
        self.pixel(point)
            .is_some_and(|pixel| self.nearness[pixel] > 0.0)
    }

    /// The pixel that contains a point.
    #[must_use]
    pub fn pixel(&self, point: DVec2) -> Option<usize> {
        let size = DVec2::new(self.width as f64, self.height as f64);
        (point.cmpge(DVec2::ZERO).all() && point.cmplt(size).all())
            .then(|| whole(point.y) * self.width + whole(point.x))
    }

    fn triangle(&mut self, name: u32, [(a, near_a), (b, near_b), (c, near_c)]: [(DVec2, f64); 3]) {
        let area = (b - a).perp_dot(c - a);
        let (low, high) = (a.min(b).min(c), a.max(b).max(c));
        if area == 0.0 || high.x < 0.0 || high.y < 0.0 {
            return;
        }
        let (left, right) = (whole(low.x), (whole(high.x) + 1).min(self.width));
        for y in whole(low.y)..(whole(high.y) + 1).min(self.height) {
            for x in left..right {
                let point = DVec2::new(x as f64 + 0.5, y as f64 + 0.5);
                let share_b = (point - a).perp_dot(c - a) / area;
                let share_c = (b - a).perp_dot(point - a) / area;
                if share_b >= 0.0 && share_c >= 0.0 && share_b + share_c <= 1.0 {
                    // One over the depth is linear in the picture.
                    let near = near_a + share_b * (near_b - near_a) + share_c * (near_c - near_a);
                    let at = y * self.width + x;
                    #[expect(clippy::cast_possible_truncation, reason = "a depth of metres")]
                    let near = near as f32;
                    if near > self.nearness[at] {
                        self.nearness[at] = near;
                        self.face[at] = name;
                    }
                }
            }
        }
    }
}

/// The whole part; 0 for what is less or no number.
fn whole(value: f64) -> usize {
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "saturates, and what is no number becomes 0"
    )]
    let whole = value as usize;
    whole
}
