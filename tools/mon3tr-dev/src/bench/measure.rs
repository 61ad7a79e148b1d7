//! Samples of a frame's stages, and their medians.

use renderer_splat::times::StageTimes;
use serde::Serialize;
use std::time::Duration;

/// Milliseconds of each frame, stage by stage as the device's clock tells them; `total_ms` by the host's clock, from
/// handing over the frame until it is drawn.
#[derive(Debug, Clone, Default, Serialize)]
pub(crate) struct Samples {
    pub(crate) total_ms: Vec<f64>,
    pub(crate) upload_ms: Vec<f64>,
    pub(crate) project_ms: Vec<f64>,
    pub(crate) sort_ms: Vec<f64>,
    /// Bin and raster together.
    pub(crate) draw_ms: Vec<f64>,
    pub(crate) bin_ms: Vec<f64>,
    pub(crate) raster_ms: Vec<f64>,
}

/// Medians of [`Samples`].
#[derive(Debug, Clone, Copy, Serialize)]
pub(crate) struct Medians {
    pub(crate) upload_ms: f64,
    pub(crate) project_ms: f64,
    pub(crate) sort_ms: f64,
    pub(crate) draw_ms: f64,
    pub(crate) bin_ms: f64,
    pub(crate) raster_ms: f64,
    pub(crate) total_ms: f64,
}

impl Samples {
    pub(crate) fn push(&mut self, total: Duration, stages: &StageTimes) {
        self.total_ms.push(total.as_secs_f64() * 1e3);
        self.upload_ms.push(stages.upload);
        self.project_ms.push(stages.project);
        self.sort_ms.push(stages.sort);
        self.draw_ms.push(stages.bin + stages.raster);
        self.bin_ms.push(stages.bin);
        self.raster_ms.push(stages.raster);
    }

    pub(crate) fn medians(&self) -> Medians {
        Medians {
            upload_ms: median(&self.upload_ms),
            project_ms: median(&self.project_ms),
            sort_ms: median(&self.sort_ms),
            draw_ms: median(&self.draw_ms),
            bin_ms: median(&self.bin_ms),
            raster_ms: median(&self.raster_ms),
            total_ms: median(&self.total_ms),
        }
    }
}

impl Medians {
    /// Headings of [`Self::row`].
    pub(crate) const HEADINGS: [&str; 7] = [
        "upload",
        "project",
        "sort",
        "draw",
        "of it bin",
        "raster",
        "total ms",
    ];

    /// The table cells of one row.
    pub(crate) fn row(&self) -> Vec<String> {
        let Self {
            upload_ms,
            project_ms,
            sort_ms,
            draw_ms,
            bin_ms,
            raster_ms,
            total_ms,
        } = *self;
        [
            upload_ms, project_ms, sort_ms, draw_ms, bin_ms, raster_ms, total_ms,
        ]
        .map(|ms| format!("{ms:.1}"))
        .into()
    }
}

/// The median; 0 of nothing.
pub(crate) fn median(values: &[f64]) -> f64 {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    let middle = sorted.len() / 2;
    match (sorted.get(middle), sorted.len() % 2) {
        (Some(value), 1) => *value,
        (Some(value), _) => {
            let below = middle.checked_sub(1).and_then(|below| sorted.get(below));
            f64::midpoint(*value, *below.unwrap_or(value))
        }
        (None, _) => 0.0,
    }
}

/// Prints a Markdown table whose cells line up: the first column to the left, figures to the right.
pub(crate) fn print_table(headings: &[&str], rows: &[Vec<String>]) {
    let width = |column: usize| {
        let cells = rows.iter().filter_map(|row| row.get(column));
        let longest = cells.map(|cell| cell.chars().count()).max().unwrap_or(0);
        longest
            .max(headings.get(column).map_or(0, |heading| heading.len()))
            .max(3)
    };
    let widths: Vec<usize> = (0..headings.len()).map(width).collect();
    let line = |cells: &[String]| {
        let padded = cells
            .iter()
            .zip(&widths)
            .enumerate()
            .map(|(column, (cell, width))| {
                if column == 0 {
                    format!("{cell:<width$}")
                } else {
                    format!("{cell:>width$}")
                }
            });
        println!("| {} |", padded.collect::<Vec<_>>().join(" | "));
    };
    line(&headings.iter().map(ToString::to_string).collect::<Vec<_>>());
    let rules: Vec<String> = widths
        .iter()
        .enumerate()
        .map(|(column, width)| {
            if column == 0 {
                "-".repeat(*width)
            } else {
                format!("{}:", "-".repeat(width - 1))
            }
        })
        .collect();
    line(&rules);
    for row in rows {
        line(row);
    }
}

/// 60000 as 60k, 1000000 as 1M.
pub(crate) fn short_count(count: usize) -> String {
    match count {
        1_000_000.. if count.is_multiple_of(1_000_000) => format!("{}M", count / 1_000_000),
        1000.. if count.is_multiple_of(1000) => format!("{}k", count / 1000),
        _ => count.to_string(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_median_lies_in_the_middle() {
        assert!(median(&[]).abs() < 1e-12, "of nothing");
        assert!((median(&[9.0, 1.0, 2.0]) - 2.0).abs() < 1e-12, "of three");
        assert!(
            (median(&[4.0, 1.0, 2.0, 9.0]) - 3.0).abs() < 1e-12,
            "of four"
        );
    }
}
