// How many pairs of splat and tile each part of the foreground makes in all views: 64 bits a part, the lower half first, so that no
// number of Gaussians that a stranger sends wraps around. Include after `#define COSTS_BINDING`.
const uint MOST_PARTS = 9u; // as src/limits.rs of xr-renderer/splat says
layout(set = 0, binding = COSTS_BINDING, std430) buffer Costs { uint pairs[2u * MOST_PARTS]; } costs;
