//! Gaussian scenes on the command line: inspected, drawn alone and around a person.

use crate::floor::{FLOOR, cameras, green, scene};
use crate::support::{json, mon3tr, puppet, text};
use std::path::Path;
use test_support::onnx::runtime;
use test_support::vulkan::gpu;

#[test]
fn inspect_tells_a_scene_by_its_content_and_counts_what_it_leaves_out() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let (file, figures) = (
        folder.path().join("odd.name"),
        folder.path().join("figures.json"),
    );
    std::fs::rename(scene(folder.path()), &file).expect("a file can be renamed");
    let shown = mon3tr(&["inspect", text(&file), "--json", text(&figures)]).succeeds();
    for word in [
        "3DGS PLY",
        "900",
        "SH degree    0",
        "1 for their position",
        "on the GPU",
    ] {
        assert!(shown.contains(word), "`{word}` is missing in:\n{shown}");
    }
    let figures = json(&figures);
    assert_eq!(figures["gaussians"], FLOOR, "count");
    assert_eq!(figures["dropped"]["position"], 1, "left out");
    assert!(
        figures["gpu_bytes"]
            .as_u64()
            .is_some_and(|bytes| bytes >= 20 * 900),
        "bytes on the GPU: {figures}"
    );
    let diary = folder.path().join("diary.txt");
    std::fs::write(&diary, "dear diary").expect("a file can be written");
    mon3tr(&["inspect", text(&diary)]).fails_naming(&["diary.txt", ".ply", ".spz"]);
    let nothing = folder.path().join("nothing.ply");
    std::fs::write(&nothing, "").expect("a file can be written");
    mon3tr(&["inspect", text(&nothing)]).fails_naming(&["nothing.ply", "empty"]);
    mon3tr(&["inspect", text(folder.path())]).fails_naming(&["is a folder"]);
    mon3tr(&["inspect", "nowhere.ply"]).fails_naming(&["nowhere.ply", "No such file"]);
}

#[test]
fn inspect_tells_what_is_up_and_why_and_takes_another_axis() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let (file, figures) = (scene(folder.path()), folder.path().join("figures.json"));
    let inspect = |arguments: &[&str]| {
        let fixed = ["inspect", text(&file), "--json", text(&figures)];
        let shown = mon3tr(&[&fixed[..], arguments].concat()).succeeds();
        (shown, json(&figures))
    };
    let (shown, usual) = inspect(&[]);
    assert!(shown.contains("up           -y (as is usual"), "{shown}");
    assert_eq!(usual["up"], "-y", "{usual}");
    // The floor reaches from -1.45 to 1.45 in x and z, and from there to the side in which it stands upright.
    let height = |figures: &serde_json::Value| figures["bounds"][1][1].as_f64().expect("a height");
    assert!(height(&usual).abs() < 1e-4, "a floor: {usual}");
    let (shown, standing) = inspect(&["--up", "+z"]);
    assert!(shown.contains("up           +z (as --up says)"), "{shown}");
    assert!(
        (height(&standing) - 1.45).abs() < 1e-4,
        "a wall: {standing}"
    );
    let (_, auto) = inspect(&["--up", "auto"]);
    assert_eq!(auto, usual, "the default");
    mon3tr(&["inspect", text(&file), "--up", "sideways"]).fails_naming(&["sideways", "+z"]);
    mon3tr(&["render", "person.m3a", "--up", "+z"]).fails_naming(&["required arguments"]);
}

#[test]
fn inspect_reads_the_formats_that_other_programs_write_today() {
    let fixtures = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../splat-scene/tests/fixtures");
    for (name, format) in [
        ("synthetic-v4.spz", ".spz version 4"),
        ("synthetic.sog", "SOG version 2"),
    ] {
        let shown = mon3tr(&["inspect", text(&fixtures.join(name))]).succeeds();
        for word in [format, "Gaussians    24", "SH degree    3"] {
            assert!(shown.contains(word), "`{word}` is missing in:\n{shown}");
        }
    }
}

