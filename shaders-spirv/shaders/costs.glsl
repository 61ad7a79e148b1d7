// How many tiles the rectangles of each part's splats have in all views, at least as many as are listed: 64 bits a part, the lower half first, so that no
// number of Gaussians that a stranger sends wraps around. Include after `#define COSTS_BINDING`.
const uint MOST_PARTS = 9u; // as src/limits.rs of xr-renderer/splat says
layout(set = 0, binding = COSTS_BINDING, std430) buffer Costs { uint pairs[2u * MOST_PARTS]; } costs;
