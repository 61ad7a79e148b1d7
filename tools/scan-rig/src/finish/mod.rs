//! From bound Gaussians to a package: deformation networks, shading by pose, order of importance.
