//! From counted work to milliseconds, frame rates, and what has to shrink.

use super::people::{Posed, count};
use crate::size::Size;
use app_pipeline::placement::{StageCosts, predicted_picture_ms};
use app_pipeline::plan::Plan;
use app_pipeline::quality::{LADDER, Quality};
use frame_budget::{
    Chip, Estimate, Person, ShaderCosts, StageEstimate, Work, drawing, networks, posing, showing,
    uploading,
};
use npu_runtime::ProviderKind;
use renderer_splat::options::BackEnd;
use renderer_vulkan::gpu::Gpu;
use serde::Serialize;
use std::sync::Arc;

/// Motion frames a second.
const MOTION_HZ: f64 = 30.0;
/// Display rates that are asked after.
pub(super) const RATES: [f64; 2] = [72.0, 90.0];
/// The system raises the GPU's level above this share of its time, which is no rate to rely on.
pub(super) const USABLE: f64 = 0.87;

/// All that is predicted.
#[derive(Debug, Serialize)]
pub(super) struct Budget {
    pub(super) headset: &'static str,
    pub(super) eye: [u32; 2],
    pub(super) distance_metres: f32,
    pub(super) crowds: Vec<Crowd>,
}

/// So many people at once.
#[derive(Debug, Serialize)]
pub(super) struct Crowd {
    pub(super) people: usize,
    pub(super) work: Work,
    /// The GPU's stages where the CPU poses, by each back end.
    pub(super) back_ends: Vec<BackEndEstimate>,
    pub(super) placements: Vec<PlacementEstimate>,
    pub(super) rates: Vec<RateEstimate>,
}

/// The GPU's time by one back end.
#[derive(Debug, Serialize)]
pub(super) struct BackEndEstimate {
    #[serde(serialize_with = "by_name")]
    pub(super) back_end: BackEnd,
    pub(super) stages: Vec<StageEstimate>,
    /// Of a picture, without the system's compositor.
    pub(super) sum: Estimate,
}

/// What a placement comes to, with the back end that is likely the faster.
#[derive(Debug, Serialize)]
pub(super) struct PlacementEstimate {
    pub(super) plan: Plan,
    /// Nothing where the device runs the networks.
    pub(super) provider: Option<ProviderKind>,
    /// Of all people, for each motion frame.
    pub(super) inference: Estimate,
    pub(super) bind: Estimate,
    /// For each picture.
    pub(super) interpolate: Estimate,
    pub(super) draw: Estimate,
    /// From picture to picture, all units at once.
    pub(super) picture: Estimate,
}

/// What a display rate asks for.
#[derive(Debug, Serialize)]
pub(super) struct RateEstimate {
    pub(super) hertz: f64,
    /// What the compositor and the system's governor leave of the period for the GPU, ms.
    pub(super) left_ms: f64,
    /// The best step of quality that is likely to fit; none where none does.
    pub(super) step: Option<Quality>,
    /// The GPU's time at that step, or at the last.
    pub(super) sum: Estimate,
}

fn by_name<S: serde::Serializer>(back_end: &BackEnd, to: S) -> Result<S::Ok, S::Error> {
    to.collect_str(back_end)
}

impl Crowd {
    /// Counts and predicts for these people.
    pub(super) fn predict(
        people: &[&Posed],
        size: Size,
        distance: f32,
        gpu: &Arc<Gpu>,
        costs: &ShaderCosts,
        chip: &Chip,
    ) -> anyhow::Result<Self> {
        let counted = |quality| count(people, quality, size, distance, gpu);
        let work = counted(Quality::of_step(0))?;
        let back_ends = by_back_end(&work, costs, chip)?;
        let figures: Vec<Person> = people.iter().map(|person| person.figures).collect();
        let placements = placements(&figures, &work, &back_ends, costs, chip)?;
        // The same pictures serve both rates.
        let mut sums = vec![(Quality::of_step(0), faster(&back_ends))];
        let mut rates = Vec::new();
        for hertz in RATES {
            let left_ms = USABLE * 1e3 / hertz - chip.compositor.likely;
            let fits = |sum: &Estimate| sum.likely <= left_ms;
            while !sums.iter().any(|(_, sum)| fits(sum)) && sums.len() < LADDER.len() {
                let quality = Quality::of_step(sums.len());
                let mut work = counted(quality)?;
                work.sort_share = 1.0 / f64::from(quality.sort_every);
                sums.push((quality, faster(&by_back_end(&work, costs, chip)?)));
            }
            let found = sums.iter().find(|(_, sum)| fits(sum));
            let last = sums.last().map_or(Estimate::NONE, |(_, sum)| *sum);
            rates.push(RateEstimate {
                hertz,
                left_ms,
                step: found.map(|(quality, _)| *quality),
                sum: found.map_or(last, |(_, sum)| *sum),
            });
        }
        Ok(Self {
            people: people.len(),
            work,
            back_ends,
            placements,
            rates,
        })
    }
}

