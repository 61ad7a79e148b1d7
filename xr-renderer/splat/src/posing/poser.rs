//! The posing passes alone, for callers that need the Gaussians rather than a picture.

use std::sync::Arc;

use ash::vk;
use renderer_vulkan::buffer::{Buffer, MemoryUsage};
use renderer_vulkan::commands::Commands;
use renderer_vulkan::gpu::Gpu;
use renderer_vulkan::timestamps::Timestamps;
use shaders_spirv::PackedGaussian;

use super::bound_mesh::BoundMesh;
use super::input::{PosedInput, StateId};
use super::interpolation::Interpolation;
use super::passes::Posing;
use crate::error::RenderError;

/// Milliseconds the device took for the passes of the last call; 0 where its queue has no clock.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct PosingTimes {
    /// Copying new poses.
    pub upload: f64,
    /// Their networks, where the device runs them.
    pub networks: f64,
    /// Skinning their meshes.
    pub skin: f64,
    /// Residuals, and the Gaussians on the meshes.
    pub attributes: f64,
    /// Gaussians between two states.
    pub interpolate: f64,
}

/// Poses a [`BoundMesh`] on the device and brings the Gaussians back: for tests, measurements and other
/// renderers. To draw them here, give the mesh to [`RendererOptions`](crate::options::RendererOptions).
pub struct Poser {
    // Dropped first: waits for the device.
    commands: Commands,
    gpu: Arc<Gpu>,
    posing: Posing,
    read_back: Buffer,
    timestamps: Option<Timestamps<6>>,
    times: PosingTimes,
    vertices: u32,
    gaussians: u32,
}

impl std::fmt::Debug for Poser {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Poser")
            .field("gaussians", &self.gaussians)
            .field("vertices", &self.vertices)
            .finish_non_exhaustive()
    }
}

impl Poser {
    /// Uploads a mesh.
    ///
    /// # Errors
    /// More memory than the device has, or a device that fails.
    pub fn new(gpu: &Arc<Gpu>, mesh: &BoundMesh) -> Result<Self, RenderError> {
        let mut posing = Posing::new(gpu, mesh)?;
        let bytes = u64::from(mesh.gaussians()) * size_of::<PackedGaussian>() as u64;
        let bytes = bytes.max(u64::from(mesh.vertices()) * size_of::<[f32; 4]>() as u64);
        let usage = vk::BufferUsageFlags::empty();
        let read_back = Buffer::new(gpu, "posed Gaussians", bytes, usage, MemoryUsage::ReadBack)?;
        let mut commands = Commands::new(gpu)?;
        commands.run("the mesh's upload", |commands| posing.record_mesh(commands))?;
        posing.mesh_upload_done();
        Ok(Self {
            commands,
            gpu: Arc::clone(gpu),
            posing,
            read_back,
            timestamps: Timestamps::new(gpu)?,
            times: PosingTimes::default(),
            vertices: mesh.vertices(),
            gaussians: mesh.gaussians(),
        })
    }

    /// Takes a pose. Its state is kept until four more are taken.
    ///
    /// # Errors
    /// [`RenderError::PosedInput`] if its sizes are not the mesh's, or a device that fails.
    pub fn push_state(&mut self, input: &PosedInput<'_>) -> Result<StateId, RenderError> {
        self.commands.wait()?;
        self.posing.push(input)
    }

    /// The Gaussians at `share` of the way from one state to another: 0..=2.
    ///
    /// # Errors
    /// [`RenderError::NoState`] if one is not kept, or a device that fails.
    pub fn interpolate(
        &mut self,
        from: StateId,
        to: StateId,
        share: f32,
    ) -> Result<Vec<PackedGaussian>, RenderError> {
        self.interpolate_level(from, to, share, 0)
    }

    /// As [`Self::interpolate`], of the Gaussians of one level of detail: 0 for all, the last one where there are not as
    /// many.
    ///
    /// # Errors
    /// As there.
    pub fn interpolate_level(
        &mut self,
        from: StateId,
        to: StateId,
        share: f32,
        level: usize,
    ) -> Result<Vec<PackedGaussian>, RenderError> {
        self.posing
            .show(Interpolation::new(from, to, share, level))?;
        self.run(true, |posing| (posing.current(), 0))?;
        self.posing.picture_done();
        Ok(self.read_back.read(self.posing.count() as usize))
    }

    /// A state's Gaussians, as they are kept.
    ///
    /// # Errors
    /// As [`Self::interpolate`].
    pub fn state(&mut self, id: StateId) -> Result<Vec<PackedGaussian>, RenderError> {
        self.posing.check_kept(id)?;
        self.run(false, |posing| posing.state(id))?;
        Ok(self.read_back.read(self.gaussians as usize))
    }

    /// A state's vertices, metres, without the root translation.
    ///
    /// # Errors
    /// As [`Self::interpolate`].
    pub fn posed_vertices(&mut self, id: StateId) -> Result<Vec<[f32; 3]>, RenderError> {
        self.posing.check_kept(id)?;
        self.run(false, |posing| posing.posed(id))?;
        let posed: Vec<[f32; 4]> = self.read_back.read(self.vertices as usize);
        Ok(posed.into_iter().map(|[x, y, z, _]| [x, y, z]).collect())
    }

