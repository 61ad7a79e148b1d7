//! False contents with true hashes: numbers, indices, shapes and counts.

use crate::Court;
use crate::parts::{BINDING, CONTROLLERS, GAUSSIANS, MANIFEST, Parts, TEMPLATE, Tensors, pack};
use serde_json::{Value, json};
use synthetic_person::Random;

pub(crate) fn wrong_numbers(court: &mut Court, parts: &Parts, random: &mut Random) {
    let count = |tensor: &str, member: &str| {
        let bytes = &parts.members.iter().find(|(n, _)| n == member);
        let header = Tensors::of(&bytes.expect("a member").1).header;
        let shape = header[tensor]["shape"].as_array().expect("a shape");
        let sizes = shape.iter().map(|s| s.as_u64().expect("a size"));
        usize::try_from(sizes.product::<u64>()).expect("small")
    };
    let floats = [
        (TEMPLATE, "vertices", TEMPLATE),
        (TEMPLATE, "joints", TEMPLATE),
        (TEMPLATE, "skin_weights", TEMPLATE),
        (CONTROLLERS, "masses", CONTROLLERS),
    ];
    for (member, tensor, blamed) in floats {
        for value in [
            f32::NAN,
            f32::INFINITY,
            f32::NEG_INFINITY,
            1e30,
            -1e3,
            f32::from_bits(0xffff_ffff),
        ] {
            let at = random.below(count(tensor, member));
            edit(
                court,
                parts,
                member,
                tensor,
                at,
                &value.to_le_bytes(),
                blamed,
            );
        }
    }
    for (member, tensor) in [(GAUSSIANS, "attributes"), (BINDING, "barycentric")] {
        for value in [half::f16::NAN, half::f16::INFINITY, half::f16::MIN] {
            let at = random.below(count(tensor, member));
            edit(
                court,
                parts,
                member,
                tensor,
                at,
                &value.to_le_bytes(),
                BINDING,
            );
        }
    }
    for (member, tensor) in [
        (TEMPLATE, "faces"),
        (BINDING, "triangle"),
        (CONTROLLERS, "vertex"),
    ] {
        for value in [u32::MAX, 1 << 31, 2_000_000, 5_000] {
            let at = random.below(count(tensor, member));
            edit(
                court,
                parts,
                member,
                tensor,
                at,
                &value.to_le_bytes(),
                member,
            );
        }
    }
    for value in [55u8, 255] {
        let at = random.below(count("skin_joints", TEMPLATE));
        edit(
            court,
            parts,
            TEMPLATE,
            "skin_joints",
            at,
            &[value],
            TEMPLATE,
        );
    }
    for value in [16u16, u16::MAX] {
        let at = random.below(count("neighbours", CONTROLLERS));
        edit(
            court,
            parts,
            CONTROLLERS,
            "neighbours",
            at,
            &value.to_le_bytes(),
            CONTROLLERS,
        );
    }
    for (value, reason) in [
        (2_000u32, "but there are only 2000"),
        (u32::MAX, "but there are only 2000"),
    ] {
        let at = random.below(count("order", GAUSSIANS));
        let value = value.to_le_bytes();
        edit(court, parts, GAUSSIANS, "order", at, &value, reason);
        edit(court, parts, GAUSSIANS, "heirs", at, &value, reason);
    }
    // In range, but no permutation: the first and the last cannot both be what the first was.
    let first = Tensors::of(parts.clone().member(GAUSSIANS)).first("order", 4);
    edit(
        court,
        parts,
        GAUSSIANS,
        "order",
        1_999,
        &first,
        "stands there before",
    );
    // The most important one has no heir but itself.
    let [a, b, c, d] = first[..] else {
        panic!("an index of four bytes")
    };
    let most = u32::from_le_bytes([a, b, c, d]);
    let other = ((most + 1) % 2_000).to_le_bytes();
    let most = usize::try_from(most).expect("an index");
    edit(
        court,
        parts,
        GAUSSIANS,
        "heirs",
        most,
        &other,
        "is less important",
    );
    // Finite and in range, but weights and masses that no longer sum to 1.
    edit(
        court,
        parts,
        TEMPLATE,
        "skin_weights",
        0,
        &0.123f32.to_le_bytes(),
        "sum of skinning",
    );
    edit(
        court,
        parts,
        CONTROLLERS,
        "masses",
        0,
        &0.9999f32.to_le_bytes(),
        "sum of virtual",
    );
}

