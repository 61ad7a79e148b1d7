//! What stands behind the splatted picture: a studio, or darkness around a scene.
//!
//! The studio a person is shown in: a floor, a soft horizon, and a shadow under the feet, so that the eye sees where the
//! person stands. Drawn on the CPU behind the splatted picture; the receiver itself never does this.

use glam::{Vec2, Vec3};
use rayon::prelude::*;
use renderer_splat::camera::Camera;
use renderer_splat::picture::{Backdrop, Image};

/// Side of the shadow map on the floor, cells and metres.
const CELLS: usize = 96;
const SIDE: f32 = 4.0;

const SKY: Vec3 = Vec3::new(0.80, 0.83, 0.87);
const HORIZON: Vec3 = Vec3::new(0.90, 0.91, 0.92);
const FLOOR: Vec3 = Vec3::new(0.70, 0.71, 0.73);

/// Behind a scene, whose own colours are to be seen: a dusk that fades upwards.
pub(crate) const DUSK: Backdrop = Backdrop::Gradient {
    top: [0.03, 0.035, 0.05],
    bottom: [0.13, 0.14, 0.16],
};

/// Darkness of the floor around one pose.
#[derive(Debug)]
pub(crate) struct Shadow {
    corner: Vec2,
    darkness: Vec<f32>,
}

impl Shadow {
    /// The soft shadow that points of the body (metres, world) cast straight down: sharp and dark where they touch the
    /// floor, wide and faint higher up.
    pub(crate) fn of(body: &[Vec3]) -> Self {
        let sum = body
            .iter()
            .fold(Vec2::ZERO, |sum, p| sum + Vec2::new(p.x, p.z));
        let corner = sum / body.len().max(1) as f32 - SIDE / 2.0;
        let darkness = (0..CELLS * CELLS)
            .into_par_iter()
            .map(|cell| {
                let at = corner
                    + Vec2::new((cell % CELLS) as f32, (cell / CELLS) as f32)
                        * (SIDE / (CELLS - 1) as f32);
                let covered: f32 = body
                    .iter()
                    .map(|p| {
                        let height = p.y.max(0.0);
                        let radius = 0.06 + 0.14 * height;
                        let share = 0.5 * (0.06 / radius).powi(2);
                        share
                            * (-at.distance_squared(Vec2::new(p.x, p.z)) / (2.0 * radius * radius))
                                .exp()
                    })
                    .sum();
                1.0 - (-covered).exp()
            })
            .collect();
        Self { corner, darkness }
    }

    fn at(&self, point: Vec2) -> f32 {
        let cell = (point - self.corner) * ((CELLS - 1) as f32 / SIDE);
        let inside =
            cell.cmpge(Vec2::ZERO).all() && cell.cmplt(Vec2::splat((CELLS - 1) as f32)).all();
        if !inside {
            return 0.0;
        }
        let (low, part) = (cell.floor(), cell.fract());
        #[allow(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "inside the map, checked above"
        )]
        let first = low.y as usize * CELLS + low.x as usize;
        let d = |offset: usize| self.darkness.get(first + offset).copied().unwrap_or(0.0);
        let near = d(0) + (d(1) - d(0)) * part.x;
        let far = d(CELLS) + (d(CELLS + 1) - d(CELLS)) * part.x;
        near + (far - near) * part.y
    }
}

/// Puts the splatted picture (premultiplied) before the studio and returns 8-bit RGB rows.
pub(crate) fn compose(picture: &Image, camera: &Camera, shadow: &Shadow) -> Vec<u8> {
    let width = camera.width as usize;
    let world_from_camera = camera.camera_from_world.inverse();
    let eye: Vec3 = world_from_camera.transform_point3(Vec3::ZERO);
    let mut rgb = vec![0u8; width * camera.height as usize * 3];
    rgb.par_chunks_mut(width * 3)
        .enumerate()
        .for_each(|(y, row)| {
            for (x, out) in row.chunks_exact_mut(3).enumerate() {
                let [r, g, b, alpha] = picture.pixels()[y * width + x];
                let behind = if alpha < 0.999 {
                    let ray = Vec3::new(
                        (x as f32 + 0.5 - camera.cx) / camera.fx,
                        -(y as f32 + 0.5 - camera.cy) / camera.fy,
                        -1.0,
                    );
                    studio(
                        eye,
                        world_from_camera.transform_vector3(ray).normalize(),
                        shadow,
                    )
                } else {
                    Vec3::ZERO
                };
                let colour = Vec3::new(r, g, b) + behind * (1.0 - alpha.min(1.0));
                for (channel, value) in out.iter_mut().zip(colour.to_array()) {
                    #[allow(
                        clippy::cast_possible_truncation,
                        clippy::cast_sign_loss,
                        reason = "clamped to 0..=255"
                    )]
                    let byte = (value.clamp(0.0, 1.0) * 255.0 + 0.5) as u8;
                    *channel = byte;
                }
            }
        });
    rgb
}

/// Colour of the empty studio along a ray.
fn studio(eye: Vec3, ray: Vec3, shadow: &Shadow) -> Vec3 {
    let wall = HORIZON.lerp(SKY, (ray.y * 1.6).clamp(0.0, 1.0));
    if ray.y >= -1e-4 || eye.y <= 0.0 {
        return wall;
    }
    let hit = eye + ray * (eye.y / -ray.y);
    let point = Vec2::new(hit.x, hit.z);
    // Near the person the floor is plain; towards the horizon it melts into the wall.
    let far = (hit.distance(eye) / 14.0).clamp(0.0, 1.0);
    FLOOR.lerp(HORIZON, far.sqrt()) * (1.0 - 0.72 * shadow.at(point))
}
