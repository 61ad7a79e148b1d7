//! The device's heat as Android sees it: a status in words, and how near it is to being throttled severely.

use std::fmt;
use std::sync::atomic::{AtomicI32, Ordering::Relaxed};
use std::time::{Duration, Instant};

use crate::native::{Listener, System, ThermalManager};

/// The least time between two questions for the headroom: Android answers a faster one with no number.
const EVERY: Duration = Duration::from_secs(1);

/// What Android does about the heat: `AThermalStatus`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum ThermalStatus {
    /// Nothing.
    None,
    /// Users do not notice.
    Light,
    /// Users hardly notice.
    Moderate,
    /// Users notice.
    Severe,
    /// Everything that it can.
    Critical,
    /// Parts are being switched off.
    Emergency,
    /// The device switches itself off.
    Shutdown,
}

impl ThermalStatus {
    /// None for Android's error, or what a newer Android may say.
    fn of(status: i32) -> Option<Self> {
        Some(match status {
            0 => Self::None,
            1 => Self::Light,
            2 => Self::Moderate,
            3 => Self::Severe,
            4 => Self::Critical,
            5 => Self::Emergency,
            6 => Self::Shutdown,
            _ => return None,
        })
    }

    /// 0 to 6, as Android counts.
    #[must_use]
    pub fn level(self) -> u8 {
        self as u8
    }
}

impl fmt::Display for ThermalStatus {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::None => "cool",
            Self::Light => "slightly throttled, by heat",
            Self::Moderate => "moderately throttled, by heat",
            Self::Severe => "severely throttled, by heat",
            Self::Critical => "throttled as far as it can be, by heat",
            Self::Emergency => "switching parts off, by heat",
            Self::Shutdown => "about to switch off, by heat",
        })
    }
}

/// Asks for the device's heat.
#[derive(Debug)]
pub struct Thermal {
    manager: ThermalManager,
    /// When the headroom was asked for, and the answer.
    headroom: Option<(Instant, Option<f32>)>,
}

impl Thermal {
    /// None where the platform does not tell.
    #[must_use]
    pub fn open(system: System) -> Option<Self> {
        Some(Self {
            manager: ThermalManager::acquire(system.thermal?)?,
            headroom: None,
        })
    }

    /// What Android does about the heat now, if it says.
    #[must_use]
    pub fn status(&self) -> Option<ThermalStatus> {
        ThermalStatus::of(self.manager.status())
    }

    /// How warm the device will be in so many seconds if it goes on like this, as a share of what makes Android throttle it severely: 1 is there,
    /// and it may be more. None where that is not known. Asked for again within a second of `now` it is the last answer.
    pub fn headroom(&mut self, seconds_ahead: u8, now: Instant) -> Option<f32> {
        if let Some((at, answer)) = self.headroom
            && now.saturating_duration_since(at) < EVERY
        {
            return answer;
        }
        let answer = self.manager.headroom(seconds_ahead.into());
        let answer = answer.filter(|share| share.is_finite() && *share >= 0.0);
        self.headroom = Some((now, answer));
        answer
    }
}

/// The status that was logged last, in this process.
static LOGGED: AtomicI32 = AtomicI32::new(0);

/// Logs what Android does about the heat whenever that changes, until it is dropped.
#[derive(Debug)]
pub struct HeatLog {
    _manager: ThermalManager,
}

impl HeatLog {
    /// None where the platform does not tell.
    #[must_use]
    pub fn start(system: System) -> Option<Self> {
        let mut manager = ThermalManager::acquire(system.thermal?)?;
        // It may be warm already.
        Logged::changed(manager.status());
        if !manager.listen::<Logged>() {
            log::debug!("Android does not tell when the thermal status changes");
            return None;
        }
        Some(Self { _manager: manager })
    }
}

struct Logged;

