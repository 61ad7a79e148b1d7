//! Where a scene goes around a person, as `--place` says it.

use anyhow::{Context, bail};
use glam::{Quat, Vec3};
use std::str::FromStr;

/// `X,Y,Z[,DEGREES[,SCALE]]`: the scene is scaled, turned about the vertical, and moved.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Place {
    /// Where the scene's origin comes to lie, metres, seen from the person's first standing place: +x the person's left,
    /// +z ahead of them; y raises the ground above the feet.
    pub(crate) offset: Vec3,
    /// To the left, seen from above.
    pub(crate) degrees: f32,
    /// Metres of one of the scene's units.
    pub(crate) scale: f32,
}

impl Default for Place {
    fn default() -> Self {
        Self {
            offset: Vec3::ZERO,
            degrees: 0.0,
            scale: 1.0,
        }
    }
}

impl Place {
    pub(crate) fn turn(&self) -> Quat {
        Quat::from_rotation_y(self.degrees.to_radians())
    }
}

impl std::fmt::Display for Place {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let Vec3 { x, y, z } = self.offset;
        write!(f, "{x},{y},{z},{},{}", self.degrees, self.scale)
    }
}

impl FromStr for Place {
    type Err = anyhow::Error;

    fn from_str(text: &str) -> anyhow::Result<Self> {
        let numbers: Vec<f32> = text
            .split(',')
            .map(|number| {
                let value = number.trim().parse::<f32>().ok();
                value
                    .filter(|value| value.abs() <= 1e6)
                    .with_context(|| {
                        format!("{number} is not a number up to a million; give X,Y,Z[,DEGREES[,SCALE]], e.g. 0.9,0,-0.6,20")
                    })
            })
            .collect::<anyhow::Result<_>>()?;
        let (offset, degrees, scale) = match numbers[..] {
            [x, y, z] => ([x, y, z], 0.0, 1.0),
            [x, y, z, degrees] => ([x, y, z], degrees, 1.0),
            [x, y, z, degrees, scale] => ([x, y, z], degrees, scale),
            _ => bail!(
                "{text} is not X,Y,Z or X,Y,Z,DEGREES or X,Y,Z,DEGREES,SCALE, e.g. 0.9,0,-0.6,20"
            ),
        };
        if !(1e-3..=1e3).contains(&scale) {
            bail!("a scale of {scale} is outside 0.001..1000");
        }
        Ok(Self {
            offset: offset.into(),
            degrees,
            scale,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_place_may_leave_out_its_turn_and_its_scale() {
        let read = |text: &str| text.parse::<Place>().expect("a place");
        let offset = Vec3::new(1.0, 0.0, -2.5);
        let plain = Place {
            offset,
            ..Place::default()
        };
        assert_eq!(read("1,0,-2.5"), plain, "moved");
        let whole = Place {
            offset,
            degrees: 90.0,
            scale: 0.5,
        };
        assert_eq!(read("1,0,-2.5,90,0.5"), whole, "moved, turned and scaled");
        assert_eq!(read(&whole.to_string()), whole, "as it is written");
        for mistake in ["1,0", "1,0,x", "1,0,0,0,0", "1,0,NaN", "1,2,3,4,5,6"] {
            assert!(mistake.parse::<Place>().is_err(), "{mistake}");
        }
    }
}
