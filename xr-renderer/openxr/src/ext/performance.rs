//! `XR_EXT_performance_settings`: asks for clock levels that the headset can sustain, and reports when it gets hot.
//!
//! Without it the runtime chooses the clocks and says nothing.

use std::fmt;

use openxr::sys::{
    PerfSettingsDomainEXT as Domain, PerfSettingsLevelEXT as Level,
    PerfSettingsNotificationLevelEXT as Notice, PerfSettingsSubDomainEXT as SubDomain,
};
use openxr::{PerfSettingsEXT, Session, Vulkan};

use super::{Absent, outcome, refused};

/// Asks for sustained high levels of CPU and GPU: the highest that a headset promises to hold. Call it once per session.
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

/// What a unit is short of.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Cause {
    /// Time for the compositor.
    Compositing,
    /// Time for our pictures.
    Rendering,
    /// Cooling.
    Heat,
}

/// How severe it is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Strain {
    /// Normal.
    Normal,
    /// Warning: near its limit.
    Warning,
    /// The clocks are lowered.
    Impaired,
}

/// A performance notice of the runtime, for the log.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Thermal {
    /// The unit.
    pub unit: Unit,
    /// The cause.
    pub cause: Cause,
    /// The level before.
    pub from: Strain,
    /// The level now.
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fake::FakeRuntime;
    use openxr::sys::EventDataPerfSettingsEXT;
    use openxr::{Event, EventDataBuffer};

    fn heard(sub_domain: SubDomain, from: Notice, to: Notice) -> Option<Thermal> {
        let fake = FakeRuntime::with_everything();
        let instance = fake.instance();
        fake.queue(EventDataPerfSettingsEXT {
            ty: EventDataPerfSettingsEXT::TYPE,
            next: std::ptr::null(),
            domain: Domain::GPU,
            sub_domain,
            from_level: from,
            to_level: to,
        });
        let mut buffer = EventDataBuffer::new();
        match instance.poll_event(&mut buffer).expect("polled") {
            Some(Event::PerfSettingsEXT(event)) => Thermal::of(&event),
            _ => panic!("the event that was queued comes"),
        }
    }

    #[test]
    fn both_units_are_asked_to_hold_a_high_level() {
        let fake = FakeRuntime::with_everything();
        let (session, _, _) = fake.session(&fake.instance());
        sustain(&session).expect("granted");
        let asked = fake.calls("xrPerfSettingsSetPerformanceLevelEXT");
        assert_eq!(asked, ["CPU SUSTAINED_HIGH", "GPU SUSTAINED_HIGH"], "asked");
    }

    #[test]
    fn a_performance_notice_has_unit_cause_and_level() {
        let thermal = heard(SubDomain::THERMAL, Notice::NORMAL, Notice::WARNING);
        let thermal = thermal.expect("a known event");
        assert!(thermal.worsens(), "{thermal:?}");
        assert_eq!(
            thermal.to_string(),
            "the headset's GPU is near its limit (heat)",
            "for the log"
        );
        let cooler = heard(SubDomain::THERMAL, Notice::IMPAIRED, Notice::NORMAL);
        assert!(!cooler.expect("a known event").worsens(), "cooler");
    }

    #[test]
    fn an_event_of_a_later_version_is_ignored() {
        let unknown = heard(SubDomain::from_raw(9), Notice::NORMAL, Notice::WARNING);
        assert_eq!(unknown, None, "a cause of the future");
        let unknown = heard(SubDomain::THERMAL, Notice::NORMAL, Notice::from_raw(99));
        assert_eq!(unknown, None, "a level of the future");
    }
}
