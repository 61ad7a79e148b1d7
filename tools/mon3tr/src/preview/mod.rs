//! A look at oneself while a camera captures: the camera's picture with the landmarks, the avatar beside it, and two lines of text, in a
//! window. Both halves are mirrored, as people expect of a picture of themselves.
//!
//! Capturing never waits for it: the newest picture is handed over, what the preview is too late for is dropped and counted, and its
//! threads run after everything else where there is too little of the processor for both.

mod caption;
mod hand_over;
mod window;

pub(crate) use caption::{Pace, PaceMeter};
pub(crate) use hand_over::HandOver;

use crate::calibrate;
use crate::composed::{Composition, Facing};
use crate::device_options::DeviceOptions;
use crate::notice::Notice;
use crate::size::{Size, Views};
use crate::stills::{RenderSettings, StillRenderer};
use anyhow::{Context, anyhow};
use app_session::display::Still;
use app_session::overlay::{STRIP_HEIGHT, strip};
use image::{Rgb, RgbImage, imageops};
use motion_fit::Fitted;
use motion_fit::landmarks::{Camera, Observation};
use npu_runtime::Runtime;
use renderer_splat::options::Filter;
use renderer_vulkan::gpu::Gpu;
use spmm3::Avatar;
use std::cell::{Cell, RefCell};
use std::sync::Arc;
use tracker::source::Picture;
use winit::event_loop::{EventLoop, EventLoopProxy};

/// Longer side of each half, pixels.
const SIDE: u32 = 480;

/// One picture that was looked at.
#[derive(Debug, Clone)]
pub(crate) struct Shot {
    pub(crate) picture: Arc<Picture>,
    pub(crate) observation: Observation,
    pub(crate) fitted: Fitted,
    /// What saw it.
    pub(crate) camera: Camera,
    pub(crate) pace: Pace,
    /// What is the matter, if that has lasted.
    pub(crate) notice: Option<Notice>,
    /// What the person is told, while a calibration is under way.
    pub(crate) calibrating: Option<calibrate::State>,
}

/// What a preview needs, found before a call begins: a display and a device.
pub(crate) struct Preview {
    events: EventLoop<()>,
    gpu: Arc<Gpu>,
    runtime: Runtime,
    shots: Arc<HandOver<Shot>>,
}

impl Preview {
    /// Connects to the window system and opens the device.
    ///
    /// # Errors
    /// If there is no display, or no device that draws.
    pub(crate) fn open(device: &DeviceOptions) -> anyhow::Result<Self> {
        let events = crate::window::events("leave out --preview")?;
        let runtime = device.runtime()?;
        // A device of software computes in threads that it starts here.
        let gpu = std::thread::scope(|scope| {
            let opening = scope.spawn(|| {
                yield_to_others();
                device.gpu()
            });
            opening
                .join()
                .map_err(|_| anyhow!("opening the Vulkan device panicked"))?
        })?;
        Ok(Self {
            events,
            gpu,
            runtime,
            shots: Arc::default(),
        })
    }

    /// Where what was seen is to be put.
    pub(crate) fn shots(&self) -> Arc<HandOver<Shot>> {
        Arc::clone(&self.shots)
    }

