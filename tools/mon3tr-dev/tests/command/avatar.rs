//! From nothing to the table: a test capture is made, an avatar trained of it and measured on it.

use crate::support::mon3tr;
use spmm3::Avatar;
use synthetic_person::real_files::makehuman;
use test_support::{onnx, vulkan};

#[test]
fn a_synthesised_capture_becomes_an_avatar_that_is_measured_on_it() {
    let (Some(_), Some(gpu), Some(_)) = (makehuman(), vulkan::gpu(), onnx::runtime()) else {
        return;
    };
    let folder = tempfile::tempdir().expect("a folder");
    let path = |name: &str| folder.path().join(name).display().to_string();
    let (capture, package, other, work) = (
        path("capture"),
        path("me.m3a"),
        path("new.m3a"),
        path("work"),
    );
    let small = ["--cameras", "4", "--size", "128x128", "--frames", "3"];
    let held_out = ["--held-out-frames", "1", "--held-out-cameras", "1"];
    let synthesise = [
        &["capture", "synthesise", "-o", &capture],
        &small[..],
        &held_out,
    ]
    .concat();
    mon3tr(&synthesise).succeeds();

    let reconstruct = |out: &str, more: &[&str]| {
        mon3tr(&[&["reconstruct", &capture, "-o", out, "--work", &work], more].concat())
    };
    // Fewer than the first avatar has.
    let said = reconstruct(&package, &["--steps", "12", "--gaussians", "900"]).succeeds();
    assert!(said.contains("900 Gaussians, 12 steps"), "{said}");
    let trained = Avatar::load(std::path::Path::new(&package)).expect("a package");
    assert_eq!(trained.gaussians.len(), 900, "as many as were asked for");

    let before = std::fs::read(&package).expect("a package");
    reconstruct(&package, &["--steps", "5"]).fails_naming(&["--resume", "--work", "checkpoint"]);
    assert!(
        std::fs::read(&package).expect("a package") == before,
        "it stays"
    );
    // It is as long as it was to be, so that nothing is left to do but to write the package where there is none.
    let said = reconstruct(&other, &["--resume"]).succeeds();
    assert!(
        said.contains("new.m3a") && said.contains("12 steps"),
        "{said}"
    );
    Avatar::load(std::path::Path::new(&other)).expect("a package there as well");

    // On a Vulkan device, and where there is no such device on the CPU.
    let name = gpu.info().name.as_str();
    for (gpu, drawn_on) in [(name, name), ("a toaster", "the CPU")] {
        let (out, work) = (path(&format!("on {gpu}.m3a")), path(&format!("on {gpu}")));
        let on_gpu = ["--device", "gpu", "--gpu", gpu, "--steps", "3"];
        let from = ["--template", &package, "-o", &out, "--work", &work];
        let said = mon3tr(&[&["reconstruct", &capture], &on_gpu[..], &from].concat()).succeeds();
        let drawn_on = format!("drawn on {drawn_on}");
        assert!(
            said.contains("3 steps") && said.contains(&drawn_on),
            "{said}"
        );
    }

    let json = path("figures.json");
    let eval = [
        "eval",
        "avatar",
        &capture,
        &package,
        "--pictures",
        "2",
        "--json",
        &json,
    ];
    let table = mon3tr(&eval).succeeds();
    for words in ["training poses", "novel poses", "novel views"] {
        assert!(table.contains(words), "{words} is missing in:\n{table}");
    }
    let figures: serde_json::Value =
        serde_json::from_slice(&std::fs::read(&json).expect("figures")).expect("JSON");
    let groups = figures["rows"][0]["groups"].as_array().expect("groups");
    assert_eq!(groups.len(), 3, "{figures:#}");
    for group in groups {
        let psnr = group["psnr_masked"].as_f64().expect("a figure");
        // The first avatar alone has 20 dB; grey has 12.
        assert!(psnr > 15.0, "{psnr} dB in {group:#}");
    }
}
