//! Where stages run: what can be asked for, by name.

use crate::stage::{Stage, Unit};
use npu_runtime::ProviderKind;
use serde::Serialize;
use spmm3::networks::GraphParts;
use std::fmt;
use std::str::FromStr;

/// A division of a frame's way among the units. Sorting and splatting are the GPU's in all of them, kinematics the CPU's.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Plan {
    /// The paper's: inference and LBS on the NPU, F_m2g and interpolation on the CPU. The whole graph is one ONNX model.
    Npu,
    /// F_attr's tail leaves the graph for a kernel on the CPU that fuses it with F_m2g.
    CpuTail,
    /// LBS leaves the graph as well: the networks alone are ONNX.
    Cpu,
    /// Everything on the GPU but the networks: Gaussians stay in device memory, and nothing is uploaded but vertices.
    Gpu,
    /// The networks as well, as compute shaders: nothing is uploaded but motion and joints. The paper's way on a PC.
    GpuAlone,
}

impl Plan {
    /// All of them, the NPU's first.
    pub const ALL: [Self; 5] = [
        Self::Npu,
        Self::CpuTail,
        Self::Cpu,
        Self::Gpu,
        Self::GpuAlone,
    ];

    /// The name it is asked for by.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Npu => "npu",
            Self::CpuTail => "cpu-tail",
            Self::Cpu => "cpu",
            Self::Gpu => "gpu",
            Self::GpuAlone => "gpu-alone",
        }
    }

    /// What of the deform graph is left to ONNX Runtime; nothing where the device does all of it.
    #[must_use]
    pub fn graph(self) -> Option<GraphParts> {
        match self {
            Self::Npu => Some(GraphParts::Whole),
            Self::CpuTail => Some(GraphParts::Skinned),
            Self::Cpu | Self::Gpu => Some(GraphParts::Networks),
            Self::GpuAlone => None,
        }
    }

    /// Whether the device poses the Gaussians, which it can for one person only.
    #[must_use]
    pub fn poses_on_device(self) -> bool {
        matches!(self, Self::Gpu | Self::GpuAlone)
    }

    /// The unit of a stage, if what is left to ONNX Runtime runs on `inference`.
    #[must_use]
    pub fn unit(self, stage: Stage, inference: Unit) -> Unit {
        match (stage, self) {
            (Stage::Inference, Self::GpuAlone) => Unit::Gpu,
            (Stage::Inference, _) | (Stage::Skin, Self::Npu | Self::CpuTail) => inference,
            (Stage::Skin | Stage::Bind | Stage::Interpolate, Self::Gpu | Self::GpuAlone) => {
                Unit::Gpu
            }
            (Stage::Kinematics | Stage::Skin | Stage::Bind | Stage::Interpolate, _) => Unit::Cpu,
            (Stage::Upload | Stage::Project | Stage::Sort | Stage::Bin | Stage::Raster, _) => {
                Unit::Gpu
            }
        }
    }
}

impl fmt::Display for Plan {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

/// Where a kind of provider computes.
#[must_use]
pub fn unit_of(provider: ProviderKind) -> Unit {
    match provider {
        ProviderKind::Qnn | ProviderKind::Nnapi => Unit::Npu,
        ProviderKind::Xnnpack | ProviderKind::Cpu => Unit::Cpu,
    }
}

/// The placement asked for. What is left open is measured.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize)]
pub struct PlacementRequest {
    /// This plan and no other.
    pub plan: Option<Plan>,
    /// This provider and no other.
    pub provider: Option<ProviderKind>,
    /// For people who come and go: plans that pose on the device are left out, for it poses one person only.
    pub for_several: bool,
}

impl FromStr for PlacementRequest {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let mut request = Self::default();
        for part in text.split(',') {
            match part.split_once('=') {
                None if part == "auto" => {}
                None => {
                    let named = Plan::ALL.into_iter().find(|plan| plan.name() == part);
                    let plan = named.ok_or_else(|| refusal(text))?;
                    if let Some(before) = request.plan.replace(plan) {
                        return Err(format!(
                            "{text} names {before} and {plan}: give one of them"
                        ));
                    }
                }
                Some(("npu", name)) => {
                    request.provider = Some(name.parse().map_err(|_| refusal(text))?);
                }
                Some(_) => return Err(refusal(text)),
            }
        }
        if let (Some(Plan::GpuAlone), Some(provider)) = (request.plan, request.provider) {
            return Err(format!(
                "{text}: gpu-alone takes no provider, for its networks are shaders; leave out npu={}",
                provider.name()
            ));
        }
        Ok(request)
    }
}

fn refusal(text: &str) -> String {
    format!(
        "{text} is no placement: give auto, or npu, cpu-tail, cpu or gpu, and npu=qnn, npu=nnapi, npu=xnnpack or npu=cpu, \
         with a comma between, e.g. npu,npu=qnn; or gpu-alone"
    )
}

impl fmt::Display for PlacementRequest {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match (self.plan, self.provider) {
            (None, None) => f.write_str("auto"),
            (Some(plan), None) => write!(f, "{plan}"),
            (None, Some(provider)) => write!(f, "npu={}", provider.name()),
            (Some(plan), Some(provider)) => write!(f, "{plan},npu={}", provider.name()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_request_reads_as_it_is_written() {
        let plans = Plan::ALL.into_iter().map(Some).chain([None]);
        for plan in plans {
            for provider in ProviderKind::ALL.into_iter().map(Some).chain([None]) {
                let request = PlacementRequest {
                    plan,
                    provider,
                    for_several: false,
                };
                if plan == Some(Plan::GpuAlone) && provider.is_some() {
                    let error = request.to_string().parse::<PlacementRequest>();
                    assert!(error.is_err_and(|why| why.contains("takes no provider")));
                    continue;
                }
                assert_eq!(request.to_string().parse(), Ok(request), "{request}");
            }
        }
        let twice = "npu,cpu".parse::<PlacementRequest>();
        assert!(twice.is_err_and(|why| why.contains("give one")));
        for wrong in ["", "card", "npu=gpu", "gpu=npu", "npu;npu=cpu", "fast"] {
            let error = wrong.parse::<PlacementRequest>().expect_err(wrong);
            assert!(error.contains("npu,npu=qnn"), "{error}");
        }
    }

    #[test]
    fn every_plan_puts_every_stage_on_a_legal_unit() {
        for plan in Plan::ALL {
            for provider in ProviderKind::ALL {
                for stage in Stage::ALL {
                    let unit = plan.unit(stage, unit_of(provider));
                    assert!(
                        stage.legal_units().contains(&unit),
                        "{plan}: {stage:?} on the {}",
                        unit.name()
                    );
                }
            }
        }
        for stage in Stage::ALL {
            assert_eq!(
                Plan::Npu.unit(stage, Unit::Npu),
                stage.legal_units()[0],
                "the paper's choice for {stage:?} comes first"
            );
        }
    }
}
