//! Drawing allocates nothing once it runs: a test program of its own, since it counts for the whole process.

use std::alloc::{GlobalAlloc, Layout, System};
use std::sync::Arc;
use std::sync::atomic::{AtomicU32, Ordering};

use glam::{Affine3A, Vec3};
use renderer_splat::camera::Camera;
use renderer_splat::drawing::{Drawing, Foreground, Part};
use renderer_splat::gaussian::{Gaussian, PackedGaussian};
use renderer_splat::motion_bound::{Change, MotionBound};
use renderer_splat::options::{BackEnd, RendererOptions};
use renderer_splat::renderer::SplatRenderer;
use renderer_vulkan::choice::GpuChoice;
use renderer_vulkan::gpu::Gpu;

/// Counts how often memory is asked for.
struct Counting;

static TAKEN: AtomicU32 = AtomicU32::new(0);

// SAFETY: hands everything on to the system's allocator.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        TAKEN.fetch_add(1, Ordering::Relaxed);
        // SAFETY: the caller keeps GlobalAlloc's contract, which is System's.
        unsafe { System.alloc(layout) }
    }

    unsafe fn dealloc(&self, memory: *mut u8, layout: Layout) {
        // SAFETY: as above.
        unsafe { System.dealloc(memory, layout) }
    }
}

#[global_allocator]
static ALLOCATOR: Counting = Counting;

/// The device that `MON3TR_GPU` names; nothing, where there is none and CI does not demand one.
fn open_gpu() -> Option<Arc<Gpu>> {
    let name = std::env::var("MON3TR_GPU").unwrap_or_default();
    let choice: GpuChoice = name.parse().expect("any text is a choice");
    // Without the validation layer: its messages are logged, and logging may allocate.
    match Gpu::open(&choice, false) {
        Ok(gpu) => Some(gpu),
        Err(why) => {
            assert!(
                std::env::var("CI").as_deref() != Ok("true"),
                "no Vulkan device: {why}"
            );
            println!("skipped: no Vulkan device: {why}");
            None
        }
    }
}

fn eyes(turn: f32, size: u32) -> [Camera; 2] {
    [-0.03, 0.03].map(|x| {
        let eye = Vec3::new(x, 0.0, 3.0);
        let target = eye + Vec3::new(turn.sin(), 0.0, -turn.cos());
        Camera::look_at(eye, target, Vec3::Y, 0.8, size, size)
    })
}

#[test]
fn pictures_after_the_first_few_are_drawn_without_an_allocation() {
    let Some(gpu) = open_gpu() else { return };
    const COUNT: u16 = 2_000;
    let person: Vec<PackedGaussian> = (0..COUNT)
        .map(|step| {
            let turn = f32::from(step) * 0.1;
            PackedGaussian::from(&Gaussian {
                position: [0.5 * turn.cos(), 0.5 * turn.sin(), 0.001 * turn],
                rotation: [0.0, 0.0, 0.0, 1.0],
                scale: [0.02; 3],
                opacity: 0.8,
                colour: [0.9, 0.6, 0.4],
            })
        })
        .collect();
    for back_end in [BackEnd::Tiles, BackEnd::Quads] {
        let options = RendererOptions {
            back_end: Some(back_end),
            ..RendererOptions::new(2 * u32::from(COUNT), 128, 128, 2)
        };
        let mut renderer = SplatRenderer::new(Arc::clone(&gpu), &options).expect("a renderer");
        let mut slots = [(); 3].map(|()| {
            renderer
                .foreground_slot_for(u32::from(COUNT))
                .expect("memory for a slot")
        });
        let mut path = MotionBound::new();
        let mut taken = 0;
        for picture in 0u16..40 {
            // Some of these sort and some do not; the size changes now and then.
            let size = if picture % 8 < 4 { 128 } else { 96 };
            let cameras = eyes(f32::from(picture / 3) * 0.01, size);
            let before = TAKEN.load(Ordering::Relaxed);
            let slot = &mut slots[usize::from(picture) % 3];
            slot.gaussians_mut().copy_from_slice(&person);
            path.advance(Change {
                metres: 0.000_1,
                ..Change::default()
            });
            slot.set(u32::from(COUNT), path).expect("they fit");
            // One person alone, then a second one that walks, then one person again.
            let place = Affine3A::from_translation(Vec3::X * 0.01 * f32::from(picture));
            let walking = Part {
                gaussians: Foreground::Slot(&slots[usize::from(picture + 1) % 3]),
                world_from_part: place,
            };
            let person = Part::here(Foreground::Slot(&slots[usize::from(picture) % 3]));
            let parts = [person, walking];
            let present = if picture % 10 < 5 {
                &parts[..1]
            } else {
                &parts
            };
            renderer
                .draw_with(&Drawing::new(&cameras, present))
                .expect("a picture");
            if picture >= 3 {
                taken += TAKEN.load(Ordering::Relaxed) - before;
            }
        }
        assert!(TAKEN.load(Ordering::Relaxed) > 0, "allocations are counted");
        assert_eq!(taken, 0, "{back_end}: allocations in 37 pictures");
        let picture = renderer.read_back(0).expect("a view");
        let drawn = picture.pixels().iter().any(|pixel| pixel[3] > 0.5);
        assert!(drawn, "{back_end}: nothing was drawn");
    }
}
