//! The transfer on bodies whose weights are known as a formula. Lengths are decimetres.

use super::*;
use glam::Vec2;
use std::f32::consts::TAU;

const UPPER: u16 = 0;
const FORE: u16 = 1;
const TRUNK: u16 = 2;

/// Where the elbow is, and how far on both sides it blends.
const ELBOW: f32 = 3.0;
const BLEND: f32 = 1.0;

/// Share of the forearm at a place along the arm.
fn share_of_forearm(x: f32) -> f32 {
    let t = ((x - ELBOW + BLEND) / (2.0 * BLEND)).clamp(0.0, 1.0);
    t * t * (3.0 - 2.0 * t)
}

struct Mesh {
    vertices: Vec<Vec3>,
    quads: Vec<Quad>,
}

/// A tube around the x axis: `rings` places along it, `sides` around, at x and radius as `shape` gives them for the place
/// (0 to 1) and the angle.
fn tube(rings: u16, sides: u16, shape: impl Fn(f32, f32) -> Vec2) -> Mesh {
    let mut mesh = Mesh {
        vertices: Vec::new(),
        quads: Vec::new(),
    };
    for ring in 0..rings {
        for side in 0..sides {
            let angle = TAU * f32::from(side) / f32::from(sides);
            let at = shape(f32::from(ring) / f32::from(rings - 1), angle);
            let around = Vec3::new(0.0, angle.cos(), angle.sin()) * at.y;
            mesh.vertices.push(Vec3::X * at.x + around);
            if ring + 1 < rings {
                let (here, next) = (u32::from(ring * sides), u32::from((ring + 1) * sides));
                let (side, beside) = (u32::from(side), u32::from((side + 1) % sides));
                mesh.quads.push(Quad {
                    corners: [here + side, here + beside, next + beside, next + side],
                    uvs: [Vec2::ZERO; 4],
                    material: 0,
                });
            }
        }
    }
    mesh
}

impl Mesh {
    fn moved(mut self, by: Vec3) -> Self {
        self.vertices.iter_mut().for_each(|v| *v += by);
        self
    }

    /// Both meshes, not connected.
    fn with(mut self, other: Self) -> Self {
        let first = u32::try_from(self.vertices.len()).expect("a small mesh");
        self.vertices.extend(other.vertices);
        self.quads.extend(other.quads.into_iter().map(|mut quad| {
            quad.corners.iter_mut().for_each(|v| *v += first);
            quad
        }));
        self
    }

    fn transfer(&self, source: &Source, own: &[Option<BoneWeights>]) -> Vec<BoneWeights> {
        source
            .transfer(&self.vertices, &self.quads, own)
            .expect("the body has faces")
    }

    /// The weights of a garment without any of its own, checked for what must hold of all.
    fn transferred(&self, source: &Source) -> Vec<BoneWeights> {
        let none = vec![None; self.vertices.len()];
        let rows = self.transfer(source, &none);
        for (vertex, row) in rows.iter().enumerate() {
            let sum: f32 = row.iter().map(|(_, w)| w).sum();
            assert!((sum - 1.0).abs() < 1e-5, "vertex {vertex} weighs {sum}");
            assert!(
                row.iter().all(|(_, w)| *w >= 0.0),
                "vertex {vertex}: {row:?}"
            );
        }
        assert_eq!(rows, self.transfer(source, &none), "the same twice");
        rows
    }

    fn matched(&self, source: &Source) -> Vec<bool> {
        let rows = source.matches(&self.vertices, &triangles(&self.quads));
        rows.iter().map(Option::is_some).collect()
    }
}

/// A bare arm along x from 0 to 6, half a decimetre thick, with the elbow in its middle.
fn arm() -> (Mesh, Vec<BoneWeights>) {
    let mesh = tube(61, 32, |t, _| Vec2::new(6.0 * t, 0.5));
    let row = |v: &Vec3| {
        let share = share_of_forearm(v.x);
        [(UPPER, 1.0 - share), (FORE, share), (0, 0.0), (0, 0.0)]
    };
    let weights = mesh.vertices.iter().map(row).collect();
    (mesh, weights)
}

fn weight(row: &BoneWeights, bone: u16) -> f32 {
    row.iter().filter(|(b, _)| *b == bone).map(|(_, w)| w).sum()
}

/// The largest difference from the formula.
fn error(rows: &[BoneWeights], x: impl Fn(usize) -> f32) -> f32 {
    let off = |(v, row): (usize, &BoneWeights)| (weight(row, FORE) - share_of_forearm(x(v))).abs();
    rows.iter().enumerate().map(off).fold(0.0, f32::max)
}

#[test]
fn a_sleeve_takes_the_weights_of_the_arm_in_it() {
    let (arm, weights) = arm();
    let source = Source::new(&arm.vertices, &arm.quads, &weights);
    let sleeve = tube(47, 20, |t, _| Vec2::new(0.9 + 4.3 * t, 0.62));
    assert!(
        sleeve.matched(&source).iter().all(|m| *m),
        "all lie on the arm"
    );
    let off = error(&sleeve.transferred(&source), |v| sleeve.vertices[v].x);
    assert!(off < 0.005, "{off} off the formula");
}

