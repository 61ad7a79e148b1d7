//! Which of a machine's Vulkan devices to draw on.

use std::convert::Infallible;
use std::fmt;
use std::str::FromStr;

use ash::vk;

/// Which device to open, as `--gpu auto|lavapipe|NAME` says it.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub enum GpuChoice {
    /// The best there is that can draw: discrete, then integrated, then virtual, then a CPU.
    #[default]
    Auto,
    /// Mesa's software driver.
    Lavapipe,
    /// The best device that can draw and whose name has this in it, whatever the case.
    Named(String),
}

impl FromStr for GpuChoice {
    type Err = Infallible;

    fn from_str(text: &str) -> Result<Self, Infallible> {
        Ok(match text.to_lowercase().as_str() {
            "auto" | "" => Self::Auto,
            "lavapipe" | "llvmpipe" => Self::Lavapipe,
            _ => Self::Named(text.to_owned()),
        })
    }
}

impl fmt::Display for GpuChoice {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Auto => f.write_str("auto"),
            Self::Lavapipe => f.write_str("lavapipe"),
            Self::Named(name) => f.write_str(name),
        }
    }
}

impl GpuChoice {
    /// Whether a device of that name and driver may be opened.
    pub(crate) fn accepts(&self, device_name: &str, driver: vk::DriverId) -> bool {
        match self {
            Self::Auto => true,
            Self::Lavapipe => {
                driver == vk::DriverId::MESA_LLVMPIPE || device_name.contains("llvmpipe")
            }
            Self::Named(wanted) => device_name.to_lowercase().contains(&wanted.to_lowercase()),
        }
    }
}

/// Smaller is better.
pub(crate) fn rank(kind: vk::PhysicalDeviceType) -> u32 {
    match kind {
        vk::PhysicalDeviceType::DISCRETE_GPU => 0,
        vk::PhysicalDeviceType::INTEGRATED_GPU => 1,
        vk::PhysicalDeviceType::VIRTUAL_GPU => 2,
        vk::PhysicalDeviceType::CPU => 3,
        _ => 4,
    }
}

/// The first that succeeds, else the first error; nothing of nothing. The errors of better devices than the
/// one found are logged.
pub(crate) fn first_usable<T, E: fmt::Display>(
    outcomes: impl IntoIterator<Item = Result<T, E>>,
) -> Option<Result<T, E>> {
    let mut failures = Vec::new();
    for outcome in outcomes {
        match outcome {
            Ok(usable) => {
                for why in failures {
                    log::warn!("passed over: {why}");
                }
                return Some(Ok(usable));
            }
            Err(why) => failures.push(why),
        }
    }
    failures.into_iter().next().map(Err)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_first_device_that_can_draw_is_taken_else_the_first_error() {
        let usable = first_usable([Err("old"), Ok(1), Ok(2)]);
        assert_eq!(usable, Some(Ok(1)), "an old device before two usable ones");
        let none: Option<Result<u32, _>> = first_usable([Err("old"), Err("odd")]);
        assert_eq!(none, Some(Err("old")), "two that cannot draw");
        let empty = first_usable(std::iter::empty::<Result<u32, &str>>());
        assert_eq!(empty, None, "no device");
    }

    #[test]
    fn a_choice_reads_back_what_it_prints() {
        for text in ["auto", "lavapipe", "GeForce RTX"] {
            let choice: GpuChoice = text.parse().expect("infallible");
            assert_eq!(choice.to_string(), text, "printed form");
        }
    }

    #[test]
    fn a_name_matches_any_part_of_a_device_name_in_any_case() {
        let choice = GpuChoice::Named("h200".to_owned());
        assert!(
            choice.accepts("NVIDIA H200", vk::DriverId::NVIDIA_PROPRIETARY),
            "other case"
        );
        assert!(
            !choice.accepts("llvmpipe (LLVM 19)", vk::DriverId::MESA_LLVMPIPE),
            "other name"
        );
    }

    #[test]
    fn lavapipe_is_known_by_its_driver_or_its_name() {
        assert!(
            GpuChoice::Lavapipe.accepts("anything", vk::DriverId::MESA_LLVMPIPE),
            "by driver"
        );
        assert!(
            GpuChoice::Lavapipe.accepts("llvmpipe (LLVM 15)", vk::DriverId::default()),
            "by name"
        );
        assert!(
            !GpuChoice::Lavapipe.accepts("NVIDIA", vk::DriverId::NVIDIA_PROPRIETARY),
            "a GPU"
        );
    }
}
