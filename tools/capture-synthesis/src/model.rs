//! What is drawn of a person whatever the pose: materials of the triangles, and how much light reaches vertices in sockets and in the mouth.

use crate::error::SynthesisError;
use crate::texture::Pyramid;
use glam::{Vec2, Vec3};
use reconstruct::{Part, Person};

/// The teeth's texture is whiter than a mouth lets them be.
const TEETH_TINT: Vec3 = Vec3::new(1.0, 0.97, 0.92);

/// How far behind the front teeth the mouth is dark, metres, and how dark: too fine for the light's maps.
const DARK_MOUTH: f32 = 0.028;
const MOUTH_LOSS: f32 = 0.75;

/// How a triangle is painted.
#[derive(Debug, Clone)]
pub struct Material {
    /// Index in [`Model::textures`].
    pub texture: usize,
    /// At the corners, v up.
    pub uvs: [Vec2; 3],
    /// Its area on the texture at full size, texels.
    pub texels: f32,
    /// The texture's alpha times this is the share of samples where the triangle is opaque; without it the whole triangle is.
    pub strands: Option<f32>,
    /// Whether it holds back the key light.
    pub casts: bool,
    /// Whether it mirrors the key light, as a wet eye does.
    pub wet: bool,
    /// Factor of the texture's colour.
    pub tint: Vec3,
}

/// How light reaches a vertex besides by its place.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Shade {
    /// How much of the sky's shading the vertex takes, 0..=1.
    pub strength: f32,
    /// The least factor of the sky's light.
    pub floor: f32,
    /// Factor of all light: the mouth's depth.
    pub depth: f32,
}

/// A person's triangles with their materials.
#[derive(Debug, Clone)]
pub struct Model {
    /// `[N_f]` corners.
    pub faces: Vec<[u32; 3]>,
    /// `[N_f]`
    pub materials: Vec<Material>,
    /// `[N_v]`
    pub shades: Vec<Shade>,
    /// Each texture once.
    pub textures: Vec<Pyramid>,
}

/// What of a part's texture is strands, and how dense: hair, brows and lashes are cards.
fn strands(part: Part) -> Option<f32> {
    match part {
        Part::Hair => Some(1.0),
        Part::Brows => Some(0.75),
        Part::Lashes => Some(0.8),
        _ => None,
    }
}

fn casts(part: Part) -> bool {
    !matches!(
        part,
        Part::Brows | Part::Lashes | Part::Eyes | Part::Teeth | Part::Tongue
    )
}

fn shade(part: Part) -> (f32, f32) {
    match part {
        // Eyes in their sockets would go dull, an open mouth black: the sky's maps are coarser than both.
        Part::Eyes => (0.35, 0.8),
        Part::Lashes | Part::Brows => (0.5, 0.7),
        Part::Teeth => (0.6, 0.9),
        Part::Tongue => (0.8, 0.5),
        _ => (1.0, 0.2),
    }
}

/// Twice the area of a triangle in the plane.
fn doubled_area([a, b, c]: [Vec2; 3]) -> f32 {
    (b - a).perp_dot(c - a).abs()
}

impl Model {
    /// Takes a person's materials.
    ///
    /// # Errors
    /// If a texture has no texels.
    pub fn new(person: &Person) -> Result<Self, SynthesisError> {
        // Many parts share a texture, which is the largest thing here.
        let mut sources = Vec::new();
        let mut textures = Vec::new();
        let mut of_part = Vec::new();
        for part in Part::ALL {
            let texture = person.texture(part);
            let known = sources.iter().position(|source| *source == texture);
            of_part.push(match known {
                Some(index) => index,
                None => {
                    let pyramid = Pyramid::of(texture).ok_or(SynthesisError::Texture(part))?;
                    sources.push(texture);
                    textures.push(pyramid);
                    textures.len() - 1
                }
            });
        }
        let materials = (person.parts().iter().zip(person.uvs()))
            .map(|(part, uvs)| {
                let texture = of_part[part.index()];
                let [width, height] = textures[texture].size();
                let scale = Vec2::new(width as f32, height as f32);
                Material {
                    texture,
                    uvs: *uvs,
                    texels: 0.5 * doubled_area(uvs.map(|uv| uv * scale)),
                    strands: strands(*part),
                    casts: casts(*part),
                    wet: *part == Part::Eyes,
                    tint: if *part == Part::Teeth {
                        TEETH_TINT
                    } else {
                        Vec3::ONE
                    },
                }
            })
            .collect();
        let template = person.template();
        let parts = person.vertex_parts();
        let front_teeth = (template.vertices().iter().zip(&parts))
            .filter(|(_, part)| **part == Part::Teeth)
            .map(|(vertex, _)| vertex.z)
            .fold(f32::NEG_INFINITY, f32::max);
        let shades = (template.vertices().iter().zip(&parts))
            .map(|(vertex, part)| {
                let (strength, floor) = shade(*part);
                let in_mouth = matches!(part, Part::Teeth | Part::Tongue);
                let depth = if in_mouth {
                    1.0 - MOUTH_LOSS * ((front_teeth - vertex.z) / DARK_MOUTH).clamp(0.0, 1.0)
                } else {
                    1.0
                };
                Shade {
                    strength,
                    floor,
                    depth,
                }
            })
            .collect();
        Ok(Self {
            faces: template.faces().to_vec(),
            materials,
            shades,
            textures,
        })
    }

    /// The texture's colour (display values 0..=1) and alpha at shares of a triangle's second and third corner.
    #[must_use]
    pub fn paint(&self, face: usize, shares: [f32; 2], level: f32) -> (Vec3, f32) {
        let material = &self.materials[face];
        let [a, b, c] = material.uvs;
        let uv = a + (b - a) * shares[0] + (c - a) * shares[1];
        let texel = self.textures[material.texture].sample(uv, level);
        (texel.truncate() * material.tint, texel.w)
    }
}
