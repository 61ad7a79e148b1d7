//! The figures as the paper's tables: one for each group of pictures.

use super::compare::Means;
use serde::Serialize;
use std::fmt::Write as _;

/// A way of drawing the avatar, with its means in each group.
#[derive(Debug, Serialize)]
pub(super) struct Row {
    /// `full`, or what is switched off.
    pub(super) method: String,
    /// In the order of the groups.
    pub(super) groups: Vec<Means>,
}

/// The whole evaluation.
#[derive(Debug, Serialize)]
pub(super) struct Report {
    /// The capture's folder.
    pub(super) capture: String,
    /// The package's file.
    pub(super) package: String,
    /// Gaussians of the avatar.
    pub(super) gaussians: usize,
    /// The device that drew.
    pub(super) device: String,
    /// Whether each camera's colours were corrected.
    pub(super) colour_correction: bool,
    /// Names of the groups.
    pub(super) groups: Vec<&'static str>,
    /// The full design first.
    pub(super) rows: Vec<Row>,
}

/// A figure of a group: its column's title, its value, and its decimals.
type Column = (&'static str, fn(&Means) -> Option<f64>, usize);

/// The paper's columns; PSNR and SSIM once over the person and once over the whole picture.
const COLUMNS: [Column; 6] = [
    (
        "PSNR masked (dB)↑",
        |means| Some(means.scores?.psnr_masked),
        2,
    ),
    ("PSNR full (dB)↑", |means| Some(means.scores?.psnr), 2),
    ("SSIM masked↑", |means| Some(means.scores?.ssim_masked), 4),
    ("SSIM full↑", |means| Some(means.scores?.ssim), 4),
    ("LPIPS↓", |means| means.scores?.lpips, 4),
    ("FID↓", |means| means.fid, 2),
];

impl Report {
    /// Markdown tables.
    pub(super) fn markdown(&self) -> String {
        let mut text = format!(
            "`{}` in the capture `{}`: {} Gaussians, drawn on {}.\n",
            self.package, self.capture, self.gaussians, self.device
        );
        if self.colour_correction {
            text += "Colours are corrected for each camera.\n";
        }
        for (index, group) in self.groups.iter().enumerate() {
            let means = |row: &'_ Row| row.groups.get(index).cloned();
            let pictures = (self.rows.first())
                .and_then(means)
                .map_or(0, |means| means.pictures);
            // Writing to a String cannot fail.
            let _ = writeln!(text, "\n**{group}** ({pictures} pictures)\n");
            if pictures == 0 {
                let _ = writeln!(text, "The capture holds none out.");
                continue;
            }
            let titles = COLUMNS.map(|(title, ..)| title).join(" | ");
            let _ = writeln!(text, "| Method | {titles} |");
            let _ = writeln!(text, "|---|{}", "---:|".repeat(COLUMNS.len()));
            for row in &self.rows {
                let Some(means) = means(row) else {
                    continue;
                };
                let cells = COLUMNS.map(|(_, value, decimals)| {
                    value(&means).map_or("-".to_owned(), |value| format!("{value:.decimals$}"))
                });
                let _ = writeln!(text, "| {} | {} |", row.method, cells.join(" | "));
            }
        }
        text
    }
}
