//! A second screen that shows what the wearer looks at.

use super::sight::DISTANCE;
use super::viewer::{is_focused, monado, viewer};
use crate::command::command;
use crate::house::{House, Program};
use glam::{DQuat, DVec3, Quat};
use image::RgbImage;
use serde_json::Value;
use std::cell::Cell;
use std::net::{Ipv4Addr, UdpSocket};
use std::time::{Duration, Instant};
use test_support::monado::{Pose, Scripted};
use test_support::service::attended;

/// The screen's picture, pixels.
const SIDE: u32 = 96;
/// The picture's vertical field of view, degrees.
const FOV: f64 = 50.0;
/// How long the screen is given to go where the wearer is.
const LONG_ENOUGH: Duration = Duration::from_secs(4);

/// Between headset and screen: hears what passes.
struct Wire {
    socket: UdpSocket,
    screen: String,
    /// Lines.
    passed: Cell<u64>,
}

impl Wire {
    fn to(screen: String) -> Self {
        let socket = UdpSocket::bind((Ipv4Addr::LOCALHOST, 0)).expect("a port");
        let longest = Duration::from_secs(60);
        socket.set_read_timeout(Some(longest)).expect("a limit");
        Self {
            socket,
            screen,
            passed: Cell::new(0),
        }
    }

    fn address(&self) -> String {
        self.socket.local_addr().expect("bound").to_string()
    }

    /// Passes on the next line: where the eye is and what it looks at.
    fn pass(&self) -> [DVec3; 2] {
        let mut bytes = [0; 2048];
        let length = self.socket.recv(&mut bytes).expect("a line");
        let line = &bytes[..length];
        self.socket.send_to(line, &self.screen).expect("passed on");
        self.passed.update(|passed| passed + 1);
        let line: Value = serde_json::from_slice(line).expect("JSON");
        ["eye", "towards"].map(|name| {
            let axis = |axis: usize| line[name][axis].as_f64().expect("metres");
            DVec3::new(axis(0), axis(1), axis(2))
        })
    }

    /// Passes on lines until one is of an eye there, metres, and so many seconds more.
    fn pass_until(
        &self,
        what: &str,
        is_there: impl Fn([DVec3; 2]) -> bool,
        stays: Duration,
    ) -> [DVec3; 2] {
        let begun = Instant::now();
        let mut last = self.pass();
        while !is_there(last) {
            assert!(begun.elapsed().as_secs() < 60, "{what}: {last:?}");
            last = self.pass();
        }
        let there = Instant::now();
        while there.elapsed() < stays {
            last = self.pass();
        }
        last
    }
}

/// The middle column of what is not the picture's background, whose rows are of one colour each.
fn middle(picture: &RgbImage) -> f64 {
    let edge = picture.width() - 1;
    let theirs = picture.enumerate_pixels().filter(|(_, y, pixel)| {
        let behind = picture.get_pixel(edge, *y);
        (0..3).any(|channel| pixel.0[channel].abs_diff(behind.0[channel]) > 40)
    });
    let columns: Vec<f64> = theirs.map(|(x, ..)| f64::from(x) + 0.5).collect();
    assert!(columns.len() > 100, "nobody is seen: {}", columns.len());
    columns.iter().sum::<f64>() / columns.len() as f64
}

#[test]
fn a_second_screen_stands_where_the_wearer_stands_and_looks_where_they_look() {
    attended(|| {
        let Some((monado, mut head)) = monado() else {
            return;
        };
        let house = House::open();
        let sender = house.sender(&[]);
        let size = format!("{SIDE}x{SIDE}");
        let (out, json) = (house.path("screen"), house.new_report());
        let mut command = command(&["receive", &sender.viewers, "--display", "offscreen"]);
        command
            .args([
                "--size", &size, "--out", &out, "--json", &json, "--gaze", "udp:0",
            ])
            .env("RUST_LOG", "warn,mon3tr=info");
        let mut screen = Program::start_as(&house, out.as_ref(), &mut command);
        let wire = Wire::to(
            screen
                .word_after("a gaze is taken at ")
                .trim_end_matches(',')
                .to_owned(),
        );

        let arguments = ["--gaze-to", &wire.address()];
        let mut viewer = viewer(&house, &monado, &[&sender.viewers], "viewer", &arguments);
        is_focused(&mut viewer, 1);
        let [eye, towards] = wire.pass_until("ahead", |_| true, Duration::from_secs(1));
        // They stand before one another; the person sways a little as they talk.
        let expected = DVec3::new(0.0, 1.6, DISTANCE);
        assert!(eye.distance(expected) < 0.2, "{eye}");
        let looks = towards - eye;
        assert!(looks.abs_diff_eq(DVec3::NEG_Z, 0.1), "{looks}");
        // They face the wearer with their body as it was turned when they came.
        let person_from_floor = DQuat::from_rotation_y((-looks.x).atan2(-looks.z));

        // A step to the right, bent down, turned back to them by less than would have them in the middle.
        let step = DVec3::new(0.5, -0.3, 0.1);
        let turn = 0.1;
        head.send(&Scripted {
            stage_from_head: Pose::at(0.5, 1.3, 0.1).turned(Quat::from_rotation_y(turn)),
            ..Scripted::default()
        });
        let there = eye + person_from_floor * step;
        let last = wire.pass_until("aside", |[eye, _]| eye.distance(there) < 0.01, LONG_ENOUGH);
        let ahead = person_from_floor * DQuat::from_rotation_y(f64::from(turn)) * DVec3::NEG_Z;
        assert!((last[1] - last[0]).abs_diff_eq(ahead, 1e-3), "{last:?}");

        screen.ask_to_end();
        let report = screen.report();
        viewer.ask_to_end();
        let sent = &viewer.report()["drawing"]["gaze_to"];
        let passed = wire.passed.get();
        assert!(sent["sent"].as_u64() >= Some(passed), "{passed}: {sent:#}");
        assert_eq!(sent["by_eyes"], 0, "a head alone: {sent:#}");
        sender.program.ends();
        let view = &report["drawing"]["gaze"]["view"];
        let seen = |name: &str| {
            DVec3::from_array([0, 1, 2].map(|k| view[name][k].as_f64().unwrap_or(f64::NAN)))
        };
        assert!(
            seen("eye").distance(there) < 0.01,
            "{} {there} {last:?}",
            seen("eye")
        );
        assert!(
            seen("direction").distance(ahead) < 0.02,
            "{} {ahead}",
            seen("direction")
        );
        assert_eq!(
            report["drawing"]["gaze"]["live"]["refused"], 0,
            "{report:#}"
        );
        // Where the person is in the screen's last picture: their axis goes through the place that was before the wearer at first.
        let picture = image::open(house.path("screen") + "/last.png");
        let middle = middle(&picture.expect("a picture").into_rgb8());
        let aside = f64::from(turn) - (step.x / (DISTANCE + step.z)).atan();
        let focal = f64::from(SIDE) / 2.0 / (FOV.to_radians() / 2.0).tan();
        let expected = f64::from(SIDE) / 2.0 + focal * aside.tan();
        println!("the person is at column {middle:.1}, {expected:.1} by geometry");
        assert!(
            (middle - expected).abs() < 5.0,
            "{middle}, {expected} by geometry"
        );
    });
}
