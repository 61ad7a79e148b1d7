//! Which placement is fastest: times of stages on each legal unit in, predicted picture times out.
//!
//! Stages on one piece of silicon add up, stages on different ones overlap: the slowest piece sets the pace. A provider that
//! computes on the CPU shares it with the CPU's stages, and so does a GPU that is software.

use crate::plan::{Plan, unit_of};
use crate::stage::Unit;
use npu_runtime::ProviderKind;
use serde::Serialize;
use std::fmt;

/// Milliseconds of stages, measured one at a time.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct StageCosts {
    /// The deform graph's part, once for every motion frame.
    pub inference: f64,
    /// LBS (where it is apart), F_attr's tail and F_m2g, once for every motion frame.
    pub bind: f64,
    /// Interpolation and packing, once for every picture.
    pub interpolate: f64,
    /// Upload, projection, sort and splatting, once for every picture.
    pub draw: f64,
}

/// A placement, what it would cost, or why it cannot be had.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Alternative {
    /// How stages are divided.
    pub plan: Plan,
    /// What runs the graph; nothing where the device runs the networks.
    pub provider: Option<ProviderKind>,
    /// The unit that it runs on.
    pub unit: Unit,
    /// What its stages took.
    pub costs: Option<StageCosts>,
    /// Milliseconds from picture to picture, if it were chosen.
    pub predicted_ms: Option<f64>,
    /// Why it is not to be had, or was not tried.
    pub refused: Option<String>,
}

impl Alternative {
    /// The plan and what runs its graph, as tables name them.
    #[must_use]
    pub fn name(&self) -> String {
        named(self.plan, self.provider)
    }
}

/// A plan and what runs its graph, if anything but the plan's own shaders does.
pub(super) fn named(plan: Plan, provider: Option<impl fmt::Display>) -> String {
    provider.map_or_else(
        || plan.to_string(),
        |provider| format!("{plan} on {provider}"),
    )
}

/// Motion frames a second that predictions reckon with.
const MOTION_HZ: f64 = 30.0;
/// The plan that is taken unless another is faster by more than [`MARGIN`]. Of its providers the fastest is, in the order of
/// [`ProviderKind::ALL`] where they are equal.
pub(super) const PREFERRED: Plan = Plan::Npu;
/// By how much measurements waver, a share of the time.
const MARGIN: f64 = 0.03;

/// Milliseconds from picture to picture when all units work at once.
#[must_use]
pub fn predicted_picture_ms(
    plan: Plan,
    provider: Option<ProviderKind>,
    costs: &StageCosts,
    gpu_is_cpu: bool,
) -> f64 {
    let gpu = if gpu_is_cpu { Unit::Cpu } else { Unit::Gpu };
    let posing = if plan.poses_on_device() {
        gpu
    } else {
        Unit::Cpu
    };
    let networks = provider.map_or(gpu, unit_of);
    let pace = Unit::ALL.map(|silicon| {
        let on = |unit: Unit, ms: f64| if unit == silicon { ms } else { 0.0 };
        let a_motion = on(networks, costs.inference) + on(posing, costs.bind);
        let a_picture = on(posing, costs.interpolate) + on(gpu, costs.draw);
        // What motion leaves of a second is for pictures. If it leaves nothing, motion frames are dropped, one a picture done.
        let left = 1.0 - a_motion * MOTION_HZ * 1e-3;
        (a_picture / left.max(1e-6)).min(a_picture + a_motion)
    });
    pace.into_iter().fold(0.0, f64::max)
}

/// The alternatives that [`choose`] may still take when more have been measured: the fastest, and the fastest of the preferred plan.
/// One that is neither never will be again.
pub(super) fn contenders(alternatives: &[Alternative]) -> [Option<usize>; 2] {
    let fastest_where = |wanted: fn(Plan) -> bool| {
        let possible = alternatives.iter().enumerate().filter_map(|(at, one)| {
            let ms = one.predicted_ms.filter(|_| wanted(one.plan))?;
            Some((at, ms))
        });
        possible
            .min_by(|a, b| a.1.total_cmp(&b.1))
            .map(|(at, _)| at)
    };
    [
        fastest_where(|_| true),
        fastest_where(|plan| plan == PREFERRED),
    ]
}

