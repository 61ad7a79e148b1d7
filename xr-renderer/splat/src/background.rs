//! A static scene packed for the device: 20 bytes a Gaussian, relative to a block of 256 neighbours, and one byte for
//! each coefficient of its spherical harmonics.
//!
//! Packed once, on the host, and kept there: a device that was lost is filled again from it.

use bytemuck::{Pod, Zeroable};
use rayon::prelude::*;
use shaders_spirv::{quantised, smallest_three};
use splat_scene::{Bounds, Scene};

/// Gaussians whose numbers are stored relative to one another; `BLOCK` in `shaders/project_background.comp`.
const BLOCK: usize = 256;
/// Blocks in one buffer: 48 bytes of harmonics for each Gaussian stay below the 128 MiB that every device binds.
const CHUNK_BLOCKS: usize = 8192;

/// What one block's Gaussians are stored relative to; `Block` in the shader.
#[derive(Debug, Clone, Copy, Pod, Zeroable)]
#[repr(C)]
pub(crate) struct Block {
    /// Least position on each axis, metres.
    origin: [f32; 3],
    /// Farthest from its centre that any of the Gaussians could still show, metres.
    reach: f32,
    /// Metres of one position step on each axis.
    position_step: [f32; 3],
    /// Least logarithm (base 2) of a scale, and its step.
    scale_least: f32,
    scale_step: f32,
    /// Least colour coefficient, and its step.
    colour_least: f32,
    colour_step: f32,
    /// Not read.
    padding_0: f32,
    /// Steps of the coefficients of degree 1, 2 and 3, each about half as large as those before it.
    harmonics_steps: [f32; 3],
    /// Not read.
    padding_1: f32,
}

/// Position 3 x 16 bits, scale 3 x 12, rotation 2 + 3 x 12, opacity 8, colour 3 x 10.
pub(crate) type PackedStatic = [u32; 5];

/// As much of a background as one set of buffers holds.
#[derive(Debug, Clone)]
pub(crate) struct Chunk {
    pub(crate) blocks: Vec<Block>,
    pub(crate) gaussians: Vec<PackedStatic>,
    /// Words of harmonics, [`harmonics_words`] for each Gaussian.
    pub(crate) harmonics: Vec<u32>,
}

/// A static scene, packed.
#[derive(Debug, Clone)]
pub struct Background {
    chunks: Vec<Chunk>,
    count: u32,
    sh_degree: u8,
}

impl Background {
    /// Packs a scene: neighbours together, positions to 1/65,536 of their block's box (a few micrometres in a room),
    /// scales to 0.1 %, rotations to 0.02 degrees, colours and harmonics to a small part of the block's range.
    #[must_use]
    pub fn pack(scene: &Scene) -> Self {
        Self::pack_in_chunks(scene, CHUNK_BLOCKS)
    }

    fn pack_in_chunks(scene: &Scene, chunk_blocks: usize) -> Self {
        let words = harmonics_words(scene.sh_degree());
        let chunks = neighbours_together(scene)
            .par_chunks(chunk_blocks)
            .map(|members| {
                let blocks: Vec<_> = members
                    .par_iter()
                    .map(|members| pack_block(scene, members, words))
                    .collect();
                let places = blocks.len() * BLOCK;
                let mut chunk = Chunk {
                    blocks: Vec::with_capacity(blocks.len()),
                    gaussians: Vec::with_capacity(places),
                    harmonics: Vec::with_capacity(places * words),
                };
                for (block, gaussians, harmonics) in blocks {
                    // A block that is not full is filled with what is wholly transparent.
                    let start = chunk.blocks.len() * BLOCK;
                    chunk.gaussians.resize(start, [0; 5]);
                    chunk.harmonics.resize(start * words, 0);
                    chunk.blocks.push(block);
                    chunk.gaussians.extend(gaussians);
                    chunk.harmonics.extend(harmonics);
                }
                chunk
            })
            .collect();
        Self {
            chunks,
            // A scene has at most 4,194,304 Gaussians.
            count: u32::try_from(scene.len()).unwrap_or(u32::MAX),
            sh_degree: scene.sh_degree(),
        }
    }

    /// The number of Gaussians.
    #[must_use]
    pub fn len(&self) -> u32 {
        self.count
    }

    /// Whether there is no Gaussian at all.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.count == 0
    }

    /// Bytes it takes on the device.
    #[must_use]
    pub fn bytes(&self) -> u64 {
        let bytes = |chunk: &Chunk| {
            size_of_val(&chunk.blocks[..])
                + size_of_val(&chunk.gaussians[..])
                + size_of_val(&chunk.harmonics[..])
        };
        self.chunks.iter().map(|chunk| bytes(chunk) as u64).sum()
    }

    /// Gaussians as the device counts them, with those that fill blocks.
    pub(crate) fn padded_count(&self) -> u32 {
        let places: usize = self.chunks.iter().map(|chunk| chunk.gaussians.len()).sum();
        u32::try_from(places).unwrap_or(u32::MAX)
    }

    pub(crate) fn chunks(&self) -> &[Chunk] {
        &self.chunks
    }

    /// Words of harmonics for each Gaussian.
    #[expect(clippy::cast_possible_truncation, reason = "at most 12")]
    pub(crate) fn harmonics_words(&self) -> u32 {
        harmonics_words(self.sh_degree) as u32
    }
}

