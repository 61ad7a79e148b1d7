//! A made-up recording for tests: four lanes as they might work on a headset at 72 Hz, with pictures late, repeated and missed,
//! and a quality that changes.

use crate::machine::{Absent, Channel, MachineFigures, Quantity, Series};
use crate::{AvatarFigures, Conditions, Measured, Memory, Report};
use app_pipeline::concealment::ConcealmentState;
use app_pipeline::placement::{Alternative, PlacementReport, StageCosts};
use app_pipeline::plan::{Plan, unit_of};
use app_pipeline::profile::{
    Collector, FrameTimes, PictureTimes, Recorder, Recording, Summary, Terms,
};
use app_pipeline::quality::{QualityController, QualityMode};
use app_pipeline::stage::{Lane, Stage, Unit};
use npu_runtime::{Landing, Origin, Provider, ProviderKind, QnnTarget};
use serde_json::json;
use std::time::{Duration, Instant};

const MOTION_MS: f64 = 1000.0 / 30.0;
const DISPLAY_MS: f64 = 1000.0 / 72.0;

pub(crate) struct Synthetic {
    pub(crate) recording: Recording,
    pub(crate) terms: Terms,
    pub(crate) report: Report,
}

struct Lanes {
    zero: Instant,
    random: fastrand::Rng,
    /// When the CPU lane has interpolated last, and when it binds next.
    interpolated: f64,
    bind: [f64; 2],
}

impl Lanes {
    fn at(&self, ms: f64) -> Instant {
        self.zero + Duration::from_secs_f64(ms / 1e3)
    }

    /// `ms` and up to a third more; now and then much more.
    fn about(&mut self, ms: f64) -> f64 {
        let rare = if self.random.u32(..60) == 0 { 0.8 } else { 0.0 };
        ms * (1.0 + 0.3 * self.random.f64().powi(2) + rare)
    }

    /// Records work on a lane of its own.
    fn work(&mut self, on: &mut Recorder, stage: Stage, frame: u64, begin: f64, ms: f64) -> f64 {
        let end = begin + self.about(ms);
        on.span(stage, frame, self.at(begin), self.at(end));
        end
    }

    fn state(&mut self, [motion, npu, cpu]: [&mut Recorder; 3], number: u64) -> (f64, FrameTimes) {
        let captured = number as f64 * MOTION_MS;
        let arrived = captured + self.about(9.0);
        let due = captured + 20.0;
        let released = arrived.max(due) + 0.2;
        let posed = self.work(motion, Stage::Kinematics, number, released, 0.06);
        let begun = posed + 0.1;
        let deformed = self.work(npu, Stage::Inference, number, begun, 17.0);
        let mut now = deformed.max(self.interpolated) + 0.05;
        let bind = now;
        for _ in 0..4 {
            now = self.work(cpu, Stage::Bind, number, now, 0.7) + 0.02;
        }
        self.bind = [bind, now];
        let times = FrameTimes {
            number,
            source: ConcealmentState::Live,
            captured: Some(self.at(captured)),
            arrived: self.at(arrived),
            due: self.at(due),
            released: self.at(released),
            inference: [self.at(begun), self.at(deformed)],
            ready: self.at(now),
        };
        (now, times)
    }
}

