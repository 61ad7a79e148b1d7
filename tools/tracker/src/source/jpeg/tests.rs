use std::io::{BufReader, Read, repeat};

use proptest::prelude::*;

use super::*;

/// A picture of 8 x 8 in one grey: 128 and `brighter` * 16, where that is 0 or 1. Its one block is the code of ITU-T T.81 table
/// K.3 for the mean and that of K.5 for the end of the block; the tables themselves are in it only where asked for.
pub(crate) fn grey(brighter: bool, tables: bool) -> Vec<u8> {
    let mut out = vec![0xff, 0xd8, 0xff, 0xdb, 0, 67, 0];
    out.extend([8; 64]);
    out.extend([0xff, 0xc0, 0, 11, 8, 0, 8, 0, 8, 1, 1, 0x11, 0]);
    if tables {
        // DC of K.3; AC with no more than the end of the block, whose code is 1010 here as there.
        out.extend([
            0xff, 0xc4, 0, 31, 0x00, 0, 1, 5, 1, 1, 1, 1, 1, 1, 0, 0, 0, 0, 0, 0, 0,
        ]);
        out.extend(0..12);
        out.extend([
            0xff, 0xc4, 0, 23, 0x10, 0, 2, 1, 1, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 1, 2, 3, 0,
        ]);
    }
    out.extend([0xff, 0xda, 0, 8, 1, 1, 0x00, 0, 63, 0]);
    // Category 0, end; or category 5 with 16, end; and ones.
    out.extend(if brighter {
        vec![0xd0, 0xaf]
    } else {
        vec![0x2b]
    });
    out.extend([0xff, 0xd9]);
    out
}

fn opened(bytes: &[u8]) -> Result<MotionJpeg<BufReader<&[u8]>>, SourceError> {
    // A small buffer, so that every marker is cut by its end somewhere.
    MotionJpeg::open(
        "test.mjpeg".to_owned(),
        BufReader::with_capacity(3, bytes),
        false,
    )
}

#[test]
fn pictures_follow_one_another_whatever_is_between_them() {
    let mut bytes = b"--boundary\r\nContent-Type: image/jpeg\r\n\r\n".to_vec();
    for brighter in [false, true, true, false] {
        bytes.extend(grey(brighter, brighter));
        bytes.extend(b"\xff\r\n--boundary\r\n\r\n");
    }
    let mut source = opened(&bytes).expect("a picture");
    let info = source.info();
    assert_eq!(
        (info.width, info.height, info.rate_hz),
        (8, 8, Some(30.0)),
        "info"
    );
    let mut picture = Picture::empty();
    for (number, expected) in [128, 144, 144, 128].into_iter().enumerate() {
        assert!(
            source.next(&mut picture).expect("no error"),
            "the end at {number}"
        );
        assert!(
            picture.rgb.iter().all(|byte| *byte == expected),
            "{:?} is not {expected}",
            &picture.rgb[..3]
        );
        assert_eq!(
            (picture.number, picture.rgb.len()),
            (number as u64, 192),
            "number and size"
        );
    }
    assert!(!source.next(&mut picture).expect("the end"), "the end");
}

#[test]
fn a_thumbnail_within_a_picture_is_no_picture() {
    let (whole, small) = (grey(true, true), grey(false, true));
    let mut bytes = whole[..2].to_vec();
    bytes.extend([0xff, 0xe1]);
    bytes.extend(u16::try_from(small.len() + 2).expect("short").to_be_bytes());
    bytes.extend(&small);
    bytes.extend(&whole[2..]);
    let mut source = opened(&bytes).expect("a picture");
    let mut picture = Picture::empty();
    assert!(source.next(&mut picture).expect("no error"), "a picture");
    assert_eq!(picture.rgb[0], 144, "the outer one");
    assert!(!source.next(&mut picture).expect("the end"), "one picture");
}

#[test]
fn a_stream_that_breaks_off_ends_there() {
    let one = grey(false, true);
    let bytes = [one.as_slice(), &one[..one.len() - 3]].concat();
    let mut source = opened(&bytes).expect("a picture");
    let mut picture = Picture::empty();
    assert!(
        source.next(&mut picture).expect("no error"),
        "the whole one"
    );
    assert!(!source.next(&mut picture).expect("no error"), "the end");
    for bytes in [b"".as_slice(), b"no picture", &one[..40]] {
        let message = opened(bytes).expect_err("no picture").to_string();
        assert!(message.contains("no whole JPEG picture"), "{message}");
    }
}

#[test]
fn a_picture_of_another_size_is_refused_in_a_recording_and_given_live() {
    let mut other = grey(false, true);
    // The width, in the frame header behind the 71 bytes of start and quantization.
    let at = other
        .windows(2)
        .position(|two| two == [0xff, 0xc0])
        .expect("a frame header");
    other[at + 8] = 5;
    let bytes = [grey(false, true), other, grey(true, true)].concat();
    let mut source =
        MotionJpeg::open("live".to_owned(), bytes.as_slice(), true).expect("a picture");
    let mut picture = Picture::empty();
    for width in [8, 5, 8] {
        assert!(source.next(&mut picture).expect("no error"), "{width} wide");
        assert_eq!((picture.width, picture.height), (width, 8), "its size");
        assert_eq!(picture.rgb.len(), width as usize * 8 * 3, "its bytes");
    }
    let mut source = opened(&bytes).expect("a picture");
    let mut picture = Picture::empty();
    assert!(source.next(&mut picture).expect("no error"), "the first");
    let message = source
        .next(&mut picture)
        .expect_err("another size")
        .to_string();
    assert!(
        message.contains("picture 1") && message.contains("5 x 8"),
        "{message}"
    );
}

