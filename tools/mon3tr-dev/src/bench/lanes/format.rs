//! What the turns for one kind of picture came to.

use super::super::measure::{median, print_table};
use super::one_by_one::OneByOne;
use super::turn::{AtOnce, Scene};
use app_pipeline::lanes::Skipped;
use app_pipeline::placement::{PlacementReport, StageCosts, predicted_picture_ms};
use app_pipeline::plan::{Plan, unit_of};
use app_pipeline::profile::Summary;
use app_pipeline::stage::{Lane, Unit};
use mon3tr::device_options::DeviceOptions;
use mon3tr::performance::MOTION_RATE;
use serde::Serialize;

/// The most that a picture is meant to take, in times that the slowest unit takes alone.
const GOAL: f64 = 1.15;

/// One size of pictures, and one or two views.
#[derive(Debug, Serialize)]
pub(super) struct Format {
    width: u32,
    height: u32,
    views: u32,
    placement: PlacementReport,
    /// Whether the device is a program on the CPU.
    gpu_is_cpu: bool,
    /// Milliseconds from one new picture to the next, turn by turn: by lanes ...
    at_once_ms: Vec<f64>,
    /// ... the median if those count that have the Gaussians of the one before ...
    drawn_ms: f64,
    /// ... and by one thread.
    one_by_one_ms: Vec<f64>,
    /// Stages' times when nothing else runs.
    costs: StageCosts,
    lanes: Vec<LaneFigures>,
    yardsticks: Vec<Yardstick>,
    /// Of the last turn.
    skipped: Skipped,
    /// Every turn by lanes.
    summaries: Vec<Summary>,
}

/// How long a lane works for a picture, milliseconds.
#[derive(Debug, Serialize)]
struct LaneFigures {
    lane: Lane,
    does: &'static str,
    /// If it were alone.
    alone_ms: f64,
    /// Beside the others.
    beside_ms: f64,
}

/// What a picture by lanes is held against.
#[derive(Debug, Serialize)]
struct Yardstick {
    what: String,
    ms: f64,
    /// The lanes' time by this: from one new picture to the next ...
    ratio: f64,
    /// ... and from any to the next.
    drawn_ratio: f64,
    #[serde(skip_serializing_if = "Option::is_none")]
    goal: Option<f64>,
}

impl Format {
    pub(super) fn new(
        scene: &Scene<'_>,
        placement: PlacementReport,
        alone: &[OneByOne],
        together: Vec<AtOnce>,
    ) -> Self {
        let middle =
            |of: &dyn Fn(&OneByOne) -> f64| median(&alone.iter().map(of).collect::<Vec<_>>());
        let costs = StageCosts {
            inference: middle(&|turn| turn.costs.inference),
            bind: middle(&|turn| turn.costs.bind),
            interpolate: middle(&|turn| turn.costs.interpolate),
            draw: middle(&|turn| turn.costs.draw),
        };
        let at_once_ms: Vec<f64> = together.iter().map(|turn| turn.picture_ms).collect();
        let one_by_one_ms: Vec<f64> = alone.iter().map(|turn| turn.picture_ms).collect();
        let picture_ms = median(&at_once_ms);
        let drawn_ms = median(&together.iter().map(drawn_ms).collect::<Vec<_>>());
        // Of a motion frame, what falls to each picture; no more than one is taken for a picture.
        let shared = (picture_ms * 1e-3 * MOTION_RATE).min(1.0);
        let (posing, drawing) = (shared * costs.bind + costs.interpolate, costs.draw);
        let kinematics = shared * middle(&|turn| turn.kinematics_ms);
        let networks = shared * costs.inference;
        let its = match scene.plan {
            Plan::GpuAlone => vec![(
                Lane::Gpu,
                "networks, states, interpolation, drawing",
                networks + posing + drawing,
            )],
            Plan::Gpu => vec![
                (Lane::Npu, "inference", networks),
                (
                    Lane::Gpu,
                    "states, interpolation, drawing",
                    posing + drawing,
                ),
            ],
            Plan::Npu | Plan::CpuTail | Plan::Cpu => vec![
                (Lane::Npu, "inference", networks),
                (Lane::Cpu, "states, interpolation", posing),
                (Lane::Gpu, "upload to raster", drawing),
            ],
        };
        let lanes: Vec<LaneFigures> = std::iter::once((Lane::Motion, "kinematics", kinematics))
            .chain(its)
            .map(|(lane, does, alone_ms)| LaneFigures {
                lane,
                does,
                alone_ms,
                beside_ms: median(
                    &together
                        .iter()
                        .map(|turn| busy_ms(turn, lane))
                        .collect::<Vec<_>>(),
                ),
            })
            .collect();
        let gpu_is_cpu = scene.gpu.info().is_cpu;
        let provider = scene.provider.map(npu_runtime::Provider::kind);
        let unit_alone = predicted_picture_ms(scene.plan, provider, &costs, gpu_is_cpu);
        let predicted = (placement.alternatives.iter())
            .find(|one| placement.is_chosen(one))
            .and_then(|one| one.predicted_ms);
        let slowest = lanes
            .iter()
            .max_by(|a, b| a.alone_ms.total_cmp(&b.alone_ms));
        let one = |what: String, ms: f64, goal: Option<f64>| Yardstick {
            what,
            ms,
            ratio: picture_ms / ms,
            drawn_ratio: drawn_ms / ms,
            goal,
        };
        let mut yardsticks = vec![one("the slowest unit alone".into(), unit_alone, Some(GOAL))];
        yardsticks.extend(slowest.map(|lane| {
            let name = lane.lane.name();
            one(
                format!("the slowest lane alone ({name})"),
                lane.alone_ms,
                None,
            )
        }));
        yardsticks.push(one(
            "all stages one after the other, by one thread".into(),
            median(&one_by_one_ms),
            None,
        ));
        yardsticks
            .extend(predicted.map(|ms| one("predicted when stages were placed".into(), ms, None)));
        Self {
            width: scene.setting.size.width,
            height: scene.setting.size.height,
            views: scene.setting.views.count(),
            placement,
            gpu_is_cpu,
            at_once_ms,
            drawn_ms,
            one_by_one_ms,
            costs,
            lanes,
            yardsticks,
            skipped: together.last().map(|turn| turn.skipped).unwrap_or_default(),
            summaries: together.into_iter().map(|turn| turn.summary).collect(),
        }
    }

