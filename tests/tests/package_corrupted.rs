//! 300 and more broken packages: each is refused with an error that says what is wrong (or, for a flip in a byte that
//! means nothing, reads as the avatar it was), without a panic and within a gigabyte.

use mon3tr_tests::synthetic::{Puppet, Random};
use serde_json::{Value, json};
use sha2::{Digest, Sha256};
use spmm3::Avatar;
use std::alloc::{GlobalAlloc, Layout, System};
use std::io::{Cursor, Read, Write};
use std::sync::atomic::{AtomicUsize, Ordering::Relaxed};
use zip::write::SimpleFileOptions;

/// The system's allocator, counting what is held and the most that ever was.
struct Counting;

static HELD: AtomicUsize = AtomicUsize::new(0);
static PEAK: AtomicUsize = AtomicUsize::new(0);

// SAFETY: every call goes to the system's allocator unchanged; only numbers are kept beside.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        PEAK.fetch_max(
            HELD.fetch_add(layout.size(), Relaxed) + layout.size(),
            Relaxed,
        );
        // SAFETY: the caller keeps GlobalAlloc's contract, which is System's.
        unsafe { System.alloc(layout) }
    }

    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        HELD.fetch_sub(layout.size(), Relaxed);
        // SAFETY: as above; `pointer` came from `System.alloc` with this layout.
        unsafe { System.dealloc(pointer, layout) }
    }
}

#[global_allocator]
static ALLOCATOR: Counting = Counting;

const TEMPLATE: &str = "template.safetensors";
const GAUSSIANS: &str = "gaussians.safetensors";
const BINDING: &str = "binding.safetensors";
const CONTROLLERS: &str = "controllers.safetensors";
const GRAPH: &str = "deform.onnx";
const MANIFEST: &str = "manifest.json";

/// A package taken apart, to be put together wrongly.
#[derive(Clone)]
struct Parts {
    manifest: Value,
    members: Vec<(String, Vec<u8>)>,
}

impl Parts {
    fn of(package: &[u8]) -> Self {
        let mut zip = zip::ZipArchive::new(Cursor::new(package)).expect("the puppet's package");
        let mut members = Vec::new();
        for index in 0..zip.len() {
            let mut file = zip.by_index(index).expect("a member");
            let mut bytes = Vec::new();
            file.read_to_end(&mut bytes).expect("a whole member");
            members.push((file.name().expect("a name").into_owned(), bytes));
        }
        let (_, manifest) = members.remove(0);
        let manifest = serde_json::from_slice(&manifest).expect("the manifest");
        Self { manifest, members }
    }

    fn member(&mut self, name: &str) -> &mut Vec<u8> {
        let found = self.members.iter_mut().find(|(n, _)| n == name);
        &mut found.expect("a known member").1
    }

    /// The manifest's entry of a member.
    fn entry(&mut self, name: &str) -> &mut Value {
        let entries = self.manifest["members"].as_array_mut().expect("a list");
        let found = entries.iter_mut().find(|entry| entry["name"] == name);
        found.expect("a listed member")
    }

    /// Makes sizes and hashes true again, so that only what was changed is wrong.
    fn rehash(mut self) -> Self {
        for (name, bytes) in self.members.clone() {
            let entry = self.entry(&name);
            entry["bytes"] = json!(bytes.len());
            entry["sha256"] = json!(hash(&bytes));
        }
        self
    }

    fn pack(&self) -> Vec<u8> {
        let manifest = serde_json::to_vec(&self.manifest).expect("the manifest");
        let mut files = vec![(MANIFEST.to_owned(), manifest)];
        files.extend(self.members.iter().cloned());
        pack(&files)
    }
}

fn hash(bytes: &[u8]) -> String {
    let digest = Sha256::digest(bytes);
    digest.iter().map(|byte| format!("{byte:02x}")).collect()
}

fn pack(files: &[(String, Vec<u8>)]) -> Vec<u8> {
    let mut zip = zip::ZipWriter::new(Cursor::new(Vec::new()));
    for (name, bytes) in files {
        zip.start_file(name.as_str(), SimpleFileOptions::default())
            .expect("a new member");
        zip.write_all(bytes).expect("memory");
    }
    zip.finish().expect("memory").into_inner()
}

