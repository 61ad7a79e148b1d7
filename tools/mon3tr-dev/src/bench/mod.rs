//! `mon3tr-dev bench`: how long drawing, sorting, the CPU's kernels and all lanes together take on this machine and what the latency
//! modes cost, as tables for `docs/performance.md` and as JSON.

mod audience;
mod figure;
mod growth;
mod kernels;
mod lanes;
mod latency_modes;
mod measure;
mod profiler;
mod render;
mod render_options;
mod row;
mod scene;
mod sort;
mod standard;
mod traffic;

use clap::Subcommand;
pub(crate) use measure::median;
use mon3tr::device_options::DeviceOptions;

/// Options of `bench`.
#[derive(Debug, clap::Args)]
pub(crate) struct Options {
    #[command(subcommand)]
    what: What,
}

#[derive(Debug, Subcommand)]
enum What {
    /// Time each stage of drawing: a made-up person of 30k to 1M Gaussians, or a scene of your own
    Render(render_options::Options),
    /// Time the depth sort by itself, from 20k to 4M keys
    Sort(sort::Options),
    /// Measure the error of interpolating and of extrapolating an avatar's states, on real motion
    LatencyModes(latency_modes::Options),
    /// Time interpolation, F_attr's tail, skinning and the networks against the memory they touch
    Kernels(kernels::Options),
    /// Time handing over from lane to lane, and pictures by all lanes at once against the slowest unit alone
    Lanes(lanes::Options),
    /// Measure what an audience costs: one sender, forwarded to 1 to 500 viewers
    Audience(audience::Options),
    /// Time what profiling itself costs
    Profiler(profiler::Options),
}

/// Runs `bench`.
pub(crate) fn run(options: &Options, device: &DeviceOptions) -> anyhow::Result<()> {
    match &options.what {
        What::Render(options) => render::run(options, &device.gpu()?),
        What::Sort(options) => sort::run(options, &device.gpu()?),
        What::LatencyModes(options) => latency_modes::run(options, device),
        What::Kernels(options) => kernels::run(options, device),
        What::Lanes(options) => lanes::run(options, device),
        What::Audience(options) => audience::run(options),
        What::Profiler(options) => profiler::run(options),
    }
}
