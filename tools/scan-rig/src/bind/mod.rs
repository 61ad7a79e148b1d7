//! Gaussians on triangles: cleaned, split, bound in the pose of the scan; weights, and accessories.