/// Header and data of a safetensors file, taken apart without that format's crate, which refuses to write wrong ones.
struct Tensors {
    header: Value,
    data: Vec<u8>,
}

impl Tensors {
    fn of(bytes: &[u8]) -> Self {
        let length = u64::from_le_bytes(*bytes.first_chunk().expect("a length"));
        let (header, data) = bytes[8..].split_at(usize::try_from(length).expect("a length"));
        Self {
            header: serde_json::from_slice(header).expect("a header"),
            data: data.to_vec(),
        }
    }

    fn bytes(&self) -> Vec<u8> {
        let header = self.header.to_string().into_bytes();
        let length = (header.len() as u64).to_le_bytes();
        [&length[..], &header, &self.data].concat()
    }

    /// Overwrites element `at` of a tensor.
    fn set(&mut self, tensor: &str, at: usize, value: &[u8]) {
        let start = self.header[tensor]["data_offsets"][0].as_u64();
        let start = usize::try_from(start.expect("an offset")).expect("an offset");
        let at = start + at * value.len();
        self.data[at..at + value.len()].copy_from_slice(value);
    }
}

/// Reads broken packages and keeps score.
struct Court {
    original: Avatar,
    cases: usize,
    harmless: usize,
    peak: usize,
}

impl Court {
    /// Reads `package`; gives the error's text, or `None` where it read as the avatar it was.
    fn read(&mut self, what: &str, package: &[u8]) -> Option<String> {
        self.cases += 1;
        let before = HELD.load(Relaxed);
        PEAK.store(before, Relaxed);
        let outcome = std::panic::catch_unwind(|| Avatar::read(Cursor::new(package)));
        let used = PEAK.load(Relaxed) - before;
        self.peak = self.peak.max(used);
        assert!(used < 1 << 30, "{what} took {used} bytes");
        match outcome {
            Err(_) => panic!("{what} made the reader panic"),
            Ok(Err(e)) => Some(e.to_string()),
            Ok(Ok(avatar)) => {
                assert!(avatar == self.original, "{what} gave another avatar");
                self.harmless += 1;
                None
            }
        }
    }

    /// `package` must be refused with words that hold `reason`.
    fn refuse(&mut self, what: &str, package: &[u8], reason: &str) {
        match self.read(what, package) {
            None => panic!("{what} was accepted"),
            Some(error) => assert!(
                error.contains(reason),
                "{what} should be refused for {reason:?}, not: {error}"
            ),
        }
    }
}

/// Little-endian patches of a zip's records, found by their signatures.
fn records(package: &[u8], signature: &[u8; 4]) -> Vec<usize> {
    (0..package.len() - 4)
        .filter(|at| package[*at..].starts_with(signature))
        .collect()
}

const LOCAL: &[u8; 4] = b"PK\x03\x04";
const CENTRAL: &[u8; 4] = b"PK\x01\x02";
const END: &[u8; 4] = b"PK\x05\x06";

/// One protobuf field of bytes.
fn field(number: u8, content: &[u8]) -> Vec<u8> {
    let mut out = vec![number << 3 | 2];
    let mut length = content.len();
    while length > 0x7f {
        out.push(length.to_le_bytes()[0] | 0x80);
        length >>= 7;
    }
    out.push(length.to_le_bytes()[0]);
    out.extend(content);
    out
}

/// Where a stored tensor's numbers begin: its name, the key of raw data, a length, then they.
fn raw_data(graph: &[u8], tensor: &str) -> usize {
    let named = [tensor.as_bytes(), &[9 << 3 | 2]].concat();
    let found = graph.windows(named.len()).position(|w| w == named);
    let mut at = found.expect("a stored tensor of this name") + named.len();
    while graph[at] & 0x80 != 0 {
        at += 1;
    }
    at + 1
}

