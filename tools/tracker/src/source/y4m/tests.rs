use proptest::prelude::*;

use super::*;

/// A stream of random samples, written here.
#[derive(Debug, Clone)]
struct Clip {
    size: (u32, u32),
    chroma: Chroma,
    bits: u32,
    full: bool,
    /// Luma, Cb and Cr of each picture, row by row.
    pictures: Vec<[Vec<u16>; 3]>,
}

impl Clip {
    fn tag(&self) -> String {
        let mono = self.chroma == Chroma::None;
        let name = match self.chroma {
            Chroma::None => "mono",
            Chroma::C420 => "420",
            Chroma::C422 => "422",
            Chroma::C444 => "444",
        };
        match self.bits {
            8 => name.to_owned(),
            bits if mono => format!("{name}{bits}"),
            bits => format!("{name}p{bits}"),
        }
    }

    fn bytes(&self) -> Vec<u8> {
        let range = if self.full { " XCOLORRANGE=FULL" } else { "" };
        let (width, height) = self.size;
        let mut out = format!(
            "YUV4MPEG2 W{width} H{height} F24000:1001 Ip A1:1 C{}{range}\n",
            self.tag()
        )
        .into_bytes();
        for picture in &self.pictures {
            out.extend(b"FRAME Ip\n");
            for sample in picture.iter().flatten() {
                out.extend(&sample.to_le_bytes()[..if self.bits > 8 { 2 } else { 1 }]);
            }
        }
        out
    }

    /// Of a pixel, by the equations of BT.601 (the clips are small), in f64.
    fn rgb(&self, picture: usize, x: usize, y: usize) -> [f64; 3] {
        let (width, planes) = (self.size.0 as usize, &self.pictures[picture]);
        let (across, down) = match self.chroma {
            Chroma::None | Chroma::C444 => (1, 1),
            Chroma::C422 => (2, 1),
            Chroma::C420 => (2, 2),
        };
        let at = (y / down) * width.div_ceil(across) + x / across;
        let unit = f64::from(1u32 << (self.bits - 8));
        let top = 256.0 * unit - 1.0;
        let luma = f64::from(planes[0][y * width + x]);
        let [b, r] = [1, 2].map(|plane| {
            planes[plane]
                .get(at)
                .map_or(0.0, |code| f64::from(*code) - 128.0 * unit)
        });
        let (luma, b, r) = if self.full {
            (luma / top, b / top, r / top)
        } else {
            (
                (luma - 16.0 * unit) / (219.0 * unit),
                b / (224.0 * unit),
                r / (224.0 * unit),
            )
        };
        [
            luma + 1.402 * r,
            luma - 0.344_136_286 * b - 0.714_136_286 * r,
            luma + 1.772 * b,
        ]
        .map(|one| (255.0 * one).clamp(0.0, 255.0))
    }
}

fn clips() -> impl Strategy<Value = Clip> {
    let chroma = prop_oneof![
        Just(Chroma::None),
        Just(Chroma::C420),
        Just(Chroma::C422),
        Just(Chroma::C444)
    ];
    (
        1u32..9,
        1u32..7,
        chroma,
        prop_oneof![Just(8u32), Just(10), Just(12)],
        any::<bool>(),
        1usize..4,
    )
        .prop_flat_map(|(width, height, chroma, bits, full, count)| {
            let (w, h) = (width as usize, height as usize);
            let chroma_samples = match chroma {
                Chroma::None => 0,
                Chroma::C444 => w * h,
                Chroma::C422 => w.div_ceil(2) * h,
                Chroma::C420 => w.div_ceil(2) * h.div_ceil(2),
            };
            let plane = move |samples: usize| proptest::collection::vec(0u16..1 << bits, samples);
            let picture = [plane(w * h), plane(chroma_samples), plane(chroma_samples)];
            proptest::collection::vec(picture, count).prop_map(move |pictures| Clip {
                size: (width, height),
                chroma,
                bits,
                full,
                pictures,
            })
        })
}

fn opened(bytes: &[u8]) -> Result<Y4m<&[u8]>, SourceError> {
    Y4m::open("test.y4m".to_owned(), bytes)
}

