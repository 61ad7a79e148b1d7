//! A few Gaussians that are drawn with the people and belong to none of them: shadows, say. The caller knows what they
//! are; here they are only kept, also for another device.

use renderer_splat::drawing::{Foreground, Part};
use renderer_splat::error::RenderError;
use renderer_splat::motion_bound::{Change, MotionBound};
use renderer_splat::renderer::SplatRenderer;
use renderer_splat::slot::ForegroundSlot;
use shaders_spirv::PackedGaussian;

/// How many there can be.
const ROOM: u32 = 256;

/// Gaussians in world space, and where the renderer reads them.
#[derive(Debug)]
pub(super) struct Scenery {
    /// One slot will do: it is drawn on the thread that writes it.
    slot: ForegroundSlot,
    kept: Vec<PackedGaussian>,
    path: MotionBound,
}

impl Scenery {
    /// None yet.
    pub(super) fn new(renderer: &SplatRenderer) -> Result<Self, RenderError> {
        Ok(Self {
            slot: renderer.foreground_slot_for(ROOM)?,
            kept: Vec::with_capacity(ROOM as usize),
            path: MotionBound::new(),
        })
    }

    /// How many there are.
    pub(super) fn len(&self) -> u32 {
        self.slot.len()
    }

    /// Takes others. Allocates nothing.
    pub(super) fn set(&mut self, gaussians: &[PackedGaussian]) -> Result<(), RenderError> {
        if gaussians.len() > ROOM as usize {
            return Err(RenderError::TooManyGaussians {
                count: gaussians.len(),
                limit: ROOM,
            });
        }
        if self.kept == gaussians {
            return Ok(());
        }
        if self.kept.len() == gaussians.len() {
            let change = (self.kept.iter().zip(gaussians)).map(|(old, new)| change(old, new));
            self.path.advance(change.fold(Change::default(), greater));
        } else {
            self.path = MotionBound::new();
        }
        self.kept.clear();
        self.kept.extend_from_slice(gaussians);
        self.write()
    }

    /// What the renderer is to draw, if there is anything.
    pub(super) fn part(&self) -> Option<Part<'_>> {
        let part = Part::here(Foreground::Slot(&self.slot));
        (!self.slot.is_empty()).then_some(part)
    }

    /// The renderer is on another device now.
    pub(super) fn renew(&mut self, renderer: &SplatRenderer) -> Result<(), RenderError> {
        self.slot = renderer.foreground_slot_for(ROOM)?;
        self.write()
    }

    fn write(&mut self) -> Result<(), RenderError> {
        let places = self.slot.gaussians_mut();
        for (place, gaussian) in places.iter_mut().zip(&self.kept) {
            *place = *gaussian;
        }
        let count = u32::try_from(self.kept.len()).unwrap_or(u32::MAX);
        self.slot.set(count, self.path)
    }
}

/// How far one went, as its order depends on it.
fn change(old: &PackedGaussian, new: &PackedGaussian) -> Change {
    if old == new {
        return Change::default();
    }
    let (old, new) = (old.unpacked(), new.unpacked());
    let position = |at: [f32; 3]| glam::Vec3::from_array(at);
    let growths = old.scale.iter().zip(new.scale);
    Change {
        metres: position(old.position).distance(position(new.position)),
        octaves: growths.fold(0.0, |most, (old, new)| (new / old).log2().abs().max(most)),
        opacity: (new.opacity - old.opacity).abs(),
    }
}

fn greater(one: Change, other: Change) -> Change {
    Change {
        metres: one.metres.max(other.metres),
        octaves: one.octaves.max(other.octaves),
        opacity: one.opacity.max(other.opacity),
    }
}