    pub(super) fn print(&self) {
        let views = if self.views == 2 { "2 x " } else { "" };
        let Self { width, height, .. } = self;
        let turns = self.at_once_ms.len();
        let (mut shown, mut repeated) = (0, 0);
        for pictures in self.summaries.iter().map(|summary| &summary.pictures) {
            shown += pictures.shown;
            repeated += pictures.repeated;
        }
        println!(
            "\n{views}{width}x{height}, {}: {turns} turns, {shown} pictures, {repeated} of them with the Gaussians of the one before\n",
            self.placement.name()
        );
        let rows: Vec<Vec<String>> = (self.lanes.iter())
            .map(|lane| {
                vec![
                    lane.lane.name().to_owned(),
                    lane.does.to_owned(),
                    format!("{:.2}", lane.alone_ms),
                    format!("{:.2}", lane.beside_ms),
                ]
            })
            .collect();
        print_table(
            &["lane", "does", "alone, ms a picture", "beside the others"],
            &rows,
        );
        println!();
        let mut rows = vec![vec![
            "by lanes at once".to_owned(),
            format!("{:.2}", median(&self.at_once_ms)),
            "1.00".into(),
            "-".into(),
            "-".into(),
        ]];
        rows.push(vec![
            "the same, repeated pictures counted".to_owned(),
            format!("{:.2}", self.drawn_ms),
            "-".into(),
            "1.00".into(),
            "-".into(),
        ]);
        rows.extend(self.yardsticks.iter().map(|one| {
            vec![
                one.what.clone(),
                format!("{:.2}", one.ms),
                format!("{:.2}", one.ratio),
                format!("{:.2}", one.drawn_ratio),
                one.goal
                    .map_or_else(|| "-".into(), |goal| format!("{goal:.2}")),
            ]
        }));
        print_table(
            &[
                "from picture to picture",
                "ms",
                "new / it",
                "drawn / it",
                "goal",
            ],
            &rows,
        );
        println!("\n{}", self.note());
    }

    /// Which units are one.
    fn note(&self) -> String {
        let provider = self.placement.provider;
        let networks_on_cpu =
            provider.is_some_and(|provider| unit_of(provider.kind()) == Unit::Cpu);
        let cores = DeviceOptions::threads();
        let shared = match (self.gpu_is_cpu, networks_on_cpu) {
            (true, true) => "NPU, CPU and GPU lanes share",
            (true, false) => "CPU and GPU lanes share",
            (false, true) => "NPU and CPU lanes share",
            (false, false) => {
                return "NPU, CPU and GPU are units of their own: the slowest sets the pace."
                    .into();
            }
        };
        format!(
            "{shared} this machine's {cores} cores, on which work adds up: they are one unit, and what it takes alone is the sum of its\n\
             stages, each measured while nothing else ran. Below 1, lanes fill cores that a stage by itself leaves idle."
        )
    }
}

/// Milliseconds from one picture to the next, new or not.
fn drawn_ms(turn: &AtOnce) -> f64 {
    turn.summary.seconds * 1e3 / turn.summary.pictures.shown.max(1) as f64
}

/// Milliseconds that a lane worked for each new picture.
fn busy_ms(turn: &AtOnce, lane: Lane) -> f64 {
    let busy = turn.summary.occupancy.lanes.iter();
    let share = busy.filter(|one| one.who == lane).map(|one| one.share);
    share.sum::<f64>() * turn.picture_ms
}