proptest! {
    #[test]
    fn every_layout_is_read_to_within_one_code(clip in clips()) {
        let bytes = clip.bytes();
        let mut source = opened(&bytes).expect("a header");
        let info = source.info().clone();
        prop_assert_eq!((info.width, info.height), clip.size);
        prop_assert!((info.rate_hz.expect("a rate") - 23.976).abs() < 1e-3);
        let mut picture = Picture::empty();
        for number in 0..clip.pictures.len() {
            prop_assert!(source.next(&mut picture).expect("no error"));
            prop_assert_eq!(picture.number, number as u64);
            for (at, pixel) in picture.rgb.chunks_exact(3).enumerate() {
                let (x, y) = (at % clip.size.0 as usize, at / clip.size.0 as usize);
                for (got, exact) in pixel.iter().zip(clip.rgb(number, x, y)) {
                    prop_assert!((f64::from(*got) - exact).abs() <= 1.0, "{} for {} at {},{}", got, exact, x, y);
                }
            }
        }
        prop_assert!(!source.next(&mut picture).expect("the end"));
    }

    #[test]
    fn streams_cut_short_give_their_whole_pictures(clip in clips(), cut in 0.0..1.0f64) {
        let whole = clip.bytes();
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a part of it")]
        let bytes = &whole[..(whole.len() as f64 * cut) as usize];
        if let Ok(mut source) = opened(bytes) {
            let mut picture = Picture::empty();
            let mut count = 0;
            while let Ok(true) = source.next(&mut picture) {
                count += 1;
            }
            prop_assert!(count <= clip.pictures.len());
            prop_assert!(matches!(source.next(&mut picture), Ok(false)), "it has ended");
        }
    }

    #[test]
    fn any_bytes_end_or_fail(bytes in proptest::collection::vec(any::<u8>(), 0..300), with_start: bool) {
        let start: &[u8] = if with_start { b"YUV4MPEG2 W4 H2\nFRAME" } else { b"" };
        if let Ok(mut source) = opened(&[start, &bytes].concat()) {
            while let Ok(true) = source.next(&mut Picture::empty()) {}
        }
    }
}

#[test]
fn what_is_no_y4m_is_refused_with_a_reason() {
    let long = [b"YUV4MPEG2 X".as_slice(), &[b'a'; 1 << 16]].concat();
    for (bytes, word) in [
        (b"".as_slice(), "empty"),
        (b"RIFF\n", "YUV4MPEG2"),
        (b"YUV4MPEG2 W4 H2", "does not end"),
        (&long, "does not end"),
        (b"YUV4MPEG2 W4\n", "width and height"),
        (b"YUV4MPEG2 W4 H-2\n", "width and height"),
        (b"YUV4MPEG2 W0 H2\n", "0 x 2"),
        (b"YUV4MPEG2 W9000 H2\n", "9000 x 2"),
        (b"YUV4MPEG2 W4294967295 H4294967295\n", "at most 8192"),
        (b"YUV4MPEG2 W4 H2 C411\n", "411"),
        (b"YUV4MPEG2 W4 H2 C420p14\n", "420p14"),
        (b"YUV4MPEG2 W4 H2 C444alpha\n", "444alpha"),
    ] {
        let message = opened(bytes).expect_err(word).to_string();
        assert!(
            message.contains(word) && message.contains("test.y4m"),
            "{message}"
        );
    }
}

#[test]
fn a_stream_without_a_whole_picture_says_so() {
    for (bytes, word) in [
        (b"YUV4MPEG2 W4 H2\n".as_slice(), "nothing follows"),
        (b"YUV4MPEG2 W4 H2\nFRAME\n0123", "cut short"),
        (b"YUV4MPEG2 W4 H2\nFRA", "cut short"),
        (b"YUV4MPEG2 W4 H2\nOTHER\n", "FRAME"),
    ] {
        let mut source = opened(bytes).expect("a header");
        let message = source
            .next(&mut Picture::empty())
            .expect_err(word)
            .to_string();
        assert!(message.contains(word), "{message}");
        assert!(
            !source.next(&mut Picture::empty()).expect("it has ended"),
            "{word}"
        );
    }
}

#[test]
fn memory_grows_with_what_comes_not_with_what_is_promised() {
    let mut source = opened(b"YUV4MPEG2 W8192 H8192 C444p12\nFRAME\n0123").expect("a header");
    let mut picture = Picture::empty();
    source.next(&mut picture).expect_err("it is cut short");
    assert!(
        source.planes.capacity() < 1 << 16,
        "{}",
        source.planes.capacity()
    );
    assert_eq!(picture.rgb.capacity(), 0, "no pixels");
}
