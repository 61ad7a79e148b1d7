//! `mon3tr-dev bench` on small scenes: what it prints and writes.

use crate::floor::{FLOOR, cameras, green, scene};
use crate::support::{json, mon3tr, text};
use test_support::vulkan::gpu;

#[test]
fn bench_render_times_a_scene_frame_by_frame() {
    if gpu().is_none() {
        return;
    }
    let folder = tempfile::tempdir().expect("a temporary folder");
    let (scene, cameras) = (scene(folder.path()), cameras(folder.path()));
    let (figures, picture) = (
        folder.path().join("figures.json"),
        folder.path().join("a.png"),
    );
    let arguments = [
        "bench",
        "render",
        "--scene",
        text(&scene),
        "--view",
        text(&cameras),
        "--id",
        "3",
        "--size",
        "96x64",
        "--frames",
        "2",
        "--back-end",
        "quads",
        "--json",
        text(&figures),
        "--png",
        text(&picture),
    ];
    let shown = mon3tr(&arguments).succeeds();
    assert!(shown.contains("| upload"), "a table:\n{shown}");
    let figures = json(&figures);
    for stage in [
        "total", "upload", "project", "sort", "draw", "bin", "raster",
    ] {
        let samples = figures[format!("{stage}_ms")].as_array().map(Vec::len);
        assert_eq!(samples, Some(2), "{stage}");
    }
    assert_eq!(figures["gaussians"], FLOOR, "count");
    assert_eq!(figures["back_end"], "quads", "as asked for");
    assert!(green(&picture) > 100, "its picture shows the floor");
}

#[test]
fn bench_render_and_bench_sort_make_the_tables_of_the_documentation() {
    let Some(gpu) = gpu() else { return };
    let folder = tempfile::tempdir().expect("a temporary folder");
    let figures = folder.path().join("figures.json");
    let small = ["--frames", "1", "--json", text(&figures)];
    let shown = mon3tr(&[&["bench", "render", "--size", "64x64"], &small[..]].concat()).succeeds();
    for word in [
        "| 1M ",
        "2 x 64x64",
        "400k to 1M: 2.50x",
        "| quads ",
        "GB/s",
    ] {
        let needs_clock = word == "GB/s" && !gpu.has_clock();
        assert!(
            needs_clock || shown.contains(word),
            "`{word}` is missing in:\n{shown}"
        );
    }
    let rows = json(&figures)["rows"].clone();
    assert_eq!(
        rows.as_array().map(Vec::len),
        Some(10),
        "5 counts, one eye and both"
    );
    assert!(
        rows[4]["medians"]["total_ms"]
            .as_f64()
            .is_some_and(|ms| ms > 0.0),
        "1M Gaussians take time"
    );

    if !gpu.has_clock() {
        return;
    }
    let shown = mon3tr(&[&["bench", "sort"], &small[..]].concat()).succeeds();
    for word in ["| 20k ", "| 4M ", "clustered", "all equal"] {
        assert!(shown.contains(word), "`{word}` is missing in:\n{shown}");
    }
    let rows = json(&figures)["rows"].clone();
    assert_eq!(
        rows.as_array().map(Vec::len),
        Some(21),
        "7 counts, 3 kinds of depths"
    );
}
