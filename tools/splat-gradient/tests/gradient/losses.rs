//! Losses and their derivatives against plain f64 sums and their differences.

use splat_gradient::Picture;
use splat_gradient::loss::{Ssim, Target, alpha_l1, colour_l1};
use synthetic_person::Random;

const SIZE: [usize; 2] = [19, 13];
const PIXELS: usize = SIZE[0] * SIZE[1];

/// The SSIM of the window around every pixel, by the article's formulas, a double loop over each window; nothing is beyond the edge.
fn windows([width, height]: [usize; 2], x: &[f64], y: &[f64]) -> Vec<f64> {
    let middles = (0..height).flat_map(|row| (0..width).map(move |column| (row, column)));
    middles
        .map(|(row, column)| {
            let (mut sum, mut m) = (0.0, [0.0; 5]);
            for (v, u) in (-5isize..=5).flat_map(|v| (-5isize..=5).map(move |u| (v, u))) {
                let square = u32::try_from(v * v + u * u).expect("at most 50");
                let weight = (-f64::from(square) / (2.0 * 1.5 * 1.5)).exp();
                sum += weight;
                let row = row.checked_add_signed(v).filter(|row| *row < height);
                let column = column
                    .checked_add_signed(u)
                    .filter(|column| *column < width);
                if let Some((row, column)) = row.zip(column) {
                    let (x, y) = (x[row * width + column], y[row * width + column]);
                    for (m, value) in m.iter_mut().zip([x, y, x * x, y * y, x * y]) {
                        *m += weight * value;
                    }
                }
            }
            let [mx, my, xx, yy, xy] = m.map(|m| m / sum);
            let (c1, c2) = (0.0001, 0.0009);
            let (vx, vy, vxy) = (xx - mx * mx, yy - my * my, xy - mx * my);
            (2.0 * mx * my + c1) * (2.0 * vxy + c2) / ((mx * mx + my * my + c1) * (vx + vy + c2))
        })
        .collect()
}

/// Two pictures that resemble one another, and weights of which some are 0.
fn pictures() -> (Picture, Target) {
    let mut random = Random::new(9);
    let mut wanted = Vec::new();
    let mut drawn = Vec::new();
    for index in 0..4 * PIXELS {
        let place = f32::from(u16::try_from(index).expect("few"));
        let value = 0.5 + 0.3 * (0.7 * place).sin() + 0.1 * random.signed();
        wanted.push(value);
        drawn.push(value + 0.2 * random.signed());
    }
    let weights = (0..PIXELS).map(|at| {
        if at % 5 == 0 {
            0.0
        } else {
            0.2 + random.unit()
        }
    });
    let picture = |numbers| Picture::new(SIZE[0], SIZE[1], numbers).expect("as many");
    let target = Target::weighted(picture(wanted), weights.collect()).expect("as many");
    (picture(drawn), target)
}

fn wide(numbers: &[f32]) -> Vec<f64> {
    numbers.iter().map(|number| f64::from(*number)).collect()
}

/// The loss and its derivatives from the crate against a plain f64 loss of the drawn numbers, and its differences.
fn assert_right(
    name: &str,
    loss: impl Fn(&Picture, &Target, f32, &mut Picture) -> f64,
    plain: impl Fn(&[f64], &[f64], &[f64]) -> f64,
) {
    let (drawn, target) = pictures();
    let share = 0.7f32;
    let mut by_pixel = Picture::transparent(SIZE[0], SIZE[1]);
    let got = loss(&drawn, &target, share, &mut by_pixel);
    let wanted = wide(target.picture().numbers());
    let weights = wide(target.weights());
    let mut numbers = wide(drawn.numbers());
    let expected = plain(&numbers, &wanted, &weights);
    assert!(
        (got - expected).abs() < 1e-6,
        "{name}: {got}, expected {expected}"
    );

    let (mut error, mut size) = (0.0, 0.0);
    for index in 0..numbers.len() {
        let middle = numbers[index];
        let mut side = |step: f64| {
            numbers[index] = middle + step;
            plain(&numbers, &wanted, &weights)
        };
        let slope = f64::from(share) * (side(1e-5) - side(-1e-5)) / 2e-5;
        numbers[index] = middle;
        let difference = f64::from(by_pixel.numbers()[index]) - slope;
        error += difference * difference;
        size += slope * slope;
    }
    let relative = (error / size).sqrt();
    println!("{name}: derivatives to {relative:.1e}");
    assert!(
        relative < 1e-4,
        "{name}: derivatives differ by {relative:e}"
    );

    // Added to what was there.
    let before = by_pixel.clone();
    loss(&drawn, &target, share, &mut by_pixel);
    for (twice, once) in by_pixel.numbers().iter().zip(before.numbers()) {
        assert!(
            (twice - 2.0 * once).abs() <= 1e-6 * once.abs(),
            "{name}: {twice}, {once}"
        );
    }
}

