//! A page of picture pairs with error maps: photograph, avatar, and where they differ.

use super::compare::{Pair, Scores};
use super::table::Report;
use anyhow::Context;
use image::RgbImage;
use std::fmt::Write as _;
use std::path::{Path, PathBuf};

/// How many times the difference is shown.
const TIMES: f32 = 4.0;

/// The most pixels of a side at which a person is shown.
const SIDE: usize = 640;

/// A pair that is shown.
#[derive(Debug)]
struct Shown {
    group: &'static str,
    camera: String,
    frame: usize,
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
            camera: camera.to_owned(),
            frame,
            caption: format!(
                "{method}: {:.2} dB masked, SSIM {:.4}",
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
             <meta name=\"viewport\" content=\"width=device-width\">\
             <style>body{font:15px sans-serif;margin:2em}img{max-width:100%}figure{margin:1em 0}\
             pre{background:#f4f4f4;padding:1em;overflow-x:auto}h3{margin:1.5em 0 0}</style>\n\
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
            // All methods of one picture below each other.
            let mut of_group: Vec<&Shown> = (self.shown.iter())
                .filter(|shown| shown.group == *group)
                .collect();
            of_group.sort_by_key(|shown| (shown.frame, &shown.camera));
            let mut last = None;
            for shown in of_group {
                let picture = (shown.frame, &shown.camera);
                if last.replace(picture) != Some(picture) {
                    let (frame, camera) = picture;
                    let _ = writeln!(html, "<h3>camera {}, frame {frame}</h3>", escaped(camera));
                }
                let caption = escaped(&shown.caption);
                let _ = writeln!(
                    html,
                    "<figure><img src=\"{}\" alt=\"{caption}\"><figcaption>{caption}</figcaption></figure>",
                    shown.file
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

/// Photograph, avatar and difference of the person's square.
fn beside(pair: &Pair) -> anyhow::Result<RgbImage> {
    let square = pair.square();
    let side = square[2].min(SIDE);
    let [truth, drawn] =
        [&pair.truth, &pair.drawn].map(|canvas| canvas.resampled(square, [side, side]));
    let mut bytes = Vec::with_capacity(9 * side * side);
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "clamped to 0..=255"
    )]
    let byte = |value: f32| (value.clamp(0.0, 1.0) * 255.0).round() as u8;
    let rows = truth.pixels.chunks(side).zip(drawn.pixels.chunks(side));
    for (truth, drawn) in rows {
        bytes.extend(truth.iter().flatten().map(|value| byte(*value)));
        bytes.extend(drawn.iter().flatten().map(|value| byte(*value)));
        let differences = (truth.iter().flatten()).zip(drawn.iter().flatten());
        bytes.extend(differences.map(|(a, b)| byte((a - b).abs() * TIMES)));
    }
    let sides = u32::try_from(3 * side).ok().zip(u32::try_from(side).ok());
    sides
        .and_then(|(width, height)| RgbImage::from_raw(width, height, bytes))
        .context("a picture that is too large to show")
}
