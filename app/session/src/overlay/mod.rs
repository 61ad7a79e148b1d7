//! A small panel of figures for who wears the headset: how a call goes, at a glance.
//!
//! [`OverlayWatch`] takes the figures from running lanes, [`Overlay`] makes pixels of them, in a thread of its own where
//! [`OverlayPainter`] does it. Where the panel hangs in the room, and when it is shown, is decided elsewhere (`headset/`).

mod figures;
mod glyphs;
mod layout;
mod notice;
mod painter;
mod panel;
#[cfg(test)]
mod tests;
mod watch;
mod words;

pub use figures::{FrameTime, OverlayFigures, OverlayLatency, UnitLoad};
pub use notice::{NOTICE_LETTERS, NOTICE_LINES, NOTICE_WIDTH_METRES, Notice, STRIP_HEIGHT, strip};
pub use painter::OverlayPainter;
pub use panel::Panel;
pub use watch::OverlayWatch;

use glyphs::Glyphs;
use layout::Item;

/// Width of the panel in metres, for which its text is large enough: from 0.8 m the smallest is 0.9 degrees high, 18 pixels of a
/// headset with 20 pixels a degree.
pub const OVERLAY_WIDTH_METRES: f32 = 0.5;

/// Draws figures, as often as they are told.
#[derive(Debug)]
pub struct Overlay {
    glyphs: Glyphs,
    /// The card without anything on it.
    card: Panel,
    panel: Panel,
    /// What is on the panel; nothing before the first time.
    items: Vec<Item>,
}

impl Default for Overlay {
    fn default() -> Self {
        let card = panel::card(layout::WIDTH, layout::HEIGHT);
        Self {
            glyphs: Glyphs::default(),
            panel: card.clone(),
            card,
            items: Vec::new(),
        }
    }
}

impl Overlay {
    /// Draws `figures`. `None` where the panel would look as it does already.
    pub fn update(&mut self, figures: &OverlayFigures) -> Option<&Panel> {
        let items = layout::items(figures);
        if items == self.items {
            return None;
        }
        self.panel.pixels.copy_from_slice(&self.card.pixels);
        for item in &items {
            self.panel.draw(item, &mut self.glyphs);
        }
        self.items = items;
        Some(&self.panel)
    }
}
