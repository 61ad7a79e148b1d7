//! Gaussians bound to a skinned mesh, posed on the device: they are never uploaded.
//!
//! A [`BoundMesh`] is uploaded once; each pose after it is its mesh, its joints and its controllers' potentials
//! ([`PosedInput`]), a quarter of a megabyte for a person of 60,000 Gaussians, or the parameters that the mesh's own networks
//! compute these from ([`BoundMesh::with_networks`]), a kilobyte. Compute passes make a *state* of it
//! and, for each picture, Gaussians between two states (paper, sections IV-B and V).

mod bound_mesh;
mod checks;
mod dispatch;
mod input;
mod interpolation;
mod mesh_buffers;
mod network_passes;
mod networks;
mod passes;
mod poser;

pub use bound_mesh::{BoundMesh, BoundMeshParts, DetailLevel};
pub use input::{Deformation, PosedInput, StateId};
pub(crate) use interpolation::Interpolation;
pub use networks::{DenseParts, NetworkParts};
pub(crate) use passes::Posing;
pub use poser::{Poser, PosingTimes};
