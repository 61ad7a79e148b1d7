//! The device's sort against std's stable sort.

use std::cell::RefCell;

use mon3tr_tests::vulkan::{assert_silent, gpu, rerun_with_other_subgroups};
use proptest::prelude::*;
use proptest::test_runner::{Config, TestRunner};
use xr_renderer::Sorter;

fn stable_order(keys: &[u16]) -> Vec<u32> {
    let mut order: Vec<u32> = (0..u32::try_from(keys.len()).expect("few")).collect();
    order.sort_by_key(|index| keys[*index as usize]);
    order
}

#[test]
fn the_device_sorts_as_std_does_at_every_size() {
    let Some(gpu) = gpu() else { return };
    let mut sorter = Sorter::new(&gpu, 300_000).expect("a sorter");
    let mut state = 0x2545_F491u32;
    for count in [0, 1, 2, 255, 65_537, 300_000] {
        let mut random = || {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            u16::try_from(state >> 16).expect("16 bits")
        };
        let spread: Vec<u16> = (0..count).map(|_| random()).collect();
        let crowded: Vec<u16> = (0..count).map(|_| random() % 50).collect();
        let equal = vec![u16::MAX; count];
        for (keys, kind) in [(spread, "spread"), (crowded, "crowded"), (equal, "equal")] {
            let got = sorter.sort_keys(&keys).expect("a sort");
            assert!(
                got == stable_order(&keys),
                "{count} {kind} keys are out of order"
            );
        }
    }
    assert!(
        sorter.sort_keys(&[0; 300_001]).is_err(),
        "one more than fits"
    );
    println!("sorted in subgroups of {}", gpu.subgroup_size());
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
fn the_sort_is_right_for_every_subgroup_size_of_the_software_driver() {
    let Some(gpu) = gpu() else { return };
    for (size, text) in rerun_with_other_subgroups(&gpu, &["the_device_sorts_as_std_does"]) {
        assert!(
            text.contains(&format!("sorted in subgroups of {size}")),
            "{text}"
        );
    }
}
