//! What was once wrong with avatars of scans, each on a scan of the body model.

#![expect(
    clippy::cast_possible_truncation,
    reason = "pixels of small pictures, vertices of one mesh"
)]

use super::super::additions::{brightness, median};
use super::super::face::cover;
use super::super::head::Head;
use super::super::stray;
use super::scene::{Scene, data, face, picture, psnr, save};
use crate::body::BodyModel;
use glam::{DVec3, Mat3, Quat, Vec3};

#[test]
fn the_shell_is_as_light_as_the_skin_before_it_is_repainted() {
    let Some(face) = face() else { return };
    let (model, scene) = (face.data.model, &face.before);
    let vertices = &scene.bound.mesh.vertices[..model.rest.len()];
    let head = Head::new(model, &scene.registered, vertices);
    let face = cover(
        model,
        &head,
        vertices,
        &scene.bound.scan,
        &scene.bound.triangles,
    );
    let skin: Vec<f64> = (face.additions.scan.colours.iter().zip(&face.as_scanned))
        .filter(|(_, as_scanned)| **as_scanned)
        .map(|(colour, _)| brightness(colour.as_dvec3()) / brightness(face.cheek))
        .collect();
    let dark = skin.iter().filter(|share| **share < 0.25).count();
    println!("{dark} dark of {} on cheeks of {}", skin.len(), face.cheek);
    assert!(skin.len() > 2000, "{} cells", skin.len());
    assert_eq!(dark, 0, "of {} cells", skin.len());
}

#[test]
fn closed_lids_are_skin_like_the_cheeks_and_no_eyeball_cuts_them_on_the_way() {
    let Some(face) = face() else { return };
    let (model, scene, report) = (face.data.model, &face.after, &face.report);
    let vertices = scene.bound.mesh.vertices.clone();
    let head = Head::new(model, &scene.registered, &vertices);
    for share in [0.0, 0.25, 0.5, 0.75, 1.0] {
        for eye in report.eyeballs.iter().flatten() {
            let deepest = (0..model.body_vertices)
                .filter(|v| head.shows[*v] && head.lid[*v] > 0.05)
                .map(|v| vertices[v] + share * head.closing[v] - eye.centre)
                .filter(|away| away.dot(head.forward()) > 0.2 * eye.radius)
                .map(|away| eye.radius - away.length())
                .fold(f64::NEG_INFINITY, f64::max);
            println!("closed by {share}: {:.2} mm inside", 1e3 * deepest);
            assert!(deepest < 2e-4, "a lid is {deepest} m inside of the eyeball");
        }
    }
    let closed: Vec<DVec3> = vertices
        .iter()
        .zip(&head.closing)
        .map(|(v, c)| *v + *c)
        .collect();
    let view = scene.face_view(0.8, 0.0);
    let shut = picture(&scene.moved(&closed), &view);
    save("closed", std::slice::from_ref(&shut), &view);
    let around = |at: DVec3, half: i32| -> Vec<Vec3> {
        let middle = view.project(at).unwrap_or_default();
        let (x, y) = (middle.x as i32, middle.y as i32);
        (-half..=half)
            .flat_map(|dy| (-half..=half).map(move |dx| (x + dx, y + dy)))
            .filter_map(|(x, y)| shut.get((y * view.width as i32 + x) as usize).copied())
            .collect()
    };
    for eye in report.eyeballs.iter().flatten() {
        let front = eye.centre + eye.radius * head.forward();
        let lid = median(&around(front, 6));
        let cheek = median(&around(front - 0.035 * head.axes.y_axis, 6));
        println!("lid {lid:.2}, cheek {cheek:.2}");
        let hue = |c: DVec3| c / brightness(c);
        assert!(
            hue(lid).distance(hue(cheek)) < 0.15,
            "lid {lid}, cheek {cheek}"
        );
        // The cheek is in the light, the lid under the brow.
        let ratio = brightness(lid) / brightness(cheek);
        assert!((0.6..1.15).contains(&ratio), "lid {lid}, cheek {cheek}");
    }
}

