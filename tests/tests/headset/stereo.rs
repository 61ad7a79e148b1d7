//! The disparities between both eyes' pictures.

use glam::{DVec3, Quat};
use image::RgbaImage;
use test_support::headset_reference::{View, light};
use test_support::monado::{Compositor, Driver, Monado, Pose, Scripted};
use test_support::service::attended;
use test_support::splat_scenes::markers;

use crate::program::Program;

const SIZE: [u32; 2] = [640, 480];

/// Pixels that a disparity may be off.
const MOST_OFF: f64 = 0.5;

/// The centroid of one colour channel, pixels from the upper left corner. The markers are pure colours, so that a channel's
/// light is its marker's alpha.
fn centroid(picture: &RgbaImage, channel: usize) -> [f64; 2] {
    let (mut sum, mut weights) = ([0.0; 2], 0.0);
    for (x, y, pixel) in picture.enumerate_pixels() {
        let weight = light(f64::from(pixel.0[channel]) / 255.0);
        sum[0] += weight * (f64::from(x) + 0.5);
        sum[1] += weight * (f64::from(y) + 0.5);
        weights += weight;
    }
    assert!(weights > 10.0, "channel {channel} shows {weights} pixels");
    sum.map(|sum| sum / weights)
}

#[test]
fn disparities_between_the_eyes_are_right_to_half_a_pixel() {
    attended(|| {
        let Some(monado) = Monado::start(Driver::Remote, Compositor::Null) else {
            return;
        };
        let mut head = monado.head();
        let eye = format!("--eye={}x{}", SIZE[0], SIZE[1]);
        let mut program =
            Program::start(&monado, u64::MAX, &["--steered", "--figure=markers", &eye]);
        program.wait_for_frames(5);
        let upright = Pose::at(0.0, 1.6, 0.0);
        let tilted = Quat::from_rotation_z(-0.25) * Quat::from_rotation_y(0.1);
        for (name, pose) in [("upright", upright), ("tilted", upright.turned(tilted))] {
            let scripted = Scripted {
                stage_from_head: pose,
                ..Scripted::default()
            };
            program.take_pose(&mut head, &scripted);
            let (_, pictures) = program.read(name);
            let views = View::of(&scripted, SIZE);
            for (channel, marker) in markers().iter().enumerate() {
                let point = DVec3::from_array(marker.position.map(f64::from));
                let got = [0, 1].map(|eye| centroid(&pictures[eye], channel));
                let wanted = views.map(|view| view.pixel(point));
                let depth = -views[0].seen(point).z;
                for (axis, along) in ["across", "down"].iter().enumerate() {
                    let got = got[0][axis] - got[1][axis];
                    let wanted = wanted[0][axis] - wanted[1][axis];
                    println!(
                        "{name}, at {depth:.2} m: {got:.2} pixels {along}, {wanted:.2} by geometry"
                    );
                    assert!(
                        (got - wanted).abs() < MOST_OFF,
                        "{name}, at {depth:.2} m: {got} pixels {along} instead of {wanted}"
                    );
                }
                for eye in 0..2 {
                    for axis in 0..2 {
                        let off = got[eye][axis] - wanted[eye][axis];
                        assert!(
                            off.abs() < MOST_OFF,
                            "{name}, eye {eye}: {off} pixels off its place"
                        );
                    }
                }
            }
            // Nearer is farther apart: of a fault of sign too.
            let apart =
                |channel| centroid(&pictures[0], channel)[0] - centroid(&pictures[1], channel)[0];
            assert!(
                apart(0) > apart(1) && apart(1) > apart(2),
                "{name}: order of depth"
            );
        }
        program.end();
        program.ended_well();
    });
}
