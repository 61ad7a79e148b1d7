//! Y'CbCr to R'G'B', as ITU-R BT.601 and BT.709 define them.

/// Which primaries weigh the luma.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Matrix {
    /// ITU-R BT.601: standard definition, cameras, JPEG.
    Bt601,
    /// ITU-R BT.709: high definition.
    Bt709,
}

impl Matrix {
    /// What players assume of a video that does not say: BT.709 above 576 lines, or from a width of 1280 on.
    pub(super) fn of_size(width: u32, height: u32) -> Self {
        if width >= 1280 || height > 576 {
            Self::Bt709
        } else {
            Self::Bt601
        }
    }
}

/// Which codes are black and white.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Range {
    /// 0 to 255 at 8 bits.
    Full,
    /// 16 to 235 for luma, 16 to 240 for chroma, at 8 bits.
    Limited,
}

/// The most bits a sample that [`Conversion`] takes.
pub(super) const MOST_BITS: u32 = 12;

/// Integer arithmetic, within one code of the exact result.
#[derive(Debug, Clone, Copy)]
pub(super) struct Conversion {
    /// Luma's code of black, and chroma's of grey.
    black: i32,
    grey: i32,
    /// Factors, with `fraction` binary places.
    luma: i32,
    red_of_cr: i32,
    green_of_cb: i32,
    green_of_cr: i32,
    blue_of_cb: i32,
    fraction: u32,
}

/// What chroma adds to red, green and blue, with the fraction of the conversion and its rounding.
#[derive(Debug, Clone, Copy)]
struct Chroma([i32; 3]);

