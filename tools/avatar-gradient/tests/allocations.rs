//! Posing, its derivatives and a step of the bases ask for no memory once it is there: a test program of its own, since it counts for the
//! whole process.

use avatar_gradient::{Derivatives, Model, Moved, Networks, Parameters, Posed, step_bases};
use rayon::ThreadPoolBuilder;
use splat_gradient::Attributes;
use std::alloc::{GlobalAlloc, Layout, System};
use std::sync::atomic::{AtomicU32, Ordering};
use synthetic_person::{Puppet, Random};

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

#[test]
fn a_step_after_the_first_allocates_only_its_list_of_stretches() {
    let puppet = Puppet::small();
    let networks = Networks {
        gaussians: puppet.gaussians.clone(),
        mesh: puppet.mesh.clone(),
        attributes: puppet.attributes.clone(),
    };
    let model = Model::new(
        &puppet.skeleton,
        &puppet.template,
        &puppet.controllers,
        &networks,
    )
    .expect("the puppet's parts fit");
    let mut parameters = networks.parameters();
    let mut gradients = Parameters::zeros_without_bases(model.sizes());
    let mut adam = splat_gradient::adam::Adam::new(parameters.bases.len());
    let mut posed = Posed::new();
    let mut by_gaussians = Attributes::zeros(model.sizes().gaussians);
    by_gaussians.numbers_mut().fill(0.5);
    let by_offsets = vec![0.1; 3 * model.sizes().controllers];
    let motions = [1, 2, 3].map(|seed| Random::new(seed).motion(0.5));
    let mut step = |motion| {
        model
            .pose(&parameters, motion, None, &mut posed)
            .expect("the parameters fit");
        model
            .controller_offsets(&parameters, &mut posed)
            .expect("posed");
        let by = Derivatives {
            gaussians: Some(&by_gaussians),
            offsets: Some(&by_offsets),
            ..Derivatives::default()
        };
        model
            .backward(&parameters, &mut posed, &by, &mut gradients)
            .expect("everything fits");
        let rates = [1e-3; 14];
        step_bases(
            &mut adam,
            &mut parameters.bases,
            &model,
            &posed,
            &rates,
            Moved::All,
        )
        .expect("derivatives");
    };
    let pool = ThreadPoolBuilder::new().num_threads(1).build();
    let taken = pool.expect("a thread").install(|| {
        step(&motions[0]);
        let before = TAKEN.load(Ordering::Relaxed);
        step(&motions[1]);
        step(&motions[2]);
        TAKEN.load(Ordering::Relaxed) - before
    });
    assert_eq!(taken, 2, "one for each step");
}
