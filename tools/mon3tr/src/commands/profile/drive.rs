//! The receiver that is profiled: draws a call for some seconds and hands over what its lanes recorded.

use super::Options;
use super::call::Room;
use crate::live::{LiveView, PreparedView, ViewReport};
use crate::stills::RenderSettings;
use crate::viewpoint::Viewpoint;
use anyhow::{Context, bail};
use app_pipeline::lanes::Drawn;
use app_pipeline::quality::QualityMode;
use npu_runtime::Runtime;
use profile_report::resident_bytes;
use renderer_splat::options::Filter;
use renderer_vulkan::gpu::Gpu;
use spmm3::Avatar;
use std::sync::Arc;
use std::sync::atomic::Ordering::Relaxed;
use std::time::{Duration, Instant};

/// From the first frame until measuring begins: clocks are compared, buffers find their size.
const WARM_UP: Duration = Duration::from_secs(2);

/// How long to wait for the first frame, beside what inferring takes.
const LONGEST_SILENCE: Duration = Duration::from_secs(30);

/// Motion frames that a measurement has at least, however slow the NPU is.
const FEWEST_INFERENCES: u32 = 3;

/// What draws, for whom, and what is wanted of it.
pub(super) struct Wanted<'a> {
    pub(super) options: &'a Options,
    pub(super) gpu: &'a Arc<Gpu>,
    pub(super) runtime: &'a Runtime,
    pub(super) avatar: &'a Arc<Avatar>,
    /// Joined only when all is prepared: the performance begins then.
    pub(super) room: &'a Room,
}

/// What a run left.
pub(super) struct Driven {
    /// What the lanes recorded, collected to the end, and what else is left of the call.
    pub(super) shown: ViewReport,
    /// When measuring began, after a warm-up, and ended.
    pub(super) begin: Instant,
    pub(super) end: Instant,
    /// What the resident set grew by when placements were tried and one was kept.
    pub(super) onnx_runtime_bytes: Option<u64>,
    /// [`Gpu::memory_taken`] while the renderer was there.
    pub(super) device_bytes: u64,
}

/// Prepares, joins, warms up, and draws for as long as the options say.
pub(super) fn drive(wanted: &Wanted<'_>) -> anyhow::Result<Driven> {
    let Wanted {
        options,
        gpu,
        runtime,
        avatar,
        room,
    } = *wanted;
    let setting = RenderSettings {
        size: options.size,
        views: options.views(),
        background: None,
        filter: Filter::Dilation,
    };
    let viewpoint: Viewpoint = super::CAMERA.parse().map_err(anyhow::Error::msg)?;
    let before = resident_bytes();
    let prepared = PreparedView::new(gpu, runtime, avatar, setting, &viewpoint, options.lanes)?;
    let onnx_runtime_bytes = resident_bytes()
        .zip(before)
        .map(|(now, then)| now.saturating_sub(then));
    let hold = if options.hold {
        QualityMode::Adapt
    } else {
        QualityMode::Fixed(0)
    };
    let mut live = prepared.show(room.join(&avatar.skeleton), options.display_hz, hold)?;
    let [begin, end] = draw(&mut live, &viewpoint, room, options.seconds)?;
    let device_bytes = gpu.memory_taken();
    Ok(Driven {
        shown: live.finish()?,
        begin,
        end,
        onnx_runtime_bytes,
        device_bytes,
    })
}

/// Draws until the time is over, and returns when measuring began and ended.
fn draw(
    live: &mut LiveView,
    viewpoint: &Viewpoint,
    room: &Room,
    seconds: Duration,
) -> anyhow::Result<[Instant; 2]> {
    let joined = Instant::now();
    let inference = live.placement.inference().unwrap_or_default();
    let seconds = match inference.saturating_mul(FEWEST_INFERENCES) {
        least if least > seconds => {
            println!(
                "measuring {:.0} s, for {FEWEST_INFERENCES} motion frames: {} took {:.1} s for one",
                least.as_secs_f64(),
                live.placement.provider,
                inference.as_secs_f64()
            );
            least
        }
        _ => seconds,
    };
    // Pictures slow it down, and the frame that begins first may be of the performance before.
    let silence = LONGEST_SILENCE.saturating_add(inference.saturating_mul(4));
    let mut measured: Option<[Instant; 2]> = None;
    loop {
        let now = Instant::now();
        if room.stop.load(Relaxed) || measured.is_some_and(|[_, end]| now >= end) {
            break;
        }
        if live.lanes.is_over() {
            bail!("the sender hung up");
        }
        live.display.wait();
        let Some(moment) = live.begin()? else {
            if now > joined + silence {
                bail!("nobody was to be seen in {} s", silence.as_secs());
            }
            std::thread::sleep(Duration::from_millis(1));
            continue;
        };
        let begin = now + WARM_UP;
        measured.get_or_insert([begin, begin + seconds]);
        let size = live.setting().size;
        let camera = viewpoint.camera(moment.floor, moment.heading, size.width, size.height);
        if let Drawn::Picture = live.draw(camera)? {
            live.displayed();
        }
    }
    let [begin, end] = measured.context("ended before the first frame")?;
    Ok([begin, end.min(Instant::now())])
}
