//! Writing foregrounds to a slot as the lanes do: with bounds of their Gaussians' motion since the last time.

use glam::{Affine3A, Vec3};
use renderer_splat::camera::Camera;
use renderer_splat::drawing::{Drawing, Foreground, Part};
use renderer_splat::error::RenderError;
use renderer_splat::gaussian::{Gaussian, PackedGaussian};
use renderer_splat::motion_bound::{Change, MotionBound};
use renderer_splat::renderer::SplatRenderer;
use renderer_splat::slot::ForegroundSlot;

/// A slot, and what was written to it last.
#[derive(Debug)]
pub struct Walking {
    slot: ForegroundSlot,
    path: MotionBound,
    last: Vec<Gaussian>,
}

impl Walking {
    /// A person that is not shown yet.
    pub fn new(renderer: &SplatRenderer) -> Self {
        Self::in_slot(renderer.foreground_slot().expect("memory for a slot"))
    }

    /// The same in a slot of one's own.
    pub fn in_slot(slot: ForegroundSlot) -> Self {
        Self {
            slot,
            path: MotionBound::new(),
            last: Vec::new(),
        }
    }

    /// Writes where the Gaussians are now, on from where they were.
    pub fn write(&mut self, gaussians: &[Gaussian]) {
        let mut path = self.path;
        path.advance(change(&self.last, gaussians));
        self.write_at(gaussians, path);
    }

    /// Writes where the Gaussians are now, which is there on their path.
    pub fn write_at(&mut self, gaussians: &[Gaussian], path: MotionBound) {
        let room = self.slot.gaussians_mut();
        for (place, gaussian) in room.iter_mut().zip(gaussians) {
            *place = PackedGaussian::from(gaussian);
        }
        self.path = path;
        self.last = gaussians.to_vec();
        let count = u32::try_from(gaussians.len()).expect("few");
        self.slot.set(count, self.path).expect("they fit");
    }

    /// Where the Gaussians written last are on their path.
    pub fn path(&self) -> MotionBound {
        self.path
    }

    /// The slot, to be drawn.
    pub fn slot(&self) -> &ForegroundSlot {
        &self.slot
    }

    /// What was written last, placed somewhere.
    pub fn at(&self, world_from_part: Affine3A) -> Part<'_> {
        Part {
            gaussians: Foreground::Slot(&self.slot),
            world_from_part,
        }
    }

    /// Draws what was written last.
    ///
    /// # Errors
    /// Those of the renderer.
    pub fn draw(
        &self,
        renderer: &mut SplatRenderer,
        cameras: &[Camera],
        keep_order: bool,
    ) -> Result<(), RenderError> {
        renderer.draw_with(&Drawing {
            keep_order,
            ..Drawing::new(cameras, &[Part::here(Foreground::Slot(&self.slot))])
        })
    }
}

/// The most that any Gaussian changed.
fn change(before: &[Gaussian], after: &[Gaussian]) -> Change {
    let greatest = |gaussian: &Gaussian| gaussian.scale.into_iter().fold(0.0, f32::max);
    // A Gaussian that is too large to be drawn counts as transparent.
    let opacity = |gaussian: &Gaussian| match greatest(gaussian) < 256.0 {
        true => gaussian.opacity,
        false => 0.0,
    };
    let pairs = before.iter().zip(after);
    pairs.fold(Change::default(), |most, (before, after)| Change {
        metres: most
            .metres
            .max(Vec3::from(before.position).distance(after.position.into())),
        octaves: most
            .octaves
            .max((greatest(after) / greatest(before)).log2()),
        opacity: most.opacity.max(opacity(after) - opacity(before)),
    })
}
