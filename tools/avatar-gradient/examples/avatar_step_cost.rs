//! What a step of training costs beside the splatter: `cargo run --release -p avatar-gradient --example avatar_step_cost [threads]` poses a person
//! of a demo's size, takes derivatives and steps, and prints milliseconds, means of many runs; with one thread those of the processor.

use avatar_gradient::loss::{Pairs, Share, Surface, guide, scale};
use avatar_gradient::{Derivatives, Model, Moved, Networks, Parameters, Posed, step_bases};
use rayon::ThreadPoolBuilder;
use splat_gradient::Attributes;
use splat_gradient::adam::{Adam, Group};
use std::time::Instant;
use synthetic_person::{Puppet, PuppetSize, Random};

const ROUNDS: u32 = 30;
/// The demo person's, with the controllers' hidden units that are trained.
const SIZE: PuppetSize = PuppetSize {
    detail: 4,
    gaussians: 50_000,
    controller_hidden: 16,
    ..PuppetSize::FULL
};

type Failure = Box<dyn std::error::Error + Send + Sync>;

/// Milliseconds that this thread has computed; nothing where the system does not say.
fn cpu_ms() -> Option<f64> {
    let text = std::fs::read_to_string("/proc/thread-self/schedstat").ok()?;
    let nanoseconds: f64 = text.split(' ').next()?.parse().ok()?;
    Some(nanoseconds / 1e6)
}

/// Mean milliseconds of what `work` does.
fn mean(mut work: impl FnMut() -> Result<(), Failure>) -> Result<f64, Failure> {
    work()?;
    let (start, start_cpu) = (Instant::now(), cpu_ms());
    for _ in 0..ROUNDS {
        work()?;
    }
    let wall = 1e3 * start.elapsed().as_secs_f64();
    let cpu = cpu_ms().zip(start_cpu).map(|(now, before)| now - before);
    let alone = rayon::current_num_threads() == 1;
    Ok(cpu.filter(|_| alone).unwrap_or(wall) / f64::from(ROUNDS))
}

fn main() -> Result<(), Failure> {
    let threads = std::env::args().nth(1).map_or(Ok(2), |text| text.parse())?;
    let pool = ThreadPoolBuilder::new().num_threads(threads).build()?;
    println!("{threads} thread(s), milliseconds; those of the processor with one thread");
    pool.install(|| measure(&Puppet::new(SIZE)))
}

fn row(name: &str, work: impl FnMut() -> Result<(), Failure>) -> Result<(), Failure> {
    println!("| {name} | {:.1} |", mean(work)?);
    Ok(())
}

/// Derivatives as a picture gives them: of about half of a person's Gaussians, so many neighbours together.
fn picture(count: usize, together: usize, random: &mut Random) -> Attributes {
    let mut by_gaussians = Attributes::zeros(count);
    for plane in 0..14 {
        for (gaussian, number) in by_gaussians.plane_mut(plane).iter_mut().enumerate() {
            let shown = (gaussian / together).is_multiple_of(2);
            *number = if shown { random.signed() } else { 0.0 };
        }
    }
    by_gaussians
}

fn measure(puppet: &Puppet) -> Result<(), Failure> {
    let networks = Networks {
        gaussians: puppet.gaussians.clone(),
        mesh: puppet.mesh.clone(),
        attributes: puppet.attributes.clone(),
    };
    let (template, controllers) = (&puppet.template, &puppet.controllers);
    let model = Model::new(&puppet.skeleton, template, controllers, &networks)?;
    let mut parameters = networks.parameters();
    let sizes = *model.sizes();
    let mut random = Random::new(1);
    let motion = random.motion(0.4);
    let by_gaussians = picture(sizes.gaussians, 512, &mut random);
    let by_parts = picture(sizes.gaussians, 8192, &mut random);
    let by = Derivatives {
        gaussians: Some(&by_gaussians),
        ..Derivatives::default()
    };
    let mut posed = Posed::new();
    let mut gradients = Parameters::zeros_without_bases(&sizes);
    let mut full = Parameters::zeros(&sizes);
    println!("{sizes:?}");
    println!("| part | ms |");
    println!("|---|---|");
    row("forward", || {
        Ok(model.pose(&parameters, &motion, None, &mut posed)?)
    })?;
    row("backward, bases left to their step", || {
        model.backward(&parameters, &mut posed, &by, &mut gradients)?;
        Ok(())
    })?;
    row("backward, derivatives by bases added up", || {
        model.backward(&parameters, &mut posed, &by, &mut full)?;
        Ok(())
    })?;
    let mut adam = Adam::new(parameters.bases.len());
    for (name, seen, moved) in [
        ("all", &by_gaussians, Moved::All),
        ("those seen: half, by 512", &by_gaussians, Moved::Seen),
        ("those seen: half, by 8192", &by_parts, Moved::Seen),
    ] {
        let by = Derivatives {
            gaussians: Some(seen),
            ..Derivatives::default()
        };
        model.backward(&parameters, &mut posed, &by, &mut gradients)?;
        row(&format!("step of the bases, {name}"), || {
            Ok(step_bases(
                &mut adam,
                &mut parameters.bases,
                &model,
                &posed,
                &[1e-6; 14],
                moved,
            )?)
        })?;
    }
    let mut adams: Vec<Adam> = full.arrays().map(|(_, a)| Adam::new(a.len())).into();
    row("step of the bases by stored derivatives", || {
        let count = full.bases.len();
        let groups = [Group { count, rate: 1e-6 }];
        Ok(adams[1].step(&mut parameters.bases, &full.bases, &groups)?)
    })?;
    row("step of everything else", || {
        let arrays = parameters.arrays_mut().into_iter().zip(gradients.arrays());
        for (((_, numbers), (_, by)), adam) in arrays.zip(&mut adams) {
            let (count, rate) = (by.len(), 1e-6);
            if count > 0 {
                adam.step(numbers, by, &[Group { count, rate }])?;
            }
        }
        Ok(())
    })?;
    row("clearing everything else's derivatives", || {
        gradients.clear();
        Ok(())
    })?;
    let pairs = Pairs::neighbouring(controllers);
    let mut by_offsets = vec![0.0; 3 * sizes.controllers];
    row("controllers' offsets and L_guide", || {
        let offsets = model.controller_offsets(&parameters, &mut posed)?;
        guide(offsets, &pairs, 1.0, &mut by_offsets)?;
        Ok(())
    })?;
    let with_guide = Derivatives {
        offsets: Some(&by_offsets),
        ..by
    };
    row("backward with L_guide", || {
        model.backward(&parameters, &mut posed, &with_guide, &mut gradients)?;
        Ok(())
    })?;
    row("step of the bases with L_guide, all", || {
        Ok(step_bases(
            &mut adam,
            &mut parameters.bases,
            &model,
            &posed,
            &[1e-6; 14],
            Moved::All,
        )?)
    })?;
    let mut by_all = by_gaussians.clone();
    row("L_scale", || {
        scale(posed.gaussians(), 0.02, 1.0, &mut by_all)?;
        Ok(())
    })?;
    let mut surface = Surface::new(template, &networks.gaussians)?;
    let mut by_vertices = vec![0.0; 3 * sizes.vertices];
    for (name, share) in [
        ("L_bind, all Gaussians", Share::ALL),
        ("L_bind, one Gaussian of 16", Share::of_step(0, 16)),
    ] {
        row(name, || {
            let shown = (posed.gaussians(), posed.vertices());
            surface.bind(shown, share, 1.0, &mut by_all, &mut by_vertices)?;
            Ok(())
        })?;
    }
    Ok(())
}
