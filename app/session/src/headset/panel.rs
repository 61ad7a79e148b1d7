//! The panel of figures in the room: hung before the viewer when they call for it, and taken away when they do so again.

use super::hanging::{Spot, image};
use crate::overlay::{OVERLAY_WIDTH_METRES, OverlayPainter, OverlayWatch};
use app_pipeline::error::ReceiverError;
use app_pipeline::lanes::{Lanes, MotionSource};
use glam::Affine3A;
use renderer_openxr::error::XrError;
use renderer_openxr::session::Session;
use std::time::{Duration, Instant};

/// Between two updates.
const PAUSE: Duration = Duration::from_millis(500);

/// The panel, and what is on it.
#[derive(Debug)]
pub(super) struct FiguresPanel {
    watch: OverlayWatch,
    /// While it is shown.
    shown: Option<Shown>,
}

#[derive(Debug)]
struct Shown {
    painter: OverlayPainter,
    floor_from_panel: Affine3A,
    looked: Option<Instant>,
    hangs: bool,
}

impl FiguresPanel {
    pub(super) fn new(watch: OverlayWatch) -> Self {
        Self { watch, shown: None }
    }

    /// The viewer called for it, or had enough of it.
    pub(super) fn toggle(
        &mut self,
        session: &mut Session,
        floor_from_head: Affine3A,
    ) -> Result<(), ReceiverError> {
        if self.shown.take().is_some() {
            session.remove_panel();
            return Ok(());
        }
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
    }

    /// Shows what there is to tell, twice a second.
    pub(super) fn update<S: MotionSource>(
        &mut self,
        session: &mut Session,
        lanes: &mut Lanes<S>,
        period: Duration,
    ) -> Result<(), XrError> {
        let Some(shown) = &mut self.shown else {
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
