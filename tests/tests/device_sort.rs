//! The device's sort against std's stable sort: up to 4,194,304 keys, as many as a scene may have Gaussians.

use std::cell::RefCell;
use std::time::Instant;

use proptest::prelude::*;
use proptest::test_runner::{Config, TestRunner};
use renderer_splat::sort::Sorter;
use synthetic_person::Random;
use test_support::vulkan::{assert_silent, gpu, rerun_with_other_subgroups};

/// As many as a background may have Gaussians.
const MOST: u32 = 1 << 22;

/// The indices that sort `keys`: equal ones stay in the order of their index.
fn stable_order<K: PartialOrd>(keys: &[K]) -> Vec<u32> {
    let mut order: Vec<u32> = (0..u32::try_from(keys.len()).expect("few")).collect();
    let key = |index: u32| &keys[index as usize];
    order.sort_by(|a, b| key(*a).partial_cmp(key(*b)).expect("numbers"));
    order
}

/// `count` depths in metres, all different, least first: neighbours differ by one unit in the last place.
fn distinct_depths(count: u32) -> Vec<f32> {
    let first = 0.75f32.to_bits();
    (first..first + count).map(f32::from_bits).collect()
}

fn shuffle<T>(values: &mut [T], random: &mut Random) {
    for last in (1..values.len()).rev() {
        values.swap(last, random.below(last + 1));
    }
}

fn assert_keys_sorted(sorter: &mut Sorter, keys: &[u16], what: &str) {
    let start = Instant::now();
    let got = sorter.sort_keys(keys).expect("a sort");
    report(what, sorter, start);
    assert!(got == stable_order(keys), "{what} are out of order");
}

fn assert_depths_sorted(sorter: &mut Sorter, metres: &[f32], what: &str) {
    let start = Instant::now();
    let got = sorter.sort_depths(metres).expect("a sort");
    report(what, sorter, start);
    assert!(got == stable_order(metres), "{what} are out of order");
}

fn report(what: &str, sorter: &Sorter, start: Instant) {
    println!(
        "{what}: {:.1} ms on the device, {:.1} with both copies",
        sorter.milliseconds(),
        start.elapsed().as_secs_f64() * 1e3
    );
}

#[test]
fn the_device_sorts_as_std_does_at_every_size() {
    let Some(gpu) = gpu() else { return };
    let mut sorter = Sorter::new(&gpu, 300_000).expect("a sorter");
    let mut random = Random::new(1);
    for count in [0, 1, 2, 255, 65_537, 300_000] {
        let spread: Vec<u16> = (0..count).map(|_| random_key(&mut random)).collect();
        let crowded: Vec<u16> = spread.iter().map(|key| key % 50).collect();
        let equal = vec![u16::MAX; count];
        for (keys, kind) in [(spread, "spread"), (crowded, "crowded"), (equal, "equal")] {
            assert_keys_sorted(&mut sorter, &keys, &format!("{count} {kind} keys"));
        }
    }
    assert!(
        sorter.sort_keys(&[0; 300_001]).is_err(),
        "one more than fits"
    );
    println!("sorted in subgroups of {}", gpu.subgroup_size());
    assert_silent(&gpu);
}

fn random_key(random: &mut Random) -> u16 {
    u16::try_from(random.bits() >> 48).expect("16 bits")
}

#[test]
fn ten_seeds_of_up_to_four_million_keys_are_sorted_as_std_does() {
    let Some(gpu) = gpu() else { return };
    let mut sorter = Sorter::new(&gpu, MOST).expect("a sorter");
    for seed in 0..10 {
        let mut random = Random::new(seed);
        for count in [1_000, 60_000, 1_000_000, MOST] {
            let keys: Vec<u16> = (0..count).map(|_| random_key(&mut random)).collect();
            assert_keys_sorted(
                &mut sorter,
                &keys,
                &format!("seed {seed}, {count} random keys"),
            );
        }
    }
    assert_silent(&gpu);
}

#[test]
fn millions_of_distinct_depths_are_sorted_from_any_order() {
    let Some(gpu) = gpu() else { return };
    let mut sorter = Sorter::new(&gpu, MOST).expect("a sorter");
    let mut depths = distinct_depths(MOST);
    assert_depths_sorted(&mut sorter, &depths, "ascending depths");
    depths.reverse();
    assert_depths_sorted(&mut sorter, &depths, "descending depths");
    shuffle(&mut depths, &mut Random::new(5));
    assert_depths_sorted(&mut sorter, &depths, "shuffled depths");
    assert_silent(&gpu);
}