#[test]
fn l1_of_colours_is_the_mean_of_differences() {
    assert_right(
        "L1",
        |drawn, target, share, by| colour_l1(drawn, target, share, by).expect("one size"),
        |drawn, wanted, weights| {
            let terms = (0..3 * PIXELS).map(|k| weights[k % PIXELS] * (drawn[k] - wanted[k]).abs());
            terms.sum::<f64>() / (3.0 * weights.iter().sum::<f64>())
        },
    );
}

#[test]
fn l1_of_alpha_is_the_mean_of_differences() {
    assert_right(
        "alpha's L1",
        |drawn, target, share, by| alpha_l1(drawn, target, share, by).expect("one size"),
        |drawn, wanted, weights| {
            let terms = (0..PIXELS)
                .map(|k| weights[k] * (drawn[3 * PIXELS + k] - wanted[3 * PIXELS + k]).abs());
            terms.sum::<f64>() / weights.iter().sum::<f64>()
        },
    );
}

#[test]
fn ssim_is_that_of_the_article() {
    assert_right(
        "SSIM",
        |drawn, target, share, by| {
            Ssim::new()
                .loss(drawn, target, share, by)
                .expect("one size")
        },
        |drawn, wanted, weights| {
            let channel =
                |numbers: &[f64], c: usize| numbers[c * PIXELS..(c + 1) * PIXELS].to_vec();
            let terms = (0..3).map(|c| {
                let all = windows(SIZE, &channel(drawn, c), &channel(wanted, c));
                all.iter()
                    .zip(weights)
                    .map(|(ssim, weight)| ssim * weight)
                    .sum::<f64>()
            });
            1.0 - terms.sum::<f64>() / (3.0 * weights.iter().sum::<f64>())
        },
    );
}

#[test]
fn ssim_of_something_small_before_black_is_that_of_the_whole_picture() {
    // Large enough that windows far from the patch see nothing.
    let size = [61, 52];
    let pixels = size[0] * size[1];
    let mut random = Random::new(14);
    let (mut drawn, mut wanted) = (vec![0.0; 4 * pixels], vec![0.0; 4 * pixels]);
    for (row, column) in (23..27).flat_map(|row| (28..34).map(move |column| (row, column))) {
        drawn[row * size[0] + column] = random.unit();
        wanted[row * size[0] + column + 1] = random.unit();
    }
    let picture =
        |numbers: &[f32]| Picture::new(size[0], size[1], numbers.to_vec()).expect("as many");
    let target = Target::new(picture(&wanted));
    let mut by_pixel = picture(&vec![0.0; 4 * pixels]);
    let got = Ssim::new()
        .loss(&picture(&drawn), &target, 1.0, &mut by_pixel)
        .expect("one size");
    let wanted = wide(&wanted[..pixels]);
    let mut red = wide(&drawn[..pixels]);
    let area = f64::from(u32::try_from(pixels).expect("few"));
    // Green and blue are equal everywhere.
    let plain =
        |red: &[f64]| (area - windows(size, red, &wanted).iter().sum::<f64>()) / (3.0 * area);
    let expected = plain(&red);
    assert!(
        (got - expected).abs() < 1e-6 * expected,
        "{got}, expected {expected}"
    );
    let greatest = by_pixel
        .plane(0)
        .iter()
        .fold(0.0f32, |most, x| most.max(x.abs()));
    // From within the patch to beyond what any window that touches it reaches.
    for away in [0, 4, 6, 9, 10, 11, 14] {
        for (row, column) in [
            (25, 28 - away),
            (25, 34 + away),
            (23 - away, 30),
            (26 + away, 30),
        ] {
            let at = row * size[0] + column;
            let middle = red[at];
            let mut side = |step: f64| {
                red[at] = middle + step;
                plain(&red)
            };
            let slope = (side(1e-5) - side(-1e-5)) / 2e-5;
            red[at] = middle;
            let difference = (f64::from(by_pixel.plane(0)[at]) - slope).abs();
            assert!(
                difference < 1e-4 * f64::from(greatest),
                "{away} away: {difference}, {slope}"
            );
        }
    }
}