#[test]
fn no_seam_shows_where_long_gaussians_gave_way_to_the_shell() {
    let Some(data) = data() else { return };
    let mut scene = Scene::of_head(data, 0.008);
    for scale in &mut scene.bound.scan.scales {
        // Long along the skin, as scans are.
        scale.x *= 4.0;
    }
    let before = scene.bound.scan.clone();
    scene.completed(data);
    for azimuth in [-30.0, 0.0, 30.0] {
        let view = scene.face_view(0.8, azimuth);
        let pictures = [picture(&before, &view), picture(&scene.bound.scan, &view)];
        let db = psnr(&pictures[0], &pictures[1]);
        println!("{azimuth} degrees: {db:.1} dB");
        save(&format!("seam_{azimuth}"), &pictures, &view);
        assert!(db > 30.0, "{db} dB at {azimuth} degrees");
    }
}

#[test]
fn what_hung_between_arm_and_flank_goes_and_what_lies_on_the_skin_stays() {
    let Some(data) = data() else { return };
    let model = data.model;
    let mut scene = Scene::standing(data, 0.03, 0.6, |_| true);
    let before = scene.bound.scan.len();
    let rest = scene
        .bound
        .rest(model, &scene.registered)
        .unwrap_or_else(|e| panic!("{e}"));
    let (here, there) = (&scene.bound.mesh.vertices, &rest.vertices);
    // Pairs of places on arm and flank that face each other, and part.
    let outer: Vec<usize> = (0..model.body_vertices)
        .filter(|v| model.outer[*v])
        .collect();
    let opening: Vec<(usize, usize)> = (outer.iter())
        .filter_map(|a| {
            let b = outer.iter().find(|b| {
                let gap = here[*a].distance(here[**b]);
                (0.03..0.045).contains(&gap) && there[*a].distance(there[**b]) > gap + 0.09
            })?;
            Some((*a, *b))
        })
        .collect();
    assert!(opening.len() > 20, "{} pairs", opening.len());
    let mut hung = 0;
    for (a, b) in &opening {
        let face = model
            .faces
            .iter()
            .position(|face| face.contains(&(*a as u32)));
        let middle = 0.5 * (here[*a] + here[*b]);
        let scan = &mut scene.bound.scan;
        scan.positions.push(middle.as_vec3());
        scan.rotations.push(Quat::IDENTITY);
        scan.scales.push(Vec3::splat(0.008));
        scan.opacities.push(0.5);
        scan.colours.push(Vec3::ONE);
        scene.bound.triangles.push(face.unwrap_or_default() as u32);
        scene.bound.accessory.push(0);
        hung += 1;
    }
    let found =
        stray::tidy(&mut scene.bound, model, &scene.registered).unwrap_or_else(|e| panic!("{e}"));
    println!(
        "{hung} hung, {found:?}",
        found = (found.dropped, found.repainted, found.shortened)
    );
    let left = scene.bound.scan.colours[..]
        .iter()
        .filter(|c| **c == Vec3::ONE)
        .count();
    assert!(left * 10 < hung, "{left} of {hung} still hang, white");
    assert!(
        scene.bound.scan.len() * 100 > before * 99,
        "skin was left out"
    );
}

/// Faces of the skin that other skin closes in, faces at the edge of such an opening, and faces far from any, all flat and on parts so thick that 25 mm above
/// and under them nothing else is near in T-pose. By a search through all pairs.
fn faces_by_opening(model: &BodyModel, here: &[DVec3], there: &[DVec3]) -> [Vec<usize>; 3] {
    let outer: Vec<usize> = (0..model.body_vertices)
        .filter(|v| model.outer[*v] && model.head_share(*v) < 0.1)
        .collect();
    let parts = |v: usize, within: f64, farther: f64| {
        outer.iter().any(|other| {
            let apart = here[v].distance(here[*other]);
            apart < within && there[v].distance(there[*other]) > apart + farther
        })
    };
    let is_flat = |corners: [usize; 3]| {
        let [a, b, c] = corners.map(|v| there[v]);
        let (middle, normal) = ((a + b + c) / 3.0, (b - a).cross(c - a).normalize_or_zero());
        let is_free = |height: f64, least: f64| {
            let place = middle + height * normal;
            outer.iter().all(|v| there[*v].distance(place) > least)
        };
        is_free(0.025, 0.024) && is_free(-0.023, 0.022)
    };
    let mut found = [const { Vec::new() }; 3];
    for (face, corners) in model.faces.iter().enumerate().step_by(5) {
        let corners = corners.map(|v| v as usize);
        if !(corners.iter()).all(|v| outer.binary_search(v).is_ok()) || !is_flat(corners) {
            continue;
        }
        let all = |within, farther| corners.iter().all(|v| parts(*v, within, farther));
        let any = |within, farther| corners.iter().any(|v| parts(*v, within, farther));
        if all(0.045, 0.09) {
            found[0].push(face);
        } else if all(0.085, 0.06) && !any(0.055, 0.075) {
            found[1].push(face);
        } else if !any(0.12, 0.04) {
            found[2].push(face);
        }
    }
    found
}