#[test]
fn far_or_inward_facing_vertices_are_filled_in_from_the_rest() {
    let (arm, weights) = arm();
    let source = Source::new(&arm.vertices, &arm.quads, &weights);
    // Its front billows over the elbow, its end flares and then turns back inside.
    let x_of = |t: f32| 1.7 + 4.1 * t;
    let turn = 4.9;
    let sleeve = tube(81, 24, |t, angle| {
        let x = x_of(t);
        let along = 1.0 - ((x - ELBOW).abs() / 0.8).powi(2);
        let billow = if angle.sin() > 0.0 && along > 0.0 {
            angle.sin() * along
        } else {
            0.0
        };
        let flare = ((x - 4.0) / 0.7).clamp(0.0, 1.0);
        if x < turn {
            Vec2::new(x, 0.62 + 0.6 * billow + 0.8 * flare)
        } else {
            Vec2::new(2.0 * turn - x, (1.42 - 1.4 * (x - turn)).max(0.56))
        }
    });
    let matched = sleeve.matched(&source);
    let failed = matched.iter().filter(|m| !**m).count();
    assert!(
        2 * failed > matched.len(),
        "only {failed} of {} fail the test",
        matched.len()
    );
    let rows = sleeve.transferred(&source);
    let off = error(&rows, |v| sleeve.vertices[v].x);
    assert!(off < 0.15, "{off} off the formula");
}

#[test]
fn a_sleeve_beside_the_trunk_follows_the_arm_alone() {
    let (arm, mut weights) = arm();
    // The trunk is a hair's breadth off the sleeve, nearer to its inner side than the arm is.
    let trunk = tube(41, 64, |t, _| Vec2::new(6.0 * t, 1.5)).moved(Vec3::Y * -2.2);
    weights.resize(
        weights.len() + trunk.vertices.len(),
        [(TRUNK, 1.0), (0, 0.0), (0, 0.0), (0, 0.0)],
    );
    let body = arm.with(trunk);
    let source = Source::new(&body.vertices, &body.quads, &weights);
    let sleeve = tube(47, 32, |t, _| Vec2::new(0.9 + 4.3 * t, 0.66));
    let on_trunk = sleeve.vertices.iter().filter(|v| {
        let found = source.closest.find(**v).expect("there is a body");
        source.row(&found).contains_key(&TRUNK)
    });
    let on_trunk = on_trunk.count();
    assert!(
        on_trunk > 100,
        "the trunk is closest to {on_trunk} vertices only"
    );
    let rows = sleeve.transferred(&source);
    let most = rows
        .iter()
        .map(|row| weight(row, TRUNK))
        .fold(0.0, f32::max);
    assert!(most == 0.0, "the trunk carries the sleeve by {most}");
    let off = error(&rows, |v| sleeve.vertices[v].x);
    assert!(off < 0.1, "{off} off the formula");
}

#[test]
fn own_weights_are_kept_and_reach_into_the_gaps() {
    let (arm, weights) = arm();
    let source = Source::new(&arm.vertices, &arm.quads, &weights);
    // A tube out of reach of everything, whose two ends have weights of their own.
    let flap = tube(11, 12, |t, _| Vec2::new(2.0 + t, 0.5)).moved(Vec3::Y * 3.0);
    let end = flap.vertices.len() - 12;
    let mut own = vec![None; flap.vertices.len()];
    own[..12].fill(Some([(TRUNK, 1.0), (0, 0.0), (0, 0.0), (0, 0.0)]));
    own[end..].fill(Some([(5, 0.7), (9, 0.3), (0, 0.0), (0, 0.0)]));
    let rows = flap.transfer(&source, &own);
    for (v, (row, own)) in rows.iter().zip(&own).enumerate() {
        assert!(
            own.is_none_or(|own| own == *row),
            "vertex {v} lost its own: {row:?}"
        );
        // Between two rings the harmonic function is a straight line.
        let along = flap.vertices[v].x - 2.0;
        let off = (weight(row, TRUNK) - (1.0 - along)).abs() + (weight(row, 9) - 0.3 * along).abs();
        assert!(off < 1e-4, "vertex {v} at {along}: {row:?}");
    }
}

#[test]
fn a_button_without_matches_follows_its_closest_points() {
    let (arm, weights) = arm();
    let source = Source::new(&arm.vertices, &arm.quads, &weights);
    let sleeve = tube(47, 20, |t, _| Vec2::new(0.9 + 4.3 * t, 0.62));
    let button = tube(3, 6, |t, _| Vec2::new(0.05 * t, 0.05)).moved(Vec3::new(5.0, 3.0, 0.0));
    let dressed = sleeve.with(button);
    let rows = dressed.transferred(&source);
    for row in &rows[rows.len() - 18..] {
        assert!(weight(row, FORE) > 0.999, "the button hangs by {row:?}");
    }
}

#[test]
fn a_body_without_faces_gives_no_weights() {
    let source = Source::new(&[], &[], &[]);
    let sleeve = tube(3, 6, |t, _| Vec2::new(t, 0.5));
    let none = vec![None; sleeve.vertices.len()];
    let result = source.transfer(&sleeve.vertices, &sleeve.quads, &none);
    assert!(
        result.is_err_and(|why| why.contains("vertex 0")),
        "an error"
    );
}