#[test]
fn all_keys_distinct_ascending_or_descending_are_sorted() {
    let Some(gpu) = gpu() else { return };
    let mut sorter = Sorter::new(&gpu, 1 << 16).expect("a sorter");
    let mut keys: Vec<u16> = (0..=u16::MAX).collect();
    assert_keys_sorted(&mut sorter, &keys, "ascending keys");
    keys.reverse();
    assert_keys_sorted(&mut sorter, &keys, "descending keys");
    shuffle(&mut keys, &mut Random::new(6));
    assert_keys_sorted(&mut sorter, &keys, "shuffled keys");
    assert_silent(&gpu);
}

#[test]
fn millions_of_equal_keys_keep_their_order() {
    let Some(gpu) = gpu() else { return };
    let mut sorter = Sorter::new(&gpu, MOST).expect("a sorter");
    let count = MOST as usize;
    assert_keys_sorted(&mut sorter, &vec![7; count], "4M equal keys");
    assert_depths_sorted(&mut sorter, &vec![2.5; count], "4M equal depths");
    // A stray far away leaves all others in one bin.
    let mut stray = distinct_depths(1 << 18);
    shuffle(&mut stray, &mut Random::new(8));
    stray[77] = 1e30;
    assert_depths_sorted(&mut sorter, &stray, "256k depths and a stray");
    assert_silent(&gpu);
}

#[test]
fn crowded_depths_of_few_values_are_sorted() {
    let Some(gpu) = gpu() else { return };
    let count = 1 << 18;
    let mut sorter = Sorter::new(&gpu, 1 << 18).expect("a sorter");
    let mut random = Random::new(9);
    let mut pick = |choices: &[f32]| -> Vec<f32> {
        (0..count)
            .map(|_| {
                choices[usize::try_from(random.bits() >> 40).expect("24 bits") % choices.len()]
            })
            .collect()
    };
    let neighbours: Vec<f32> = (0..30)
        .map(|step| f32::from_bits(2.5f32.to_bits() + step))
        .collect();
    let walls = [1.0, 2.5, 2.6, 40.0];
    let [mut near, mut far] = [pick(&neighbours), pick(&walls)];
    assert_depths_sorted(&mut sorter, &near, "neighbouring depths");
    assert_depths_sorted(&mut sorter, &far, "four walls");
    // In one bin with a stray: the neighbours differ in the lowest of many bits, and are told apart by merging.
    for depths in [&mut near, &mut far] {
        depths[77] = 1e30;
        depths[78] = 1e-30;
        assert_depths_sorted(&mut sorter, depths, "few depths and strays");
    }
    assert_silent(&gpu);
}

#[test]
fn the_device_sorts_as_std_does_whatever_the_keys() {
    let Some(gpu) = gpu() else { return };
    let sorter = RefCell::new(Sorter::new(&gpu, 4_000).expect("a sorter"));
    let keys = prop_oneof![
        proptest::collection::vec(any::<u16>(), 0..4_000),
        proptest::collection::vec(0u16..8, 0..1_000),
        proptest::collection::vec(65_530u16.., 0..1_000),
    ];
    let mut runner = TestRunner::new(Config::with_cases(64));
    runner
        .run(&keys, |keys| {
            let sorted = sorter.borrow_mut().sort_keys(&keys);
            let got = sorted.map_err(|why| TestCaseError::fail(why.to_string()))?;
            prop_assert_eq!(got, stable_order(&keys));
            Ok(())
        })
        .unwrap_or_else(|why| panic!("{why}"));
    assert_silent(&gpu);
}

#[test]
fn the_device_sorts_as_std_does_whatever_the_depths() {
    let Some(gpu) = gpu() else { return };
    let sorter = RefCell::new(Sorter::new(&gpu, 4_000).expect("a sorter"));
    let chosen = [0.05f32, 1.0, 1.0 + f32::EPSILON, 3.2, 1e6];
    let depths = prop_oneof![
        // A room, a person at arm's length, everything a float can say, and ties.
        proptest::collection::vec(0.05f32..30.0, 0..4_000),
        proptest::collection::vec(2.0f32..2.001, 0..4_000),
        proptest::collection::vec(f32::MIN_POSITIVE..f32::MAX, 0..1_000),
        proptest::collection::vec(proptest::sample::select(chosen.to_vec()), 0..1_000),
    ];
    let mut runner = TestRunner::new(Config::with_cases(64));
    runner
        .run(&depths, |metres| {
            let sorted = sorter.borrow_mut().sort_depths(&metres);
            let got = sorted.map_err(|why| TestCaseError::fail(why.to_string()))?;
            prop_assert_eq!(got, stable_order(&metres));
            Ok(())
        })
        .unwrap_or_else(|why| panic!("{why}"));
    assert_silent(&gpu);
}

#[test]
fn the_sort_is_right_for_every_subgroup_size_of_the_software_driver() {
    let Some(gpu) = gpu() else { return };
    for (size, text) in rerun_with_other_subgroups(&gpu, &["the_device_sorts_as_std_does"]) {
        assert!(
            text.contains(&format!("sorted in subgroups of {size}")),
            "{text}"
        );
    }
}