#[test]
fn sizes_beyond_the_limit_are_refused_before_there_is_memory_for_them() {
    let mut huge = grey(false, true);
    let at = huge
        .windows(2)
        .position(|two| two == [0xff, 0xc0])
        .expect("a frame header");
    huge[at + 5..at + 9].fill(0xff);
    let mut picture = Picture::empty();
    JpegPictures::default()
        .decode("huge", &huge, &mut picture)
        .expect_err("too large");
    assert_eq!(picture.rgb.capacity(), 0, "no pixels");
}

#[test]
fn a_picture_without_an_end_is_not_read_for_ever() {
    let start = grey(false, true);
    let endless = start[..start.len() - 2].chain(repeat(7));
    let refused = MotionJpeg::open("endless".to_owned(), BufReader::new(endless), false);
    let message = refused.expect_err("endless").to_string();
    assert!(message.contains("64 MiB"), "{message}");
    let nothing = MotionJpeg::open("nothing".to_owned(), BufReader::new(repeat(7)), false);
    let message = nothing.expect_err("no picture in it").to_string();
    assert!(message.contains("1 MiB"), "{message}");
}

#[test]
fn the_end_differs_from_much_that_is_no_picture() {
    let (one, mut whole) = (grey(false, true), Vec::new());
    let mut next = |between: &[u8], last: &[u8]| {
        let bytes = [one.as_slice(), between, last].concat();
        let mut input = bytes.as_slice();
        [(); 2].map(|()| next_picture(&mut input, &mut whole).expect("memory is read"))
    };
    let much = vec![7; 2 << 20];
    for (between, last, expected) in [
        (&much[..1000], one.as_slice(), Found::Whole),
        (&much[..1000], &[], Found::End),
        (&much, &one, Found::OtherBytes),
        (&much, &[], Found::OtherBytes),
    ] {
        assert_eq!(next(between, last), [Found::Whole, expected]);
    }
    // A recording gives what it has.
    let bytes = [one.as_slice(), &much].concat();
    let mut source = opened(&bytes).expect("a picture");
    let mut picture = Picture::empty();
    assert!(source.next(&mut picture).expect("no error"), "the first");
    assert!(!source.next(&mut picture).expect("no error"), "the end");
}

/// Its one table of quantization has no such number.
fn damaged() -> Vec<u8> {
    let mut bytes = grey(false, true);
    bytes[6] = 9;
    bytes
}

#[test]
fn damaged_pictures_are_left_out_with_their_numbers() {
    let (good, bad) = (grey(true, true), damaged());
    let bytes = [&bad, &good, &bad, &bad, &good, &bad]
        .map(Vec::as_slice)
        .concat();
    let mut source = opened(&bytes).expect("a picture");
    let mut picture = Picture::empty();
    for number in [1_u32, 4] {
        assert!(source.next(&mut picture).expect("no error"), "no end");
        assert_eq!(picture.number, u64::from(number), "number");
        assert!(
            (picture.seconds - f64::from(number) / 30.0).abs() < 1e-9,
            "time"
        );
    }
    assert!(!source.next(&mut picture).expect("no error"), "the end");
}

#[test]
fn nothing_but_damaged_pictures_is_an_error() {
    let (good, bad) = (grey(true, true), damaged());
    for count in [1, 59, 60, 200] {
        let message = opened(&bad.repeat(count)).expect_err("none").to_string();
        assert!(message.contains("damaged"), "{message}");
    }
    let bytes = [good, bad.repeat(60)].concat();
    let mut source = opened(&bytes).expect("a picture");
    let mut picture = Picture::empty();
    assert!(source.next(&mut picture).expect("no error"), "no end");
    source.next(&mut picture).expect_err("too many");
    assert!(!source.next(&mut picture).expect("no error"), "the end");
}

#[test]
fn endless_fill_before_a_marker_is_not_read_for_ever() {
    let start = grey(false, true);
    let endless = start[..2].chain(repeat(0xff));
    let refused = MotionJpeg::open("endless".to_owned(), BufReader::new(endless), false);
    let message = refused.expect_err("endless").to_string();
    assert!(message.contains("64 MiB"), "{message}");
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(2000))]
    #[test]
    fn damaged_pictures_end_or_fail(brighter: bool, tables: bool, damage in proptest::collection::vec((0usize..200, any::<u8>()), 1..4), cut in 0usize..400) {
        let mut bytes = grey(brighter, tables);
        let count = bytes.len();
        for (at, value) in damage {
            bytes[at % count] = value;
        }
        bytes.truncate(cut);
        if let Ok(mut source) = opened(&bytes) {
            let mut picture = Picture::empty();
            while let Ok(true) = source.next(&mut picture) {}
        }
    }
}