/// `seconds` of it.
pub(crate) fn synthetic(seconds: f64) -> Synthetic {
    let mut collector = Collector::default();
    let [mut motion, mut npu, mut cpu, mut gpu] = Lane::ALL.map(|lane| collector.recorder(lane));
    let mut lanes = Lanes {
        zero: Instant::now(),
        random: fastrand::Rng::with_seed(5),
        interpolated: 0.0,
        bind: [0.0; 2],
    };
    let mut states: Vec<(f64, FrameTimes)> = Vec::new();
    let (mut gpu_free, mut number, mut shown_last) = (0.0_f64, 0, 0.0_f64);
    let mut pictured: Option<PictureTimes> = None;
    for blank in 0.. {
        let predicted = blank as f64 * DISPLAY_MS;
        if predicted > seconds * 1e3 {
            break;
        }
        collector.collect();
        // The CPU lane interpolates a little before the GPU needs it.
        let begin = predicted - 13.5;
        while states.last().is_none_or(|(ready, _)| *ready < begin) {
            let next = states.len() as u64;
            states.push(lanes.state([&mut motion, &mut npu, &mut cpu], next));
        }
        let Some([(_, from), (newest, to)]) = states
            .iter()
            .rposition(|(ready, _)| *ready <= begin)
            .and_then(|k| k.checked_sub(1).and_then(|before| states.get(before..=k)))
            .and_then(|two| two.first_chunk::<2>().copied())
        else {
            continue;
        };
        if shown_last > predicted - 0.5 * DISPLAY_MS {
            // The picture before has taken this blank too.
            continue;
        }
        #[expect(clippy::cast_possible_truncation, reason = "a fraction")]
        let alpha = ((begin - newest) / MOTION_MS).min(1.0) as f32;
        number += 1;
        let repeated = number % 97 == 0;
        let interpolated = if repeated {
            begin + 1.0
        } else {
            // What takes 3 ms at most comes before the next bind, or after it.
            let [bind, ready] = lanes.bind;
            let is_free = begin + 3.0 < bind || begin > ready;
            let free = if is_free { begin } else { ready };
            let free = free.max(lanes.interpolated);
            lanes.work(&mut cpu, Stage::Interpolate, number, free, 1.3)
        };
        lanes.interpolated = interpolated;
        let scale = if (4e3..6.5e3).contains(&predicted) {
            0.8
        } else {
            1.0
        };
        let begun = interpolated.max(gpu_free) + 0.15;
        let mut now = begun;
        for (stage, ms) in [
            (Stage::Upload, 0.3),
            (Stage::Project, 1.1),
            (Stage::Sort, 1.4),
        ] {
            now = lanes.work(&mut gpu, stage, number, now, ms);
        }
        let sorted = now;
        for (stage, ms) in [(Stage::Bin, 0.8), (Stage::Raster, 4.2 * f64::from(scale))] {
            now = lanes.work(&mut gpu, stage, number, now, ms);
        }
        gpu_free = now;
        let late = if now > predicted { DISPLAY_MS } else { 0.0 };
        shown_last = predicted + late;
        let picture = PictureTimes {
            number,
            from,
            to,
            alpha,
            interpolated_for: number,
            interpolation: [lanes.at(interpolated - 1.0), lanes.at(interpolated)],
            begun: lanes.at(begun),
            sorted: lanes.at(sorted),
            drawn: lanes.at(now),
            displayed: lanes.at(shown_last),
            predicted: lanes.at(predicted),
            repeated,
            gaussians: 60_035,
            scale,
        };
        let picture = match pictured {
            Some(before) if repeated => again(picture, before),
            _ => picture,
        };
        pictured = Some(picture);
        gpu.picture(picture);
    }
    collector.collect();
    let begin = lanes.at(200.0);
    let recording = Recording::new(&collector, begin, lanes.at(seconds * 1e3));
    let terms = Terms {
        display_period: Duration::from_secs_f64(DISPLAY_MS / 1e3),
        motion_hz: 30.0,
        units: Stage::ALL.map(|stage| stage.legal_units()[0]),
        encode: Some(Duration::from_micros(180)),
        lost_events: 0,
    };
    let report = report(&recording, &terms);
    Synthetic {
        recording,
        terms,
        report,
    }
}

/// `picture` with the Gaussians of the one before.
fn again(picture: PictureTimes, before: PictureTimes) -> PictureTimes {
    PictureTimes {
        from: before.from,
        to: before.to,
        alpha: before.alpha,
        interpolated_for: before.interpolated_for,
        interpolation: before.interpolation,
        ..picture
    }
}

fn report(recording: &Recording, terms: &Terms) -> Report {
    Report {
        avatar: AvatarFigures {
            name: "A made-up person </script>".into(),
            package: "out/demo.m3a".into(),
            package_bytes: 13_400_000,
            vertices: 19_684,
            triangles: 39_000,
            gaussians: 60_035,
            controllers: 500,
        },
        conditions: Conditions {
            motion: "a made-up schedule".into(),
            vulkan_device: "a made-up GPU".into(),
            vulkan_driver: "none".into(),
            onnx_runtime: "1.24.1".into(),
            provider: Some("CPU, 2 threads".into()),
            width: 1680,
            height: 1760,
            views: 2,
            latency: "interpolate".into(),
            cores: 8,
        },
        shown: Measured {
            placement: placement(),
            skipped: app_pipeline::lanes::Skipped::default(),
            quality: QualityController::new(terms.display_period, QualityMode::Fixed(0)).figures(),
            measured: Summary::new(recording, terms),
        },
        memory: Memory {
            host_bytes: Some(612_000_000),
            host_peak_bytes: Some(640_000_000),
            device_bytes: 148_000_000,
            onnx_runtime_bytes: Some(233_000_000),
        },
        machine: machine(),
        call: None,
        sent: json!({ "encoded": 300, "encode_ns": 54_000_000 }),
    }
}

