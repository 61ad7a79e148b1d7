//! What a picture and its derivatives cost on the CPU and on a Vulkan device: `cargo run --release -p splat-gradient-vulkan --example splat_devices
//! [threads]` draws a person-like scene with both in turn and prints milliseconds, medians of many runs, with all copies to the device and back.
//! `MON3TR_GPU` chooses the device, as `--gpu` does.

#[path = "../../splat-gradient/tests/gradient/scenes.rs"]
#[expect(dead_code, reason = "tests need more of it")]
mod scenes;

use rayon::ThreadPoolBuilder;
use renderer_vulkan::gpu::Gpu;
use scenes::{attributes_of, random_picture, view_of};
use splat_gradient::error::GradientError;
use splat_gradient::{Attributes, Picture, SplatDevice, Splatter, View};
use splat_gradient_vulkan::VulkanSplatter;
use std::time::Instant;
use synthetic_person::Random;
use test_support::splat_scenes::{in_front_of_figure, standing_figure};

const ROUNDS: usize = 21;

/// A scene, and derivatives by its picture's pixels.
struct Scene {
    attributes: Attributes,
    view: View,
    by_pixel: Picture,
}

impl Scene {
    fn new(count: u32, side: u32) -> Self {
        let view = view_of(&in_front_of_figure(side, side));
        let [width, height] = view.size();
        Self {
            attributes: attributes_of(&standing_figure(count)),
            view,
            by_pixel: random_picture(width, height, &mut Random::new(1)),
        }
    }

    /// Milliseconds of the picture and of its derivatives.
    fn once(&self, device: &mut dyn SplatDevice) -> Result<[f64; 2], GradientError> {
        let mut gradients = Attributes::zeros(self.attributes.len());
        let start = Instant::now();
        let mut drawn = device.draw(&self.attributes, &self.view)?;
        let forward = start.elapsed();
        drawn.backward(&self.by_pixel, &mut gradients)?;
        let backward = start.elapsed() - forward;
        Ok([forward, backward].map(|time| 1e3 * time.as_secs_f64()))
    }
}

fn median(times: &[[f64; 2]], which: usize) -> f64 {
    let mut times: Vec<f64> = times.iter().map(|pair| pair[which]).collect();
    times.sort_by(f64::total_cmp);
    times[times.len() / 2]
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let threads = std::env::args().nth(1).map_or(Ok(1), |text| text.parse())?;
    let pool = ThreadPoolBuilder::new().num_threads(threads).build()?;
    let choice = std::env::var("MON3TR_GPU").unwrap_or_default();
    let gpu = Gpu::open(&choice.parse()?, false)?;
    let info = gpu.info();
    let software = if info.is_cpu {
        ", software on the CPU"
    } else {
        ""
    };
    println!(
        "CPU: {threads} thread(s); device: {} ({}){software}",
        info.name, info.driver
    );
    println!("| Gaussians | picture | CPU forward | backward | device forward | backward |");
    println!("|---|---|--:|--:|--:|--:|");
    for (count, side) in [
        (20_000, 256),
        (20_000, 512),
        (50_000, 256),
        (50_000, 512),
        (200_000, 1024),
    ] {
        let scene = Scene::new(count, side);
        let (mut cpu, mut device) = (Splatter::new(), VulkanSplatter::new(&gpu)?);
        let (mut by_cpu, mut by_device) = (Vec::new(), Vec::new());
        for round in 0..=ROUNDS {
            let of_cpu = pool.install(|| scene.once(&mut cpu))?;
            let of_device = scene.once(&mut device)?;
            // The first finds its memory.
            if round > 0 {
                by_cpu.push(of_cpu);
                by_device.push(of_device);
            }
        }
        println!(
            "| {count} | {side}x{side} | {:.1} | {:.1} | {:.1} | {:.1} |",
            median(&by_cpu, 0),
            median(&by_cpu, 1),
            median(&by_device, 0),
            median(&by_device, 1)
        );
    }
    Ok(())
}