#[test]
fn three_hundred_broken_packages_are_refused_and_none_takes_a_gigabyte() {
    let original = Puppet::small().avatar();
    let package = original.to_bytes().expect("the puppet packs");
    let parts = Parts::of(&package);
    let mut court = Court {
        original,
        cases: 0,
        harmless: 0,
        peak: 0,
    };
    let mut random = Random::new(300);
    let repacked = Avatar::read(Cursor::new(parts.pack()));
    assert!(
        repacked.is_ok_and(|avatar| avatar == court.original),
        "the tools of this test break packages by themselves"
    );

    flips_and_cuts(&mut court, &package, &mut random);
    wrong_numbers(&mut court, &parts, &mut random);
    wrong_shapes(&mut court, &parts);
    wrong_manifests(&mut court, &parts);
    wrong_graphs(&mut court, &parts);
    wrong_archives(&mut court, &package, &parts);
    bombs(&mut court, &parts);

    println!(
        "{} broken packages, {} of them harmless; at most {:.1} MiB held",
        court.cases,
        court.harmless,
        court.peak as f64 / f64::from(1 << 20)
    );
    assert!(court.cases >= 300, "only {} cases", court.cases);
}

fn flips_and_cuts(court: &mut Court, package: &[u8], random: &mut Random) {
    for _ in 0..120 {
        let mut broken = package.to_vec();
        let (at, bit) = (random.below(broken.len()), random.below(8));
        broken[at] ^= 1 << bit;
        court.read(&format!("a flip of bit {bit} at byte {at}"), &broken);
    }
    assert!(
        court.harmless < 6,
        "{} of 120 flips changed nothing: is anything checked?",
        court.harmless
    );
    // The directory and the records around the members, where a random flip seldom lands.
    let directory = records(package, CENTRAL)[0];
    for _ in 0..60 {
        let mut broken = package.to_vec();
        let at = directory + random.below(broken.len() - directory);
        broken[at] ^= 1 << random.below(8);
        court.read(&format!("a flip in the directory at {at}"), &broken);
    }
    for _ in 0..40 {
        let length = random.below(package.len());
        let cut = &package[..length];
        court.refuse(&format!("a cut to {length} bytes"), cut, "package");
    }
    for length in [0, 1, 21, 22, 41, 42, package.len() - 1] {
        court.refuse("a cut", &package[..length], "package");
    }
}

fn wrong_numbers(court: &mut Court, parts: &Parts, random: &mut Random) {
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

fn wrong_shapes(court: &mut Court, parts: &Parts) {
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
                // The manifest tells the same lie, or not.
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
        "2 tensors, not 1",
    );
}

fn wrong_manifests(court: &mut Court, parts: &Parts) {
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
    change("/version", json!(2), "update mon3tr");
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
        court.refuse("a manifest that is none", &pack(&files), MANIFEST);
    }
    // A key from the future is not an error.
    let mut newer = parts.clone();
    newer.manifest["mood"] = json!({"today": ["good", 1]});
    newer.manifest["counts"]["hats"] = json!(3);
    assert_eq!(
        court.read("unknown keys", &newer.pack()),
        None,
        "unknown keys are ignored"
    );
}

