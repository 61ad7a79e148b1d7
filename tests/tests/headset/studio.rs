//! The studio that surrounds a person where the room is not shown.

use glam::{DMat3, DVec3, Quat};
use image::RgbaImage;
use test_support::headset_reference::{View, studio};
use test_support::monado::{Compositor, Driver, Monado, Pose, Scripted};
use test_support::service::attended;

use crate::program::Program;

const SIZE: [u32; 2] = [480, 360];

/// The world's up by the eye's axes, as the picture alone tells it: the wall's red falls in proportion to how far a way of length 1
/// rises, so it falls fastest upwards. Least squares over the wall's pixels, away from the colours it shares with floor and sky.
fn up_of(picture: &RgbaImage, view: &View) -> DVec3 {
    let wall: Vec<(DVec3, f64)> = picture
        .enumerate_pixels()
        .filter(|(_, _, pixel)| {
            let [red, _, blue, _] = pixel.0;
            (207..=221).contains(&red) && blue > red + 8
        })
        .map(|(x, y, pixel)| (view.toward(x, y).normalize(), f64::from(pixel.0[0])))
        .collect();
    assert!(wall.len() > 5_000, "{} pixels of the wall", wall.len());
    #[expect(clippy::cast_precision_loss, reason = "pixel counts are small")]
    let share = 1.0 / wall.len() as f64;
    let middle = wall.iter().map(|(way, _)| *way).sum::<DVec3>() * share;
    let mean = wall.iter().map(|(_, red)| red).sum::<f64>() * share;
    let (mut squares, mut products) = (DMat3::ZERO, DVec3::ZERO);
    for (way, red) in wall {
        let way = way - middle;
        squares += DMat3::from_cols(way * way.x, way * way.y, way * way.z);
        products += way * (red - mean);
    }
    -(squares.inverse() * products).normalize()
}

fn floor_and_wall_are_right(back_end: &str) {
    let Some(monado) = Monado::start(Driver::Remote, Compositor::Null) else {
        return;
    };
    let mut head = monado.head();
    let mut program = Program::in_studio(&monado, back_end, SIZE);
    let rolled =
        Quat::from_rotation_y(0.8) * Quat::from_rotation_x(0.1) * Quat::from_rotation_z(0.6);
    for (name, rotation) in [("upright", Quat::IDENTITY), ("rolled", rolled)] {
        let scripted = Scripted {
            stage_from_head: Pose::at(0.2, 1.7, -0.3).turned(rotation),
            ..Scripted::default()
        };
        program.take_pose(&mut head, &scripted);
        let (_, pictures) = program.read(name);
        for (eye, (view, picture)) in View::of(&scripted, SIZE).iter().zip(&pictures).enumerate() {
            let mut most = 0.0f64;
            let (mut floor, mut wall) = (0, 0);
            for (x, y, pixel) in picture.enumerate_pixels() {
                assert_eq!(pixel.0[3], 255, "{name}: nothing shows through");
                let way = view.floor_from_eye * view.toward(x, y);
                *(if way.y < 0.0 { &mut floor } else { &mut wall }) += 1;
                let wanted = studio(view.place, way);
                for (got, wanted) in pixel.0.iter().zip(wanted) {
                    most = most.max((f64::from(*got) - 255.0 * wanted).abs());
                }
            }
            println!(
                "{name}, eye {eye}: {most:.2} of 255 off at most, {floor} pixels of floor, {wall} of wall"
            );
            assert!(most <= 1.0, "{name}, eye {eye}: {most} of 255 off");
            assert!(
                floor > 10_000 && wall > 10_000,
                "{name}: {floor} and {wall} pixels"
            );
            let up = up_of(picture, view);
            let wanted = view.floor_from_eye.transpose() * DVec3::Y;
            let off = up.angle_between(wanted).to_degrees();
            println!("{name}, eye {eye}: the horizon is {off:.3} degrees off level");
            assert!(off < 0.5, "{name}, eye {eye}: up is {up}, not {wanted}");
        }
    }
    program.end();
    program.ended_well();
}

#[test]
fn floor_and_wall_have_their_colours_and_the_horizon_is_level_in_any_pose_of_the_head() {
    attended(|| floor_and_wall_are_right("tiles"));
}

#[test]
fn they_are_the_same_behind_quads_drawn_directly_into_the_images() {
    attended(|| floor_and_wall_are_right("quads"));
}
