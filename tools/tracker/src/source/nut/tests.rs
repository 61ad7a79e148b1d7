use super::*;
use proptest::prelude::*;

/// One picture of 2 x 1 as ffmpeg 7.0 writes it, but for checksums and texts.
fn stream() -> Vec<u8> {
    let packet = |start: u64, body: &[u8]| {
        let mut out = start.to_be_bytes().to_vec();
        out.push(u8::try_from(body.len() + 4).expect("short"));
        out.extend(body);
        out.extend([0; 4]);
        out
    };
    let mut out = SIGNATURE.to_vec();
    // Version 3, one stream, distance 65536, one time base of 1/25; then all codes with coded flags of everything.
    let mut main = vec![3, 1, 0x84, 0x80, 0x00, 1, 1, 25];
    main.extend([0xa0, 0x00, 6, 0, 1, 0, 0, 0, 0x81, 0x7f, 0]);
    out.extend(packet(MAIN, &main));
    out.extend(packet(
        STREAM,
        &[
            0, 0, 4, b'R', b'G', b'B', 24, 0, 7, 1, 0, 0, 0, 2, 1, 1, 1, 0,
        ],
    ));
    out.extend(packet(SYNCPOINT, &[50, 0]));
    for (pts, pixels) in [(50u8, [1, 2, 3, 4, 5, 6]), (53, [6, 5, 4, 3, 2, 1])] {
        // Code 0; flags key, coded time and size; the time's low bits; the size.
        out.extend([0, 1 | 8 | 32, pts, 6]);
        out.extend(pixels);
    }
    out
}

#[test]
fn pictures_and_times_are_read() {
    let bytes = stream();
    let mut nut = Nut::open(bytes.as_slice()).expect("a header");
    assert_eq!((nut.width, nut.height), (2, 1), "size");
    let mut pixels = [0; 6];
    assert_eq!(nut.frame(&mut pixels).expect("a frame"), Some(2.0), "time");
    assert_eq!(pixels, [1, 2, 3, 4, 5, 6], "pixels");
    assert_eq!(
        nut.frame(&mut pixels).expect("a frame"),
        Some(53.0 / 25.0),
        "time"
    );
    assert_eq!(nut.frame(&mut pixels).expect("the end"), None, "end");
}

#[test]
fn low_bits_give_the_nearest_time() {
    for (last, low, expected) in [
        (1000, 1001 & 127, 1001),
        (127, 0, 128),
        (128, 127, 127),
        (0, 5, 5),
    ] {
        assert_eq!(
            nearest_with_low_bits(last, 7, low),
            Some(expected),
            "{last} {low}"
        );
    }
}

proptest! {
    #[test]
    fn damaged_streams_end_or_fail(at in 0usize..140, value: u8, cut in 0usize..160) {
        let mut bytes = stream();
        let count = bytes.len();
        bytes[at % count] = value;
        bytes.truncate(cut);
        if let Ok(mut nut) = Nut::open(bytes.as_slice()) {
            let mut pixels = [0; 6];
            for _ in 0..4 {
                if !matches!(nut.frame(&mut pixels), Ok(Some(_))) { break; }
            }
        }
    }

    #[test]
    fn any_bytes_end_or_fail(bytes in proptest::collection::vec(any::<u8>(), 0..400)) {
        let whole = [SIGNATURE.as_slice(), &bytes].concat();
        let _ = Nut::open(whole.as_slice());
    }
}
