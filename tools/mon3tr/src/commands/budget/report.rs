//! The predictions as tables in Markdown, for a terminal and for a page.

use super::predictions::{Budget, Crowd, USABLE, unit_share};
use app_pipeline::plan::unit_of;
use app_pipeline::stage::Unit;
use frame_budget::{Chip, Estimate, ViewWork};

/// What was published about splatting people on the same headset.
const PUBLISHED: [(&str, &str); 5] = [
    (
        "SqueezeMe (arXiv 2412.15171): three avatars of 60,000 Gaussians in stereo",
        "72 Hz, so at most 13.9 ms with the compositor; its decoder 5 ms on the NPU, or 0.45 ms with shared correctives; other stages are not published",
    ),
    (
        "Mon3tr's paper: one avatar",
        "about 60 pictures a second from 30 motion frames; no stages, sizes or counts",
    ),
    (
        "Unity-VR-Gaussian-Splatting: a scene of 400,000, small and far, seldom sorted",
        "72 Hz, by its author",
    ),
    (
        "a fork of UnityGaussianSplatting: a scene of 300,000, stereo, native size",
        "16 to 18 Hz, by its author",
    ),
    (
        "mkkellogg's viewer in the headset's browser",
        "17 to 24 Hz, by users",
    ),
];

pub(super) fn print(budget: &Budget, chip: &Chip) {
    let [width, height] = budget.eye;
    println!(
        "\nPredicted for {}, 2 x {width}x{height}, people {:.1} m away. Counts are measured here; milliseconds are a model: likely (least to most).",
        budget.headset, budget.distance_metres
    );
    counts(&budget.crowds);
    for back_end in 0..2 {
        stages(&budget.crowds, back_end);
    }
    placements(&budget.crowds);
    rates(&budget.crowds, chip);
    println!("\nPublished by others on the same headset\n\n| what | figure |\n|---|---|");
    for (what, figure) in PUBLISHED {
        println!("| {what} | {figure} |");
    }
    println!("\nThe chip's rates\n\n| rate | where it is from |\n|---|---|");
    for (rate, source) in chip.sources {
        println!("| {rate} | {source} |");
    }
}

fn heading(first: &str, crowds: &[Crowd], last: &str) {
    let columns = (crowds.iter()).map(|crowd| match crowd.people {
        1 => " 1 person |".to_owned(),
        people => format!(" {people} people |"),
    });
    println!(
        "| {first} |{}{last}\n|---|{}{}",
        columns.collect::<String>(),
        "--:|".repeat(crowds.len()),
        if last.is_empty() { "" } else { "---|" }
    );
}

fn row(what: &str, cells: impl Iterator<Item = String>) -> String {
    cells.fold(format!("| {what} |"), |row, cell| row + " " + &cell + " |")
}

/// In thousands.
fn thousands(count: u64) -> String {
    format!("{:.0}k", count as f64 / 1e3)
}

fn counts(crowds: &[Crowd]) {
    println!("\nCounted: work of a picture, both eyes\n");
    heading("what", crowds, "");
    type Count = (&'static str, fn(&ViewWork) -> u64);
    let of_views: [Count; 7] = [
        ("splats seen", |view| view.splats),
        ("pairs of splat and tile", |view| view.pairs),
        ("blocks of 8x8 pixels drawn", |view| view.blocks),
        ("splats tested by blocks, 64 at a time", |view| {
            64 * view.batches
        }),
        ("splats blended by blocks", |view| view.blends),
        ("fragments of hexagons", |view| view.fragments),
        ("pixels covered", |view| view.covered),
    ];
    println!(
        "{}",
        row(
            "Gaussians",
            crowds.iter().map(|c| thousands(c.work.gaussians))
        )
    );
    println!(
        "{}",
        row("sorted", crowds.iter().map(|c| thousands(c.work.sorted)))
    );
    for (what, of) in of_views {
        let sums = crowds
            .iter()
            .map(|crowd| crowd.work.views.iter().map(of).sum());
        println!("{}", row(what, sums.map(thousands)));
    }
    let overdraw = crowds.iter().map(|crowd| {
        let sum = |of: fn(&ViewWork) -> u64| crowd.work.views.iter().map(of).sum::<u64>();
        let (fragments, covered) = (sum(|view| view.fragments), sum(|view| view.covered));
        format!("{:.1}", fragments as f64 / covered.max(1) as f64)
    });
    println!("{}", row("hexagons over each pixel covered", overdraw));
}

fn stages(crowds: &[Crowd], back_end: usize) {
    let all: Vec<_> = (crowds.iter())
        .filter_map(|crowd| crowd.back_ends.get(back_end))
        .collect();
    let Some(first) = all.first() else { return };
    println!(
        "\nModelled: the GPU's milliseconds a picture, by {}\n",
        first.back_end
    );
    heading("stage", crowds, " bound by |");
    for (at, stage) in first.stages.iter().enumerate() {
        let cells = all
            .iter()
            .filter_map(|one| one.stages.get(at))
            .map(|stage| stage.ms.to_string());
        let mut limits: Vec<&str> = Vec::new();
        for of in all.iter().filter_map(|one| one.stages.get(at)) {
            if limits.last() != Some(&of.limit.name()) {
                limits.push(of.limit.name());
            }
        }
        println!("{} {} |", row(stage.stage, cells), limits.join(", then "));
    }
    println!(
        "{} |",
        row("sum", all.iter().map(|one| one.sum.to_string()))
    );
}

fn placements(crowds: &[Crowd]) {
    println!(
        "\nModelled: each placement, with the faster back end, in milliseconds; pictures with the compositor's part\n"
    );
    println!(
        "| people | placement | graph on | inference, a motion frame | of that unit's time | bind, a motion frame | interpolate, a picture | draw | from picture to picture | a second |\n|--:|---|---|--:|--:|--:|--:|--:|--:|--:|"
    );
    for crowd in crowds {
        for one in &crowd.placements {
            let share: Estimate = unit_share(one.inference) * 100.0;
            println!(
                "| {} | {} | {} | {} | {:.0} % | {} | {} | {} | {} | {:.0} |",
                crowd.people,
                one.plan,
                one.provider.map_or(Unit::Gpu, unit_of).name(),
                one.inference,
                share.likely,
                one.bind,
                one.interpolate,
                one.draw,
                one.picture,
                1e3 / one.picture.likely
            );
        }
    }
}

fn rates(crowds: &[Crowd], chip: &Chip) {
    println!(
        "\nModelled: what a display's rate asks for. The GPU's share of a period is {:.0} % of it, above which the system raises its clock, less the compositor's {} ms\n",
        100.0 * USABLE,
        chip.compositor
    );
    println!(
        "| people | rate | left for the GPU, ms | likely at full quality, ms | it must shrink to | the first step of quality that fits | at that step, ms |\n|--:|--:|--:|--:|--:|---|--:|"
    );
    for crowd in crowds {
        let full = (crowd.back_ends.iter())
            .map(|one| one.sum.likely)
            .fold(f64::INFINITY, f64::min);
        for rate in &crowd.rates {
            let step = rate.step.map_or_else(
                || "none".to_owned(),
                |quality| format!("{}: {quality}", quality.step),
            );
            println!(
                "| {} | {:.0} Hz | {:.1} | {full:.1} | {:.0} % | {step} | {} |",
                crowd.people,
                rate.hertz,
                rate.left_ms,
                (100.0 * rate.left_ms / full).min(100.0),
                rate.sum
            );
        }
    }
}