#[test]
fn mist_in_an_opening_goes_and_cloth_and_what_is_elsewhere_stays() {
    let Some(data) = data() else { return };
    let model = data.model;
    let mut scene = Scene::standing(data, 0.03, 0.6, |_| true);
    scene.bound.scan.colours.fill(Vec3::splat(0.4));
    let rest = (scene.bound.rest(model, &scene.registered)).unwrap_or_else(|e| panic!("{e}"));
    let faces = faces_by_opening(model, &scene.bound.mesh.vertices, &rest.vertices);
    let tidied = |extra: &dyn Fn(&mut Scene)| {
        let mut scene = Scene {
            bound: scene.bound.clone(),
            registered: scene.registered.clone(),
        };
        extra(&mut scene);
        stray::tidy(&mut scene.bound, model, &scene.registered).unwrap_or_else(|e| panic!("{e}"))
    };
    let usual = tidied(&|_| {});
    let (closed_in, edge, elsewhere) = (0, 1, 2);
    // Where, how far over the skin, how wide (standard deviation), millimetres; how light, of skin of 0.4; whether it is left out, or repainted.
    for (place, over, wide, light, goes, repainted) in [
        (closed_in, 25.0, 6.0, 0.4, true, false),
        (closed_in, 25.0, 2.0, 0.4, true, false),
        (closed_in, 8.0, 6.0, 0.4, true, false),
        (closed_in, 8.0, 2.0, 0.4, false, false),
        (closed_in, 4.5, 6.0, 0.4, false, false),
        (closed_in, 8.0, 2.0, 0.6, false, true),
        (closed_in, 8.0, 2.0, 0.5, false, false),
        (closed_in, 3.0, 2.0, 0.9, false, false),
        // Under the skin in both poses.
        (closed_in, -23.0, 6.0, 0.4, false, false),
        // Loose cloth.
        (edge, 15.0, 3.0, 0.4, false, false),
        (edge, 15.0, 9.0, 0.4, true, false),
        (edge, 8.0, 3.0, 0.8, false, true),
        (edge, 8.0, 3.0, 0.6, false, false),
        (elsewhere, 25.0, 12.0, 1.0, false, false),
    ] {
        let faces = &faces[place];
        assert!(faces.len() > 30, "{} faces of kind {place}", faces.len());
        let found = tidied(&|scene: &mut Scene| {
            for face in faces {
                let [a, b, c] = model.faces[*face].map(|v| scene.bound.mesh.vertices[v as usize]);
                let along = (b - a).normalize().as_vec3();
                let normal = (b - a).cross(c - a).normalize().as_vec3();
                let scan = &mut scene.bound.scan;
                let middle = ((a + b + c) / 3.0).as_vec3();
                scan.positions.push(middle + over / 1e3 * normal);
                let axes = Mat3::from_cols(along, normal.cross(along), normal);
                scan.rotations.push(Quat::from_mat3(&axes));
                scan.scales.push(Vec3::new(wide, wide, 1.0) / 1e3);
                scan.opacities.push(0.01);
                scan.colours.push(Vec3::splat(light));
                scene.bound.triangles.push(*face as u32);
                scene.bound.accessory.push(0);
            }
        });
        let case = format!("{over} mm over, {wide} mm wide, {light} light, place {place}");
        // Where a part of the body bends, a face or two are ambiguous.
        let check = |what: &str, found: usize, expected: bool| {
            let expected = if expected { faces.len() } else { 0 };
            let off = found.abs_diff(expected);
            assert!(off <= 1, "{found} of {} {what}: {case}", faces.len());
        };
        check("left out", found.dropped - usual.dropped, goes);
        check("repainted", found.repainted - usual.repainted, repainted);
    }
}
