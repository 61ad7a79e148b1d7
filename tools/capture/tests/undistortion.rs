//! Undistorted pictures against a reference in f64 that is written apart, and cameras against OpenCV's formula spelt out.

use capture::{Camera, Photograph};
use glam::{DAffine3, DVec2, DVec3};

const LENS: [f64; 5] = [-0.31, 0.12, 0.0013, -0.0009, -0.02];

fn camera() -> Camera {
    Camera {
        name: "lens".to_owned(),
        size: [64, 48],
        focal: [50.0, 52.0],
        centre: [31.0, 25.5],
        distortion: LENS,
        camera_from_world: DAffine3::IDENTITY,
    }
}

/// OpenCV's documentation, calib3d: x'' and y'' of x' and y'.
fn reference(x: f64, y: f64) -> (f64, f64) {
    let [k1, k2, p1, p2, k3] = LENS;
    let r2 = x * x + y * y;
    let radial = 1.0 + k1 * r2 + k2 * r2.powi(2) + k3 * r2.powi(3);
    (
        x * radial + 2.0 * p1 * x * y + p2 * (r2 + 2.0 * x * x),
        y * radial + p1 * (r2 + 2.0 * y * y) + 2.0 * p2 * x * y,
    )
}

#[test]
fn points_are_seen_where_opencvs_formula_has_them() {
    let camera = camera();
    for (x, y) in [(0.0, 0.0), (0.3, -0.2), (-0.45, 0.35), (0.1, 0.4)] {
        let pixel = camera
            .project(DVec3::new(2.5 * x, 2.5 * y, 2.5))
            .expect("before it");
        let (bx, by) = reference(x, y);
        let expected = DVec2::new(50.0 * bx + 31.0, 52.0 * by + 25.5);
        assert!(pixel.distance(expected) < 1e-12, "{pixel} for {expected}");
        let slopes = camera.slopes(pixel).expect("within the lens");
        assert!(slopes.distance(DVec2::new(x, y)) < 1e-8, "{slopes}");
    }
    assert!(
        camera.project(DVec3::new(0.0, 0.0, -1.0)).is_none(),
        "behind it"
    );
}

#[test]
fn an_undistorted_picture_is_the_references_to_half_a_value() {
    let camera = camera();
    // A smooth picture, known between the pixels: what bilinear sampling of it may be off is a third of a value.
    let truth =
        |x: f64, y: f64| 128.0 + 60.0 * (0.11 * x).sin() + 50.0 * (0.13 * y + 0.05 * x).cos();
    let byte = |value: f64| value.round().clamp(0.0, 255.0);
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "clamped to a byte's range"
    )]
    let taken: Vec<u8> = (0..48)
        .flat_map(|y| (0..64).map(move |x| (x, y)))
        .flat_map(|(x, y)| [byte(truth(f64::from(x) + 0.5, f64::from(y) + 0.5)) as u8; 3])
        .collect();
    let Photograph { rgb, mask, .. } = camera
        .photograph(taken, Some(vec![255; 64 * 48]))
        .expect("of its size");
    let mask = mask.expect("was given");
    let mut compared = 0;
    for y in 0..48_u32 {
        for x in 0..64_u32 {
            let at = (y * 64 + x) as usize;
            let (sx, sy) = (
                (f64::from(x) + 0.5 - 31.0) / 50.0,
                (f64::from(y) + 0.5 - 25.5) / 52.0,
            );
            let (bx, by) = reference(sx, sy);
            let (px, py) = (50.0 * bx + 31.0, 52.0 * by + 25.5);
            if px > 0.5 && px < 63.5 && py > 0.5 && py < 47.5 {
                let off = (f64::from(rgb[3 * at]) - truth(px, py)).abs();
                assert!(off < 1.5, "pixel {x}, {y} is off by {off}");
                assert_eq!(mask[at], 255, "all of it is the person");
                compared += 1;
            }
        }
    }
    assert!(compared > 2800, "{compared} pixels were compared");
}

#[test]
fn pixels_that_the_camera_did_not_see_are_black_and_no_person() {
    // A pincushion: the pinhole's corners are outside what was taken.
    let camera = Camera {
        distortion: [0.4, 0.0, 0.0, 0.0, 0.0],
        ..camera()
    };
    let photograph = camera
        .photograph(vec![200; 3 * 64 * 48], Some(vec![255; 64 * 48]))
        .expect("of its size");
    let mask = photograph.mask.expect("was given");
    assert_eq!((photograph.rgb[0], mask[0]), (0, 0), "the corner");
    let middle = 24 * 64 + 32;
    assert_eq!(
        (photograph.rgb[3 * middle], mask[middle]),
        (200, 255),
        "the middle"
    );
}

#[test]
fn a_cropped_and_a_scaled_camera_see_the_same_points() {
    let camera = camera().undistorted();
    let point = DVec3::new(0.2, -0.1, 2.0);
    let whole = camera.project(point).expect("seen");
    let cropped = camera
        .cropped([10, 5], [40, 40])
        .project(point)
        .expect("seen");
    assert!(
        cropped.distance(whole - DVec2::new(10.0, 5.0)) < 1e-12,
        "{cropped}"
    );
    let scaled = camera.scaled([32, 24]).project(point).expect("seen");
    assert!(scaled.distance(whole / 2.0) < 1e-12, "{scaled}");
    let photograph = Photograph {
        size: [4, 3],
        rgb: (0..36).collect(),
        mask: Some((0..12).collect()),
    };
    let part = photograph.cropped([1, 1], [9, 2]);
    assert_eq!(part.size, [3, 2], "as far as there is");
    assert_eq!(
        part.mask,
        Some(vec![5, 6, 7, 9, 10, 11]),
        "rows 1 and 2 without the first column"
    );
    assert_eq!(part.rgb[..3], [15, 16, 17], "its colours");
}