/// Overwrites one element, makes the hashes true again and expects a refusal that holds `reason`.
fn edit(
    court: &mut Court,
    parts: &Parts,
    member: &str,
    tensor: &str,
    at: usize,
    value: &[u8],
    reason: &str,
) {
    let mut broken = parts.clone();
    let mut tensors = Tensors::of(broken.member(member));
    tensors.set(tensor, at, value);
    *broken.member(member) = tensors.bytes();
    let what = format!("{member}: {tensor}[{at}] = {value:x?}");
    court.refuse(&what, &broken.rehash().pack(), reason);
}

pub(crate) fn wrong_shapes(court: &mut Court, parts: &Parts) {
    let huge = [
        json!(u64::MAX),
        json!(1u64 << 62),
        json!(1u64 << 33),
        json!(-1),
        json!(1e300),
    ];
    for (member, tensor) in [
        (TEMPLATE, "vertices"),
        (TEMPLATE, "joints"),
        (GAUSSIANS, "attributes"),
        (GAUSSIANS, "order"),
        (BINDING, "triangle"),
        (CONTROLLERS, "neighbours"),
    ] {
        let mut lies: Vec<(&str, Value)> = huge
            .iter()
            .flat_map(|size| {
                [
                    ("shape", json!([size, 3])),
                    ("shape", json!([size, size, size])),
                    ("data_offsets", json!([0, size])),
                ]
            })
            .collect();
        lies.push(("shape", json!([])));
        lies.push(("shape", json!([0, 3])));
        lies.push(("dtype", json!("I64")));
        lies.push(("dtype", json!("BOOL")));
        for (key, value) in lies {
            for listed in [false, true] {
                let mut broken = parts.clone();
                let mut tensors = Tensors::of(broken.member(member));
                tensors.header[tensor][key] = value.clone();
                *broken.member(member) = tensors.bytes();
                // The manifest has the same false value, or not.
                if listed && key != "data_offsets" {
                    broken.entry(member)["tensors"][tensor][key] = value.clone();
                }
                let what = format!("{member}: {tensor}.{key} = {value}");
                court.refuse(&what, &broken.rehash().pack(), "package member");
            }
        }
        // The same bytes under another shape or type, and the manifest agrees: only the counts object.
        let mut broken = parts.clone();
        let mut tensors = Tensors::of(broken.member(member));
        let mut shape: Vec<u64> =
            serde_json::from_value(tensors.header[tensor]["shape"].clone()).expect("a shape");
        shape.reverse();
        shape.push(1);
        tensors.header[tensor]["shape"] = json!(shape);
        *broken.member(member) = tensors.bytes();
        broken.entry(member)["tensors"][tensor]["shape"] = json!(shape);
        court.refuse("a reversed shape", &broken.rehash().pack(), "counts need");
    }
    for length in [u64::MAX, 1 << 40, 100_000_000, 0] {
        let mut broken = parts.clone();
        broken.member(TEMPLATE)[..8].copy_from_slice(&length.to_le_bytes());
        court.refuse("a header length", &broken.rehash().pack(), TEMPLATE);
    }
    let mut broken = parts.clone();
    let mut tensors = Tensors::of(broken.member(GAUSSIANS));
    let end = tensors.data.len();
    tensors.data.extend([0; 4]);
    let extra = json!({"dtype": "F32", "shape": [1], "data_offsets": [end, end + 4]});
    tensors.header["extra"] = extra;
    *broken.member(GAUSSIANS) = tensors.bytes();
    broken.entry(GAUSSIANS)["tensors"]["extra"] = json!({"dtype": "F32", "shape": [1]});
    court.refuse(
        "an extra tensor",
        &broken.rehash().pack(),
        "4 tensors, not 3",
    );
}

