//! The soft shadow that a person casts straight down, as a few flat Gaussians on the floor: drawn and sorted with the people,
//! over any background or none.

use super::standing::{BODY_JOINTS, SOLE_POINTS, Standing};
use bytemuck::Zeroable;
use glam::{Affine3A, Quat, Vec3};
use renderer_splat::gaussian::{ALPHA_CUT, PackedGaussian};
use spmm3::Joint;

/// The most Gaussians of one person's shadow.
pub const SHADOW_GAUSSIANS: usize = 2 * (BODY_JOINTS - FEET) + 2 * SOLE_POINTS;

/// Joints whose shadow is that of the soles: ankles and balls.
const FEET: usize = 4;
/// Of a shadow's Gaussian in two, in its standard deviations: theirs, and how far each lies off the middle. Pairs that lie
/// all ways have the same variance on average.
const HALF_WIDTH: f32 = 0.7;
const HALF_ASIDE: f32 = 1.0;
/// From one pair's direction to the next, radians: the golden angle.
const NEXT: f32 = 2.399_963;

/// Above the floor, metres, so that the floor does not swallow it.
const HEIGHT: f32 = 0.004;
/// Standard deviation across the floor, metres.
const THICKNESS: f32 = 0.000_5;

/// A kind of point that casts a shadow.
struct Caster {
    /// Standard deviation where it touches the floor, metres, and how much it grows with each metre of height.
    radius: f32,
    growth: f32,
    /// Opacity where it touches the floor; higher up the same shade is spread over a wider spot.
    opacity: f32,
}

/// As the studio's: a joint is the middle of a limb. Drawn in halves, since a floor of Gaussians hides what lies before the
/// middle of each: many middles leave no edge.
const JOINT: Caster = Caster {
    radius: 0.06,
    growth: 0.14,
    opacity: 0.36,
};
/// Small, since Gaussians are sorted by their middle: a wide one would be drawn over the shoe that stands behind it.
const SOLE: Caster = Caster {
    radius: 0.034,
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

    fn add(&mut self, at: Vec3, radius: f32, opacity: f32) {
        if let Some(place) = self.gaussians.get_mut(self.count)
            && opacity >= ALPHA_CUT
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

impl Caster {
    /// Standard deviation (metres) and opacity of the shadow of a point so high (metres).
    fn shadow(&self, height: f32) -> (f32, f32) {
        let radius = self.radius + self.growth * height.max(0.0);
        (radius, self.opacity * (self.radius / radius).powi(2))
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
    for (k, (joint, at)) in Joint::ALL.iter().zip(&standing.body).enumerate() {
        let is_foot = matches!(
            joint,
            Joint::LeftAnkle | Joint::LeftFoot | Joint::RightAnkle | Joint::RightFoot
        );
        if !is_foot {
            let (radius, opacity) = JOINT.shadow(at.y);
            let aside = Quat::from_rotation_y(NEXT * k as f32) * Vec3::X * radius * HALF_ASIDE;
            // Half the shade each, on half the floor.
            let opacity = opacity * 0.5 / (HALF_WIDTH * HALF_WIDTH);
            for at in [*at + aside, *at - aside] {
                let at = floor_from_person.transform_point3(at);
                shadow.add(at, radius * HALF_WIDTH, opacity);
            }
        }
    }
    for sole in standing.soles.as_flattened() {
        let (radius, opacity) = SOLE.shadow(sole.y);
        shadow.add(floor_from_person.transform_point3(*sole), radius, opacity);
    }
    shadow
}
