//! The decoders of the MakeHuman package against files the test writes: small good ones, and damaged ones, which must
//! give errors and never panic.

use glam::{Vec2, Vec3};
use reconstruct::ReconstructError;
use reconstruct::makehuman::{Anchor, Model, Package, Proxy, Rig, ScaleReference, Targets};
use serde_json::{Value, json};
use std::path::Path;

/// One quad on one bone. The face carries a material, corner coordinates and a normal, so that skipping is tried too.
fn one_quad() -> Value {
    json!({
        "vertices": [0, 0, 0, 1, 0, 0, 1, 2, 0, 0, 2, 0],
        "uvs": [[0, 0, 1, 0, 1, 1, 0, 1]],
        "faces": [27, 0, 1, 2, 3, 7, 3, 2, 1, 0, 99],
        "bones": [{"name": "root____head", "parent": -1}, {"name": "root", "parent": 0}],
        "skinIndices": [0, 0, 0, 0, 0, 0, 0, 0],
        "skinWeights": [0.5, 0.25, 1, 0, 1, 0, 1, 0],
        "influencesPerVertex": 2,
        "metadata": {"joint_pos_idxs": {"root____head": [0, 1], "root____tail": [2]}},
    })
}

/// The quad as a proxy: every vertex is bound to the body's first three.
fn one_proxy() -> Value {
    let mut proxy = one_quad();
    proxy["ref_vIdxs"] = json!([[0, 1, 2], [0, 1, 2], [0, 1, 2], [0, 1, 2]]);
    proxy["weights"] = json!([[0.5, 0.25, 0.25], [1, 0, 0], [0, 1, 0], [0, 0, 1]]);
    proxy["offsets"] = json!([[0, 0, 1], [0, 0, 0], [0, 0, 0], [0, 0, 0]]);
    proxy["metadata"] = json!({"deleteVerts": [0, 1, 1, 0]});
    proxy
}

