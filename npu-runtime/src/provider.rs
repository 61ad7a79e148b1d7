//! The execution providers and the chips that graphs are compiled for: names and settings only.

use serde::{Serialize, Serializer};
use std::fmt;
use std::str::FromStr;

/// An execution provider with its settings.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Provider {
    /// Qualcomm's Hexagon NPU, or on x86-64 its emulator, through the QNN plugin; never in part on the CPU.
    Qnn {
        /// The chip that the graph is compiled for.
        target: QnnTarget,
    },
    /// Android's neural network interface; never in part on ONNX Runtime's own kernels, and not offered where Android has no device for it but its own code on the
    /// CPU.
    Nnapi,
    /// XNNPACK's CPU kernels, with ONNX Runtime's own for what they lack.
    Xnnpack {
        /// Threads within one operator, at least 1.
        threads: usize,
    },
    /// ONNX Runtime's own CPU kernels.
    Cpu {
        /// Threads within one operator, at least 1.
        threads: usize,
    },
}

impl Provider {
    /// Which of the four kinds it is.
    #[must_use]
    pub fn kind(self) -> ProviderKind {
        match self {
            Self::Qnn { .. } => ProviderKind::Qnn,
            Self::Nnapi => ProviderKind::Nnapi,
            Self::Xnnpack { .. } => ProviderKind::Xnnpack,
            Self::Cpu { .. } => ProviderKind::Cpu,
        }
    }
}

impl fmt::Display for Provider {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Qnn { target } => write!(f, "QNN for {target}"),
            Self::Nnapi => f.write_str("NNAPI"),
            Self::Xnnpack { threads } => write!(f, "XNNPACK with {threads} threads"),
            Self::Cpu { threads } => write!(f, "CPU with {threads} threads"),
        }
    }
}

/// The kinds of providers, in the order in which they are preferred.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum ProviderKind {
    /// [`Provider::Qnn`].
    Qnn,
    /// [`Provider::Nnapi`].
    Nnapi,
    /// [`Provider::Xnnpack`].
    Xnnpack,
    /// [`Provider::Cpu`].
    Cpu,
}

impl ProviderKind {
    /// All, most preferred first.
    pub const ALL: [Self; 4] = [Self::Qnn, Self::Nnapi, Self::Xnnpack, Self::Cpu];

    /// The name by which it is asked for, as [`FromStr`] reads it.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Qnn => "qnn",
            Self::Nnapi => "nnapi",
            Self::Xnnpack => "xnnpack",
            Self::Cpu => "cpu",
        }
    }

    /// Such a provider, for the one chip that is known where it is a chip's, with so many threads (at least 1) where it computes on the
    /// CPU.
    #[must_use]
    pub fn with_threads(self, threads: usize) -> Provider {
        let threads = threads.max(1);
        match self {
            Self::Qnn => Provider::Qnn {
                target: QnnTarget::SXR2230P,
            },
            Self::Nnapi => Provider::Nnapi,
            Self::Xnnpack => Provider::Xnnpack { threads },
            Self::Cpu => Provider::Cpu { threads },
        }
    }

    /// ONNX Runtime's name for it.
    #[must_use]
    pub fn ort_name(self) -> &'static str {
        match self {
            Self::Qnn => "QNNExecutionProvider",
            Self::Nnapi => "NnapiExecutionProvider",
            Self::Xnnpack => "XnnpackExecutionProvider",
            Self::Cpu => "CPUExecutionProvider",
        }
    }
}

impl fmt::Display for ProviderKind {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Qnn => "QNN",
            Self::Nnapi => "NNAPI",
            Self::Xnnpack => "XNNPACK",
            Self::Cpu => "CPU",
        })
    }
}

impl FromStr for ProviderKind {
    type Err = UnknownProvider;

    fn from_str(text: &str) -> Result<Self, Self::Err> {
        Self::ALL
            .into_iter()
            .find(|kind| kind.name() == text)
            .ok_or_else(|| UnknownProvider(text.to_owned()))
    }
}

/// A text that names no kind of provider.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("there is no provider {0:?}; known: {known}", known = ProviderKind::ALL.map(ProviderKind::name).join(", "))]
pub struct UnknownProvider(pub String);

/// A chip with a Hexagon NPU. Only known chips can be named: without a chip's numbers QNN would compile for another one,
/// and its emulator would compute in single precision where the chip computes in half.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct QnnTarget {
    name: &'static str,
    soc_model: u32,
    htp_arch: u32,
}

impl QnnTarget {
    /// Snapdragon XR2 Gen 2, the Quest 3's: Hexagon V69.
    pub const SXR2230P: Self = Self {
        name: "sxr2230p",
        soc_model: 53,
        htp_arch: 69,
    };
    /// All that are known.
    pub const ALL: [Self; 1] = [Self::SXR2230P];

    /// Its name, as [`FromStr`] reads it.
    #[must_use]
    pub fn name(self) -> &'static str {
        self.name
    }

    /// QNN's number for the chip.
    #[must_use]
    pub fn soc_model(self) -> u32 {
        self.soc_model
    }

    /// The Hexagon's architecture.
    #[must_use]
    pub fn htp_arch(self) -> u32 {
        self.htp_arch
    }
}

impl fmt::Display for QnnTarget {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name)
    }
}

impl Serialize for QnnTarget {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.serialize_str(self.name)
    }
}

impl FromStr for QnnTarget {
    type Err = UnknownTarget;

    fn from_str(text: &str) -> Result<Self, Self::Err> {
        Self::ALL
            .into_iter()
            .find(|target| target.name.eq_ignore_ascii_case(text))
            .ok_or_else(|| UnknownTarget(text.to_owned()))
    }
}

/// A text that names no known chip.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("there is no NPU target {0:?}; known: {known}", known = QnnTarget::ALL.map(QnnTarget::name).join(", "))]
pub struct UnknownTarget(pub String);

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_target_is_read_from_its_name_and_always_has_a_chip_number() {
        for target in QnnTarget::ALL {
            assert_eq!(target.name().parse(), Ok(target), "by its own name");
            assert!(target.soc_model() > 0, "{target} has no chip number");
            assert!(target.htp_arch() > 0, "{target} has no architecture");
        }
        assert_eq!("SXR2230P".parse(), Ok(QnnTarget::SXR2230P), "in capitals");
        let error = "sm1".parse::<QnnTarget>().expect_err("no such chip");
        assert!(error.to_string().contains("sxr2230p"), "{error}");
    }

    #[test]
    fn a_provider_is_read_from_its_name() {
        for kind in ProviderKind::ALL {
            assert_eq!(kind.name().parse(), Ok(kind), "by its own name");
            assert_eq!(kind.with_threads(0).kind(), kind, "of its kind");
        }
        let error = "gpu".parse::<ProviderKind>().expect_err("no provider");
        assert!(
            error.to_string().contains("qnn, nnapi, xnnpack, cpu"),
            "{error}"
        );
    }

    #[test]
    fn providers_are_ordered_by_preference() {
        assert!(ProviderKind::ALL.is_sorted(), "the order of the probe");
        let qnn = Provider::Qnn {
            target: QnnTarget::SXR2230P,
        };
        assert_eq!(qnn.kind(), ProviderKind::ALL[0], "the NPU first");
    }
}