/// Coefficients of degree 1 up to `degree`, red, green and blue, in bytes of whole words.
fn harmonics_words(degree: u8) -> usize {
    let coefficients = (usize::from(degree) + 1).pow(2) - 1;
    (3 * coefficients).div_ceil(4)
}

/// Blocks of at most [`BLOCK`] indices of a scene's Gaussians along a Morton curve, so that each is compact: culled as
/// one, and finely resolved by a few bits. Ties keep their order.
///
/// Far Gaussians have blocks of their own, since a single stray would cost its neighbours their resolution: around the box of
/// most, shells that are twice as large each, no block in two of them.
fn neighbours_together(scene: &Scene) -> Vec<Vec<u32>> {
    let Some(Bounds { min, max }) = scene.robust_bounds() else {
        return Vec::new();
    };
    let cells = 1024.0;
    let half = [0, 1, 2].map(|axis: usize| (0.5 * (max[axis] - min[axis])).max(f32::MIN_POSITIVE));
    let largest = half.into_iter().fold(f32::MIN_POSITIVE, f32::max);
    let mut keyed: Vec<(u32, u32, u32)> = scene
        .positions()
        .par_iter()
        .enumerate()
        .map(|(index, position)| {
            let way = [0, 1, 2].map(|axis: usize| position[axis] - 0.5 * (min[axis] + max[axis]));
            let out = way.into_iter().fold(0.0f32, |out, way| out.max(way.abs())) / largest;
            let shell = quantised(out.log2().ceil() - 1.0, 64.0);
            let cell = |axis: usize| {
                // Within the innermost shell, what is outside of the box of most shares its border.
                let half = if shell == 0 {
                    half[axis]
                } else {
                    out * largest
                };
                quantised((0.5 + 0.5 * way[axis] / half) * cells, cells - 1.0)
            };
            let code = spread(cell(0)) | (spread(cell(1)) << 1) | (spread(cell(2)) << 2);
            (shell, code, u32::try_from(index).unwrap_or(u32::MAX))
        })
        .collect();
    keyed.par_sort_unstable();
    keyed
        .chunk_by(|(shell, ..), (next, ..)| shell == next)
        .flat_map(|shell| shell.chunks(BLOCK))
        .map(|block| block.iter().map(|(.., index)| *index).collect())
        .collect()
}

/// The lower 10 bits of a number, two zeros between each and the next.
fn spread(value: u32) -> u32 {
    let mut bits = value & 0x3FF;
    bits = (bits | (bits << 16)) & 0x0300_00FF;
    bits = (bits | (bits << 8)) & 0x0300_F00F;
    bits = (bits | (bits << 4)) & 0x030C_30C3;
    (bits | (bits << 2)) & 0x0924_9249
}

/// Values between a least one and a greatest, in steps.
struct Steps {
    least: f32,
    step: f32,
    most: f32,
}

impl Steps {
    fn around(values: impl Iterator<Item = f32>, most: f32) -> Self {
        let (least, greatest) = values.fold((f32::MAX, f32::MIN), |(least, greatest), value| {
            (least.min(value), greatest.max(value))
        });
        let step = ((greatest - least) / most).max(f32::MIN_POSITIVE);
        Self { least, step, most }
    }

    fn of(&self, value: f32) -> u32 {
        quantised((value - self.least) / self.step, self.most)
    }
}

