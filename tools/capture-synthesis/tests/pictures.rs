//! Pictures of simple bodies: what two cameras see of one point, masks against geometry, shadows, and that threads change nothing.

#![expect(
    clippy::cast_possible_truncation,
    reason = "pixels and metres of small scenes"
)]

use capture_synthesis::draw::Scene;
use capture_synthesis::lens::Lens;
use capture_synthesis::model::{Material, Model, Shade};
use capture_synthesis::shadow::ShadowMap;
use capture_synthesis::sitter::Posed;
use capture_synthesis::texture::Pyramid;
use glam::{DVec2, DVec3, Vec2, Vec3};
use std::f32::consts::{PI, TAU};

/// A texture whose colours say where on it one is.
fn gradient() -> Pyramid {
    let texels = (0..64u8)
        .flat_map(|y| (0..64u8).map(move |x| [40 + 3 * x, 40 + 3 * y, 120, 255]))
        .collect();
    Pyramid::new([64, 64], texels).expect("64 x 64 texels")
}

/// A ball of radius 0.5 around the origin, textured by longitude and latitude.
fn ball(rings: u16, around: u16) -> (Model, Posed) {
    let at = |ring: u16, k: u16| {
        let (latitude, longitude) = (
            PI * f32::from(ring) / f32::from(rings) - PI / 2.0,
            TAU * f32::from(k) / f32::from(around),
        );
        let (sin, cos) = latitude.sin_cos();
        let place = Vec3::new(cos * longitude.sin(), sin, cos * longitude.cos()) * 0.5;
        let across = (longitude / PI - 1.0).abs();
        (place, Vec2::new(across, f32::from(ring) / f32::from(rings)))
    };
    let (mut positions, mut uvs) = (Vec::new(), Vec::new());
    for ring in 0..=rings {
        for k in 0..=around {
            let (place, uv) = at(ring, k);
            positions.push(place);
            uvs.push(uv);
        }
    }
    let mut faces = Vec::new();
    let index = |ring: u16, k: u16| u32::from(ring) * (u32::from(around) + 1) + u32::from(k);
    for ring in 0..rings {
        for k in 0..around {
            let [a, b] = [index(ring, k), index(ring, k + 1)];
            let [d, c] = [index(ring + 1, k), index(ring + 1, k + 1)];
            faces.extend([[a, b, c], [a, c, d]]);
        }
    }
    let materials = (faces.iter())
        .map(|face: &[u32; 3]| Material {
            texture: 0,
            uvs: face.map(|vertex| uvs[vertex as usize]),
            texels: 4.0,
            strands: None,
            casts: false,
            wet: false,
            tint: Vec3::ONE,
        })
        .collect();
    let shade = Shade {
        strength: 1.0,
        floor: 0.0,
        depth: 1.0,
    };
    let model = Model {
        shades: vec![shade; positions.len()],
        faces,
        materials,
        textures: vec![gradient()],
    };
    let posed = Posed {
        normals: positions.iter().map(|p| p.normalize()).collect(),
        sky: vec![Vec3::ONE; positions.len()],
        positions,
    };
    (model, posed)
}

fn camera(angle: f64, height: f64) -> Lens {
    let eye = DVec3::new(angle.sin() * 2.5, height, angle.cos() * 2.5);
    Lens::look_at(eye, DVec3::ZERO, DVec3::Y, 260.0, [160, 144])
}

fn project(lens: &Lens, point: Vec3) -> DVec2 {
    let seen = lens.camera_point(point);
    DVec2::new(
        seen.x / seen.z * lens.focal[0] + lens.centre[0],
        seen.y / seen.z * lens.focal[1] + lens.centre[1],
    )
}

/// The picture between pixel centres.
fn at(rgb: &[u8], size: [u32; 2], point: DVec2) -> [f64; 3] {
    let (x, y) = (point.x - 0.5, point.y - 0.5);
    let (left, top) = (x.floor(), y.floor());
    let (right, down) = (x - left, y - top);
    [0, 1, 2].map(|channel| {
        let pixel = |dx: usize, dy: usize| {
            let index = (top as usize + dy) * size[0] as usize + left as usize + dx;
            f64::from(rgb[3 * index + channel])
        };
        let above = pixel(0, 0) * (1.0 - right) + pixel(1, 0) * right;
        let below = pixel(0, 1) * (1.0 - right) + pixel(1, 1) * right;
        above * (1.0 - down) + below * down
    })
}

#[test]
fn a_vertex_shows_the_same_texture_to_two_cameras() {
    let (model, posed) = ball(24, 48);
    let scene = Scene::new(&model, &posed);
    let cameras = [camera(0.1, 0.4), camera(0.7, -0.3)];
    let pictures = cameras.map(|lens| scene.draw(&lens, [0; 3]));
    let mut compared = 0;
    for position in &posed.positions {
        // Where both see the ball's surface well.
        let faced = |lens: &Lens| {
            let towards = (lens.eye() - position.as_dvec3()).normalize();
            towards.dot(position.as_dvec3().normalize()) > 0.5
        };
        // The seam of the texture, where it turns back, and its poles have no smooth colour.
        let longitude = f64::from(position.x).atan2(f64::from(position.z));
        let smooth = position.y.abs() < 0.4 && longitude.abs() > 0.2;
        if !smooth || !cameras.iter().all(faced) {
            continue;
        }
        compared += 1;
        let [a, b] = [0, 1].map(|k| {
            let picture = &pictures[k];
            at(&picture.rgb, picture.size, project(&cameras[k], *position))
        });
        for (a, b) in a.into_iter().zip(b) {
            assert!((a - b).abs() < 4.0, "{a} and {b} at {position}");
        }
    }
    assert!(compared > 50, "only {compared} vertices compared");
}

