//! What the panel shows. Whatever is not known is `None`, and a dash on the panel.

use app_pipeline::profile::Since;
use app_pipeline::quality::Quality;
use app_pipeline::stage::Unit;

/// The figures of the last seconds.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct OverlayFigures {
    /// Pictures shown a second.
    pub shown_hz: Option<f64>,
    /// Pictures a second that the display could show.
    pub display_hz: Option<f64>,
    /// The pictures of the last seconds, oldest first.
    pub frames: Vec<FrameTime>,
    /// Pictures that came late since the call began.
    pub late_in_all: Option<u64>,
    /// What each unit does, in the order of [`Unit::ALL`]; `None` where it has nothing to do in the placement.
    pub units: [Option<UnitLoad>; Unit::ALL.len()],
    /// From capture to display.
    pub latency: Option<OverlayLatency>,
    /// What comes, without any header.
    pub kbit_s: Option<f64>,
    /// Share of the frames that never came, 0 to 1.
    pub loss: Option<f64>,
    /// How stages are divided among units, and what runs the graph.
    pub placement: Option<String>,
    /// Gaussians drawn.
    pub gaussians: Option<u32>,
    /// What is given up to hold the display's rate.
    pub quality: Option<Quality>,
}

/// One picture.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FrameTime {
    /// From beginning it until it is drawn, milliseconds.
    pub ms: f32,
    /// It was shown later than it was meant for.
    pub is_late: bool,
}

/// What one unit does.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct UnitLoad {
    /// Milliseconds that it works for each picture shown.
    pub ms: f64,
    /// Share of the time in which it works, 0 to 1.
    pub share: f64,
}

/// How old what is seen is.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct OverlayLatency {
    /// Where it is counted from.
    pub since: Since,
    /// Median, milliseconds.
    pub p50_ms: f64,
    /// 95th percentile, milliseconds.
    pub p95_ms: f64,
}
