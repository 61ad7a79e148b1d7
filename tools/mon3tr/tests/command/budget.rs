//! `budget`: counts, and what is predicted of them.

use crate::command::{json, mon3tr, puppet, text};
use serde_json::Value;

/// Least, likely and most.
fn estimate(value: &Value) -> [f64; 3] {
    let [least, likely, most] =
        ["least", "likely", "most"].map(|name| value[name].as_f64().expect("a number"));
    assert!(0.0 <= least && least <= likely && likely <= most, "{value}");
    [least, likely, most]
}

#[test]
fn one_to_four_people_are_counted_and_predicted_by_each_back_end() {
    if test_support::vulkan::gpu().is_none() {
        return;
    }
    let folder = tempfile::tempdir().expect("a folder");
    let (package, figures) = (puppet(&folder), folder.path().join("budget.json"));
    let out = mon3tr(&[
        "budget",
        text(&package),
        "--size",
        "320x336",
        "--json",
        text(&figures),
    ])
    .succeeds();
    for told in [
        "Counted:",
        "by tiles",
        "by quads",
        "72 Hz",
        "SqueezeMe",
        "a model",
    ] {
        assert!(out.contains(told), "{told} is missing in:\n{out}");
    }
    let figures = json(&figures);
    let crowds = figures["crowds"].as_array().expect("people");
    assert_eq!(crowds.len(), 4, "one to four");
    let mut before = 0;
    for (people, crowd) in (1u64..).zip(crowds) {
        assert_eq!(crowd["people"], people);
        let gaussians = crowd["work"]["gaussians"].as_u64().expect("a count");
        assert_eq!(gaussians % people, 0, "the same person each time");
        assert!(gaussians > before, "{gaussians} after {before}");
        before = gaussians;
        let views = crowd["work"]["views"].as_array().expect("eyes");
        assert_eq!(views.len(), 2, "both eyes");
        for view in views {
            let count = |name: &str| view[name].as_u64().expect("a count");
            assert!(
                count("covered") > 0 && count("pairs") >= count("splats"),
                "{view}"
            );
        }
        for back_end in crowd["back_ends"].as_array().expect("two") {
            let stages = back_end["stages"].as_array().expect("stages");
            let sums = stages.iter().map(|stage| estimate(&stage["ms"]));
            let sum = sums.fold([0.0; 3], |sum, one| {
                std::array::from_fn(|at| sum[at] + one[at])
            });
            for (sum, told) in sum.into_iter().zip(estimate(&back_end["sum"])) {
                assert!((sum - told).abs() < 1e-9, "{back_end}");
            }
        }
        for placement in crowd["placements"].as_array().expect("placements") {
            let [_, draw, _] = estimate(&placement["draw"]);
            let [_, picture, _] = estimate(&placement["picture"]);
            assert!(picture > draw, "with the compositor: {placement}");
        }
        for rate in crowd["rates"].as_array().expect("rates") {
            let (left, [_, sum, _]) = (rate["left_ms"].as_f64(), estimate(&rate["sum"]));
            assert_eq!(rate["step"].is_null(), Some(sum) > left, "{rate}");
        }
    }
}

#[test]
fn what_cannot_be_reckoned_with_is_refused() {
    mon3tr(&["budget", "me.m3a", "--distance", "0"]).fails_naming(&["--distance 0", "0.3"]);
    mon3tr(&["budget", "no-such.m3a"]).fails_naming(&["no-such.m3a"]);
}