/// A headset that warms up, with a sensor that fails now and then and a GPU whose load cannot be read.
fn machine() -> MachineFigures {
    let at_s: Vec<f64> = (0..20).map(|k| f64::from(k) * 0.5).collect();
    let series = |name: &str, quantity: Quantity, of: &dyn Fn(f64) -> Option<f64>| {
        let values: Vec<Option<f64>> = at_s.iter().map(|at| of(*at)).collect();
        let read: Vec<f64> = values.iter().flatten().copied().collect();
        Series {
            channel: Channel {
                name: name.to_owned(),
                quantity,
            },
            unit: quantity.unit(),
            least: read.iter().copied().fold(f64::INFINITY, f64::min),
            mean: read.iter().sum::<f64>() / read.len() as f64,
            most: read.iter().copied().fold(f64::NEG_INFINITY, f64::max),
            values,
        }
    };
    let fails = |at: f64| (at != 3.0).then_some(36.0 + at * 0.2);
    MachineFigures {
        series: vec![
            series("cpu-0-0 (0)", Quantity::Temperature, &|at| Some(48.0 + at)),
            series("<skin> (10)", Quantity::Temperature, &fails),
            series("CPU 0-2", Quantity::CpuClock, &|_| Some(2016.0)),
            series("CPU 5", Quantity::CpuClock, &|at| Some(3187.2 - at * 40.0)),
            series("GPU clock", Quantity::GpuClock, &|_| Some(492.0)),
            series("GPU throttling level", Quantity::Level, &|at| {
                Some((at / 4.0).floor())
            }),
        ],
        at_s,
        absent: vec![Absent {
            what: "GPU busy".into(),
            why: "cannot read gpu_busy_percentage: Permission denied".into(),
        }],
    }
}

/// One that is chosen, one that is slower, one that fails, and what was not asked for.
fn placement() -> PlacementReport {
    let of = |plan, provider, costs: Result<[f64; 4], &str>| Alternative {
        plan,
        provider: Some(provider),
        unit: unit_of(provider),
        costs: costs
            .ok()
            .map(|[inference, bind, interpolate, draw]| StageCosts {
                inference,
                bind,
                interpolate,
                draw,
            }),
        predicted_ms: costs.ok().map(|costs| costs[3] + 1.0),
        refused: costs.err().map(str::to_owned),
    };
    let [qnn, cpu] = [ProviderKind::Qnn, ProviderKind::Cpu];
    let whole = Err("the NPU takes the whole graph");
    PlacementReport {
        requested: "auto".into(),
        plan: Plan::Npu,
        provider: Some(Provider::Qnn {
            target: QnnTarget::SXR2230P,
        }),
        units: Stage::ALL
            .map(|stage| (stage, Plan::Npu.unit(stage, Unit::Npu)))
            .into(),
        reason: "8.1 ms a picture is predicted, cpu-tail on CPU would take 9.3 ms".into(),
        alternatives: vec![
            of(Plan::Npu, qnn, Ok([17.2, 2.8, 1.3, 7.1])),
            of(Plan::CpuTail, qnn, whole),
            of(Plan::Gpu, qnn, whole),
            of(Plan::Npu, cpu, Ok([31.0, 2.8, 1.3, 8.9])),
            of(Plan::CpuTail, cpu, Ok([21.0, 4.4, 1.3, 8.3])),
            of(
                Plan::Gpu,
                cpu,
                Err(
                    "the device has 41 MB left, and states of 60035 Gaussians need 46 MB there: \
                     draw fewer pixels\nor fewer Gaussians",
                ),
            ),
        ],
        providers: Vec::new(),
        changes: Vec::new(),
        landing: Some(Landing {
            nodes: [("QNNExecutionProvider".into(), 1)].into(),
        }),
        graph: Some(Origin::Precompiled),
    }
}
