//! Strangers whose packages cost those who look at them much, in a room with others; and Ctrl-C while the device is busy.

use crate::command::command;
use crate::house::{House, Program, Sender, count};
use splat_scene::SH_C0;
use std::path::Path;
use std::time::Duration;
use synthetic_person::hostile::{cloud, hollow};
use test_support::{onnx, vulkan};

/// What `receive` may take for one person, whoever they are, drawn by a software driver: 1,042 MB were measured, of which this test's own pictures, and several
/// times the largest graph.
const MOST_MEMORY: u64 = 1200 << 20;

fn can_draw() -> bool {
    vulkan::gpu().is_some() && onnx::runtime().is_some()
}

/// A house whose person is that one.
fn house_of(avatar: &spmm3::Avatar) -> (House, Sender) {
    let house = House::open();
    let saved = avatar.save(&house.avatar);
    saved.expect("a package may hold them");
    let sender = house.sender(&[]);
    (house, sender)
}

#[test]
fn who_covers_too_many_tiles_is_left_out_and_the_others_are_seen() {
    if !can_draw() {
        return;
    }
    let house = House::open();
    let good = house.sender(&[]);
    let (_second, burden) = house_of(&cloud(2_000, 0.49));
    let (out, json) = (house.path("pictures"), house.new_report());
    let mut command = command(&["receive", &good.viewers, &burden.viewers, "--stereo"]);
    command
        .args(["--display", "offscreen", "--size", "1024x1024"])
        .args(["--frames", "12", "--out", &out, "--json", &json]);
    let (report, said) = Program::start_as(&house, out.as_ref(), &mut command).report_and_said();
    assert!(said.contains("is left out of pictures"), "{said}");
    let drawn = &report["drawing"]["measured"]["pictures"];
    assert!(count(drawn, "shown") >= 10, "{report:#}");
    assert!(report["left_out"].is_null(), "{report:#}");
    let left_out = &report["others"][0]["left_out"];
    assert!(count(left_out, "pairs") > 1 << 23, "{left_out:#}");
    assert!(count(left_out, "pictures") >= 1, "{left_out:#}");
}

#[test]
fn another_persons_package_takes_a_bounded_amount_of_memory() {
    if !can_draw() {
        return;
    }
    // The largest that may be, and one that is larger.
    let (house, sender) = house_of(&hollow(6_500));
    let (out, json) = (house.path("pictures"), house.new_report());
    let mut command = command(&["receive", &sender.viewers, "--display", "offscreen"]);
    command
        .args(["--size", "200x150", "--frames", "10000"])
        .args(["--out", &out, "--json", &json])
        .env("RUST_LOG", "link=info");
    let mut receiver = Program::start_as(&house, out.as_ref(), &mut command);
    receiver.says("joined (session", 1);
    std::thread::sleep(Duration::from_secs(3));
    let peak = receiver.peak_memory();
    println!("{} MB at most", peak / 1_000_000);
    assert!(peak < MOST_MEMORY, "{peak} bytes");
    receiver.ends();

    let (other, sender) = house_of(&hollow(8_000));
    let receiver = other.receiver(&sender.viewers, "cache", &[]);
    let said = receiver.fails();
    assert!(said.contains("bytes of networks"), "{said}");
}

/// A scene of the viewer's own that takes the device seconds a picture.
fn slow_scene(path: &Path) {
    const SPLATS: usize = 1_900;
    let mut ply = b"ply\nformat binary_little_endian 1.0\nelement vertex ".to_vec();
    ply.extend(format!("{SPLATS}\n").bytes());
    for name in [
        "x", "y", "z", "f_dc_0", "f_dc_1", "f_dc_2", "opacity", "scale_0", "scale_1", "scale_2",
        "rot_0", "rot_1", "rot_2", "rot_3",
    ] {
        ply.extend(format!("property float {name}\n").bytes());
    }
    ply.extend(b"end_header\n");
    for splat in 0..SPLATS {
        let depth = splat as f32 * 1e-3;
        let (grey, faint, large) = (0.2 / SH_C0, -4.0, 20.0_f32.ln());
        let numbers = [
            0.0, 0.0, depth, grey, grey, grey, faint, large, large, large, 1.0, 0.0, 0.0, 0.0,
        ];
        ply.extend(numbers.iter().flat_map(|number: &f32| number.to_le_bytes()));
    }
    std::fs::write(path, ply).expect("a file");
}

#[test]
fn ctrl_c_ends_a_viewer_whose_device_is_busy() {
    if !can_draw() {
        return;
    }
    let (house, sender) = house_of(&cloud(2_000, 0.49));
    let scene = house.path("slow.ply");
    slow_scene(scene.as_ref());
    let (out, json) = (house.path("pictures"), house.new_report());
    let mut command = command(&["receive", &sender.viewers, "--display", "offscreen"]);
    command
        .args(["--size", "2048x2048", "--background", &scene])
        .args(["--out", &out, "--json", &json])
        .env("RUST_LOG", "link=info");
    let mut receiver = Program::start_as(&house, out.as_ref(), &mut command);
    receiver.says("joined (session", 1);
    std::thread::sleep(Duration::from_secs(2));
    let (status, took, said) = receiver.interrupted();
    println!("ended ({status}) after {took:?}");
    // Between two pictures it may have noticed by itself, and then says goodbye and writes what it measured.
    let longest = match status.code() {
        Some(130) => Duration::from_secs(5),
        Some(0) => Duration::from_secs(12),
        _ => panic!("{status}:\n{said}"),
    };
    assert!(took < longest, "{took:?}:\n{said}");
}
