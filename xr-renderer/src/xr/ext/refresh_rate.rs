//! `XR_FB_display_refresh_rate`: asks for 72 Hz, and for more where frames keep up with room to spare.
//!
//! Without it the display has the rate it has: the period that the runtime predicts with every frame.

use openxr::{Session, Vulkan};

use super::rate_choice::{Held, RateChoice};
use super::{Absent, refused};

const EXTENSION: &str = "XR_FB_display_refresh_rate";

/// The rate to start with: the lowest that every headset of this kind has.
pub const DEFAULT_HZ: f32 = 72.0;

/// The display's rate, and the way to another.
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
    /// Lists the display's rates and asks for the one nearest to the wanted, which is not gone below.
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

    /// The rates there are, rising, Hz.
    #[must_use]
    pub fn rates(&self) -> &[f32] {
        self.choice.rates()
    }

    /// The rate there is, or was last asked for, Hz.
    #[must_use]
    pub fn now_hz(&self) -> f32 {
        self.choice.now_hz()
    }

    /// The runtime says that the rate changed (`XrEventDataDisplayRefreshRateChangedFB`): because it was asked to, or by itself.
    pub fn changed(&mut self, to_hz: f32) {
        log::info!("the display is refreshed at {to_hz} Hz");
        self.choice.is(to_hz);
    }

    /// Takes how a frame went. Every frame is to be told in the order of display; the rate goes up one step after seconds with
    /// room for it, and down again when frames are missed.
    pub fn consider(&mut self, frame: &Held) {
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