    /// How long the device took for the last call.
    #[must_use]
    pub fn times(&self) -> PosingTimes {
        self.times
    }

    /// Poses what waits, interpolates if asked to, and copies the end of a buffer back.
    fn run(
        &mut self,
        interpolates: bool,
        wanted: impl FnOnce(&Posing) -> (&Buffer, u64),
    ) -> Result<(), RenderError> {
        let (posing, read_back) = (&self.posing, &self.read_back);
        let timestamps = self.timestamps.as_ref();
        let point = |commands: vk::CommandBuffer, index: usize| {
            if let Some(timestamps) = timestamps {
                timestamps.record_point(commands, index);
            }
        };
        let (source, offset) = wanted(posing);
        self.commands.run("posing", |commands| {
            if let Some(timestamps) = timestamps {
                timestamps.record_reset(commands);
            }
            point(commands, 0);
            posing.record_upload(commands);
            point(commands, 1);
            posing.record_networks(commands);
            point(commands, 2);
            posing.record_skin(commands);
            point(commands, 3);
            posing.record_attributes(commands);
            point(commands, 4);
            if interpolates {
                posing.record_interpolation(commands);
            }
            point(commands, 5);
            posing.record_copy(commands, source, offset, read_back);
        })?;
        self.posing.states_done();
        if let Some(timestamps) = &self.timestamps {
            let ticks = timestamps.read()?;
            let pass = |index: usize| self.gpu.nanoseconds(ticks[index], ticks[index + 1]) * 1e-6;
            self.times = PosingTimes {
                upload: pass(0),
                networks: pass(1),
                skin: pass(2),
                attributes: pass(3),
                interpolate: pass(4),
            };
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::posing::Deformation;
    use crate::posing::bound_mesh::{BoundMeshParts, DetailLevel};
    use crate::testing::open_gpu;
    use half::f16;

    const ONES: [f32; 14] = [1.0; 14];

    /// One Gaussian at rest in the middle of a triangle's first edge.
    fn one_gaussian() -> BoundMesh {
        let mut attributes = [0.0; 14];
        // No turn, scales of 2^-7 m, half transparent, grey.
        attributes[6] = 1.0;
        attributes[7..10].fill(-7.0 * std::f32::consts::LN_2);
        let mut values = [0; 14];
        values[2] = 64;
        let mesh = BoundMesh::new(&BoundMeshParts {
            joints: 1,
            skin_joints: &[[0; 4]; 3],
            skin_weights: &[[1.0, 0.0, 0.0, 0.0]; 3],
            corners: &[[0, 1, 2]],
            barycentrics: &[[0.5, 0.0]],
            attributes: &attributes,
            controllers: 1,
            neighbours: &[[0; 3]],
            masses: &[[0.5, 0.25, 0.25]],
            bases: 1,
            units: &ONES,
            scales: &[f16::from_f32_const(0.125); 14],
            values: &values,
        })
        .expect("a mesh");
        let level = DetailLevel {
            kept: &[0],
            log2_growth: &[1.0],
        };
        mesh.with_levels(&[level]).expect("all of it")
    }

    #[test]
    fn poses_are_read_in_place_or_copied() {
        for shares_memory in [true, false] {
            let Some(mut gpu) = open_gpu() else { return };
            Arc::get_mut(&mut gpu)
                .expect("just opened")
                .features_mut()
                .shares_memory &= shares_memory;
            let mut poser = Poser::new(&gpu, &one_gaussian()).expect("one Gaussian");
            // The identity, then a metre up.
            let mut skinning = [0.0; 12];
            for diagonal in [0, 4, 8] {
                skinning[diagonal] = 1.0;
            }
            skinning[10] = 1.0;
            let mut states = Vec::new();
            // 64 / 8 metres along the normal for each unit of force; more poses than there are slots.
            for force in [0.0, 0.25, 0.5, 0.75, 1.0] {
                let pose = PosedInput {
                    deformation: Deformation::Computed {
                        canonical_vertices: &[0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0],
                        potentials: &[force],
                    },
                    skinning: &skinning,
                    root: [0.0, 0.0, -3.0],
                };
                states.push(poser.push_state(&pose).expect("a pose"));
            }
            let [.., from, to] = states[..] else { return };
            let got = poser.interpolate_level(from, to, 0.5, 1);
            let [packed] = got.expect("two states")[..] else {
                panic!("one Gaussian");
            };
            let got = packed.unpacked();
            assert_eq!(got.position, [0.5, 1.0, 4.0], "8 x 0.875 m - 3 m");
            assert_eq!(got.scale, [2f32.powi(-6); 3], "grown by an octave");
            assert!((got.opacity - 0.5).abs() < 1e-5, "{}", got.opacity);
            assert_eq!(got.colour, [0.5; 3], "grey");
            assert!(got.rotation[3].abs() > 0.999_999, "{:?}", got.rotation);
            assert_eq!(gpu.validation_messages(), 0, "validation messages");
        }
    }
}
