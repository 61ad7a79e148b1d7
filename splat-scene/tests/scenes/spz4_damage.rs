//! `.spz` version 4: tables, streams and extensions with false statements.

use splat_scene::Scene;

use crate::damage::{message, raws};
use crate::spz4_writer::{Block, Parts, extension, frame, parts};

fn changed(change: impl FnOnce(&mut Parts)) -> Vec<u8> {
    let mut parts = parts(&raws(3, 3), 12, 0);
    change(&mut parts);
    parts.join()
}

#[test]
fn counts_and_versions_of_a_header_are_checked_first() {
    let text = message(&changed(|parts| parts.header[8..12].fill(0xff)), "big.spz");
    assert!(text.contains("4294967295 Gaussians"), "{text}");
    let text = message(&changed(|parts| parts.header[4] = 5), "new.spz");
    assert!(text.contains("version 5"), "{text}");
    let text = message(&changed(|parts| parts.header[12] = 4), "deep.spz");
    assert!(text.contains("SH degree 4"), "{text}");
    let text = message(&changed(|parts| parts.header[12] = 0), "flat.spz");
    assert!(text.contains("it has 6 streams"), "{text}");
    let text = message(&changed(|parts| parts.header[13] = 25), "fine.spz");
    assert!(text.contains("25 fractional bits"), "{text}");
    let file = changed(|_| {});
    let text = message(&crate::writers::gzip(&file), "twice.spz");
    assert!(text.contains("it is in gzip"), "{text}");
}

#[test]
fn a_table_elsewhere_is_refused() {
    for (start, what) in [(0_u32, "within the header"), (u32::MAX, "before its table")] {
        let mut file = changed(|_| {});
        file[16..20].copy_from_slice(&start.to_le_bytes());
        let text = message(&file, "x.spz");
        assert!(text.contains(what), "{text}");
    }
    let mut file = changed(|_| {});
    let end = u32::try_from(file.len() - 10).unwrap();
    file[16..20].copy_from_slice(&end.to_le_bytes());
    assert!(
        message(&file, "x.spz").contains("its table would take 96 bytes, 10 are there"),
        "cut"
    );
}

#[test]
fn sizes_of_streams_that_lie_are_refused() {
    let text = message(&changed(|parts| parts.streams[1].1 = 1 << 60), "x.spz");
    assert!(
        text.contains("the opacities have 1152921504606846976 bytes, but 3 Gaussians take 3"),
        "{text}"
    );
    let mut file = changed(|_| {});
    file[32..40].fill(0xff);
    let text = message(&file, "x.spz");
    assert!(
        text.contains("the stream of the positions would take"),
        "{text}"
    );
    let mut longer = changed(|_| {});
    longer.push(0);
    assert!(
        message(&longer, "x.spz").contains("1 bytes follow its last stream"),
        "one more"
    );
}

#[test]
fn streams_of_another_length_are_refused_without_unpacking_them() {
    let zeros = [0; 27];
    let cases = [
        (frame(26, &[Block::Raw(&zeros[..26])]), "fewer than 27"),
        (frame(28, &[Block::Repeated(0, 28)]), "more than 27"),
        // Half a gigabyte from 16 kB.
        (
            frame(8 << 20, &[Block::Repeated(0, 128 << 10); 4096]),
            "more than 27",
        ),
        // A window of 4 GB.
        (frame(usize::MAX >> 32, &[Block::Raw(&zeros)]), "window"),
        (
            [frame(27, &[Block::Raw(&zeros)]), vec![0]].concat(),
            "1 bytes follow its frame",
        ),
        (b"not Zstandard at all".to_vec(), "cannot be unpacked"),
        (Vec::new(), "cannot be unpacked"),
    ];
    for (stream, what) in cases {
        let text = message(&changed(|parts| parts.streams[0].0 = stream), "x.spz");
        assert!(text.to_lowercase().contains(what), "{what} in: {text}");
        assert!(text.contains("the stream of the positions"), "{text}");
    }
}

#[test]
fn extensions_that_lie_are_refused() {
    let axes = 0xADBE_0003;
    for (records, what) in [
        (vec![1, 2, 3], "an extension"),
        (
            extension(1, b"abc")[..9].to_vec(),
            "an extension would take 11 bytes, 9 are there",
        ),
        (extension(axes, &[4, 0]), "has 2 bytes instead of 4"),
        (
            extension(axes, &17_u32.to_le_bytes()),
            "coordinate system 17",
        ),
    ] {
        let file = changed(|parts| {
            parts.header[14] = 2;
            parts.extensions = records;
        });
        let text = message(&file, "x.spz");
        assert!(text.contains(what), "{what} in: {text}");
    }
    // Without the flag the same bytes mean nothing.
    let file = changed(|parts| parts.extensions = vec![1, 2, 3]);
    assert_eq!(
        Scene::read(&file, "x.spz").unwrap().len(),
        3,
        "all Gaussians"
    );
}
