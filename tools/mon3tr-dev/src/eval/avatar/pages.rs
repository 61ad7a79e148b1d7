//! A page of picture pairs with error maps: photograph, avatar, and where they differ.

use super::compare::{Pair, Scores};
use super::table::Report;
use anyhow::Context;
use image::RgbImage;
use std::fmt::Write as _;
use std::path::{Path, PathBuf};

/// How many times the difference is shown.
const TIMES: f32 = 4.0;

/// A pair that is shown.
#[derive(Debug)]
struct Shown {
    group: &'static str,
    caption: String,
    file: String,
}

/// The page while its pictures are made.
#[derive(Debug)]
pub(super) struct Pages {
    folder: PathBuf,
    shown: Vec<Shown>,
}

impl Pages {
    pub(super) fn new(folder: &Path) -> anyhow::Result<Self> {
        mon3tr::device_options::make_folder(folder)?;
        Ok(Self {
            folder: folder.to_owned(),
            shown: Vec::new(),
        })
    }

    /// Writes a pair's picture: photograph, avatar, and four times their difference, side by side.
    pub(super) fn add(
        &mut self,
        group: &'static str,
        method: &str,
        camera: &str,
        frame: usize,
        pair: &Pair,
        scores: &Scores,
    ) -> anyhow::Result<()> {
        let file = format!("{:03}.png", self.shown.len());
        let path = self.folder.join(&file);
        (beside(pair)?.save(&path)).with_context(|| format!("cannot write {}", path.display()))?;
        self.shown.push(Shown {
            group,
            caption: format!(
                "{method}; camera {camera}, frame {frame}: {:.2} dB masked, SSIM {:.4}",
                scores.psnr_masked, scores.ssim_masked
            ),
            file,
        });
        Ok(())
    }

    /// Writes `index.html` with the pairs and the tables.
    pub(super) fn finish(&self, report: &Report) -> anyhow::Result<()> {
        let mut html = String::from(
            "<!doctype html><meta charset=\"utf-8\"><title>eval avatar</title>\
             <style>body{font:15px sans-serif;margin:2em}img{max-width:100%}figure{margin:1em 0}pre{background:#f4f4f4;padding:1em}</style>\n\
             <h1>Avatar against photographs</h1>\n",
        );
        // Writing to a String cannot fail.
        let _ = writeln!(html, "<pre>{}</pre>", escaped(&report.markdown()));
        let _ = writeln!(
            html,
            "<p>Each picture: the photograph's person over black, the avatar, and {TIMES} times their difference.</p>"
        );
        for group in &report.groups {
            let _ = writeln!(html, "<h2>{}</h2>", escaped(group));
            for shown in self.shown.iter().filter(|shown| shown.group == *group) {
                let _ = writeln!(
                    html,
                    "<figure><img src=\"{}\"><figcaption>{}</figcaption></figure>",
                    shown.file,
                    escaped(&shown.caption)
                );
            }
        }
        let path = self.folder.join("index.html");
        std::fs::write(&path, html).with_context(|| format!("cannot write {}", path.display()))
    }
}

fn escaped(text: &str) -> String {
    text.replace('&', "&amp;")
        .replace('<', "&lt;")
        .replace('>', "&gt;")
}

fn beside(pair: &Pair) -> anyhow::Result<RgbImage> {
    let (width, height) = (pair.truth.width, pair.truth.height());
    let mut bytes = Vec::with_capacity(9 * width * height);
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "clamped to 0..=255"
    )]
    let byte = |value: f32| (value.clamp(0.0, 1.0) * 255.0).round() as u8;
    let rows = (pair.truth.pixels.chunks(width)).zip(pair.drawn.pixels.chunks(width));
    for (truth, drawn) in rows {
        bytes.extend(truth.iter().flatten().map(|value| byte(*value)));
        bytes.extend(drawn.iter().flatten().map(|value| byte(*value)));
        let differences = (truth.iter().flatten()).zip(drawn.iter().flatten());
        bytes.extend(differences.map(|(a, b)| byte((a - b).abs() * TIMES)));
    }
    let sides = u32::try_from(3 * width)
        .ok()
        .zip(u32::try_from(height).ok());
    sides
        .and_then(|(width, height)| RgbImage::from_raw(width, height, bytes))
        .context("a picture that is too large to show")
}