#[test]
fn render_shows_a_scene_without_anyone_from_a_side_or_from_its_cameras() {
    if gpu().is_none() {
        return;
    }
    let folder = tempfile::tempdir().expect("a temporary folder");
    let (scene, cameras) = (scene(folder.path()), cameras(folder.path()));
    let picture = |out: &str, more: &[&str]| {
        let out = folder.path().join(out);
        let arguments = [
            "render",
            "--background",
            text(&scene),
            "--size",
            "160x80",
            "--out",
            text(&out),
        ];
        mon3tr(&[&arguments[..], more].concat()).succeeds();
        out.join("frame_00000.png")
    };
    let figures = folder.path().join("figures.json");
    let overview = picture("overview", &["--json", text(&figures)]);
    let dimensions = image::image_dimensions(&overview).expect("a PNG");
    assert_eq!(dimensions, (160, 80), "the size asked for");
    assert!(green(&overview) > 500, "the floor is in the picture");
    let figures = json(&figures);
    assert_eq!(figures["background"]["gaussians"], FLOOR, "count");
    let splatting = &figures["runs"][0]["splatting"];
    let back_end = splatting["back_end"].as_str().unwrap_or_default();
    assert!(["tiles", "quads"].contains(&back_end), "{splatting}");

    let of_file = ["--view", text(&cameras)];
    let third = picture("third", &[&of_file[..], &["--id", "3"]].concat());
    let seventh = picture("seventh", &[&of_file[..], &["--id", "7"]].concat());
    let first = picture("first", &of_file);
    let own = folder.path().join("own");
    mon3tr(&[
        "render",
        "--background",
        text(&scene),
        "--view",
        text(&cameras),
        "--out",
        text(&own),
    ])
    .succeeds();
    let dimensions = image::image_dimensions(own.join("frame_00000.png")).expect("a PNG");
    assert_eq!(dimensions, (200, 100), "the camera's own size");
    let read = |path: &Path| std::fs::read(path).expect("a picture");
    assert!(
        green(&third) > 500 && green(&seventh) > 500,
        "the floor is seen by both"
    );
    assert_ne!(read(&third), read(&seventh), "from different places");
    // Each run draws with the back end that it found faster, and these agree to a few steps of 256.
    let [third, first] = [&third, &first].map(|path| image::open(path).expect("a PNG").to_rgb8());
    let furthest = (third.as_raw().iter().zip(first.as_raw()))
        .map(|(a, b)| a.abs_diff(*b))
        .max();
    assert!(
        furthest.is_some_and(|steps| steps <= 4),
        "without --id it is the file's first camera: {furthest:?} steps apart"
    );
}

#[test]
fn render_explains_mistakes_about_scenes_and_cameras() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let (scene, cameras) = (scene(folder.path()), cameras(folder.path()));
    let (scene, cameras) = (text(&scene), text(&cameras));
    let render = |arguments: &[&str]| mon3tr(&[&["render"], arguments].concat());
    render(&["--background", scene, "--view", cameras, "--id", "9"])
        .fails_naming(&["camera 9", "3, 7"]);
    render(&["--background", scene, "--id", "3"]).fails_naming(&["--id", "--view"]);
    render(&["nobody.m3a", "--view", cameras]).fails_naming(&["--background"]);
    render(&["--background", "nowhere.ply"]).fails_naming(&["nowhere.ply"]);
    render(&["--background", cameras]).fails_naming(&["cameras.json", ".ply"]);
    render(&["--background", scene, "--place", "1,2"]).fails_naming(&["1,2", "DEGREES"]);
    render(&["--background", scene, "--place", "1,2,3"]).fails_naming(&["--place", "PACKAGE"]);
    render(&["--background", scene, "--frames", "0..2"]).fails_naming(&["--frames", "PACKAGE"]);
    render(&[scene]).fails_naming(&["floor.ply", "--background"]);
    let package = folder.path().join("person.m3a");
    std::fs::write(&package, b"PK\x03\x04 and so on").expect("a file can be written");
    render(&["--background", text(&package)]).fails_naming(&["person.m3a", "avatar package"]);
    let header = "ply\nformat ascii 1.0\nelement vertex 0\n";
    let names = [
        "x", "y", "z", "opacity", "f_dc_0", "f_dc_1", "f_dc_2", "scale_0", "scale_1", "scale_2",
        "rot_0", "rot_1", "rot_2", "rot_3",
    ];
    let properties: String = names
        .iter()
        .map(|name| format!("property float {name}\n"))
        .collect();
    let empty = folder.path().join("vacuum.ply");
    std::fs::write(&empty, format!("{header}{properties}end_header\n")).expect("a file");
    render(&["--background", text(&empty)]).fails_naming(&["vacuum.ply", "no Gaussian"]);
    render(&[]).fails_naming(&["avatar package", "--background"]);
}

#[test]
fn render_puts_a_person_onto_a_scenes_ground_wherever_that_lies() {
    if gpu().is_none() || runtime().is_none() {
        return;
    }
    let folder = tempfile::tempdir().expect("a temporary folder");
    let (scene, package) = (scene(folder.path()), puppet(&folder));
    let figures = folder.path().join("figures.json");
    let picture = |out: &str, more: &[&str]| {
        let out = folder.path().join(out);
        let arguments = [
            "render",
            text(&package),
            "--background",
            text(&scene),
            "--frames",
            "0..1",
            "--size",
            "128x128",
            "--out",
            text(&out),
            "--json",
            text(&figures),
        ];
        mon3tr(&[&arguments[..], more].concat()).succeeds();
        out.join("frame_00000.png")
    };
    let around = picture("around", &[]);
    assert!(green(&around) > 200, "the floor is in the picture");
    let figures_around = json(&figures);
    assert_eq!(figures_around["background"]["gaussians"], FLOOR, "count");
    assert_eq!(
        figures_around["avatar"]["gaussians"], 2000,
        "and the person's"
    );
    let below = picture("below", &["--place", "0,-20,0"]);
    assert_eq!(green(&below), 0, "a floor 20 m below is out of the picture");
}