#[test]
fn a_picture_that_is_met_costs_nothing_and_one_of_another_size_is_refused() {
    let (_, target) = pictures();
    let drawn = target.picture().clone();
    let mut by_pixel = Picture::transparent(SIZE[0], SIZE[1]);
    let losses = [
        colour_l1(&drawn, &target, 1.0, &mut by_pixel),
        alpha_l1(&drawn, &target, 1.0, &mut by_pixel),
        Ssim::new().loss(&drawn, &target, 1.0, &mut by_pixel),
    ];
    for loss in losses {
        let loss = loss.expect("one size");
        assert!(loss.abs() < 1e-6, "{loss}");
    }
    let most = by_pixel
        .numbers()
        .iter()
        .fold(0.0f32, |most, x| most.max(x.abs()));
    assert!(most < 1e-4, "derivatives at the least: {most}");
    let other = Picture::transparent(SIZE[0], SIZE[1] + 1);
    assert!(
        Ssim::new()
            .loss(&other, &target, 1.0, &mut by_pixel)
            .is_err(),
        "another height"
    );
    assert!(
        colour_l1(&drawn, &target, 1.0, &mut other.clone()).is_err(),
        "other derivatives"
    );
    assert!(
        Target::weighted(other, vec![1.0; PIXELS]).is_err(),
        "other weights"
    );
}

#[test]
fn pictures_of_one_pixel_and_without_weight_have_finite_losses() {
    let one = |value| Picture::new(1, 1, vec![value; 4]).expect("four");
    for target in [
        Target::new(one(0.7)),
        Target::weighted(one(0.7), vec![0.0]).expect("one"),
        Target::weighted(one(0.7), vec![f32::NAN]).expect("one"),
    ] {
        let mut by_pixel = Picture::transparent(1, 1);
        let sum = colour_l1(&one(0.2), &target, 1.0, &mut by_pixel).expect("one size")
            + alpha_l1(&one(0.2), &target, 1.0, &mut by_pixel).expect("one size")
            + Ssim::new()
                .loss(&one(0.2), &target, 1.0, &mut by_pixel)
                .expect("one size");
        assert!(sum.is_finite(), "{sum}");
        assert!(
            by_pixel.numbers().iter().all(|x| x.is_finite()),
            "{by_pixel:?}"
        );
    }
}

#[test]
fn ssim_of_one_picture_does_not_depend_on_the_ones_before() {
    let mut random = Random::new(5);
    let mut picture = |width: usize, height: usize| {
        let numbers = (0..4 * width * height).map(|_| random.unit()).collect();
        Picture::new(width, height, numbers).expect("as many")
    };
    let mut used = Ssim::new();
    for size in [[40, 31], [26, 60], [40, 31], [33, 20]] {
        let (drawn, wanted) = (picture(size[0], size[1]), picture(size[0], size[1]));
        let target = Target::new(wanted);
        let take = |ssim: &mut Ssim| {
            let mut by_pixel = Picture::transparent(size[0], size[1]);
            let loss = ssim.loss(&drawn, &target, 0.5, &mut by_pixel);
            (loss.expect("one size"), by_pixel)
        };
        assert!(take(&mut used) == take(&mut Ssim::new()), "{size:?}");
    }
}