impl Listener for Logged {
    /// Logs another status than the last one.
    fn changed(status: i32) {
        let Some(now) = ThermalStatus::of(status) else {
            return;
        };
        let before = LOGGED.swap(status, Relaxed);
        if before == status {
            return;
        }
        if now >= ThermalStatus::Severe && status > before {
            log::warn!("the device is {now}");
        } else {
            log::info!("the device is {now}");
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fake;

    #[test]
    fn the_status_is_in_words_and_what_android_cannot_say_is_nothing() {
        let _here = fake::alone();
        let thermal = Thermal::open(fake::system()).expect("a manager");
        for (status, expected) in [
            (0, Some(ThermalStatus::None)),
            (3, Some(ThermalStatus::Severe)),
            (6, Some(ThermalStatus::Shutdown)),
            (-1, None),
            (7, None),
        ] {
            fake::set(|fake| fake.status = status);
            assert_eq!(thermal.status(), expected, "{status}");
        }
        assert_eq!(ThermalStatus::Shutdown.level(), 6, "as Android counts");
        drop(thermal);
        assert_eq!(fake::set(|fake| fake.managers), 0, "released");
    }

    #[test]
    fn headroom_is_asked_for_once_a_second_and_only_numbers_are_answers() {
        let _here = fake::alone();
        let mut thermal = Thermal::open(fake::system()).expect("a manager");
        let begin = Instant::now();
        let after = |milliseconds| begin + Duration::from_millis(milliseconds);
        fake::set(|fake| fake.headroom = 0.75);
        assert_eq!(thermal.headroom(10, begin), Some(0.75), "the first");
        fake::set(|fake| fake.headroom = 0.875);
        assert_eq!(thermal.headroom(10, after(999)), Some(0.75), "too early");
        assert_eq!(thermal.headroom(10, after(1_000)), Some(0.875), "again");
        assert_eq!(fake::set(|fake| fake.forecasts.clone()), [10, 10], "calls");
        for (at, wrong) in [(2_000, f32::NAN), (3_000, f32::INFINITY), (4_000, -1.0)] {
            fake::set(|fake| fake.headroom = wrong);
            assert_eq!(thermal.headroom(10, after(at)), None, "{wrong}");
            assert_eq!(thermal.headroom(10, after(at + 500)), None, "held too");
        }
        assert_eq!(fake::set(|fake| fake.forecasts.len()), 5, "calls");
    }

    #[test]
    fn an_android_of_level_30_has_a_status_and_no_headroom_and_an_older_one_neither() {
        let _here = fake::alone();
        let mut system = fake::system();
        if let Some(thermal) = &mut system.thermal {
            thermal.headroom = None;
        }
        let mut thermal = Thermal::open(system).expect("a manager");
        assert_eq!(thermal.status(), Some(ThermalStatus::None), "the status");
        assert_eq!(thermal.headroom(0, Instant::now()), None, "no function");
        assert!(Thermal::open(System::default()).is_none(), "nothing");
        assert!(HeatLog::start(System::default()).is_none(), "nothing");
        fake::set(|fake| fake.gives_managers = false);
        assert!(Thermal::open(fake::system()).is_none(), "no manager");
    }

    #[test]
    fn each_change_of_the_status_is_a_line_until_nobody_listens() {
        let _here = fake::alone();
        let _ = fake::logged();
        fake::set(|fake| fake.status = 1);
        let log = HeatLog::start(fake::system()).expect("a listener");
        for status in [1, 3, 3, -1, 2, 0] {
            fake::tell_status(status);
        }
        assert_eq!(
            fake::logged(),
            [
                "INFO the device is slightly throttled, by heat",
                "WARN the device is severely throttled, by heat",
                "INFO the device is moderately throttled, by heat",
                "INFO the device is cool",
            ],
            "lines"
        );
        drop(log);
        assert_eq!(fake::set(|fake| fake.listeners), 0, "nobody listens");
        assert_eq!(fake::set(|fake| fake.managers), 0, "released");
        fake::set(|fake| fake.registers = false);
        assert!(HeatLog::start(fake::system()).is_none(), "refused");
        assert_eq!(fake::set(|fake| fake.managers), 0, "released too");
    }
}
