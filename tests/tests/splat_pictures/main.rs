//! The renderer's pictures against the f64 reference, by both back ends, and inputs at the edge.
//!
//! Every test runs with the validation layer on and demands that it stays silent.

mod background;
mod costs;
mod counted;
mod device;
mod edges;
mod filter_and_depth;
mod foreground;
mod golden;
mod lists;
mod order;
mod parts;
mod person_in_scene;
mod sizes;
mod slots;
mod subgroups;

use test_support::picture_check::Least;

// Least PSNR in dB. Rounding to 8 bits alone is 59. Quads round each pixel to half floats after each splat: the
// more splats lie over one another, the more is lost.

/// Few Gaussians over one another: colours in half floats and arithmetic in f32 are all that differs.
const SPARSE: Least = Least {
    tiles: 68.0,
    quads: 60.0,
};
/// A scene packed to 20 bytes a Gaussian: opacities in steps of 1/255 are most of the error.
const PACKED: Least = Least {
    tiles: 60.0,
    quads: 54.0,
};
/// Thousands of equal Gaussians in one place. On their rim all have an alpha of 1/255, and all are drawn or none is:
/// a pixel or two where f32 decides otherwise than f64. Half floats lose up to a sixteenth of so thin a layer.
const EQUAL: Least = Least {
    tiles: 40.0,
    quads: 30.0,
};
/// Tiles stop where less than 1/255 shows through, which the reference does not.
const CROWDED: Least = Least {
    tiles: 58.0,
    quads: 52.0,
};
/// The same, where nearly every pixel stops early: 48 is what losing 1/255 everywhere would give.
const OPAQUE: Least = Least {
    tiles: 50.0,
    quads: 50.0,
};