fn wrong_graphs(court: &mut Court, parts: &Parts) {
    let mut change = |what: &str, reason: &str, edit: &dyn Fn(&mut Vec<u8>)| {
        let mut broken = parts.clone();
        edit(broken.member(GRAPH));
        court.refuse(what, &broken.rehash().pack(), reason);
    };
    let replace = |from: &'static str, to: &'static str| {
        move |graph: &mut Vec<u8>| {
            assert_eq!(from.len(), to.len(), "the lengths around it stay true");
            let mut at = 0;
            while at + from.len() <= graph.len() {
                if graph[at..].starts_with(from.as_bytes()) {
                    graph[at..at + from.len()].copy_from_slice(to.as_bytes());
                }
                at += 1;
            }
        }
    };
    for (from, to) in [("Gemm", "Loop"), ("Gather", "DQNcpu"), ("Mul", "If\0")] {
        change(&format!("{to} for {from}"), "operator", &replace(from, to));
    }
    for (from, to) in [
        ("motion", "Motion"),
        ("skinning", "Skinning"),
        ("posed_vertices", "posed_triangle"),
        ("residuals", "Residuals"),
    ] {
        change(
            &format!("{to} for {from}"),
            "counts need",
            &replace(from, to),
        );
    }
    for tensor in [
        "mesh.decoder.unit",
        "mesh.canonical",
        "skin.weights",
        "attr.mass2",
    ] {
        for value in [f32::NAN, f32::INFINITY] {
            change("a number that is none", "not finite", &|graph| {
                let at = raw_data(graph, tensor);
                graph[at..at + 4].copy_from_slice(&value.to_le_bytes());
            });
        }
    }
    for tensor in [
        "attr.bases.scales",
        "mesh.first.weights",
        "attr.second.weights",
    ] {
        change("a half that is none", "not finite", &|graph| {
            let at = raw_data(graph, tensor);
            graph[at..at + 2].copy_from_slice(&half::f16::NAN.to_le_bytes());
        });
    }
    change("an empty graph", "no graph", &Vec::clear);
    change("a text", GRAPH, &|graph| *graph = b"hello".to_vec());
    for keep in [3, 10, 1_000, 100_000] {
        change("half a graph", GRAPH, &|graph| graph.truncate(keep));
    }
    let stored = |tensor: Vec<u8>| field(7, &field(5, &tensor));
    let outside = field(
        13,
        &[field(1, b"location"), field(2, b"/etc/passwd")].concat(),
    );
    change(
        "numbers in another file",
        "raw data in this file",
        &|graph| {
            *graph = stored([field(8, b"w"), outside.clone()].concat());
        },
    );
    change("a tensor of 2^62 x 2^62", "bytes for shape", &|graph| {
        let size = [8, 128, 128, 128, 128, 128, 128, 128, 128, 64];
        let floats = [16, 1];
        *graph = stored([&size[..], &size, &floats, &field(8, b"w")].concat());
    });
    change("a domain of its own", "foreign", &|graph| {
        let node = [field(4, b"Add"), field(7, b"com.example")].concat();
        *graph = field(7, &field(1, &node));
    });
    change("a graph in an attribute", "attribute", &|graph| {
        let node = [field(4, b"Add"), field(5, &field(6, b""))].concat();
        *graph = field(7, &field(1, &node));
    });
    change("two graphs", "more than one", &|graph| {
        let second = graph.clone();
        graph.extend(second);
    });
    change("a million empty nodes", "operator", &|graph| {
        *graph = field(7, &field(1, b"").repeat(1_000_000));
    });
    change("a million nodes", "more nodes", &|graph| {
        *graph = field(7, &field(1, &field(4, b"Add")).repeat(1_000_000));
    });
    change("a varint without end", GRAPH, &|graph| {
        *graph = vec![0xff; 64];
    });
}

