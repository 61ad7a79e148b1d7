//! The same bytes from any number of threads.

use crate::scenes::{attributes_of, random_picture, view_of};
use rayon::ThreadPoolBuilder;
use splat_gradient::adam::{Adam, Group};
use splat_gradient::attributes::{ATTRIBUTES, Attributes};
use splat_gradient::loss::{Ssim, Target, alpha_l1, colour_l1};
use splat_gradient::{Picture, Splatter};
use synthetic_person::Random;
use test_support::splat_scenes::{in_front_of_figure, standing_figure};

/// Three steps of a fit: every number that comes of them.
fn fitted(threads: usize) -> (Vec<u32>, Vec<u64>) {
    let pool = ThreadPoolBuilder::new()
        .num_threads(threads)
        .build()
        .expect("threads");
    pool.install(|| {
        let mut attributes = attributes_of(&standing_figure(9_000));
        let view = view_of(&in_front_of_figure(200, 150));
        let target = Target::new(random_picture(200, 150, &mut Random::new(4)));
        let (mut splatter, mut ssim) = (Splatter::new(), Ssim::new());
        let mut adam = Adam::new(attributes.numbers().len());
        let groups = [Group {
            count: attributes.len(),
            rate: 1e-3,
        }; ATTRIBUTES];
        let mut wide = Vec::new();
        for _ in 0..3 {
            let mut drawn = splatter.draw(&attributes, &view);
            let mut by_pixel = Picture::transparent(200, 150);
            let picture = drawn.picture();
            wide.push(colour_l1(picture, &target, 0.8, &mut by_pixel).expect("one size"));
            wide.push(alpha_l1(picture, &target, 0.1, &mut by_pixel).expect("one size"));
            wide.push(
                ssim.loss(picture, &target, 0.2, &mut by_pixel)
                    .expect("one size"),
            );
            let mut gradients = Attributes::zeros(9_000);
            wide.extend(drawn.backward(&by_pixel, &mut gradients).expect("one size"));
            adam.step(attributes.numbers_mut(), gradients.numbers(), &groups)
                .expect("all");
        }
        let bits = attributes.numbers().iter().map(|number| number.to_bits());
        (
            bits.collect(),
            wide.iter().map(|number| number.to_bits()).collect(),
        )
    })
}

#[test]
fn one_thread_and_several_compute_the_same_bytes() {
    let alone = fitted(1);
    for threads in [2, 5] {
        assert!(fitted(threads) == alone, "{threads} threads");
    }
}