/// One block; `members` are indices of the scene's Gaussians, at least one.
#[expect(
    clippy::indexing_slicing,
    reason = "members index the scene they were made from; all its arrays have one length"
)]
fn pack_block(
    scene: &Scene,
    members: &[u32],
    words: usize,
) -> (Block, Vec<PackedStatic>, Vec<u32>) {
    let each = || members.iter().map(|index| *index as usize);
    let log2_scales =
        |index: usize| scene.log_scales()[index].map(|log| log * std::f32::consts::LOG2_E);
    let positions: [Steps; 3] = std::array::from_fn(|axis| {
        Steps::around(each().map(|index| scene.positions()[index][axis]), 65_535.0)
    });
    let scales = Steps::around(each().flat_map(log2_scales), 4095.0);
    let colours = Steps::around(each().flat_map(|index| scene.colours()[index]), 1023.0);
    let rest = scene.rest_coefficients() * 3;
    let rest_of = |index: usize| &scene.sh_rest()[index * rest..(index + 1) * rest];
    let harmonics_steps = [0..9, 9..24, 24..45].map(|band| {
        let values = each().flat_map(|index| rest_of(index).get(band.clone()).unwrap_or_default());
        let largest = values.fold(0.0f32, |largest, value| largest.max(value.abs()));
        (largest / 127.0).max(f32::MIN_POSITIVE)
    });

    let gaussians = each().map(|index| {
        let position = scene.positions()[index];
        let [px, py, pz]: [u32; 3] = std::array::from_fn(|axis| positions[axis].of(position[axis]));
        let [sx, sy, sz] = log2_scales(index).map(|log| scales.of(log));
        let (largest, [a, b, c]) = smallest_three(scene.rotations()[index], 4094.0);
        let alpha = quantised(scene.opacities()[index] * 255.0, 255.0);
        let [red, green, blue] = scene.colours()[index].map(|value| colours.of(value));
        [
            px | (py << 16),
            pz | (alpha << 16) | (sz << 24),
            sx | (sy << 12) | ((sz >> 8) << 24) | (a << 28),
            (a >> 4) | (b << 8) | (c << 20),
            red | (green << 10) | (blue << 20) | (largest << 30),
        ]
    });
    let gaussians = gaussians.collect();
    let harmonics = each().flat_map(|index| {
        let [first, second, third] = harmonics_steps;
        let steps = std::iter::repeat_n(first, 9)
            .chain(std::iter::repeat_n(second, 15))
            .chain(std::iter::repeat_n(third, 21));
        let mut bytes =
            (rest_of(index).iter().zip(steps)).map(|(value, step)| signed_byte(value / step));
        (0..words)
            .map(|_| u32::from_le_bytes(std::array::from_fn(|_| bytes.next().unwrap_or_default())))
            .collect::<Vec<_>>()
    });
    let harmonics = harmonics.collect();
    let greatest_scale = (scales.least + scales.step * scales.most).exp2();
    let block = Block {
        origin: [0, 1, 2].map(|axis: usize| positions[axis].least),
        // Where even an opaque Gaussian is cut off, and a little for rounding.
        reach: 1.01 * (-2.0 * shaders_spirv::ALPHA_CUT.ln()).sqrt() * greatest_scale,
        position_step: [0, 1, 2].map(|axis: usize| positions[axis].step),
        scale_least: scales.least,
        scale_step: scales.step,
        colour_least: colours.least,
        colour_step: colours.step,
        padding_0: 0.0,
        harmonics_steps,
        padding_1: 0.0,
    };
    (block, gaussians, harmonics)
}

#[expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "held within -127..=127 first; the sign lies in the byte's bits"
)]
fn signed_byte(value: f32) -> u8 {
    (value.round().clamp(-127.0, 127.0) as i8) as u8
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use glam::Vec3;
    use splat_scene::{SceneBuilder, Splat};

    use super::*;
    use crate::camera::Camera;
    use crate::options::{BackEnd, RendererOptions};
    use crate::renderer::SplatRenderer;
    use crate::testing::open_gpu;

    /// A helix of 1,500 splats whose colour depends on the direction of view.
    fn helix() -> Scene {
        let mut builder = SceneBuilder::new(1).expect("degree 1");
        for step in 0u16..1_500 {
            let turn = f32::from(step) * 0.05;
            let splat = Splat {
                position: [turn.cos(), turn / 40.0 - 0.9, turn.sin()],
                rotation: glam::Quat::from_rotation_y(turn).to_array(),
                log_scale: [-3.0, -3.5, -4.0],
                opacity: 0.7,
                colour: [turn.sin(), 0.2, turn.cos()],
            };
            builder.push(&splat, &[0.3; 9]).expect("a splat fits");
        }
        builder.finish()
    }

    #[test]
    fn a_scene_in_many_chunks_makes_the_picture_of_the_scene_in_one() {
        let Some(gpu) = open_gpu() else { return };
        let camera = Camera::look_at(Vec3::new(0.3, 0.4, 3.5), Vec3::ZERO, Vec3::Y, 0.7, 160, 120);
        let scene = helix();
        let pictures = [CHUNK_BLOCKS, 1, 2].map(|chunk_blocks| {
            let background = Background::pack_in_chunks(&scene, chunk_blocks);
            let expected = scene.len().div_ceil(BLOCK).div_ceil(chunk_blocks);
            assert!(background.chunks().len() >= expected, "chunks");
            let options = RendererOptions {
                background: Some(Arc::new(background)),
                back_end: Some(BackEnd::Tiles),
                ..RendererOptions::new(0, 160, 120, 1)
            };
            let mut renderer = SplatRenderer::new(Arc::clone(&gpu), &options).expect("a renderer");
            renderer.draw(&[camera]).expect("a picture");
            renderer.read_back(0).expect("a view")
        });
        let drawn = pictures[0].pixels().iter().filter(|pixel| pixel[3] > 0.3);
        assert!(drawn.count() > 2_000, "a helix");
        assert!(pictures[1] == pictures[0], "one block to a chunk");
        assert!(pictures[2] == pictures[0], "two blocks to a chunk");
        assert_eq!(gpu.validation_messages(), 0, "validation messages");
    }
}
