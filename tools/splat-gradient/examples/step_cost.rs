//! What a step of training costs: `cargo run --release -p splat-gradient --example step_cost [threads]` draws a person-like scene,
//! takes L1 and SSIM of it and their derivatives, and prints milliseconds, medians of many runs in turn.

use glam::{Affine3A, Mat3A, Vec3, Vec3A};
use rayon::ThreadPoolBuilder;
use splat_gradient::attributes::Attributes;
use splat_gradient::loss::{Target, colour_l1, ssim};
use splat_gradient::{Picture, Splatter, View};
use std::time::Instant;
use test_support::splat_scenes::{in_front_of_figure, standing_figure};

const ROUNDS: usize = 31;

fn person(count: u32) -> Attributes {
    let figure = standing_figure(count);
    let mut attributes = Attributes::zeros(figure.len());
    for (index, gaussian) in figure.iter().enumerate() {
        let opacity = gaussian.opacity.min(0.9999);
        let numbers = (gaussian.position.into_iter())
            .chain(gaussian.rotation)
            .chain(gaussian.scale.map(f32::ln))
            .chain([(opacity / (1.0 - opacity)).ln()])
            .chain(gaussian.colour);
        for (plane, number) in numbers.enumerate() {
            attributes.plane_mut(plane)[index] = number;
        }
    }
    attributes
}

fn view(side: u32) -> Result<View, Box<dyn std::error::Error>> {
    let camera = in_front_of_figure(side, side);
    let flip = Affine3A {
        matrix3: Mat3A::from_diagonal(Vec3::new(1.0, -1.0, -1.0)),
        translation: Vec3A::ZERO,
    };
    let pose = flip * camera.camera_from_world;
    let pixels = side as usize;
    Ok(View::new(
        pose,
        [camera.fx, camera.fy],
        [camera.cx, camera.cy],
        [pixels; 2],
    )?)
}

fn median(mut times: Vec<f64>) -> f64 {
    times.sort_by(f64::total_cmp);
    times[times.len() / 2]
}

/// Milliseconds of drawing, losses and the backward pass.
fn step(
    splatter: &mut Splatter,
    attributes: &Attributes,
    view: &View,
    target: &Target,
) -> Result<[f64; 3], Box<dyn std::error::Error>> {
    let [width, height] = view.size();
    let mut by_pixel = Picture::transparent(width, height);
    let mut gradients = Attributes::zeros(attributes.len());
    let start = Instant::now();
    let mut drawn = splatter.draw(attributes, view);
    let forward = start.elapsed();
    colour_l1(drawn.picture(), target, 0.8, &mut by_pixel)?;
    ssim(drawn.picture(), target, 0.2, &mut by_pixel)?;
    let losses = start.elapsed();
    drawn.backward(&by_pixel, &mut gradients)?;
    let all = start.elapsed();
    Ok([forward, losses - forward, all - losses].map(|time| 1e3 * time.as_secs_f64()))
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let threads = std::env::args().nth(1).map_or(Ok(1), |text| text.parse())?;
    let pool = ThreadPoolBuilder::new().num_threads(threads).build()?;
    println!("{threads} thread(s); milliseconds, medians of {ROUNDS}");
    println!("| Gaussians | picture | forward | L1 + SSIM | backward | step |");
    println!("|---|---|---|---|---|---|");
    for (count, side) in [(20_000, 256), (20_000, 512), (50_000, 256), (50_000, 512)] {
        let (attributes, view) = (person(count), view(side)?);
        let mut splatter = Splatter::new();
        let mut wanted = pool.install(|| splatter.draw(&attributes, &view).picture().clone());
        for number in wanted.numbers_mut() {
            *number *= 0.9;
        }
        let target = Target::new(wanted);
        let mut times = [(); 3].map(|()| Vec::new());
        for _ in 0..ROUNDS {
            let parts = pool.install(|| {
                step(&mut splatter, &attributes, &view, &target).map_err(|why| why.to_string())
            })?;
            for (times, part) in times.iter_mut().zip(parts) {
                times.push(part);
            }
        }
        let [forward, losses, backward] = times.map(median);
        let all = forward + losses + backward;
        println!(
            "| {count} | {side}x{side} | {forward:.1} | {losses:.1} | {backward:.1} | {all:.1} |"
        );
    }
    Ok(())
}
