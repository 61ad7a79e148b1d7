//! What can be chosen about the lanes that show a call.

use app_pipeline::placement::InferenceBackends;
use app_pipeline::plan::PlacementRequest;
use app_pipeline::quality::QualityMode;
use app_pipeline::timeline::LatencyMode;
use app_session::session::SessionConfig;
use clap::ValueEnum;

/// Options of commands that show a call.
#[derive(Debug, Clone, Copy, clap::Args)]
pub(crate) struct LaneChoices {
    /// What runs where: auto (measured at the start, plan npu where it is as fast as another), npu (NPU: networks and skinning), cpu-tail, cpu, gpu
    /// (GPU: all but the networks) or gpu-alone (the networks too, by shaders), both for one person; and which runtime the networks use: npu=qnn, nnapi, xnnpack or cpu, e.g. npu,npu=qnn
    #[arg(long, value_name = "PLACEMENT", default_value = "auto")]
    pub(crate) placement: PlacementRequest,
    /// Pictures between two motion frames: interpolate (exact, one motion frame late) or extrapolate (at once, and wrong where
    /// motion turns)
    #[arg(long, value_name = "HOW", default_value = "interpolate")]
    pub(crate) latency: Latency,
}

impl LaneChoices {
    /// A session as they say, on what this machine has.
    pub(crate) fn session<'a>(
        &self,
        backends: InferenceBackends<'a>,
        quality: QualityMode,
    ) -> SessionConfig<'a> {
        SessionConfig {
            backends,
            placement: self.placement,
            latency: self.latency.into(),
            quality,
        }
    }
}

/// [`LatencyMode`] by its name.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum Latency {
    Interpolate,
    Extrapolate,
}

impl From<Latency> for LatencyMode {
    fn from(latency: Latency) -> Self {
        match latency {
            Latency::Interpolate => Self::Interpolate,
            Latency::Extrapolate => Self::Extrapolate,
        }
    }
}