fn by_back_end(
    work: &Work,
    costs: &ShaderCosts,
    chip: &Chip,
) -> anyhow::Result<Vec<BackEndEstimate>> {
    [BackEnd::Tiles, BackEnd::Quads]
        .into_iter()
        .map(|back_end| {
            let mut stages = vec![uploading(work, chip)];
            stages.extend(drawing(work, back_end, costs, chip)?);
            stages.push(showing(work, back_end, costs, chip)?);
            Ok(BackEndEstimate {
                back_end,
                sum: stages.iter().map(|stage| stage.ms).sum(),
                stages,
            })
        })
        .collect()
}

/// The sum of the back end that is likely the faster.
fn faster(back_ends: &[BackEndEstimate]) -> Estimate {
    let sums = back_ends.iter().map(|one| one.sum);
    sums.min_by(|a, b| a.likely.total_cmp(&b.likely))
        .unwrap_or(Estimate::NONE)
}

fn placements(
    people: &[Person],
    work: &Work,
    back_ends: &[BackEndEstimate],
    costs: &ShaderCosts,
    chip: &Chip,
) -> anyhow::Result<Vec<PlacementEstimate>> {
    let draw = faster(back_ends);
    let mut all = Vec::new();
    for provider in [Some(ProviderKind::Qnn), Some(ProviderKind::Cpu), None] {
        for plan in Plan::ALL {
            // Without an NPU the graph's rest is faster as kernels of the CPU: `bench kernels`.
            let is_slower =
                provider == Some(ProviderKind::Cpu) && matches!(plan, Plan::Npu | Plan::CpuTail);
            if plan.graph().is_some() != provider.is_some() || is_slower {
                continue;
            }
            let on_npu = provider == Some(ProviderKind::Qnn);
            let times = (people.iter()).map(|person| person.times(plan == Plan::Npu, on_npu, chip));
            let mut sum = times.fold([Estimate::NONE; 3], |[a, b, c], one| {
                [a + one.inference, b + one.bind, c + one.interpolate]
            });
            let mut on_gpu = draw;
            if plan.poses_on_device() {
                // The device poses one person only.
                let [person] = people else { continue };
                let stages = posing(work, person.vertices, person.bases, 1.0, costs, chip)?;
                let [pose, interpolate] = stages.as_slice() else {
                    continue;
                };
                let inference = match provider {
                    Some(_) => sum[0],
                    None => networks(person, costs, chip)?.ms,
                };
                sum = [inference, pose.ms, interpolate.ms];
                let upload = uploading(work, chip).ms;
                on_gpu = Estimate::new(
                    draw.least - upload.least,
                    draw.likely - upload.likely,
                    draw.most - upload.most,
                );
            }
            let [inference, bind, interpolate] = sum;
            let picture = |of: fn(Estimate) -> f64| {
                let costs = StageCosts {
                    inference: of(inference),
                    bind: of(bind),
                    interpolate: of(interpolate),
                    // The compositor takes its part of the same GPU.
                    draw: of(on_gpu) + of(chip.compositor),
                };
                predicted_picture_ms(plan, provider, &costs, false)
            };
            all.push(PlacementEstimate {
                plan,
                provider,
                inference,
                bind,
                interpolate,
                draw: on_gpu,
                picture: Estimate::new(
                    picture(|ms| ms.least),
                    picture(|ms| ms.likely),
                    picture(|ms| ms.most),
                ),
            });
        }
    }
    Ok(all)
}

/// Of a unit's time, the share that inference takes at the usual rate of motion.
pub(super) fn unit_share(inference: Estimate) -> Estimate {
    inference * (MOTION_HZ * 1e-3)
}