pub(crate) fn wrong_manifests(court: &mut Court, parts: &Parts) {
    let mut change = |path: &str, value: Value, reason: &str| {
        let mut broken = parts.clone();
        *broken.manifest.pointer_mut(path).expect("a known key") = value.clone();
        court.refuse(&format!("{path} = {value}"), &broken.pack(), reason);
    };
    for count in [
        "vertices",
        "faces",
        "gaussians",
        "controllers",
        "bases",
        "joints",
        "motion",
    ] {
        let path = format!("/counts/{count}");
        for value in [
            json!(0),
            json!(1),
            json!(u64::MAX),
            json!(1u64 << 40),
            json!(-5),
            json!(1.5),
        ] {
            change(&path, value, "package member");
        }
    }
    change("/version", json!(3), "signature.txt: it is missing");
    change("/version", json!(4), "update mon3tr");
    change("/version", json!(4_000_000_000u32), "update mon3tr");
    change("/version", json!("1"), MANIFEST);
    change("/format", json!("mon3tr-scene"), "mon3tr-scene");
    change("/members", json!([]), "manifest lists");
    change("/members/0/name", json!("deform.onnx"), "manifest lists");
    change(
        "/members/0/name",
        json!("../template.safetensors"),
        "manifest lists",
    );
    change("/members/0/bytes", json!(u64::MAX), "bytes, not");
    change("/members/0/bytes", json!(0), "more than the 0");
    change("/members/0/sha256", json!("00"), "SHA-256");
    change("/members/4/sha256", json!(""), "SHA-256");
    change("/members/0/tensors", json!({}), "manifest lists");
    change("/members/4/tensors", json!({}), "manifest lists");
    change(
        "/expressions/smile/coefficients",
        json!([1.0, 2.0]),
        "coefficients",
    );
    change(
        "/expressions/smile/coefficients/3",
        json!(1e30),
        "coefficient",
    );
    change("/expressions/smile/coefficients/3", json!(1e300), MANIFEST);
    change("/expressions/smile/jaw", Value::Null, MANIFEST);
    for key in ["format", "version", "name", "counts", "members"] {
        let mut broken = parts.clone();
        let object = broken.manifest.as_object_mut().expect("an object");
        object.remove(key);
        court.refuse(&format!("no {key}"), &broken.pack(), "missing field");
    }
    for text in [
        "",
        "{",
        "[]",
        "null",
        "\u{feff}{}",
        &"[".repeat(100_000),
        &"{\"a\":".repeat(5_000),
    ] {
        let mut files = vec![(MANIFEST.to_owned(), text.as_bytes().to_vec())];
        files.extend(parts.members.iter().cloned());
        court.refuse("a text that is no manifest", &pack(&files), MANIFEST);
    }
    // A package of an older version is not an error.
    let mut older = parts.clone();
    older.manifest["version"] = json!(1);
    assert_eq!(court.read("version 1", &older.pack()), None, "it is read");
    // Nor is a key from the future.
    let mut newer = parts.clone();
    newer.manifest["mood"] = json!({"today": ["good", 1]});
    newer.manifest["counts"]["hats"] = json!(3);
    assert_eq!(
        court.read("unknown keys", &newer.pack()),
        None,
        "unknown keys are ignored"
    );
}

/// Texts that the command prints: a terminal would execute the first two, the third shows what follows it backwards.
pub(crate) fn unprintable_texts(court: &mut Court, parts: &Parts) {
    for text in ["\u{1b}[2J", "two\nlines", "\u{202e}0-1CC"] {
        for key in ["name", "generator", "provenance", "licence"] {
            let mut broken = parts.clone();
            broken.manifest[key] = json!(text);
            court.refuse(key, &broken.pack(), "must not be printed");
        }
        let mut broken = parts.clone();
        let smile = broken.manifest["expressions"]["smile"].clone();
        broken.manifest["expressions"][text] = smile;
        court.refuse("an expression", &broken.pack(), "must not be printed");
    }
}
