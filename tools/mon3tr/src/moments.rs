//! Moments of a motion on one sheet, spread evenly over a time whose length is not known beforehand.

use image::{RgbImage, imageops};

/// Moments on the sheet, columns x rows.
const SHEET: (u32, u32) = (4, 2);

/// Collects them.
#[derive(Debug)]
pub(crate) struct Moments {
    kept: Vec<RgbImage>,
    stride: usize,
    offered: usize,
}

impl Default for Moments {
    fn default() -> Self {
        Self {
            kept: Vec::new(),
            stride: 1,
            offered: 0,
        }
    }
}

impl Moments {
    const COUNT: usize = (SHEET.0 * SHEET.1) as usize;

    /// Looks at the next picture, and keeps it at half size if its time has come.
    pub(crate) fn offer(&mut self, picture: &RgbImage) {
        if self.offered.is_multiple_of(self.stride) {
            if self.kept.len() == 2 * Self::COUNT {
                // Twice as many as fit: every other one stays.
                let mut place = 0;
                self.kept.retain(|_| {
                    place += 1;
                    place % 2 == 1
                });
                self.stride *= 2;
            }
            if self.offered.is_multiple_of(self.stride) {
                let (width, height) = (picture.width() / 2, picture.height() / 2);
                let filter = imageops::FilterType::Triangle;
                self.kept
                    .push(imageops::resize(picture, width, height, filter));
            }
        }
        self.offered += 1;
    }

    /// The sheet, its cells from the left to the right and from the top down; with fewer pictures than cells some stay empty.
    pub(crate) fn sheet(&self) -> RgbImage {
        let (width, height) = self.kept.first().map_or((1, 1), RgbImage::dimensions);
        let mut sheet = RgbImage::new(width * SHEET.0, height * SHEET.1);
        let count = self.kept.len().min(Self::COUNT);
        for cell in 0..count {
            let picture = &self.kept[cell * self.kept.len() / count];
            #[allow(clippy::cast_possible_truncation, reason = "there are eight cells")]
            let (column, row) = (cell as u32 % SHEET.0, cell as u32 / SHEET.0);
            let (x, y) = (i64::from(column * width), i64::from(row * height));
            imageops::replace(&mut sheet, picture, x, y);
        }
        sheet
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use image::Rgb;

    #[test]
    fn the_sheet_spreads_its_moments_over_the_whole_time_however_long_it_was() {
        for count in [3u8, 8, 17, 100, 250] {
            let mut moments = Moments::default();
            for k in 0..count {
                moments.offer(&RgbImage::from_pixel(4, 4, Rgb([k, 0, 0])));
            }
            let sheet = moments.sheet();
            assert_eq!(sheet.dimensions(), (8, 4), "four by two cells of 2 x 2");
            let shown: Vec<u8> = (0..8)
                .map(|k| sheet.get_pixel(k % 4 * 2, k / 4 * 2)[0])
                .collect();
            let filled = usize::from(count.min(8));
            assert_eq!(shown[0], 0, "{count} begin at the first: {shown:?}");
            let steps: Vec<u8> = shown[..filled].windows(2).map(|w| w[1] - w[0]).collect();
            assert!(
                steps.iter().all(|step| *step > 0),
                "{count} go on: {shown:?}"
            );
            assert!(
                u32::from(shown[filled - 1]) * 4 >= u32::from(count - 1) * 3,
                "{count} reach the end: {shown:?}"
            );
        }
    }
}