fn wrong_archives(court: &mut Court, package: &[u8], parts: &Parts) {
    let manifest = (
        MANIFEST.to_owned(),
        serde_json::to_vec(&parts.manifest).expect("json"),
    );
    let files = [vec![manifest], parts.members.clone()].concat();
    let with = |name: &str, bytes: &[u8]| {
        let extra = (name.to_owned(), bytes.to_vec());
        pack(&[files.clone(), vec![extra]].concat())
    };
    for name in [
        "/etc/passwd",
        "../up",
        "a/b",
        "C:\\x",
        "folder/",
        ".hidden",
        "a\0b",
        &"n".repeat(200),
    ] {
        court.refuse(
            &format!("a member {name:?}"),
            &with(name, b"x"),
            "unusable name",
        );
    }
    court.refuse(
        "an unlisted member",
        &with("notes.txt", b"x"),
        "manifest lists",
    );
    court.refuse(
        "a nested package",
        &with("inner.m3a", package),
        "manifest lists",
    );
    let mut listed = parts.clone();
    let extra = json!({"name": "notes.txt", "bytes": 1, "sha256": hash(b"x"), "tensors": {}});
    listed.manifest["members"]
        .as_array_mut()
        .expect("a list")
        .push(extra);
    listed.members.push(("notes.txt".into(), b"x".to_vec()));
    court.refuse(
        "a listed but unknown member",
        &listed.pack(),
        "a package holds",
    );
    for missing in 0..files.len() {
        let mut fewer = files.clone();
        let (name, _) = fewer.remove(missing);
        court.refuse(&format!("no {name}"), &pack(&fewer), "package");
    }
    let crowd: Vec<(String, Vec<u8>)> = (0..17).map(|k| (format!("m{k}"), vec![])).collect();
    court.refuse("17 members", &pack(&crowd), "at most 16");
    let crowd: Vec<(String, Vec<u8>)> = (0..60_000).map(|k| (format!("m{k}"), vec![])).collect();
    court.refuse("60,000 members", &pack(&crowd), "at most 16");

    // Two members under one name: written apart, renamed in the bytes.
    let twin = with("deform.onny", b"second");
    let mut broken = twin.clone();
    for at in 0..broken.len() - 11 {
        if broken[at..].starts_with(b"deform.onny") {
            broken[at..at + 11].copy_from_slice(b"deform.onnx");
        }
    }
    court.refuse("two members of one name", &broken, "duplicate");

    let (local, central) = (records(package, LOCAL), records(package, CENTRAL));
    let end = records(package, END)[0];
    let mut patch = |what: &str, at: usize, value: &[u8]| {
        let mut broken = package.to_vec();
        broken[at..at + value.len()].copy_from_slice(value);
        court.refuse(what, &broken, "package");
    };
    for (entry, size) in [
        (0, 1u32),
        (1, 7),
        (2, u32::MAX),
        (5, 400 << 20),
        (5, 0),
        (4, u32::MAX - 1),
    ] {
        let size = size.to_le_bytes();
        patch("a size in the directory", central[entry] + 24, &size);
        patch("a packed size in the directory", central[entry] + 20, &size);
        patch("a size in the local header", local[entry] + 22, &size);
        patch(
            "a packed size in the local header",
            local[entry] + 18,
            &size,
        );
    }
    patch("a wrong checksum", central[3] + 16, &[1, 2, 3, 4]);
    patch("an encrypted member", central[2] + 8, &[1]);
    patch("an unknown method", central[2] + 10, &[99]);
    patch("a stored member that is deflated", central[2] + 10, &[0]);
    patch("a member outside the file", central[2] + 42, &[0xff; 4]);
    let first = u32::try_from(local[1]).expect("small").to_le_bytes();
    patch("two entries for one member", central[2] + 42, &first);
    patch("65,535 entries", end + 8, &[0xff; 4]);
    patch("a directory of 4 GiB", end + 12, &[0xff; 4]);
    patch("a directory outside the file", end + 16, &[0xff; 4]);
    patch("a second disk", end + 4, &[1]);
    patch("a comment that is missing", end + 20, &[9]);
    let before = [b"#!/bin/sh\n", package].concat();
    court.refuse(
        "something before the archive",
        &before,
        "directory is not where",
    );
    let after = [package, b"more"].concat();
    court.refuse("something after the archive", &after, "no zip directory");
    let ends: Vec<u8> = package[end..].repeat(50_000);
    court.refuse("50,000 ends", &[package, &ends].concat(), "package");
    court.refuse(
        "a text file",
        &b"not a package at all\n".repeat(9),
        "no zip directory",
    );
}

/// Small files that unpack to a lot.
fn bombs(court: &mut Court, parts: &Parts) {
    let zeros = vec![0u8; 1 << 20];
    let mut bomb = |name: &str, mebibytes: usize, reason: &str, honest: bool| {
        let mut digest = Sha256::new();
        (0..mebibytes).for_each(|_| digest.update(&zeros));
        let digest: String = digest
            .finalize()
            .iter()
            .map(|b| format!("{b:02x}"))
            .collect();
        let mut lying = parts.clone();
        if honest && name != MANIFEST {
            lying.entry(name)["bytes"] = json!(mebibytes << 20);
            lying.entry(name)["sha256"] = json!(digest);
        }
        let mut zip = zip::ZipWriter::new(Cursor::new(Vec::new()));
        let options = SimpleFileOptions::default();
        let manifest = serde_json::to_vec(&lying.manifest).expect("json");
        let manifest = (MANIFEST.to_owned(), manifest);
        for (member, bytes) in [&manifest].into_iter().chain(&lying.members) {
            zip.start_file(member.as_str(), options)
                .expect("a new member");
            if member == name {
                for _ in 0..mebibytes {
                    zip.write_all(&zeros).expect("memory");
                }
            } else {
                zip.write_all(bytes).expect("memory");
            }
        }
        let packed = zip.finish().expect("memory").into_inner();
        let what = format!("{mebibytes} MiB of nothing as {name}");
        court.refuse(&what, &packed, reason);
    };
    bomb(MANIFEST, 300, "more than the", true);
    bomb(TEMPLATE, 300, "more than the", false);
    bomb(TEMPLATE, 700, "unpacks to", true);
    bomb(TEMPLATE, 450, TEMPLATE, true);
    bomb(GRAPH, 450, GRAPH, true);
}
