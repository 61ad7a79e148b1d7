// Included by the build script too, which defines it for the shaders.

/// A splat contributes nothing to a pixel where its opacity is less. 3DGS's value, a step of an 8-bit picture: with a lower one splats
/// reach farther.
pub const ALPHA_CUT: f32 = 1.0 / 255.0;