#[test]
fn the_mask_is_the_silhouette() {
    let (model, posed) = ball(64, 128);
    let scene = Scene::new(&model, &posed);
    let lens = camera(0.4, 0.3);
    let drawn = scene.draw(&lens, [9, 8, 7]);
    let covered: f64 = drawn.mask.iter().map(|m| f64::from(*m) / 255.0).sum();
    // A ball of radius r in the axis at distance d is seen as a disc of radius f r / sqrt(d^2 - r^2).
    let distance = lens.eye().length();
    let radius = 260.0 * 0.5 / (distance * distance - 0.25).sqrt();
    let disc = std::f64::consts::PI * radius * radius;
    assert!(
        (covered / disc - 1.0).abs() < 0.004,
        "{covered} pixels, not {disc}"
    );
    for (pixel, mask) in drawn.mask.iter().enumerate() {
        let (x, y) = ((pixel % 160) as f64 + 0.5, (pixel / 160) as f64 + 0.5);
        let away = DVec2::new(x - 80.0, y - 72.0).length();
        if away < radius - 1.5 {
            assert_eq!(*mask, 255, "a hole at {x}, {y}");
        }
        if away > radius + 1.0 {
            assert_eq!(*mask, 0, "something at {x}, {y}");
            assert_eq!(drawn.rgb[3 * pixel..][..3], [9, 8, 7], "the background");
        }
    }
    // Every vertex that is seen at all is where the mask is.
    for position in &posed.positions {
        let point = project(&lens, *position);
        let mask = drawn.mask[point.y as usize * 160 + point.x as usize];
        assert!(
            mask > 0 || (point - DVec2::new(80.0, 72.0)).length() > radius - 1.0,
            "{point}"
        );
    }
}

#[test]
fn the_number_of_threads_changes_nothing() {
    let (model, posed) = ball(16, 24);
    let draw = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new()
            .num_threads(threads)
            .build()
            .expect("threads");
        pool.install(|| Scene::new(&model, &posed).draw(&camera(0.2, 0.1), [50; 3]))
    };
    let one = draw(1);
    assert_eq!(one, draw(3), "three threads draw another picture");
    assert!(one.mask.contains(&255), "there is something in the picture");
}

#[test]
fn a_plate_shades_what_is_under_it_and_nothing_else() {
    // A plate of 0.4 m half a metre above a floor; the light comes straight down.
    let square = |half: f32, y: f32| {
        [(-1.0, -1.0), (-1.0, 1.0), (1.0, 1.0), (1.0, -1.0)]
            .map(|(x, z)| Vec3::new(x * half, y, z * half))
    };
    let positions = [square(1.0, 0.0), square(0.2, 0.5)].concat();
    let faces = [[0, 1, 2], [0, 2, 3], [4, 5, 6], [4, 6, 7]];
    let map = ShadowMap::new(Vec3::Y, &positions, &faces, |_, _| true);
    let light = |x: f32, y: f32| map.light(Vec3::new(x, y, 0.03), Vec3::Y);
    assert_eq!(light(0.0, 0.0), 0.0, "in the middle of the shadow");
    assert_eq!(light(0.15, 0.0), 0.0, "inside its edge");
    assert_eq!(light(0.25, 0.0), 1.0, "beside the shadow");
    assert_eq!(light(0.0, 0.5), 1.0, "the plate does not shade itself");
    let edge = light(0.2, 0.0);
    assert!(
        (edge - 0.5).abs() < 0.2,
        "half of the light at the edge: {edge}"
    );
    let fading: Vec<f32> = (0..40u8)
        .map(|k| light(0.18 + f32::from(k) * 1e-3, 0.0))
        .collect();
    assert!(
        fading.windows(2).all(|pair| pair[0] <= pair[1] + 1e-6),
        "the light grows outwards: {fading:?}"
    );
}

#[test]
fn a_texture_keeps_its_mean_at_every_size_and_transparent_texels_do_not_darken_it() {
    let texels = (0..256u16)
        .map(|k| match k % 4 {
            0 => [200, 100, 50, 255],
            // What is transparent is painted black.
            _ => [0, 0, 0, 0],
        })
        .collect();
    let pyramid = Pyramid::new([16, 16], texels).expect("16 x 16 texels");
    let far = pyramid.sample(Vec2::splat(0.5), 9.0);
    for (value, wanted) in far.to_array().into_iter().zip([200.0, 100.0, 50.0, 64.0]) {
        assert!((value * 255.0 - wanted).abs() < 1.1, "{far}");
    }
    assert!(
        Pyramid::new([4, 4], vec![[0; 4]; 15]).is_none(),
        "a texel is missing"
    );
}
