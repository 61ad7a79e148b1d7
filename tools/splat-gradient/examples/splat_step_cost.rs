//! What a step of training costs: `cargo run --release -p splat-gradient --example splat_step_cost [threads]` draws a person-like scene,
//! takes L1 and SSIM of it and their derivatives, and prints milliseconds, means of many runs.

#[path = "../tests/gradient/scenes.rs"]
#[expect(dead_code, reason = "tests need more of it")]
mod scenes;

use rayon::ThreadPoolBuilder;
use scenes::{attributes_of, view_of};
use splat_gradient::error::GradientError;
use splat_gradient::loss::{Ssim, Target, colour_l1};
use splat_gradient::{Attributes, Picture, Splatter, View};
use std::time::Instant;
use test_support::splat_scenes::{in_front_of_figure, standing_figure};

const ROUNDS: u32 = 40;

/// Milliseconds that this thread has computed; nothing where the system does not say.
fn cpu_ms() -> Option<f64> {
    let text = std::fs::read_to_string("/proc/thread-self/schedstat").ok()?;
    let nanoseconds: f64 = text.split(' ').next()?.parse().ok()?;
    Some(nanoseconds / 1e6)
}

/// What is measured: how far a step goes.
#[derive(Debug, Clone, Copy, PartialEq, PartialOrd)]
enum Until {
    Drawn,
    Compared,
    Derived,
}

/// Mean milliseconds of steps up to `until`.
fn cost(
    splatter: &mut Splatter,
    attributes: &Attributes,
    view: &View,
    target: &Target,
    until: Until,
) -> Result<f64, GradientError> {
    let [width, height] = view.size();
    let mut gradients = Attributes::zeros(attributes.len());
    let mut by_pixel = Picture::transparent(width, height);
    let mut ssim = Ssim::new();
    let (start, start_cpu) = (Instant::now(), cpu_ms());
    for _ in 0..ROUNDS {
        let mut drawn = splatter.draw(attributes, view);
        if until >= Until::Compared {
            by_pixel.clear();
            colour_l1(drawn.picture(), target, 0.8, &mut by_pixel)?;
            ssim.loss(drawn.picture(), target, 0.2, &mut by_pixel)?;
            if until >= Until::Derived {
                drawn.backward(&by_pixel, &mut gradients)?;
            }
        }
    }
    let wall = 1e3 * start.elapsed().as_secs_f64();
    let cpu = cpu_ms().zip(start_cpu).map(|(now, before)| now - before);
    let alone = rayon::current_num_threads() == 1;
    let total = cpu.filter(|_| alone).unwrap_or(wall);
    Ok(total / f64::from(ROUNDS))
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let threads = std::env::args().nth(1).map_or(Ok(1), |text| text.parse())?;
    let pool = ThreadPoolBuilder::new().num_threads(threads).build()?;
    println!("{threads} thread(s), milliseconds; those of the processor with one thread");
    println!("| Gaussians | picture | forward | L1 + SSIM | backward | step |");
    println!("|---|---|---|---|---|---|");
    for (count, side) in [(20_000, 256), (20_000, 512), (50_000, 256), (50_000, 512)] {
        let attributes = attributes_of(&standing_figure(count));
        let view = view_of(&in_front_of_figure(side, side));
        let mut splatter = Splatter::new();
        let mut wanted = pool.install(|| splatter.draw(&attributes, &view).picture().clone());
        for number in wanted.numbers_mut() {
            *number *= 0.9;
        }
        let target = Target::new(wanted);
        let mut until =
            |until| pool.install(|| cost(&mut splatter, &attributes, &view, &target, until));
        let drawn = until(Until::Drawn)?;
        let compared = until(Until::Compared)? - drawn;
        let all = until(Until::Derived)?;
        let derived = all - compared - drawn;
        println!(
            "| {count} | {side}x{side} | {drawn:.1} | {compared:.1} | {derived:.1} | {all:.1} |"
        );
    }
    Ok(())
}
