//! Meshes whose parts fit and do not.

use super::*;
use crate::posing::DenseParts;

const UNITS: [f32; ATTRIBUTES] = [1.0; ATTRIBUTES];

/// Two Gaussians on one triangle, with three bases.
fn parts<'a>(attributes: &'a [f32], scales: &'a [f16], values: &'a [i8]) -> BoundMeshParts<'a> {
    BoundMeshParts {
        joints: 1,
        skin_joints: &[[0; 4]; 3],
        skin_weights: &[[0.25; 4]; 3],
        corners: &[[0, 1, 2], [2, 1, 0]],
        barycentrics: &[[0.25, 0.5], [0.0, 1.0]],
        attributes,
        controllers: 2,
        neighbours: &[[0, 1, 0], [1, 0, 1]],
        masses: &[[0.5, 0.25, 0.25], [1.0, 0.0, 0.0]],
        bases: 3,
        units: &UNITS,
        scales,
        values,
    }
}

#[test]
fn bases_of_one_gaussian_lie_side_by_side() {
    let scales: Vec<f16> = (0u8..28).map(f16::from).collect();
    let values: Vec<i8> = (0..84).collect();
    let mesh = BoundMesh::new(&parts(&[0.0; 28], &scales, &values)).expect("it fits together");
    // Plane 1, Gaussian 1: rows 3, 4, 5 of two values each.
    assert_eq!(mesh.values[3][..4], [7, 9, 11, 0], "three bases, then none");
    // Planes 2 and 3 of Gaussian 1.
    assert_eq!(mesh.scales[3], [5u8, 7].map(f16::from), "a pair of scales");
    assert_eq!(mesh.bound[10..14], [1 << 16, 1, 0, 1], "neighbours");
}

#[test]
fn parts_that_do_not_fit_are_refused_by_name() {
    let (attributes, scales, values) = ([0.0; 28], [f16::ZERO; 28], [0; 84]);
    let good = parts(&attributes, &scales, &values);
    let cases = [
        (
            BoundMeshParts {
                values: &values[1..],
                ..good
            },
            "83 values, not 84",
        ),
        (BoundMeshParts { bases: 0, ..good }, "no bases"),
        (
            BoundMeshParts {
                corners: &[[0, 1, 3], [0; 3]],
                ..good
            },
            "no vertex 3 of 3",
        ),
        (
            BoundMeshParts {
                neighbours: &[[0, 2, 0], [0; 3]],
                ..good
            },
            "no controller 2",
        ),
        (
            BoundMeshParts {
                skin_joints: &[[1; 4]; 3],
                ..good
            },
            "no joint 1",
        ),
        (
            BoundMeshParts {
                masses: &[[0.0; 3]],
                ..good
            },
            "1 masses, not 2",
        ),
    ];
    for (parts, expected) in cases {
        let error = BoundMesh::new(&parts).expect_err(expected);
        assert!(error.to_string().contains(expected), "{error}");
    }
    let mesh = BoundMesh::new(&good).expect("it fits together");
    for (kept, log2_growth, expected) in [
        (&[0, 2][..], &[0.0, 0.0][..], "no Gaussian 2"),
        (&[], &[], "keeps 0"),
        (&[1], &[f32::NAN], "NaN octaves"),
        (&[1], &[], "grows 0"),
    ] {
        let level = DetailLevel { kept, log2_growth };
        let error = mesh.clone().with_levels(&[level]).expect_err(expected);
        assert!(error.to_string().contains(expected), "{error}");
    }
}

#[test]
fn networks_that_do_not_follow_one_another_are_refused_by_name() {
    let (attributes, scales, values) = ([0.0; 28], [f16::ZERO; 28], [0; 84]);
    let mesh = BoundMesh::new(&parts(&attributes, &scales, &values)).expect("it fits together");
    // Two parameters, three and four hidden units, a code of one; one hidden unit for each of two controllers.
    let half = [f16::ZERO; 16];
    let dense = |inputs: usize, outputs: usize| DenseParts {
        weights: &half[..inputs * outputs],
        bias: &[0.0; 16][..outputs],
    };
    let good = NetworkParts {
        first: dense(2, 3),
        second: dense(3, 4),
        code: dense(4, 1),
        fields: &[0; 9],
        scales: &half[..9],
        unit: 1.0,
        rest: &[0.0; 9],
        controllers_first: dense(2, 2),
        controllers_second: &half[..6],
        controllers_bias: &[0.0; 6],
    };
    let driven = mesh.clone().with_networks(&good);
    assert_eq!(driven.expect("it fits").parameters(), Some(2));
    let cases = [
        (
            NetworkParts {
                first: DenseParts {
                    weights: &half[..5],
                    ..good.first
                },
                ..good
            },
            "5 weights for 3 outputs",
        ),
        (
            NetworkParts {
                second: dense(2, 4),
                ..good
            },
            "8 weights of its mesh's second layer, not 12",
        ),
        (
            NetworkParts {
                code: dense(4, 2),
                ..good
            },
            "9 numbers of its fields, not 18",
        ),
        (
            NetworkParts {
                rest: &[0.0; 6],
                ..good
            },
            "6 coordinates at rest, not 9",
        ),
        (
            NetworkParts {
                controllers_first: dense(2, 3),
                ..good
            },
            "3 hidden units for 2 controllers",
        ),
        (
            NetworkParts {
                controllers_first: dense(3, 2),
                ..good
            },
            "6 weights of its controllers' first layer, not 4",
        ),
        (
            NetworkParts {
                controllers_bias: &[0.0; 4],
                ..good
            },
            "4 biases of its controllers' second layers, not 6",
        ),
        (
            NetworkParts {
                code: dense(4, 0),
                ..good
            },
            "a code of 0 numbers",
        ),
        (
            NetworkParts {
                second: dense(3, 0),
                code: dense(0, 1),
                ..good
            },
            "a second layer of 0",
        ),
    ];
    for (networks, expected) in cases {
        let error = mesh.clone().with_networks(&networks).expect_err(expected);
        assert!(error.to_string().contains(expected), "{error}");
    }
}
