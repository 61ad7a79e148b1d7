//! Gaussians bound to a skinned mesh, posed on the device: they are never uploaded.
//!
//! A [`BoundMesh`] is uploaded once; each pose after it is its mesh, its joints and its controllers' potentials
//! ([`PosedInput`]), a quarter of a megabyte for a person of 60,000 Gaussians. Three compute passes make a *state* of it
//! and, for each picture, Gaussians between two states (paper, sections IV-B and V). Where the mesh and the
//! potentials come from is not known here.

mod bound_mesh;
mod input;
mod mesh_buffers;
mod passes;
mod poser;

pub use bound_mesh::{BoundMesh, BoundMeshParts, DetailLevel};
pub use input::{PosedInput, StateId};
pub(crate) use passes::{Interpolation, Posing};
pub use poser::{Poser, PosingTimes};
