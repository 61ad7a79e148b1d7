//! The rasteriser against rays that are cut with every triangle in double precision.

#![expect(
    clippy::cast_possible_truncation,
    reason = "pixels and metres of small scenes"
)]

use capture_synthesis::lens::Lens;
use capture_synthesis::raster::{Corner, Facets, Sample};
use glam::{DVec3, Vec3};

const SIZE: usize = 96;

/// Where a ray (from the origin, along `direction`) meets a triangle: the distance in units of `direction`, the shares of the second and the third
/// corner, and how far inside the nearest edge lies (the least share).
fn meet(direction: DVec3, [a, b, c]: [DVec3; 3]) -> Option<(f64, f64, f64, f64)> {
    // Cramer's rule on a + s (b - a) + t (c - a) = r direction.
    let (u, v) = (b - a, c - a);
    let determinant = u.dot(v.cross(-direction));
    if determinant.abs() < 1e-15 {
        return None;
    }
    let s = (-a).dot(v.cross(-direction)) / determinant;
    let t = u.dot((-a).cross(-direction)) / determinant;
    let r = u.dot(v.cross(-a)) / determinant;
    (r > 0.0).then_some((r, s, t, s.min(t).min(1.0 - s - t)))
}

fn corner(lens: &Lens, point: Vec3) -> Corner {
    let seen = lens.camera_point(point);
    let nearness = (1.0 / seen.z) as f32;
    Corner {
        x: seen.x / seen.z * lens.focal[0] + lens.centre[0],
        y: seen.y / seen.z * lens.focal[1] + lens.centre[1],
        inverse_w: nearness,
        nearness,
    }
}

fn draw(lens: &Lens, faces: &[[Vec3; 3]], rows_in_band: usize) -> Vec<Sample> {
    let facets = Facets::new(
        faces.len(),
        |face| Some(faces[face].map(|point| corner(lens, point))),
        [SIZE; 2],
        rows_in_band,
    );
    let (mut all, mut band_samples) = (Vec::new(), Vec::new());
    for band in 0..facets.bands() {
        facets.draw(band, &mut band_samples, |_, _, _| true);
        all.extend_from_slice(&band_samples);
    }
    all
}

fn lens() -> Lens {
    Lens::look_at(
        DVec3::new(0.3, 0.8, 2.0),
        DVec3::new(0.0, 0.1, 0.0),
        DVec3::Y,
        70.0,
        [SIZE as u32; 2],
    )
}

/// Triangles of all sizes and both windings, some of them steep.
fn triangles() -> Vec<[Vec3; 3]> {
    let mut rng = fastrand::Rng::with_seed(5);
    let mut one = |scale: f32| {
        let mut number = || 2.0 * rng.f32() - 1.0;
        Vec3::new(number(), number(), number()) * scale
    };
    (0..60u8)
        .map(|k| {
            let size = if k % 3 == 0 { 0.9 } else { 0.25 };
            let middle = one(0.8);
            [0, 1, 2].map(|_| middle + one(size))
        })
        .collect()
}

