//! A screenshot of the compositor's mirror window: the X server's screen, which it keeps as a file.

use anyhow::{Context, ensure};
use image::{Rgb, RgbImage};
use std::path::Path;
use test_support::monado::Monado;

/// A picture of the screen.
#[derive(Debug)]
pub(crate) struct Screenshot(RgbImage);

impl Screenshot {
    /// Of a service with a window.
    pub(crate) fn of(monado: &Monado) -> anyhow::Result<Self> {
        let file = monado.screen().context("this service has no window")?;
        let data =
            std::fs::read(&file).with_context(|| format!("cannot read {}", file.display()))?;
        Self::read(&data).with_context(|| format!("{} is no screen", file.display()))
    }

    /// X's window dump, version 7: a header of big-endian numbers, colours, then rows of pixels.
    fn read(data: &[u8]) -> anyhow::Result<Self> {
        let number = |at: usize| -> anyhow::Result<usize> {
            let bytes = data.get(4 * at..4 * at + 4).context("cut short")?;
            Ok(u32::from_be_bytes(bytes.try_into()?) as usize)
        };
        let (header, version) = (number(0)?, number(1)?);
        let (width, height) = (number(4)?, number(5)?);
        let (bits, row, colours) = (number(11)?, number(12)?, number(19)?);
        ensure!(
            version == 7 && bits == 32,
            "version {version}, {bits} bits a pixel"
        );
        let pixels = data.get(header + 12 * colours..).context("cut short")?;
        ensure!(
            pixels.len() >= row * height && row >= 4 * width,
            "cut short"
        );
        let picture = RgbImage::from_fn(u32::try_from(width)?, u32::try_from(height)?, |x, y| {
            let at = y as usize * row + 4 * x as usize;
            let [blue, green, red] = [0, 1, 2].map(|channel| pixels[at + channel]);
            Rgb([red, green, blue])
        });
        Ok(Self(picture))
    }

    /// Pixels that differ much from the one to their right: text is full of them, and a surface has few.
    pub(crate) fn edges(&self) -> usize {
        let rows = self.0.rows();
        rows.map(|row| {
            let pixels: Vec<[u8; 3]> = row.map(|pixel| pixel.0).collect();
            let differs =
                |pair: &&[[u8; 3]]| (0..3).any(|at| pair[0][at].abs_diff(pair[1][at]) > 48);
            pixels.windows(2).filter(differs).count()
        })
        .sum()
    }

    /// As a PNG.
    pub(crate) fn save(&self, file: &Path) -> anyhow::Result<()> {
        self.0
            .save(file)
            .with_context(|| format!("cannot write {}", file.display()))
    }
}
