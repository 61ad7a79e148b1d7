//! Crops against a reference in f64 that shares no code.
#![allow(
    clippy::cast_possible_truncation,
    reason = "the reference computes in f64 what the crop does in f32"
)]

use glam::Vec2;
use tracker::crop::{Border, Crop, Region};
use tracker::picture::PictureView;

fn noise(width: usize, height: usize) -> Vec<u8> {
    let mut state = 12345_u32;
    (0..width * height * 3)
        .map(|_| {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            (state >> 24) as u8
        })
        .collect()
}

/// The value at row and column of the crop, 0..=255, from the definition: the pixel's centre in the square, turned and moved into the
/// picture, between the four nearest centres of pixels.
fn reference(
    (width, height, rgb): (usize, usize, &[u8]),
    (centre, side, radians): ([f64; 2], f64, f64),
    (size, row, column, channel): (usize, usize, usize, usize),
    border: Border,
) -> f64 {
    let u = ((column as f64 + 0.5) / size as f64 - 0.5) * side;
    let v = ((row as f64 + 0.5) / size as f64 - 0.5) * side;
    let x = centre[0] + u * radians.cos() - v * radians.sin() - 0.5;
    let y = centre[1] + u * radians.sin() + v * radians.cos() - 0.5;
    let pixel = |x: f64, y: f64| {
        let (last_x, last_y) = ((width - 1) as f64, (height - 1) as f64);
        if border == Border::Zero && (x < 0.0 || y < 0.0 || x > last_x || y > last_y) {
            return 0.0;
        }
        let (x, y) = (x.clamp(0.0, last_x) as usize, y.clamp(0.0, last_y) as usize);
        f64::from(rgb[(y * width + x) * 3 + channel])
    };
    let (x0, y0) = (x.floor(), y.floor());
    let (fx, fy) = (x - x0, y - y0);
    pixel(x0, y0) * (1.0 - fx) * (1.0 - fy)
        + pixel(x0 + 1.0, y0) * fx * (1.0 - fy)
        + pixel(x0, y0 + 1.0) * (1.0 - fx) * fy
        + pixel(x0 + 1.0, y0 + 1.0) * fx * fy
}

#[test]
fn a_crop_is_the_bilinear_sample_of_its_square() {
    let size = 32;
    for (width, height) in [(64, 48), (1, 1), (1, 50), (50, 1), (2, 2), (640, 480)] {
        let rgb = noise(width, height);
        let picture = PictureView::new(width, height, &rgb).unwrap();
        for (centre, side, radians) in [
            ([30.0, 20.0], 20.0, 0.0),
            ([30.25, 20.75], 33.3, 0.7),
            ([0.0, 0.0], 40.0, -2.0),
            ([-100.0, 20.0], 30.0, 1.0),
            ([25.0, 25.0], 500.0, 3.0),
            ([320.0, 240.0], 640.0, 0.0),
            ([321.3, 239.2], 200.0, std::f64::consts::FRAC_PI_2),
            ([0.5, 0.5], 0.01, 0.3),
        ] {
            let region = Region::new(
                Vec2::new(centre[0] as f32, centre[1] as f32),
                side as f32,
                radians as f32,
            )
            .unwrap();
            for border in [Border::Zero, Border::Replicate] {
                let crop = Crop {
                    size,
                    border,
                    black: -1.0,
                    white: 1.0,
                };
                let mut planes = vec![9.0; 3 * size * size];
                crop.fill(picture, &region, &mut planes);
                for (at, got) in planes.iter().enumerate() {
                    let (channel, row, column) = (at / (size * size), at / size % size, at % size);
                    let expected = reference(
                        (width, height, &rgb),
                        (centre, side, radians),
                        (size, row, column, channel),
                        border,
                    );
                    let got = f64::from(got + 1.0) * 127.5;
                    // Beyond the edge with zeros, rounding may put a sample on the other side of a step: of no height, but for weights.
                    assert!(
                        (got - expected).abs() < 1.0,
                        "{width}x{height}, {region:?}, {border:?}, {channel} {row} {column}: {got} against {expected}"
                    );
                }
            }
        }
    }
}

#[test]
fn a_point_comes_back_from_a_region_where_it_went_in() {
    let region = Region::new(Vec2::new(333.0, 222.0), 77.0, 2.5).unwrap();
    for point in [
        Vec2::new(0.0, 0.0),
        Vec2::new(300.0, 250.0),
        Vec2::new(-40.0, 900.0),
    ] {
        let there = region.region_from_picture().transform_point2(point);
        let back = region.picture_from_region().transform_point2(there);
        assert!(back.distance(point) < 1e-2, "{point} came back as {back}");
    }
    let corner = region.picture_from_region().transform_point2(Vec2::ZERO);
    let expected = Vec2::new(333.0, 222.0)
        + Vec2::new(
            -38.5 * 2.5_f32.cos() + 38.5 * 2.5_f32.sin(),
            -38.5 * 2.5_f32.sin() - 38.5 * 2.5_f32.cos(),
        );
    assert!(
        corner.distance(expected) < 1e-3,
        "{corner} against {expected}"
    );
}

#[test]
fn impossible_regions_and_pictures_are_refused() {
    let good = Vec2::new(10.0, 10.0);
    for (centre, side, radians) in [
        (Vec2::NAN, 10.0, 0.0),
        (Vec2::INFINITY, 10.0, 0.0),
        (Vec2::splat(1e9), 10.0, 0.0),
        (good, 0.0, 0.0),
        (good, -1.0, 0.0),
        (good, f32::NAN, 0.0),
        (good, f32::INFINITY, 0.0),
        (good, 10.0, f32::NAN),
    ] {
        assert!(
            Region::new(centre, side, radians).is_none(),
            "{centre} {side} {radians}"
        );
    }
    for (width, height, bytes) in [(0, 0, 0), (0, 5, 0), (2, 2, 11), (usize::MAX, 2, 6)] {
        let rgb = vec![0; bytes];
        let error = PictureView::new(width, height, &rgb)
            .unwrap_err()
            .to_string();
        assert!(error.contains("three bytes"), "{error}");
    }
}