/// The change to a good file.
type Damage = (&'static str, fn(&mut Value));

fn write(folder: &Path, name: &str, bytes: impl AsRef<[u8]>) -> std::path::PathBuf {
    let path = folder.join(name);
    std::fs::create_dir_all(path.parent().expect("a file has a folder")).expect("make a folder");
    std::fs::write(&path, bytes).expect("write a test file");
    path
}

fn read_model(value: &Value) -> Result<Model, ReconstructError> {
    let folder = tempfile::tempdir().expect("a temporary folder");
    Model::read(&write(folder.path(), "model.json", value.to_string()))
}

fn read_proxy(value: &Value) -> Result<Proxy, ReconstructError> {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let body = read_model(&one_quad()).expect("the body is good");
    Proxy::read(
        &write(folder.path(), "proxy.json", value.to_string()),
        &body,
    )
}

#[test]
fn a_model_of_one_quad_is_decoded_field_by_field() {
    let model = read_model(&one_quad()).expect("a good model");
    assert_eq!(model.vertices[2], Vec3::new(1.0, 2.0, 0.0), "third vertex");
    let quad = model.quads[0];
    assert_eq!(model.quads.len(), 1, "one face");
    assert_eq!(quad.corners, [0, 1, 2, 3], "corners");
    assert_eq!(quad.material, 7, "material");
    assert_eq!(
        quad.uvs,
        [Vec2::Y, Vec2::ONE, Vec2::X, Vec2::ZERO],
        "texture coordinates in the face's own order"
    );
    let sum: f32 = model.weights[0].iter().map(|(_, w)| w).sum();
    assert!((sum - 1.0).abs() < 1e-6, "weights are normalised: {sum}");
    let rig = Rig::new(&model).expect("a good rig");
    assert_eq!(
        rig.heads(&model.vertices),
        [Vec3::new(0.5, 0.0, 0.0)],
        "a joint is the mean of its vertices"
    );
}

#[test]
fn a_proxy_is_bound_to_the_body_and_lists_what_it_covers() {
    let proxy = read_proxy(&one_proxy()).expect("a good proxy");
    let body = [Vec3::ZERO, Vec3::X * 4.0, Vec3::Y * 8.0, Vec3::ZERO];
    assert_eq!(
        proxy.anchors[0].position(&body, Vec3::new(1.0, 1.0, 0.5)),
        Vec3::new(1.0, 2.0, 0.5),
        "a weighted mean plus a scaled offset"
    );
    assert_eq!(proxy.covers, [false, true, true, false], "deleteVerts");
    assert_eq!(
        Anchor::body_vertex(2).interpolate(&body),
        body[2],
        "the body's own vertices follow themselves"
    );
    assert_eq!(
        ScaleReference::Male.scale(&body),
        Vec3::ONE,
        "a body without the markers does not scale"
    );
}

#[test]
fn a_damaged_model_is_refused_with_its_name() {
    let damages: &[Damage] = &[
        ("a half vertex", |m| m["vertices"] = json!([0, 0, 0, 1])),
        ("half a texture coordinate", |m| m["uvs"] = json!([[0.5]])),
        ("no texture coordinates", |m| m["uvs"] = json!([])),
        ("a triangle", |m| m["faces"][0] = json!(26)),
        ("a face cut short", |m| m["faces"] = json!([27, 0, 1])),
        ("a corner out of range", |m| m["faces"][3] = json!(4)),
        ("a coordinate out of range", |m| m["faces"][7] = json!(4)),
        ("too few weights", |m| m["skinWeights"] = json!([1])),
        ("a bone out of range", |m| m["skinIndices"][0] = json!(2)),
        ("no weights", |m| {
            m["skinIndices"] = json!([]);
            m["skinWeights"] = json!([]);
        }),
        ("weights of nothing", |m| {
            m["skinWeights"] = json!(vec![0; 8]);
        }),
        ("a joint out of range", |m| {
            m["metadata"]["joint_pos_idxs"]["root____head"] = json!([4]);
        }),
    ];
    for (name, damage) in damages {
        let mut model = one_quad();
        damage(&mut model);
        match read_model(&model) {
            Err(ReconstructError::Content { path, .. }) => {
                assert!(path.ends_with("model.json"), "{name}: names {path:?}");
            }
            other => panic!("{name}: {other:?}"),
        }
    }
}

#[test]
fn a_proxy_says_which_vertices_lack_weights() {
    let mut proxy = one_proxy();
    proxy["skinWeights"] = json!([0, 0, 1, 0, 1, 0, 1, 0]);
    let own = read_proxy(&proxy).expect("a gap is no damage").weights;
    let lacking: Vec<bool> = own.iter().map(Option::is_none).collect();
    assert_eq!(lacking, [true, false, false, false], "zero weights");
    for key in ["bones", "skinIndices", "skinWeights"] {
        proxy.as_object_mut().and_then(|p| p.remove(key));
    }
    let own = read_proxy(&proxy).expect("no skin is no damage").weights;
    assert_eq!(own, [None; 4], "no skin");
}

#[test]
fn a_damaged_proxy_is_refused() {
    let damages: &[Damage] = &[
        ("no fit", |p| p["ref_vIdxs"] = json!([])),
        ("a fit too short", |p| p["weights"] = json!([[1, 0, 0]])),
        ("a fit beyond the body", |p| {
            p["ref_vIdxs"][0] = json!([0, 1, 4]);
        }),
        ("flags for another body", |p| {
            p["metadata"]["deleteVerts"] = json!([1]);
        }),
        ("another rig", |p| p["bones"][1]["name"] = json!("tail")),
    ];
    for (name, damage) in damages {
        let mut proxy = one_proxy();
        damage(&mut proxy);
        let result = read_proxy(&proxy);
        assert!(
            matches!(result, Err(ReconstructError::Content { .. })),
            "{name}: {result:?}"
        );
    }
}

#[test]
fn a_rig_whose_bones_do_not_chain_is_refused() {
    let damages: &[Damage] = &[
        ("an odd list", |m| {
            m["bones"] = json!([{"name": "root____head", "parent": -1}]);
        }),
        ("its own parent", |m| m["bones"][0]["parent"] = json!(0)),
        ("a joint without vertices", |m| {
            m["metadata"]["joint_pos_idxs"] = json!({});
        }),
    ];
    for (name, damage) in damages {
        let mut model = one_quad();
        damage(&mut model);
        let rig = read_model(&model).and_then(|model| Rig::new(&model));
        assert!(
            matches!(rig, Err(ReconstructError::Content { .. })),
            "{name}: {rig:?}"
        );
    }
}

#[test]
fn a_model_cut_anywhere_is_refused() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let whole = one_proxy().to_string();
    for length in 0..whole.len() {
        let path = write(folder.path(), "model.json", &whole[..length]);
        let result = Model::read(&path);
        assert!(
            matches!(result, Err(ReconstructError::Json { .. })),
            "cut at {length}: {result:?}"
        );
    }
    let missing = Model::read(&folder.path().join("nothing.json"));
    assert!(
        matches!(missing, Err(ReconstructError::Read { .. })),
        "{missing:?}"
    );
}

