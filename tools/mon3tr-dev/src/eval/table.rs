//! The evaluation's figures as tables.

use super::fit_by::FitBy;
use super::score::Scores;
use serde::Serialize;
use tracker::workers;

/// One motion from one camera.
#[derive(Debug, Serialize)]
pub(super) struct Row {
    pub(super) motion: String,
    pub(super) camera: &'static str,
    pub(super) by: FitBy,
    #[serde(flatten)]
    pub(super) scores: Scores,
    /// Mean time of the fit, milliseconds a frame.
    pub(super) fit_ms: f64,
}

/// Milliseconds that the networks took, frame by frame.
#[derive(Debug, Default, Serialize)]
pub(super) struct StageSamples {
    pub(super) body_ms: Vec<f64>,
    pub(super) hands_ms: Vec<f64>,
    pub(super) face_ms: Vec<f64>,
    pub(super) all_ms: Vec<f64>,
}

impl StageSamples {
    pub(super) fn add(&mut self, times: &workers::StageTimes) {
        let [left, right] = times.hands_ms;
        self.body_ms.push(times.body_ms.into());
        self.hands_ms.push(left.max(right).into());
        self.face_ms.push(times.face_ms.into());
        self.all_ms.push(times.total_ms.into());
    }

    pub(super) fn print(&self) {
        let of = |values: &[f64]| text(median(values.to_vec()));
        println!(
            "\nmedian ms of {} pictures: body {}, the slower hand {}, face {}, from picture to landmarks {}",
            self.all_ms.len(),
            of(&self.body_ms),
            of(&self.hands_ms),
            of(&self.face_ms),
            of(&self.all_ms)
        );
    }
}

/// A figure of a row, for the median over all of them.
type Figure = (&'static str, fn(&Row) -> Option<f64>);

const FIGURES: [Figure; 14] = [
    ("MPJPE, mm", |row| Some(row.scores.mpjpe_mm)),
    ("95 %, mm", |row| Some(row.scores.mpjpe_p95_mm)),
    ("PA-MPJPE, mm", |row| Some(row.scores.pa_mpjpe_mm)),
    ("pelvis, degrees", |row| {
        Some(row.scores.whole_body.as_ref()?.pelvis_degrees)
    }),
    ("fingers left, degrees", |row| {
        Some(row.scores.whole_body.as_ref()?.finger_degrees[0])
    }),
    ("fingers right, degrees", |row| {
        Some(row.scores.whole_body.as_ref()?.finger_degrees[1])
    }),
    ("curl correlation, left", |row| {
        row.scores.whole_body.as_ref()?.curl_correlation[0]
    }),
    ("curl correlation, right", |row| {
        row.scores.whole_body.as_ref()?.curl_correlation[1]
    }),
    ("expression correlation", |row| {
        row.scores.whole_body.as_ref()?.expression_correlation
    }),
    ("jaw correlation", |row| {
        row.scores.whole_body.as_ref()?.jaw_correlation
    }),
    ("jitter / truth's", |row| {
        Some(row.scores.jitter_mm / row.scores.jitter_truth_mm.max(1e-9))
    }),
    ("foot slide, m/s", |row| {
        row.scores.whole_body.as_ref()?.foot_slide
    }),
    ("of feet in the picture", |row| {
        row.scores.whole_body.as_ref()?.foot_slide_seen
    }),
    ("reprojection, %", |row| {
        Some(row.scores.reprojection_percent)
    }),
];

/// One motion's figures in a line.
pub(super) fn print_scores(row: &Row) {
    let Row {
        motion,
        camera,
        by,
        scores,
        ..
    } = row;
    let both = |[left, right]: [Option<f64>; 2]| format!("{}/{}", text(left), text(right));
    print!(
        "{motion:<22.22} {camera:<8} {:<9} {:>3}/{:<3} MPJPE {:>4.0} (95 %: {:>4.0}) PA {:>4.0} mm  jitter {:>4.1} ({:>4.1})  swaps {:>2} ({})  reprojection {:.1} %",
        by.name(),
        scores.frames,
        scores.of,
        scores.mpjpe_mm,
        scores.mpjpe_p95_mm,
        scores.pa_mpjpe_mm,
        scores.jitter_mm,
        scores.jitter_truth_mm,
        scores.swapped,
        scores.longest_swap,
        scores.reprojection_percent,
    );
    if let Some(body) = &scores.whole_body {
        let [left, right] = body.finger_degrees;
        print!(
            "  pelvis {:>3.0}°  fingers {left:>2.0}/{right:<2.0}° curl {:<11} face {:<5} jaw {:<5} slide {:<5} (seen {:<5})",
            body.pelvis_degrees,
            both(body.curl_correlation),
            text(body.expression_correlation),
            text(body.jaw_correlation),
            text(body.foot_slide),
            text(body.foot_slide_seen),
        );
    }
    println!();
}

/// What is known of footage whose truth is that of the limbs alone.
pub(super) fn print_limbs(what: &str, scores: &Scores) {
    println!(
        "  {what:<14} {:>3}/{:<3} MPJPE {:>4.0} (95 %: {:>4.0}) PA {:>4.0} mm  jitter {:>5.1} ({:.1})  swaps {:>2} ({})  without truth {} joints",
        scores.frames,
        scores.of,
        scores.mpjpe_mm,
        scores.mpjpe_p95_mm,
        scores.pa_mpjpe_mm,
        scores.jitter_mm,
        scores.jitter_truth_mm,
        scores.swapped,
        scores.longest_swap,
        scores.unknown,
    );
}

/// Medians over all motions and cameras that were fitted so.
pub(super) fn print_summary(by: FitBy, rows: &[Row]) {
    let rows: Vec<&Row> = rows.iter().filter(|row| row.by == by).collect();
    println!(
        "\nmedians over {} motions and cameras, {}",
        rows.len(),
        by.name()
    );
    for (name, of) in FIGURES {
        let values: Vec<f64> = rows.iter().filter_map(|row| of(row)).collect();
        println!("  {name:<26} {}", text(median(values)));
    }
}

fn text(value: Option<f64>) -> String {
    value.map_or_else(|| "-".to_owned(), |value| format!("{value:.2}"))
}

/// The middle value; none of none.
pub(super) fn median(mut values: Vec<f64>) -> Option<f64> {
    values.sort_by(f64::total_cmp);
    values.get(values.len() / 2).copied()
}
