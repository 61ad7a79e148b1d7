//! Fits F_mesh and F_attr (paper, sections IV-A and IV-B) to simulated truth. Nothing here simulates or draws.

mod attributes;
mod deformer;
mod linear;
mod mesh;
mod perceptron;
mod pool;
mod regions;
mod scatter;
mod targets;

pub use attributes::{
    AttributeFit, AttributeOptions, Lessons, Residuals, fit_attributes, fit_residuals,
};
pub use deformer::{MeshRunner, potentials, residuals};
pub use linear::{Components, components, procrustes, ridge, solve_ridge, temporal_codes};
pub(crate) use mesh::EPOCHS as MESH_EPOCHS;
pub use mesh::{MeshFit, fit_mesh, mesh_code, mesh_offsets};
pub use perceptron::{Perceptron, Training, silu};
pub(crate) use scatter::pieces;
pub use scatter::scatter_controllers;
pub use targets::{Frame, Targets};