impl Conversion {
    /// For samples of 8 to [`MOST_BITS`] bits.
    pub(super) fn new(matrix: Matrix, range: Range, bits: u32) -> Self {
        let bits = bits.clamp(8, MOST_BITS);
        let (red, blue) = match matrix {
            Matrix::Bt601 => (0.299, 0.114),
            Matrix::Bt709 => (0.2126, 0.0722),
        };
        let green = 1.0 - red - blue;
        let scale = f64::from(1u32 << (bits - 8));
        let largest = f64::from((1u32 << bits) - 1);
        let (luma, chroma) = match range {
            Range::Full => (255.0 / largest, 255.0 / largest),
            Range::Limited => (255.0 / (219.0 * scale), 255.0 / (224.0 * scale)),
        };
        // So that products stay below 2^31 with as many places as fit.
        let fraction = 16 + (bits - 8);
        #[allow(
            clippy::cast_possible_truncation,
            reason = "the factors are below 2.2 * 2^16, whatever the bits"
        )]
        let fixed = |factor: f64| (factor * f64::from(1u32 << fraction)).round() as i32;
        Self {
            black: match range {
                Range::Full => 0,
                Range::Limited => 16 << (bits - 8),
            },
            grey: 128 << (bits - 8),
            luma: fixed(luma),
            red_of_cr: fixed(2.0 * (1.0 - red) * chroma),
            green_of_cb: fixed(-2.0 * blue * (1.0 - blue) / green * chroma),
            green_of_cr: fixed(-2.0 * red * (1.0 - red) / green * chroma),
            blue_of_cb: fixed(2.0 * (1.0 - blue) * chroma),
            fraction,
        }
    }

    #[inline]
    fn chroma(&self, cb: u16, cr: u16) -> Chroma {
        let (cb, cr) = (i32::from(cb) - self.grey, i32::from(cr) - self.grey);
        let half = 1 << (self.fraction - 1);
        Chroma([
            self.red_of_cr * cr + half,
            self.green_of_cb * cb + self.green_of_cr * cr + half,
            self.blue_of_cb * cb + half,
        ])
    }

    #[inline]
    fn pixel(&self, y: u16, chroma: Chroma) -> [u8; 3] {
        let luma = self.luma * (i32::from(y) - self.black);
        #[allow(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "clamped to 0..=255"
        )]
        chroma
            .0
            .map(|add| ((luma + add) >> self.fraction).clamp(0, 255) as u8)
    }

    /// A row whose chroma has as many samples as luma. Ends with the shortest of the slices.
    pub(super) fn row_444<T: Copy + Into<u16>>(&self, y: &[T], cb: &[T], cr: &[T], rgb: &mut [u8]) {
        let (pixels, _) = rgb.as_chunks_mut();
        for (((y, cb), cr), rgb) in y.iter().zip(cb).zip(cr).zip(pixels) {
            *rgb = self.pixel((*y).into(), self.chroma((*cb).into(), (*cr).into()));
        }
    }

    /// A row in which two pixels share a sample of chroma; the last one may be of one pixel.
    pub(super) fn row_422<T: Copy + Into<u16>>(&self, y: &[T], cb: &[T], cr: &[T], rgb: &mut [u8]) {
        self.row_of_pairs(
            y,
            cb.iter()
                .zip(cr)
                .map(|(cb, cr)| ((*cb).into(), (*cr).into())),
            rgb,
        );
    }

    /// A row of luma with one of `Cb Cr` bytes, which two pixels share.
    pub(super) fn row_nv12(&self, y: &[u8], cbcr: &[u8], rgb: &mut [u8]) {
        let (pairs, _) = cbcr.as_chunks();
        self.row_of_pairs(
            y,
            pairs
                .iter()
                .map(|[cb, cr]| (u16::from(*cb), u16::from(*cr))),
            rgb,
        );
    }

    #[inline]
    fn row_of_pairs<T: Copy + Into<u16>>(
        &self,
        y: &[T],
        mut chroma: impl Iterator<Item = (u16, u16)>,
        rgb: &mut [u8],
    ) {
        let (y, last) = y.as_chunks::<2>();
        let (pixels, rest) = rgb.as_chunks_mut::<6>();
        for ((y, (cb, cr)), rgb) in y.iter().zip(&mut chroma).zip(pixels) {
            let chroma = self.chroma(cb, cr);
            let [a, b] = y.map(|y| self.pixel(y.into(), chroma));
            *rgb = [a[0], a[1], a[2], b[0], b[1], b[2]];
        }
        if let ([y], Some((cb, cr)), Some(rgb)) = (last, chroma.next(), rest.first_chunk_mut()) {
            *rgb = self.pixel((*y).into(), self.chroma(cb, cr));
        }
    }

    /// A row without chroma.
    pub(super) fn row_grey<T: Copy + Into<u16>>(&self, y: &[T], rgb: &mut [u8]) {
        #[allow(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "at most 2^11"
        )]
        let none = self.chroma(self.grey as u16, self.grey as u16);
        let (pixels, _) = rgb.as_chunks_mut();
        for (y, rgb) in y.iter().zip(pixels) {
            *rgb = self.pixel((*y).into(), none);
        }
    }

    /// A row of `Y0 Cb Y1 Cr` bytes, two pixels each; the last may be of one pixel.
    pub(super) fn row_yuyv(&self, yuyv: &[u8], rgb: &mut [u8]) {
        let (quads, _) = yuyv.as_chunks::<4>();
        let (pixels, rest) = rgb.as_chunks_mut::<6>();
        let both = |[first, cb, second, cr]: [u8; 4]| {
            let chroma = self.chroma(cb.into(), cr.into());
            [first, second].map(|y| self.pixel(y.into(), chroma))
        };
        for (four, rgb) in quads.iter().zip(pixels.iter_mut()) {
            let [a, b] = both(*four);
            *rgb = [a[0], a[1], a[2], b[0], b[1], b[2]];
        }
        if let (Some(four), Some(rgb)) = (quads.get(pixels.len()), rest.first_chunk_mut()) {
            *rgb = both(*four)[0];
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The standards' equations, solved the other way round: R'G'B' is what gives the codes when it is encoded. In f64.
    fn reference(matrix: Matrix, range: Range, bits: u32, code: [u16; 3]) -> [f64; 3] {
        let [kr, kg, kb] = match matrix {
            Matrix::Bt601 => [0.299, 0.587, 0.114],
            Matrix::Bt709 => [0.2126, 0.7152, 0.0722],
        };
        let codes = f64::from(1u32 << bits);
        let code = code.map(f64::from);
        // E'Y in 0..1, E'CB and E'CR in -0.5..0.5
        let [y, cb, cr] = match range {
            Range::Limited => {
                let unit = codes / 256.0;
                [
                    (code[0] / unit - 16.0) / 219.0,
                    (code[1] / unit - 128.0) / 224.0,
                    (code[2] / unit - 128.0) / 224.0,
                ]
            }
            Range::Full => [
                code[0] / (codes - 1.0),
                (code[1] - codes / 2.0) / (codes - 1.0),
                (code[2] - codes / 2.0) / (codes - 1.0),
            ],
        };
        let red = y + cr * 2.0 * (1.0 - kr);
        let blue = y + cb * 2.0 * (1.0 - kb);
        let green = (y - kr * red - kb * blue) / kg;
        [red, green, blue].map(|one| (one * 255.0).clamp(0.0, 255.0))
    }

    #[test]
    fn every_conversion_is_within_one_code_of_f64() {
        let mut worst = 0.0f64;
        for matrix in [Matrix::Bt601, Matrix::Bt709] {
            for range in [Range::Full, Range::Limited] {
                for bits in [8, 10, 12] {
                    let conversion = Conversion::new(matrix, range, bits);
                    let last = (1u16 << bits) - 1;
                    let steps = |count: u16| {
                        (0..=count).map(move |i| {
                            u16::try_from(u32::from(last) * u32::from(i) / u32::from(count))
                                .unwrap_or(last)
                        })
                    };
                    for y in steps(255) {
                        for cb in steps(51) {
                            for cr in steps(51) {
                                let mut rgb = [0; 3];
                                conversion.row_444(&[y], &[cb], &[cr], &mut rgb);
                                for (got, exact) in
                                    rgb.into_iter()
                                        .zip(reference(matrix, range, bits, [y, cb, cr]))
                                {
                                    worst = worst.max((f64::from(got) - exact).abs());
                                }
                            }
                        }
                    }
                }
            }
        }
        println!("largest difference from f64: {worst:.3} codes");
        assert!(worst <= 1.0, "{worst}");
    }

    #[test]
    fn black_white_and_grey_are_exact() {
        for (range, codes) in [(Range::Full, [0u8, 255]), (Range::Limited, [16, 235])] {
            let mut rgb = [7; 6];
            Conversion::new(Matrix::Bt709, range, 8).row_grey(&codes, &mut rgb);
            assert_eq!(rgb, [0, 0, 0, 255, 255, 255], "{range:?}");
        }
    }

    #[test]
    fn every_layout_gives_the_same_pixels() {
        let conversion = Conversion::new(Matrix::Bt601, Range::Limited, 8);
        let (y, cb, cr) = ([16u8, 90, 150, 235, 40], [30u8, 128, 200], [220u8, 100, 60]);
        let doubled = |plane: [u8; 3]| [plane[0], plane[0], plane[1], plane[1], plane[2]];
        let mut expected = [0; 15];
        conversion.row_444(&y, &doubled(cb), &doubled(cr), &mut expected);
        let mut row = [0; 15];
        conversion.row_422(&y, &cb, &cr, &mut row);
        assert_eq!(row, expected, "4:2:2");
        row = [0; 15];
        conversion.row_nv12(&y, &[cb[0], cr[0], cb[1], cr[1], cb[2], cr[2]], &mut row);
        assert_eq!(row, expected, "NV12");
        row = [0; 15];
        conversion.row_yuyv(
            &[
                y[0], cb[0], y[1], cr[0], y[2], cb[1], y[3], cr[1], y[4], cb[2], 0, cr[2],
            ],
            &mut row,
        );
        assert_eq!(row, expected, "YUYV");
    }
}
