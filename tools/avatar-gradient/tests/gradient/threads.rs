//! The same bytes from any number of threads.

use crate::people::{Person, random_attributes};
use avatar_gradient::loss::{Pairs, Share, Surface, guide, scale};
use avatar_gradient::{Derivatives, Moved, Parameters, step_bases};
use rayon::ThreadPoolBuilder;
use splat_gradient::adam::Adam;
use synthetic_person::{PuppetSize, Random};

/// Two steps of a fit: every number that comes of them.
fn fitted(threads: usize) -> Vec<u32> {
    let pool = ThreadPoolBuilder::new().num_threads(threads).build();
    pool.expect("threads").install(|| {
        let mut person = Person::new(PuppetSize {
            gaussians: 5_000,
            detail: 2,
            ..PuppetSize::SMALL
        });
        let puppet = &person.puppet;
        let pairs = Pairs::neighbouring(&puppet.controllers);
        let mut surface = Surface::new(&puppet.template, &puppet.gaussians).expect("bound");
        let mut adam = Adam::new(person.parameters.bases.len());
        let mut bits = Vec::new();
        for seed in 0..2 {
            let mut posed = person.posed(&Random::new(seed).motion(0.5));
            let mut by_gaussians = random_attributes(5_000, &mut Random::new(seed));
            let mut by_vertices = vec![0.0; posed.vertices().len()];
            let all = posed.gaussians();
            let large = scale(all, 0.01, 0.5, &mut by_gaussians).expect("as many");
            let far = surface
                .bind(
                    (all, posed.vertices()),
                    Share::ALL,
                    0.5,
                    &mut by_gaussians,
                    &mut by_vertices,
                )
                .expect("as many");
            let offsets = person
                .model
                .controller_offsets(&person.parameters, &mut posed)
                .expect("posed");
            let mut by_offsets = vec![0.0; offsets.len()];
            let apart = guide(offsets, &pairs, 10.0, &mut by_offsets).expect("as many");
            let by = Derivatives {
                gaussians: Some(&by_gaussians),
                vertices: Some(&by_vertices),
                offsets: Some(&by_offsets),
            };
            let mut gradients = Parameters::zeros_without_bases(person.model.sizes());
            let by_pose = person
                .model
                .backward(&person.parameters, &mut posed, &by, &mut gradients)
                .expect("fits");
            step_bases(
                &mut adam,
                &mut person.parameters.bases,
                &person.model,
                &posed,
                &[1e-3; 14],
                Moved::Seen,
            )
            .expect("derivatives");
            let numbers = gradients.arrays().map(|(_, array)| array).into_iter();
            let numbers = numbers.chain([&by_pose.0[..], &person.parameters.bases]);
            bits.extend(numbers.flatten().map(|x| x.to_bits()));
            #[expect(clippy::cast_possible_truncation, reason = "halves of the bits")]
            bits.extend(
                [large, far, apart].map(|loss| (loss.to_bits() ^ (loss.to_bits() >> 32)) as u32),
            );
        }
        bits
    })
}

#[test]
fn one_thread_and_several_compute_the_same_bytes() {
    let alone = fitted(1);
    for threads in [2, 5] {
        assert!(fitted(threads) == alone, "{threads} threads");
    }
}