#[test]
fn coverage_depth_and_perspective_correct_shares_are_those_of_rays() {
    let (lens, faces) = (lens(), triangles());
    let seen: Vec<[DVec3; 3]> = (faces.iter())
        .map(|face| face.map(|point| lens.camera_point(point)))
        .collect();
    let samples = draw(&lens, &faces, SIZE);
    let (mut compared, mut covered) = (0, 0);
    for (at, sample) in samples.iter().enumerate() {
        let (x, y) = ((at % SIZE) as f64 + 0.5, (at / SIZE) as f64 + 0.5);
        let direction = DVec3::new(
            (x - lens.centre[0]) / lens.focal[0],
            (y - lens.centre[1]) / lens.focal[1],
            1.0,
        );
        // All that the ray meets; the distance along the axis is r, since the direction's z is 1.
        let mut hits: Vec<(f64, usize, f64, f64)> = Vec::new();
        let mut at_an_edge = false;
        for (face, corners) in seen.iter().enumerate() {
            if let Some((r, s, t, inside)) = meet(direction, *corners) {
                // Corners lie on a grid of 1/256 sample.
                at_an_edge |= inside.abs() < 2e-3;
                if inside > 0.0 {
                    hits.push((r, face, s, t));
                }
            }
        }
        hits.sort_by(|a, b| a.0.total_cmp(&b.0));
        let too_close = hits.len() > 1 && hits[1].0 - hits[0].0 < 1e-3;
        if at_an_edge || too_close {
            continue;
        }
        compared += 1;
        let Some((r, face, s, t)) = hits.first() else {
            assert!(!sample.is_covered(), "sample {x}, {y} should be empty");
            continue;
        };
        covered += 1;
        assert_eq!(sample.face as usize, *face, "at sample {x}, {y}");
        // A corner's place on the grid is off by 1/512 sample at most: more of a share on a small or steep triangle.
        let [a, b, c] = faces[*face].map(|point| corner(&lens, point));
        let area = ((b.x - a.x) * (c.y - a.y) - (b.y - a.y) * (c.x - a.x)).abs();
        let longest = (b.x - a.x)
            .hypot(b.y - a.y)
            .max((c.x - a.x).hypot(c.y - a.y));
        let allowed = 1e-4 + 0.03 * longest / area;
        let depth = 1.0 / f64::from(sample.nearness);
        assert!((depth - r).abs() < allowed * 2.0, "depth {depth}, not {r}");
        for (share, wanted) in sample.shares.iter().zip([s, t]) {
            assert!(
                (f64::from(*share) - wanted).abs() < allowed,
                "share {share}, not {wanted}, of triangle {face} at {x}, {y}"
            );
        }
    }
    assert!(
        compared > SIZE * SIZE * 8 / 10,
        "only {compared} samples compared"
    );
    assert!(covered > 1000, "only {covered} samples are covered");
}

#[test]
fn neighbours_leave_no_gap_and_share_no_sample() {
    // A fan of triangles around a point: every sample of the disc belongs to exactly one.
    let lens = lens();
    let spoke = |k: u16| {
        let angle = f32::from(k % 64) / 64.0 * std::f32::consts::TAU;
        Vec3::new(
            0.5 * angle.cos(),
            0.5 * angle.sin(),
            0.1 * (3.0 * angle).sin(),
        )
    };
    let middle = Vec3::new(0.05, 0.02, 0.0);
    let mut owners = vec![0; SIZE * SIZE];
    let mut all = Vec::new();
    for k in 0..64 {
        let face = [middle, spoke(k), spoke(k + 1)];
        all.push(face);
        for (owner, sample) in owners.iter_mut().zip(draw(&lens, &[face], SIZE)) {
            *owner += u8::from(sample.is_covered());
        }
    }
    let whole = draw(&lens, &all, SIZE);
    assert!(
        owners.iter().all(|count| *count <= 1),
        "a sample has two owners"
    );
    let filled = whole.iter().filter(|sample| sample.is_covered()).count();
    assert_eq!(
        filled,
        owners.iter().filter(|count| **count == 1).count(),
        "a sample was lost"
    );
    // Row by row there is no hole.
    for row in whole.chunks(SIZE) {
        let first = row.iter().position(Sample::is_covered);
        let last = row.iter().rposition(Sample::is_covered);
        if let (Some(first), Some(last)) = (first, last) {
            assert!(
                row[first..=last].iter().all(Sample::is_covered),
                "a gap between neighbours"
            );
        }
    }
}

#[test]
fn bands_change_nothing() {
    let (lens, faces) = (lens(), triangles());
    let whole = draw(&lens, &faces, SIZE);
    for rows in [1, 7, 40] {
        assert_eq!(draw(&lens, &faces, rows), whole, "in bands of {rows} rows");
    }
}

#[test]
fn what_is_not_finite_or_has_no_area_is_not_drawn() {
    let lens = lens();
    let flat = [Vec3::ZERO, Vec3::X * 0.1, Vec3::X * 0.2];
    let broken = [Vec3::ZERO, Vec3::NAN, Vec3::Y];
    let samples = draw(&lens, &[flat, broken], SIZE);
    assert!(
        samples.iter().all(|sample| !sample.is_covered()),
        "something was drawn"
    );
}