#[test]
fn no_single_hostile_number_makes_a_decoder_panic() {
    let body = read_model(&one_quad()).expect("the body is good");
    let folder = tempfile::tempdir().expect("a temporary folder");
    let whole = one_proxy().to_string();
    let bytes = whole.as_bytes();
    for at in (0..bytes.len()).filter(|at| bytes[*at].is_ascii_digit()) {
        for hostile in ["4294967295", "-1", "1e39", "65536", "null"] {
            let text = format!("{}{hostile}{}", &whole[..at], &whole[at + 1..]);
            let path = write(folder.path(), "proxy.json", text);
            // Some numbers may be anything; what counts is that every one comes back as a value or an error.
            let model = Model::read(&path);
            let proxy = Proxy::read(&path, &body);
            if let Ok(model) = model {
                drop(Rig::new(&model));
                let finite = model.vertices.iter().all(|v| v.is_finite());
                assert!(finite, "{hostile} at {at} passed as a vertex");
            }
            if let Ok(proxy) = proxy {
                let inside = proxy.anchors.iter().flat_map(|a| a.references);
                assert!(
                    inside.into_iter().all(|v| v < 4),
                    "{hostile} at {at} passed as a reference"
                );
            }
        }
    }
}

/// A package with two targets of four vertices; in the list's order `b` comes first, in the rows' order `a`.
fn two_targets(bytes: &[u8]) -> (tempfile::TempDir, Package) {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let list = json!({"targets": {"data/targets/b.target": ["b"], "data/targets/a.target": []}});
    write(
        folder.path(),
        "src/json/targets/target-list.json",
        list.to_string(),
    );
    write(folder.path(), "public/data/targets/targets.bin", bytes);
    let package = Package::new(folder.path());
    (folder, package)
}

#[test]
fn targets_are_rows_of_int16_in_the_order_of_their_names() {
    let numbers: Vec<i16> = (0..24).map(|k| k * 100 - 1200).collect();
    let bytes: Vec<u8> = numbers.iter().flat_map(|n| n.to_le_bytes()).collect();
    let (_folder, package) = two_targets(&bytes);
    let mut targets = Targets::open(&package, 4).expect("good targets");
    assert_eq!((targets.row("a"), targets.row("b")), (Some(0), Some(1)));
    let b = targets.read("b").expect("row of b");
    let expected: [Vec3; 4] = [
        Vec3::new(0.0, 0.1, 0.2),
        Vec3::new(0.3, 0.4, 0.5),
        Vec3::new(0.6, 0.7, 0.8),
        Vec3::new(0.9, 1.0, 1.1),
    ];
    for (got, expected) in b.iter().zip(expected) {
        assert!(got.abs_diff_eq(expected, 1e-6), "{got} for {expected}");
    }
    let unknown = targets.read("c");
    assert!(
        matches!(unknown, Err(ReconstructError::Content { .. })),
        "{unknown:?}"
    );
}

#[test]
fn targets_of_another_size_are_refused() {
    for length in [0, 47, 49, 96] {
        let (_folder, package) = two_targets(&vec![0; length]);
        let opened = Targets::open(&package, 4);
        let good = length == 48;
        assert!(
            good || matches!(opened, Err(ReconstructError::Content { .. })),
            "{length} bytes: {opened:?}"
        );
    }
}
