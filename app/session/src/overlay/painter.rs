//! The overlay in a thread of its own: who draws pictures for a headset has no milliseconds to spare.

use super::{Overlay, OverlayFigures, Panel};
use app_pipeline::lanes::{Reader, WakeSignal, Writer, triple_buffer};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering::Relaxed};
use std::thread::JoinHandle;
use std::time::Duration;

/// How long the thread sleeps unless it is woken.
const PATIENCE: Duration = Duration::from_secs(1);

/// Draws panels elsewhere.
#[derive(Debug)]
pub struct OverlayPainter {
    figures: Writer<OverlayFigures>,
    panels: Reader<Panel>,
    bell: WakeSignal,
    stop: Arc<AtomicBool>,
    thread: Option<JoinHandle<()>>,
}

impl OverlayPainter {
    /// Starts the thread.
    ///
    /// # Errors
    /// If the system gives no thread.
    pub fn start() -> std::io::Result<Self> {
        let bell = WakeSignal::default();
        let (figures, wanted) = triple_buffer(Default::default(), &bell);
        let overlay = Overlay::default();
        let empty = || overlay.card.clone();
        // The thread that draws never waits for a panel.
        let (drawn, panels) = triple_buffer([empty(), empty(), empty()], &WakeSignal::default());
        let stop = Arc::<AtomicBool>::default();
        let thread = {
            let (bell, stop) = (bell.clone(), Arc::clone(&stop));
            std::thread::Builder::new()
                .name("overlay".to_owned())
                .spawn(move || paint(overlay, wanted, drawn, &bell, &stop))?
        };
        Ok(Self {
            figures,
            panels,
            bell,
            stop,
            thread: Some(thread),
        })
    }

    /// Has `figures` drawn. Does not wait.
    pub fn show(&mut self, figures: OverlayFigures) {
        *self.figures.place() = figures;
        self.figures.give();
    }

    /// The panel, if it looks different since this was asked last. Does not wait.
    pub fn panel(&mut self) -> Option<&Panel> {
        self.panels.take().then(|| &*self.panels.taken())
    }
}

impl Drop for OverlayPainter {
    fn drop(&mut self) {
        self.stop.store(true, Relaxed);
        self.bell.ring();
        if self.thread.take().is_some_and(|one| one.join().is_err()) {
            log::error!("the overlay's thread failed");
        }
    }
}

fn paint(
    mut overlay: Overlay,
    mut wanted: Reader<OverlayFigures>,
    mut drawn: Writer<Panel>,
    bell: &WakeSignal,
    stop: &AtomicBool,
) {
    while !stop.load(Relaxed) {
        if wanted.take()
            && let Some(panel) = overlay.update(wanted.taken())
        {
            drawn.place().pixels.copy_from_slice(&panel.pixels);
            drawn.give();
        }
        bell.wait(PATIENCE);
    }
}
