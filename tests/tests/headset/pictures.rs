//! Both eyes' pictures as submitted to the compositor, against the reference in f64.

use std::path::Path;

use glam::{Quat, Vec3};
use image::{Rgba, RgbaImage};
use test_support::headset_reference::{View, composed, psnr};
use test_support::monado::{Compositor, Driver, Monado, Pose, Scripted};
use test_support::service::attended;
use test_support::splat_reference::{PixelBox, ReferencePicture, covered_box, render};
use test_support::splat_scenes::figure_ahead;

use crate::program::Program;

const SIZE: [u32; 2] = [640, 480];

/// Least PSNR over the figure's box, dB. Colours that were not made ready for a compositor are 40 dB off there, for there is little of
/// the figure that is translucent.
const LEAST_DB: f64 = 50.0;

/// Least PSNR where there are fewer pixels: where one sees through the figure, and at the picture's edges.
const LEAST_OF_FEW_DB: f64 = 44.0;

/// Pixels from an edge that count as its.
const EDGE: u32 = 12;

fn head_at(position: Vec3, rotation: Quat) -> Scripted {
    let [x, y, z] = position.to_array();
    Scripted {
        stage_from_head: Pose::at(x, y, z).turned(rotation),
        ..Scripted::default()
    }
}

/// A pose of the head, and at which edges of view the figure is cut, for either eye: together at all four.
struct Scene {
    name: &'static str,
    head: Scripted,
    cut: &'static [&'static str],
}

/// Straight ahead and whole; with the head turned about every axis; close.
fn scenes() -> [Scene; 3] {
    let rolled =
        Quat::from_rotation_y(-1.1) * Quat::from_rotation_x(-0.15) * Quat::from_rotation_z(0.5);
    let close = Quat::from_rotation_y(0.12) * Quat::from_rotation_x(-0.1);
    let scene = |name, position, rotation, cut| Scene {
        name,
        head: head_at(position, rotation),
        cut,
    };
    let (far, aside, near) = (
        Vec3::new(0.0, 1.2, 0.1),
        Vec3::new(-0.5, 1.5, -0.4),
        Vec3::new(-0.12, 1.4, -1.15),
    );
    [
        scene("whole", far, Quat::IDENTITY, &[]),
        scene("rolled", aside, rolled, &["left", "upper"]),
        scene("close", near, close, &["right", "upper", "lower"]),
    ]
}

/// `way` is the expected render path.
fn eyes_show_the_reference(back_end: &str, way: &str) {
    let Some(monado) = Monado::start(Driver::Remote, Compositor::Null) else {
        return;
    };
    let mut head = monado.head();
    let (eye, back_end) = (
        format!("--eye={}x{}", SIZE[0], SIZE[1]),
        format!("--back-end={back_end}"),
    );
    let mut program = Program::start(&monado, u64::MAX, &["--steered", &eye, &back_end]);
    program.wait_for_frames(5);
    let figure = figure_ahead();
    for Scene {
        name,
        head: scripted,
        cut,
    } in scenes()
    {
        program.take_pose(&mut head, &scripted);
        let (told, pictures) = program.read(name);
        let views = View::of(&scripted, SIZE);
        for (eye, (view, picture)) in views.iter().zip(&pictures).enumerate() {
            let name = format!("{name}-{}-{}", ["left", "right"][eye], &back_end[11..]);
            assert_eq!(told["way"], way, "{name}: the way into the images");
            view.assert_is(&told["eyes"][eye], &name);
            let expected = render(&figure, &view.camera());
            let shown_cut = assert_shows(picture, &expected, &name);
            assert_eq!(shown_cut, cut, "{name}: edges that the figure crosses");
        }
    }
    program.end();
    program.ended_well();
}

