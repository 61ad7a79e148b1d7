//! `XR_EXT_performance_settings`: asks for clocks that hold for as long as a call lasts, and hears when the headset gets hot.
//!
//! Without it the runtime chooses the clocks and says nothing.

use std::fmt;

use openxr::sys::{
    PerfSettingsDomainEXT as Domain, PerfSettingsLevelEXT as Level,
    PerfSettingsNotificationLevelEXT as Notice, PerfSettingsSubDomainEXT as SubDomain,
};
use openxr::{PerfSettingsEXT, Session, Vulkan};

use super::{Absent, outcome, refused};

/// Asks for sustained high levels of CPU and GPU: the highest that a headset promises to hold. To be asked once per session.
///
/// # Errors
/// [`Absent`] where the runtime has no levels or refuses them.
pub fn sustain(session: &Session<Vulkan>) -> Result<(), Absent> {
    let exts = session.instance().exts();
    let fp = exts
        .ext_performance_settings
        .as_ref()
        .ok_or(Absent::NotGranted("XR_EXT_performance_settings"))?;
    for domain in [Domain::CPU, Domain::GPU] {
        // SAFETY: the session is alive.
        let result = unsafe {
            (fp.perf_settings_set_performance_level)(
                session.as_raw(),
                domain,
                Level::SUSTAINED_HIGH,
            )
        };
        outcome(result).map_err(refused("xrPerfSettingsSetPerformanceLevelEXT"))?;
    }
    Ok(())
}

/// Which unit a notice is about.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Unit {
    /// The CPU.
    Cpu,
    /// The GPU.
    Gpu,
}

/// What a unit has too little of.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Cause {
    /// Time for the compositor.
    Compositing,
    /// Time for our pictures.
    Rendering,
    /// Cooling.
    Heat,
}

/// How bad it is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Strain {
    /// Not at all.
    Normal,
    /// Soon to be.
    Warning,
    /// The clocks are lowered.
    Impaired,
}

/// What the runtime says of its strain, for the log.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Thermal {
    /// Where.
    pub unit: Unit,
    /// Why.
    pub cause: Cause,
    /// How it was.
    pub from: Strain,
    /// How it is.
    pub to: Strain,
}

impl Thermal {
    /// The event's meaning. None for one of a later version.
    #[must_use]
    pub fn of(event: &PerfSettingsEXT<'_>) -> Option<Self> {
        let unit = match event.domain() {
            Domain::CPU => Unit::Cpu,
            Domain::GPU => Unit::Gpu,
            _ => return None,
        };
        let cause = match event.sub_domain() {
            SubDomain::COMPOSITING => Cause::Compositing,
            SubDomain::RENDERING => Cause::Rendering,
            SubDomain::THERMAL => Cause::Heat,
            _ => return None,
        };
        Some(Self {
            unit,
            cause,
            from: strain(event.from_level())?,
            to: strain(event.to_level())?,
        })
    }

    /// Whether it got worse.
    #[must_use]
    pub fn worsens(&self) -> bool {
        self.to > self.from
    }
}

fn strain(level: Notice) -> Option<Strain> {
    match level {
        Notice::NORMAL => Some(Strain::Normal),
        Notice::WARNING => Some(Strain::Warning),
        Notice::IMPAIRED => Some(Strain::Impaired),
        _ => None,
    }
}

impl fmt::Display for Thermal {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let unit = match self.unit {
            Unit::Cpu => "CPU",
            Unit::Gpu => "GPU",
        };
        let cause = match self.cause {
            Cause::Compositing => "compositing",
            Cause::Rendering => "rendering",
            Cause::Heat => "heat",
        };
        let to = match self.to {
            Strain::Normal => "back to normal",
            Strain::Warning => "near its limit",
            Strain::Impaired => "beyond its limit",
        };
        write!(f, "the headset's {unit} is {to} ({cause})")
    }
}