    /// Does `work` in a thread of its own, and shows the preview meanwhile: on this one, which has to be the program's first. The preview
    /// ends when the window is closed, and with the work.
    pub(crate) fn beside<T: Send>(
        self,
        avatar: &Arc<Avatar>,
        camera: &Camera,
        work: impl FnOnce() -> T + Send,
    ) -> anyhow::Result<T> {
        let Self {
            events,
            gpu,
            runtime,
            shots,
        } = self;
        let composition = Composition::of_side(camera, SIDE);
        let Size { width, height } = composition.half();
        let size = Size {
            width: 2 * width,
            height: height + 2 * STRIP_HEIGHT,
        };
        let pictures = HandOver::default();
        let proxy = events.create_proxy();
        let (gpu, runtime, shots) = (&gpu, &runtime, &shots);
        let (composition, pictures, proxy) = (&composition, &pictures, &proxy);
        std::thread::scope(|scope| {
            // The end of the work or of the drawing closes the window, also where they panic.
            let end = || Closing {
                shots: Arc::clone(shots),
                window: proxy.clone(),
            };
            let (work_ends, drawing_ends) = (end(), end());
            let working = scope.spawn(move || {
                let _end = work_ends;
                work()
            });
            let drawing = scope.spawn(move || {
                let _end = drawing_ends;
                yield_to_others();
                let renderer = StillRenderer {
                    gpu,
                    runtime,
                    avatar,
                };
                let drawn = draw(&renderer, composition, shots, |picture| {
                    pictures.put(picture);
                    // A window that is closed needs no picture.
                    let _ = proxy.send_event(());
                });
                if let Err(error) = drawn {
                    log::warn!("the preview ends, the call goes on: {error:#}");
                }
            });
            let shown = window::show(events, gpu, size, shots, pictures);
            shots.close();
            if let Err(error) = shown {
                log::warn!("the preview ends, the call goes on: {error:#}");
            } else if !working.is_finished() {
                log::info!("the preview is closed, the call goes on: Ctrl-C ends it");
            }
            let drawn = drawing.join();
            log::info!(
                "the preview left out {} pictures, because newer ones were there",
                shots.dropped()
            );
            if drawn.is_err() {
                log::warn!("the preview ended, the call went on: its thread panicked");
            }
            working.join().map_err(|_| anyhow!("capturing panicked"))
        })
    }
}

/// Ends the preview when it is dropped.
struct Closing {
    shots: Arc<HandOver<Shot>>,
    window: EventLoopProxy<()>,
}

impl Drop for Closing {
    fn drop(&mut self) {
        self.shots.close();
        let _ = self.window.send_event(());
    }
}

/// Draws shots and hands each picture to `drawn`, until no more come.
fn draw(
    renderer: &StillRenderer<'_>,
    first: &Composition,
    shots: &HandOver<Shot>,
    mut drawn: impl FnMut(RgbImage),
) -> anyhow::Result<()> {
    let composition = Cell::new(*first);
    let current = RefCell::new(None);
    let stills = std::iter::from_fn(|| {
        let shot = shots.take()?;
        let placed = first.with_camera(&shot.camera);
        composition.set(placed);
        let still = Still {
            motion: shot.fitted.motion.clone(),
            cameras: vec![placed.eye(shot.fitted.camera_from_room)],
        };
        current.replace(Some(shot));
        Some(still)
    });
    let setting = RenderSettings {
        size: first.half(),
        views: Views::Mono,
        background: None,
        filter: Filter::Dilation,
    };
    renderer.draw(&setting, stills, |_, views| {
        let shot = current.take().context("a picture was drawn of nothing")?;
        let view = views.first().context("the renderer returned no picture")?;
        drawn(page(&composition.get(), &shot, view, shots.dropped())?);
        Ok(())
    })?;
    Ok(())
}

/// Both halves, mirrored, and two lines below.
fn page(
    composition: &Composition,
    shot: &Shot,
    avatar: &RgbImage,
    dropped: u64,
) -> anyhow::Result<RgbImage> {
    let seen = Some(&shot.observation);
    let both = composition.compose(&shot.picture, seen, avatar, Facing::Mirrored)?;
    let (width, height) = both.dimensions();
    let figures = caption::figures(shot.pace, dropped);
    let told = match shot.calibrating {
        Some(told) => format!("calibrate: {told}"),
        None => caption::lacking(&shot.fitted, shot.notice),
    };
    let mut page = RgbImage::new(width, height + 2 * STRIP_HEIGHT);
    imageops::replace(&mut page, &both, 0, 0);
    let text = [figures, told].map(|line| strip(&line, width).pixels);
    let text = text.iter().flat_map(|line| line.as_chunks::<4>().0);
    let below = page.rows_mut().skip(height as usize).flatten();
    for (pixel, [r, g, b, _]) in below.zip(text) {
        *pixel = Rgb([*r, *g, *b]);
    }
    Ok(page)
}

/// Has this thread, and those that it starts, run after others where there is too little of the processor for all.
fn yield_to_others() {
    #[cfg(target_os = "linux")]
    {
        /// As `nice` has it.
        const LATER: i32 = 10;
        let thread = rustix::thread::gettid();
        // On Linux a priority is a thread's own.
        if let Err(error) = rustix::process::setpriority_process(Some(thread), LATER) {
            log::debug!("the preview's threads keep their priority: {error}");
        }
    }
}

#[cfg(test)]
mod tests;
