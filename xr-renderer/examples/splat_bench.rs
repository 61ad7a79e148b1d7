//! Median stage times for a cloud of random Gaussians about as large and as dense as a person's.
//!
//! `cargo run --release -p xr-renderer --example splat_bench -- --gaussians 60000 --size 1024 --stereo`

use std::path::PathBuf;

use anyhow::{Context, Result};
use clap::Parser;
use glam::{Quat, Vec3};
use xr_renderer::{Camera, Gpu, GpuChoice, PackedGaussian, SplatRenderer, StageTimes};

#[derive(Parser)]
struct Arguments {
    /// How many Gaussians.
    #[arg(long, default_value_t = 60_000)]
    gaussians: u32,
    /// Side of the picture in pixels.
    #[arg(long, default_value_t = 1024)]
    size: u32,
    /// Draw two views, 64 mm apart.
    #[arg(long)]
    stereo: bool,
    /// auto, lavapipe or a part of the device's name.
    #[arg(long, default_value = "auto")]
    gpu: GpuChoice,
    /// Pictures to take the median of.
    #[arg(long, default_value_t = 30)]
    frames: u32,
    /// Where to leave the left picture as a binary PPM.
    #[arg(long)]
    out: Option<PathBuf>,
}

fn main() -> Result<()> {
    env_logger::init();
    let arguments = Arguments::parse();
    let views = if arguments.stereo { 2 } else { 1 };
    let gpu = Gpu::open(&arguments.gpu, false)?;
    let mut renderer = SplatRenderer::new(
        gpu.clone(),
        arguments.gaussians,
        arguments.size,
        arguments.size,
        views,
    )?;
    let gaussians = standing_figure(arguments.gaussians);
    let eye = |x: f32| {
        let (eye, target) = (Vec3::new(x, 1.0, 2.6), Vec3::new(x, 0.9, 0.0));
        Camera::look_at(eye, target, Vec3::Y, 0.8, arguments.size, arguments.size)
    };
    let eyes = [eye(-0.032), eye(0.032)];
    let cameras = if arguments.stereo {
        &eyes[..]
    } else {
        &eyes[..1]
    };

    let mut times = Vec::new();
    for _ in 0..arguments.frames.max(1) {
        renderer.render(&gaussians, cameras)?;
        times.push(renderer.stage_times());
    }
    let median = |stage: fn(&StageTimes) -> f64| {
        let mut values: Vec<f64> = times.iter().map(stage).collect();
        values.sort_by(f64::total_cmp);
        values[values.len() / 2]
    };
    println!(
        "{} ({}), subgroups of {}",
        gpu.info().name,
        gpu.info().driver,
        gpu.subgroup_size()
    );
    println!(
        "{} Gaussians, {views} x {size}x{size}, {pairs} tile pairs, median of {} pictures",
        arguments.gaussians,
        times.len(),
        size = arguments.size,
        pairs = renderer.tile_pairs(),
    );
    for (name, milliseconds) in [
        ("upload", median(|t| t.upload)),
        ("project", median(|t| t.project)),
        ("sort", median(|t| t.sort)),
        ("bin", median(|t| t.bin)),
        ("raster", median(|t| t.raster)),
        ("all", median(StageTimes::total)),
    ] {
        println!("{name:>8} {milliseconds:8.2} ms");
    }
    if let Some(path) = arguments.out {
        let image = renderer.read_back(0)?;
        let grey = xr_renderer::Background::Gradient {
            top: [0.32; 3],
            bottom: [0.12; 3],
        };
        let mut bytes = format!("P6 {} {} 255\n", image.width(), image.height()).into_bytes();
        bytes.extend(image.over(grey));
        std::fs::write(&path, bytes).with_context(|| format!("writing {}", path.display()))?;
    }
    Ok(())
}

/// An ellipsoid of a body.
struct Part {
    centre: Vec3,
    /// Half axes, metres.
    axes: Vec3,
    /// Of all Gaussians.
    share: f32,
    colour: [f32; 3],
}

/// Flat splats on the skin of a body made of ellipsoids, opaque and overlapping as a scan's are.
fn standing_figure(count: u32) -> Vec<PackedGaussian> {
    let part = |centre, axes, share, colour| Part {
        centre: Vec3::from_array(centre),
        axes: Vec3::from_array(axes),
        share,
        colour,
    };
    let (skin, jacket, trousers) = ([0.85, 0.64, 0.52], [0.2, 0.3, 0.5], [0.18, 0.18, 0.2]);
    let parts = [
        part([0.0, 1.62, 0.0], [0.09, 0.13, 0.11], 0.2, skin),
        part([0.0, 1.15, 0.0], [0.2, 0.34, 0.13], 0.35, jacket),
        part([-0.28, 1.1, 0.0], [0.06, 0.34, 0.06], 0.1, jacket),
        part([0.28, 1.1, 0.0], [0.06, 0.34, 0.06], 0.1, jacket),
        part([-0.1, 0.42, 0.0], [0.09, 0.44, 0.1], 0.125, trousers),
        part([0.1, 0.42, 0.0], [0.09, 0.44, 0.1], 0.125, trousers),
    ];
    let mut random = Random(0x9E37_79B9_7F4A_7C15);
    let mut gaussians = Vec::with_capacity(count as usize);
    for _ in 0..count {
        let mut pick = random.unit();
        let chosen = parts.iter().find(|part| {
            pick -= part.share;
            pick < 0.0
        });
        let &Part {
            centre,
            axes,
            share,
            colour,
        } = chosen.unwrap_or(&parts[0]);
        let direction = random.direction_by_area(axes);
        let normal = (direction / axes).normalize();
        let area = axes.x * axes.y + axes.y * axes.z + axes.z * axes.x;
        #[expect(clippy::cast_precision_loss, reason = "a rough spacing")]
        let spacing = 2.2 * (area / (share * count as f32)).sqrt();
        let shade = 0.55 + 0.45 * normal.dot(Vec3::new(0.3, 0.6, 0.74)).max(0.0);
        gaussians.push(PackedGaussian::new(
            (centre + direction * axes).to_array(),
            Quat::from_rotation_arc(Vec3::Z, normal).to_array(),
            [
                spacing,
                spacing * (0.6 + 0.8 * random.unit()),
                0.1 * spacing,
            ],
            0.6 + 0.4 * random.unit(),
            colour.map(|channel| channel * shade * (0.9 + 0.2 * random.unit())),
        ));
    }
    gaussians
}

/// Xorshift: repeatable, and good enough to strew splats.
struct Random(u64);

impl Random {
    /// A direction whose point on an ellipsoid is as likely to lie on one patch as on any of the same area.
    fn direction_by_area(&mut self, axes: Vec3) -> Vec3 {
        loop {
            let direction = Vec3::from_array(std::array::from_fn(|_| 2.0 * self.unit() - 1.0));
            let length = direction.length();
            if !(0.1..=1.0).contains(&length) {
                continue;
            }
            let direction = direction / length;
            if self.unit() < (direction / axes).length() * axes.min_element() {
                return direction;
            }
        }
    }

    /// 0..1.
    #[expect(clippy::cast_precision_loss, reason = "24 bits fit")]
    fn unit(&mut self) -> f32 {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        (self.0 >> 40) as f32 / (1u64 << 24) as f32
    }
}
