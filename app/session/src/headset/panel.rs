//! The one panel in the room: figures, hung before the viewer when they call for it and taken away when they do so again; else, while the viewer is not
//! heard or not seen by others, that it is so.

use super::hanging::{Spot, image};
use crate::overlay::{
    NOTICE_WIDTH_METRES, Notice, OVERLAY_WIDTH_METRES, OverlayPainter, OverlayWatch,
};
use app_pipeline::error::ReceiverError;
use app_pipeline::lanes::{Lanes, MotionSource};
use glam::Affine3A;
use renderer_openxr::error::XrError;
use renderer_openxr::input::Controls;
use renderer_openxr::session::Session;
use std::sync::Arc;
use std::time::{Duration, Instant};

/// Between two updates.
const PAUSE: Duration = Duration::from_millis(500);

/// Whether others hear and see the viewer, which the viewer changes at a button.
pub trait PrivacySwitch: Send + Sync + std::fmt::Debug {
    /// Is no longer heard, or is again.
    fn toggle_mute(&self);

    /// Is no longer seen, or is again.
    fn toggle_hide(&self);

    /// What the viewer is to be told as long as it holds.
    fn notice(&self) -> Option<Notice>;
}

/// The panel, and what is on it.
#[derive(Debug)]
pub(super) struct RoomPanel {
    watch: OverlayWatch,
    /// While the figures are shown.
    shown: Option<Shown>,
    privacy: Option<Arc<dyn PrivacySwitch>>,
    /// The notice that hangs there.
    notice: Option<Notice>,
}

#[derive(Debug)]
struct Shown {
    painter: OverlayPainter,
    floor_from_panel: Affine3A,
    looked: Option<Instant>,
    hangs: bool,
}

impl RoomPanel {
    pub(super) fn new(watch: OverlayWatch, privacy: Option<Arc<dyn PrivacySwitch>>) -> Self {
        Self {
            watch,
            shown: None,
            privacy,
            notice: None,
        }
    }

    /// Takes what the viewer pressed that others hear and see.
    pub(super) fn press(&self, controls: &Controls) {
        let Some(privacy) = &self.privacy else {
            return;
        };
        if controls.mute_toggled {
            privacy.toggle_mute();
        }
        if controls.hide_toggled {
            privacy.toggle_hide();
        }
    }

    /// The viewer called for the figures, or had enough of them.
    pub(super) fn toggle(
        &mut self,
        session: &mut Session,
        floor_from_head: Affine3A,
    ) -> Result<(), ReceiverError> {
        if self.shown.take().is_some() {
            session.remove_panel();
            return Ok(());
        }
        // In the place of what hangs there.
        self.notice = None;
        self.shown = Some(Shown {
            painter: OverlayPainter::start().map_err(ReceiverError::Thread)?,
            floor_from_panel: Spot::BESIDE.before(floor_from_head),
            looked: None,
            hangs: false,
        });
        Ok(())
    }

    /// The session is another one, without panels.
    pub(super) fn renewed(&mut self) {
        if let Some(shown) = &mut self.shown {
            (shown.looked, shown.hangs) = (None, false);
        }
        self.notice = None;
    }

    /// Shows what there is to tell: figures twice a second, a notice when it changes, where the viewer looks then.
    pub(super) fn update<S: MotionSource>(
        &mut self,
        session: &mut Session,
        lanes: &mut Lanes<S>,
        floor_from_head: Affine3A,
        period: Duration,
    ) -> Result<(), XrError> {
        let Some(shown) = &mut self.shown else {
            let notice = self.privacy.as_ref().and_then(|privacy| privacy.notice());
            if notice != self.notice {
                match &notice {
                    Some(notice) => {
                        let place = Spot::BESIDE.before(floor_from_head);
                        session.hang_panel(image(&notice.panel()), place, NOTICE_WIDTH_METRES)?;
                    }
                    None => session.remove_panel(),
                }
                self.notice = notice;
            }
            return Ok(());
        };
        let now = Instant::now();
        if shown
            .looked
            .is_none_or(|last| now.saturating_duration_since(last) >= PAUSE)
        {
            shown.looked = Some(now);
            shown.painter.show(self.watch.look(lanes, period));
        }
        let floor_from_panel = shown.floor_from_panel;
        if let Some(panel) = shown.painter.panel() {
            session.hang_panel(image(panel), floor_from_panel, OVERLAY_WIDTH_METRES)?;
            shown.hangs = true;
        }
        Ok(())
    }
}
