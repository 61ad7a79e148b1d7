//! The soft shadow that a person casts straight down, as a few flat Gaussians on the floor: drawn and sorted with the people,
//! over any background or none.

use super::standing::{BODY_JOINTS, SOLE_POINTS, Standing};
use bytemuck::Zeroable;
use glam::{Affine3A, Quat, Vec3};
use spmm3::Joint;
use xr_renderer::PackedGaussian;

/// The most Gaussians of one person's shadow.
pub const SHADOW_GAUSSIANS: usize = BODY_JOINTS + 2 * SOLE_POINTS;

/// Above the floor, metres, so that the floor does not swallow it.
const HEIGHT: f32 = 0.004;
/// Standard deviation across the floor, metres.
const THICKNESS: f32 = 0.000_5;
/// What is drawn at all: the renderer's own cut.
const LEAST: f32 = 1.0 / 255.0;

/// A kind of point that casts a shadow.
struct Caster {
    /// Standard deviation where it touches the floor, metres, and how much it grows with each metre of height.
    radius: f32,
    growth: f32,
    /// Opacity where it touches the floor; higher up the same shade is spread over a wider spot.
    opacity: f32,
}

/// As the studio's: a joint is the middle of a limb.
const JOINT: Caster = Caster {
    radius: 0.06,
    growth: 0.14,
    opacity: 0.36,
};
/// Small, since Gaussians are sorted by their middle: a wide one would be drawn over the shoe that stands behind it.
const SOLE: Caster = Caster {
    radius: 0.036,
    growth: 0.3,
    opacity: 0.3,
};

/// One person's shadow.
#[derive(Debug, Clone, Copy)]
pub struct ContactShadow {
    gaussians: [PackedGaussian; SHADOW_GAUSSIANS],
    count: usize,
}

impl ContactShadow {
    /// What there is to draw, in floor space.
    #[must_use]
    pub fn gaussians(&self) -> &[PackedGaussian] {
        self.gaussians.get(..self.count).unwrap_or_default()
    }

    fn add(&mut self, at: Vec3, caster: &Caster) {
        let radius = caster.radius + caster.growth * at.y.max(0.0);
        let opacity = caster.opacity * (caster.radius / radius).powi(2);
        if let Some(place) = self.gaussians.get_mut(self.count)
            && opacity >= LEAST
        {
            *place = PackedGaussian::new(
                [at.x, HEIGHT, at.z],
                Quat::IDENTITY.to_array(),
                [radius, THICKNESS, radius].map(f32::log2),
                opacity,
                [0.0; 3],
            );
            self.count += 1;
        }
    }
}

/// The shadow of a person who stands so in motion space, for where [`super::Presence`] put them: black, dark and narrow
/// below what touches the floor, faint and wide below what is high. Does not allocate.
#[must_use]
pub fn contact_shadow(standing: &Standing, floor_from_person: &Affine3A) -> ContactShadow {
    let mut shadow = ContactShadow {
        gaussians: [PackedGaussian::zeroed(); SHADOW_GAUSSIANS],
        count: 0,
    };
    for (joint, at) in Joint::ALL.iter().zip(&standing.body) {
        let is_foot = matches!(
            joint,
            Joint::LeftAnkle | Joint::LeftFoot | Joint::RightAnkle | Joint::RightFoot
        );
        if !is_foot {
            shadow.add(floor_from_person.transform_point3(*at), &JOINT);
        }
    }
    for sole in standing.soles.as_flattened() {
        shadow.add(floor_from_person.transform_point3(*sole), &SOLE);
    }
    shadow
}