/// Returns the edges of view that the figure crosses.
fn assert_shows(picture: &RgbaImage, expected: &ReferencePicture, name: &str) -> Vec<&'static str> {
    assert_eq!(picture.dimensions(), (SIZE[0], SIZE[1]), "{name}: size");
    let PixelBox {
        left,
        top,
        right,
        bottom,
    } = covered_box(expected).expect("something to see");
    let inside = |x: u32, y: u32| {
        (left..=right).contains(&(x as usize)) && (top..=bottom).contains(&(y as usize))
    };
    let db = psnr(picture, expected, inside).expect("a box");
    if std::env::var_os("MON3TR_KEEP_PICTURES").is_some() {
        keep(picture, expected, name);
    }
    // On failure only.
    let kept = || keep(picture, expected, name);
    println!("{name}: {db:.1} dB in {left}..={right} x {top}..={bottom}");
    assert!(db >= LEAST_DB, "{name}: {db:.1} dB; see {}-*.png", kept());
    let translucent = |x: u32, y: u32| {
        let index = y as usize * expected.width + x as usize;
        (0.02..0.98).contains(&expected.pixels[index][3])
    };
    let rim = psnr(picture, expected, translucent).expect("a rim");
    println!("{name}: {rim:.1} dB where one sees through");
    assert!(
        rim >= LEAST_OF_FEW_DB,
        "{name}: {rim:.1} dB where one sees through; see {}-*.png",
        kept()
    );
    let [width, height] = SIZE;
    let edges = [
        ("left", 0..EDGE, 0..height),
        ("right", width - EDGE..width, 0..height),
        ("upper", 0..width, 0..EDGE),
        ("lower", 0..width, height - EDGE..height),
    ];
    let mut cut = Vec::new();
    for (edge, columns, rows) in edges {
        let shows = |x: u32, y: u32| {
            let index = y as usize * expected.width + x as usize;
            columns.contains(&x) && rows.contains(&y) && expected.pixels[index][3] > 0.0
        };
        let Some(db) = psnr(picture, expected, shows) else {
            continue;
        };
        cut.push(edge);
        println!("{name}: {db:.1} dB at the {edge} edge");
        assert!(
            db >= LEAST_OF_FEW_DB,
            "{name}, {edge} edge: {db:.1} dB; see {}-*.png",
            kept()
        );
    }
    // At its rim a splat may just reach 1/255 in one arithmetic, and just not in the other.
    let beyond = picture
        .enumerate_pixels()
        .filter(|(x, y, pixel)| !inside(*x, *y) && pixel.0[3] > 2);
    assert_eq!(beyond.count(), 0, "{name}: pixels beside the figure");
    cut
}

/// Leaves both pictures in `target/pictures`; returns the common start of their paths.
#[expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "0 to 255"
)]
fn keep(picture: &RgbaImage, expected: &ReferencePicture, name: &str) -> String {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../target/pictures");
    std::fs::create_dir_all(&folder).unwrap_or_else(|why| panic!("{}: {why}", folder.display()));
    let start = folder.join(format!("headset-{name}")).display().to_string();
    let byte = |value: f64| (value * 255.0).round() as u8;
    let bytes = expected
        .pixels
        .iter()
        .flat_map(|pixel| composed(*pixel).map(byte));
    let expected = RgbaImage::from_raw(picture.width(), picture.height(), bytes.collect());
    let expected = expected.expect("as large as it says");
    for (kind, picture) in [("got", picture), ("expected", &expected)] {
        let opaque = RgbaImage::from_fn(picture.width(), picture.height(), |x, y| {
            let Rgba([red, green, blue, _]) = *picture.get_pixel(x, y);
            Rgba([red, green, blue, 255])
        });
        let file = format!("{start}-{kind}.png");
        opaque
            .save(&file)
            .unwrap_or_else(|why| panic!("{file}: {why}"));
    }
    start
}

#[test]
fn at_three_poses_of_the_head_both_eyes_show_the_reference_by_tiles_that_are_copied() {
    attended(|| eyes_show_the_reference("tiles", "composed and copied"));
}

#[test]
fn at_three_poses_of_the_head_both_eyes_show_the_reference_by_quads_drawn_straight_into_the_images()
{
    attended(|| eyes_show_the_reference("quads", "drawn straight into the headset's images"));
}
