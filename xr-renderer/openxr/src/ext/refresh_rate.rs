//! `XR_FB_display_refresh_rate`: asks for 72 Hz, and for more where frames keep up with room to spare.
//!
//! Without it the display's rate stays; its period is what the runtime predicts with every frame.

use openxr::{Session, Vulkan};

use super::rate_choice::{FrameTiming, RateChoice};
use super::{Absent, refused};

const EXTENSION: &str = "XR_FB_display_refresh_rate";

/// The rate to start with: the lowest that headsets offer.
pub const DEFAULT_HZ: f32 = 72.0;

/// The display's refresh rate, and requests for another.
pub struct RefreshRate {
    session: Session<Vulkan>,
    choice: RateChoice,
}

impl std::fmt::Debug for RefreshRate {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("RefreshRate")
            .field("choice", &self.choice)
            .finish_non_exhaustive()
    }
}

impl RefreshRate {
    /// Lists the display's rates and asks for the one nearest to the wanted, the lowest that is chosen.
    ///
    /// # Errors
    /// [`Absent`] where the runtime lists none. A request that it refuses is logged only: the display keeps its rate.
    pub fn new(session: &Session<Vulkan>, wanted_hz: f32) -> Result<Self, Absent> {
        let instance = session.instance();
        if instance.exts().fb_display_refresh_rate.is_none() {
            return Err(Absent::NotGranted(EXTENSION));
        }
        let rates = session
            .enumerate_display_refresh_rates()
            .map_err(refused("xrEnumerateDisplayRefreshRatesFB"))?;
        let choice = RateChoice::new(&rates, wanted_hz).ok_or(Absent::NotBySystem(EXTENSION))?;
        let mut this = Self {
            session: session.clone(),
            choice,
        };
        let start = this.choice.now_hz();
        let now = session
            .get_display_refresh_rate()
            .map_err(refused("xrGetDisplayRefreshRateFB"))?;
        if now != start && !this.request(start) {
            this.choice.is(now);
        }
        Ok(this)
    }

    /// As [`Self::new`], but the rate stays the nearest to the wanted, whether frames are in time or not.
    ///
    /// # Errors
    /// As [`Self::new`].
    pub fn fixed(session: &Session<Vulkan>, wanted_hz: f32) -> Result<Self, Absent> {
        let mut this = Self::new(session, wanted_hz)?;
        this.choice.stay();
        Ok(this)
    }

    /// The rates there are, rising, Hz.
    #[must_use]
    pub fn rates(&self) -> &[f32] {
        self.choice.rates()
    }

    /// The present rate, or the one last asked for, Hz.
    #[must_use]
    pub fn now_hz(&self) -> f32 {
        self.choice.now_hz()
    }

    /// Takes the runtime's event that the rate changed (`XrEventDataDisplayRefreshRateChangedFB`): because it was asked to, or by itself.
    pub fn changed(&mut self, to_hz: f32) {
        log::info!("the display is refreshed at {to_hz} Hz");
        self.choice.is(to_hz);
    }

    /// Takes the timing of a frame. Call it for every frame, in the order of display; the rate goes up one step after seconds with
    /// room for it, and down again when frames are missed.
    pub fn consider(&mut self, frame: &FrameTiming) {
        let before = self.now_hz();
        if let Some(hz) = self.choice.consider(frame)
            && !self.request(hz)
        {
            self.choice.is(before);
            self.choice.refuse(hz);
        }
    }

    fn request(&self, hz: f32) -> bool {
        match self.session.request_display_refresh_rate(hz) {
            Ok(()) => {
                log::info!("asked for a display rate of {hz} Hz");
                true
            }
            Err(why) => {
                log::warn!("the runtime refuses a display rate of {hz} Hz: {why}");
                false
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fake::FakeRuntime;
    use openxr::sys::Result as XrResult;
    use openxr::{Event, EventDataBuffer};

    const REQUEST: &str = "xrRequestDisplayRefreshRateFB";

    fn run(rate: &mut RefreshRate, from_s: u32, to_s: u32, in_time: bool) {
        for tenth in from_s * 10..to_s * 10 {
            rate.consider(&FrameTiming {
                display_s: f64::from(tenth) * 0.1,
                in_time,
                busy_ms: 3.0,
            });
        }
    }

    #[test]
    fn it_requests_the_default_and_a_higher_rate_when_frames_are_in_time() {
        let fake = FakeRuntime::with_everything();
        fake.set(|world| world.rate_hz = 60.0);
        let (session, _, _) = fake.session(&fake.instance());
        let mut rate = RefreshRate::new(&session, DEFAULT_HZ).expect("rates");
        run(&mut rate, 0, 20, true);
        assert_eq!(fake.calls(REQUEST), ["72", "90", "120"], "asked for");
        run(&mut rate, 20, 22, false);
        assert_eq!(fake.calls(REQUEST)[3..], ["90", "72"], "and back");
    }

    #[test]
    fn a_fixed_rate_is_requested_once_and_kept() {
        let fake = FakeRuntime::with_everything();
        let (session, _, _) = fake.session(&fake.instance());
        let mut rate = RefreshRate::fixed(&session, 90.0).expect("rates");
        run(&mut rate, 0, 20, true);
        run(&mut rate, 20, 30, false);
        assert_eq!(fake.calls(REQUEST), ["90"], "asked once");
        assert_eq!(rate.now_hz(), 90.0, "kept");
    }

    #[test]
    fn a_display_that_has_the_rate_already_is_not_asked() {
        let fake = FakeRuntime::with_everything();
        let (session, _, _) = fake.session(&fake.instance());
        RefreshRate::new(&session, DEFAULT_HZ).expect("rates");
        assert!(fake.calls(REQUEST).is_empty(), "nothing to ask");
    }

    #[test]
    fn a_request_that_is_refused_leaves_the_rate_and_is_not_repeated() {
        let fake = FakeRuntime::with_everything();
        let (session, _, _) = fake.session(&fake.instance());
        fake.fail(REQUEST, XrResult::ERROR_DISPLAY_REFRESH_RATE_UNSUPPORTED_FB);
        let mut rate = RefreshRate::new(&session, DEFAULT_HZ).expect("rates");
        run(&mut rate, 0, 60, true);
        assert_eq!(fake.calls(REQUEST), ["90"], "asked once");
        assert_eq!(rate.now_hz(), 72.0, "as before");
    }

    #[test]
    fn a_display_without_a_choice_of_rates_keeps_its_own() {
        let fake = FakeRuntime::with_everything();
        fake.set(|world| world.rate_hz = 120.0);
        fake.fail(REQUEST, XrResult::ERROR_FEATURE_UNSUPPORTED);
        let (session, _, _) = fake.session(&fake.instance());
        let rate = RefreshRate::new(&session, DEFAULT_HZ).expect("rates");
        assert_eq!(rate.now_hz(), 120.0, "what it is");
    }

    #[test]
    fn the_event_of_a_changed_rate_is_taken_over() {
        let fake = FakeRuntime::with_everything();
        let instance = fake.instance();
        let (session, _, _) = fake.session(&instance);
        let mut rate = RefreshRate::new(&session, DEFAULT_HZ).expect("rates");
        fake.queue_rate(90.0);
        let mut buffer = EventDataBuffer::new();
        while let Some(event) = instance.poll_event(&mut buffer).expect("polled") {
            if let Event::DisplayRefreshRateChangedFB(change) = event {
                rate.changed(change.to_display_refresh_rate());
            }
        }
        assert_eq!(rate.now_hz(), 90.0, "taken over");
    }
}
