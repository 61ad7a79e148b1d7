//! The panel of figures in the room: hung before the viewer when they call for it, and taken away when they do so again.

use crate::{
    Lanes, MotionSource, OVERLAY_WIDTH_METRES, OverlayPainter, OverlayWatch, Panel, ReceiverError,
};
use glam::{Affine3A, Mat3A, Vec3};
use std::time::{Duration, Instant};
use xr_renderer::xr::{PanelImage, Session, XrError};

/// Between two updates.
const PAUSE: Duration = Duration::from_millis(500);
/// Before the viewer, metres, below their eyes, and to their right, clear of whoever they look at.
const AWAY: f32 = 0.8;
const BELOW: f32 = 0.12;
const BESIDE: f32 = 0.32;

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
            floor_from_panel: before(floor_from_head),
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

fn image(panel: &Panel) -> PanelImage<'_> {
    PanelImage {
        width: panel.width,
        height: panel.height,
        rgba: &panel.pixels,
    }
}

/// Upright before the viewer, turned to them.
fn before(floor_from_head: Affine3A) -> Affine3A {
    let head = Vec3::from(floor_from_head.translation);
    let ahead = floor_from_head.transform_vector3(Vec3::NEG_Z);
    let ahead = Vec3::new(ahead.x, 0.0, ahead.z).normalize_or(Vec3::NEG_Z);
    let right = ahead.cross(Vec3::Y);
    let at = head + ahead * AWAY + right * BESIDE - Vec3::Y * BELOW;
    let back = (head - at).normalize_or(-ahead);
    let side = Vec3::Y.cross(back).normalize_or(right);
    Affine3A {
        matrix3: Mat3A::from_cols(side.into(), back.cross(side).into(), back.into()),
        translation: at.into(),
    }
}