/// The index of the alternative to take: the fastest, the preferred plan where it makes no difference. `None` if none is to be had.
#[must_use]
pub fn choose(alternatives: &[Alternative]) -> Option<usize> {
    let predicted = |at: usize| alternatives.get(at).and_then(|one| one.predicted_ms);
    let [fastest, preferred] = contenders(alternatives);
    let least = predicted(fastest?)?;
    preferred
        .filter(|at| predicted(*at).is_some_and(|ms| ms <= least * (1.0 + MARGIN)))
        .or(fastest)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn costs(inference: f64, bind: f64, interpolate: f64, draw: f64) -> StageCosts {
        StageCosts {
            inference,
            bind,
            interpolate,
            draw,
        }
    }

    #[test]
    fn units_overlap_and_stages_on_one_add_up() {
        // By hand: the NPU is busy 30 x 10 ms a second, the CPU 30 x 5 ms and 2 ms a picture, the GPU 8 ms a picture.
        let paper = costs(10.0, 5.0, 2.0, 8.0);
        let ms = predicted_picture_ms(Plan::Npu, Some(ProviderKind::Qnn), &paper, false);
        assert!((ms - 8.0).abs() < 1e-9, "the GPU sets the pace: {ms}");
        // With a slow CPU that is 2 / (1 - 0.75).
        let slow = costs(10.0, 25.0, 2.0, 7.0);
        let ms = predicted_picture_ms(Plan::Npu, Some(ProviderKind::Qnn), &slow, false);
        assert!((ms - 8.0).abs() < 1e-9, "the CPU: {ms}");
        // All on one processor: (2 + 8) / (1 - 0.03 x 15).
        let ms = predicted_picture_ms(Plan::Npu, Some(ProviderKind::Cpu), &paper, true);
        assert!((ms - 10.0 / 0.55).abs() < 1e-9, "all together: {ms}");
        // On a GPU of its own everything but the networks.
        let ms = predicted_picture_ms(Plan::Gpu, Some(ProviderKind::Cpu), &paper, false);
        assert!((ms - 10.0 / 0.85).abs() < 1e-9, "posing on the GPU: {ms}");
        // And the networks there too: (2 + 8) / (1 - 0.03 x 15), with nothing left for the CPU.
        let ms = predicted_picture_ms(Plan::GpuAlone, None, &paper, false);
        assert!((ms - 10.0 / 0.55).abs() < 1e-9, "the GPU alone: {ms}");
        // More motion than there is time for.
        let ms = predicted_picture_ms(
            Plan::Npu,
            Some(ProviderKind::Cpu),
            &costs(50.0, 5.0, 2.0, 8.0),
            true,
        );
        assert!((ms - 65.0).abs() < 1e-9, "one motion a picture: {ms}");
    }

    #[test]
    fn the_fastest_is_chosen_and_the_npus_where_it_makes_no_difference() {
        let one = |plan, predicted_ms| Alternative {
            plan,
            provider: Some(ProviderKind::Cpu),
            unit: Unit::Cpu,
            costs: None,
            predicted_ms,
            refused: None,
        };
        let mut alternatives = [
            one(Plan::Npu, Some(10.2)),
            one(Plan::CpuTail, Some(10.0)),
            one(Plan::Gpu, None),
        ];
        assert_eq!(
            choose(&alternatives),
            Some(0),
            "within what measurements waver"
        );
        alternatives[1].predicted_ms = Some(8.0);
        assert_eq!(choose(&alternatives), Some(1), "the fastest");
        alternatives[0].predicted_ms = None;
        assert_eq!(choose(&alternatives), Some(1), "without the NPU's");
        alternatives[1].predicted_ms = None;
        assert_eq!(choose(&alternatives), None, "none");
    }

    #[test]
    fn what_is_chosen_in_the_end_was_a_contender_from_the_time_it_was_measured() {
        let rng = &mut fastrand::Rng::with_seed(7);
        let mut preferred_of_two = 0;
        for _ in 0..2000 {
            let mut alternatives = Vec::new();
            let mut open = Vec::<bool>::new();
            for provider in [
                ProviderKind::Nnapi,
                ProviderKind::Xnnpack,
                ProviderKind::Cpu,
            ] {
                for plan in Plan::ALL {
                    alternatives.push(Alternative {
                        plan,
                        provider: Some(provider),
                        unit: unit_of(provider),
                        costs: None,
                        // Many within the margin of one another.
                        predicted_ms: (rng.u8(0..5) > 0).then(|| 10.0 + 0.6 * rng.f64()),
                        refused: None,
                    });
                    open.push(true);
                    let contenders = contenders(&alternatives);
                    for (at, open) in open.iter_mut().enumerate() {
                        *open &= contenders.contains(&Some(at));
                    }
                }
            }
            let chosen = choose(&alternatives).expect("some time of twelve");
            assert!(open[chosen], "closed too early: {alternatives:?}");
            let least = (alternatives.iter().filter_map(|one| one.predicted_ms))
                .fold(f64::INFINITY, f64::min);
            let ms = alternatives[chosen].predicted_ms.expect("measured");
            preferred_of_two += u32::from(ms > least);
        }
        assert!(
            preferred_of_two > 100,
            "the preferred plan was never slower: {preferred_of_two}"
        );
    }
}
