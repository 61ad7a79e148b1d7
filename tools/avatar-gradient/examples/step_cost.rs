//! What a step of training costs beside the splatter: `cargo run --release -p avatar-gradient --example step_cost [threads]` poses a person
//! of a demo's size, takes derivatives and steps, and prints milliseconds, means of many runs.

use avatar_gradient::loss::{Pairs, Surface, guide, scale};
use avatar_gradient::{
    BasisAdam, Derivatives, Model, ModelError, Moved, Networks, Parameters, Posed,
};
use rayon::ThreadPoolBuilder;
use splat_gradient::Attributes;
use splat_gradient::adam::{Adam, Group};
use std::time::Instant;
use synthetic_person::{Puppet, PuppetSize, Random};

const ROUNDS: u32 = 30;

/// Mean milliseconds of what `work` does.
fn mean(mut work: impl FnMut() -> Result<(), ModelError>) -> Result<f64, ModelError> {
    work()?;
    let start = Instant::now();
    for _ in 0..ROUNDS {
        work()?;
    }
    Ok(1e3 * start.elapsed().as_secs_f64() / f64::from(ROUNDS))
}

type Failure = Box<dyn std::error::Error + Send + Sync>;

fn main() -> Result<(), Failure> {
    let threads = std::env::args().nth(1).map_or(Ok(2), |text| text.parse())?;
    let pool = ThreadPoolBuilder::new().num_threads(threads).build()?;
    pool.install(|| measure(threads))
}

fn measure(threads: usize) -> Result<(), Failure> {
    let puppet = Puppet::new(PuppetSize {
        detail: 4,
        gaussians: 50_000,
        controller_hidden: 16,
        ..PuppetSize::FULL
    });
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
    let mut by_gaussians = Attributes::zeros(sizes.gaussians);
    // A picture shows about half of a person.
    for plane in 0..14 {
        for (gaussian, number) in by_gaussians.plane_mut(plane).iter_mut().enumerate() {
            let shown = gaussian / 64 % 2 == 0;
            *number = if shown { random.signed() } else { 0.0 };
        }
    }
    let mut posed = Posed::new();
    let mut gradients = Parameters::zeros_without_bases(&sizes);
    let mut full = Parameters::zeros(&sizes);
    let by = Derivatives {
        gaussians: Some(&by_gaussians),
        ..Derivatives::default()
    };
    println!(
        "{threads} thread(s), {} Gaussians, {} vertices; milliseconds",
        sizes.gaussians, sizes.vertices
    );
    println!("| part | ms |");
    println!("|---|---|");
    let row = |name: &str, ms: f64| println!("| {name} | {ms:.1} |");
    row(
        "forward",
        mean(|| model.pose(&parameters, &motion, None, &mut posed))?,
    );
    row(
        "backward, bases left to their step",
        mean(|| {
            model
                .backward(&parameters, &mut posed, &by, &mut gradients)
                .map(drop)
        })?,
    );
    row(
        "backward, derivatives by bases added up",
        mean(|| {
            model
                .backward(&parameters, &mut posed, &by, &mut full)
                .map(drop)
        })?,
    );
    let mut adam = BasisAdam::new(parameters.bases.len());
    for (name, moved) in [
        ("step of the bases, those seen (half)", Moved::Seen),
        ("step of the bases, all", Moved::All),
    ] {
        row(
            name,
            mean(|| adam.step(&mut parameters.bases, &model, &posed, &[1e-6; 14], moved))?,
        );
    }
    let mut stored = Adam::new(parameters.bases.len());
    let group = [Group {
        count: parameters.bases.len(),
        rate: 1e-6,
    }];
    let start = Instant::now();
    for _ in 0..ROUNDS {
        stored.step(&mut parameters.bases, &full.bases, &group)?;
    }
    row(
        "step of the bases by stored derivatives",
        1e3 * start.elapsed().as_secs_f64() / f64::from(ROUNDS),
    );
    let mut adams: Vec<Adam> = gradients.arrays().map(|(_, a)| Adam::new(a.len())).into();
    let start = Instant::now();
    for _ in 0..ROUNDS {
        let arrays = parameters.arrays_mut().into_iter().zip(gradients.arrays());
        for (((_, numbers), (_, by)), adam) in arrays.zip(&mut adams) {
            if !by.is_empty() {
                let rate = 1e-6;
                let count = by.len();
                adam.step(numbers, by, &[Group { count, rate }])?;
            }
        }
        gradients.clear();
    }
    row(
        "step of everything else, derivatives cleared",
        1e3 * start.elapsed().as_secs_f64() / f64::from(ROUNDS),
    );
    let pairs = Pairs::neighbouring(controllers);
    let mut by_offsets = vec![0.0; 3 * sizes.controllers];
    row(
        "controllers' offsets and L_guide",
        mean(|| {
            let offsets = model.controller_offsets(&parameters, &mut posed)?;
            guide(offsets, &pairs, 1.0, &mut by_offsets).map(drop)
        })?,
    );
    let mut by_all = by_gaussians.clone();
    row(
        "L_scale",
        mean(|| scale(posed.gaussians(), 0.02, 1.0, &mut by_all).map(drop))?,
    );
    let mut surface = Surface::new(template, &networks.gaussians)?;
    let mut by_vertices = vec![0.0; 3 * sizes.vertices];
    row(
        "L_bind",
        mean(|| {
            let (all, mesh) = (posed.gaussians(), posed.vertices());
            surface
                .bind(all, mesh, 1.0, &mut by_all, &mut by_vertices)
                .map(drop)
        })?,
    );
    Ok(())
}
