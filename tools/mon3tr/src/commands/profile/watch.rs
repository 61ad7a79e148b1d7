//! Looks on while the profiled call is drawn: when measuring begins and ends, and what it takes of memory.

use super::{CAMERA, Options};
use crate::flat::display_error;
use crate::size::Size;
use crate::viewpoint::{Viewpoint, eyes};
use anyhow::anyhow;
use app_session::display::{DrawnPicture, LiveSession, PictureObserver, SessionError, Standpoint};
use profile_report::resident_bytes;
use renderer_splat::camera::Camera;
use renderer_vulkan::gpu::Gpu;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering::Relaxed};
use std::time::{Duration, Instant};

/// From the first frame until measuring begins: clocks are compared, buffers find their size.
const WARM_UP: Duration = Duration::from_secs(2);

/// How long to wait for the first frame, beside what inferring takes.
const LONGEST_SILENCE: Duration = Duration::from_secs(30);

/// Motion frames that a measurement has at least, however slow the NPU is.
const FEWEST_INFERENCES: u32 = 3;

/// Measures a call.
pub(super) struct Watch<'a> {
    options: &'a Options,
    viewpoint: Viewpoint,
    gpu: Arc<Gpu>,
    stop: Arc<AtomicBool>,
    /// When the people were joined, and how long measuring takes.
    begun: Option<(Instant, Duration)>,
    /// When measuring begins, after a warm-up, and ends.
    measured: Option<[Instant; 2]>,
    resident_before: Option<u64>,
    /// What the resident set grew by when placements were tried and one was kept.
    pub(super) onnx_runtime_bytes: Option<u64>,
    /// [`Gpu::memory_taken`] while the renderer was there.
    pub(super) device_bytes: u64,
}

impl<'a> Watch<'a> {
    pub(super) fn new(
        options: &'a Options,
        gpu: &Arc<Gpu>,
        stop: &Arc<AtomicBool>,
    ) -> anyhow::Result<Self> {
        Ok(Self {
            options,
            viewpoint: CAMERA.parse()?,
            gpu: Arc::clone(gpu),
            stop: Arc::clone(stop),
            begun: None,
            measured: None,
            resident_before: resident_bytes(),
            onnx_runtime_bytes: None,
            device_bytes: 0,
        })
    }

    /// When measuring began and ended, if the session `ended` then; an error where the call did not last so long.
    pub(super) fn time(&self, ended: Instant) -> anyhow::Result<[Instant; 2]> {
        match self.measured {
            Some([_, end]) if ended < end && !self.stop.load(Relaxed) => {
                Err(anyhow!("the sender hung up"))
            }
            Some([begin, end]) => Ok([begin, end.min(ended)]),
            None => Err(anyhow!("ended before the first frame")),
        }
    }

    /// How long is measured, and how long the first frame is waited for.
    fn begin(&self, session: &LiveSession<'_>) -> (Instant, Duration) {
        let placement = session.people.first().map(|first| &first.placement);
        let inference = (placement.and_then(|placement| placement.inference())).unwrap_or_default();
        let mut seconds = self.options.seconds;
        let least = inference.saturating_mul(FEWEST_INFERENCES);
        let provider = placement.and_then(|placement| placement.provider);
        if let (true, Some(provider)) = (least > seconds, provider) {
            println!(
                "measuring {:.0} s, for {FEWEST_INFERENCES} motion frames: {provider} took {:.1} s for one",
                least.as_secs_f64(),
                inference.as_secs_f64()
            );
            seconds = least;
        }
        (Instant::now(), seconds)
    }

    fn look(&mut self, session: &LiveSession<'_>, first: Option<Instant>) -> anyhow::Result<bool> {
        let (begun, seconds) = match self.begun {
            Some(begun) => begun,
            None => {
                let begun = self.begin(session);
                *self.begun.insert(begun)
            }
        };
        if let Some(first) = first {
            let begin = first + WARM_UP;
            let [_, end] = *self.measured.get_or_insert([begin, begin + seconds]);
            self.device_bytes = self.gpu.memory_taken();
            return Ok(self.stop.load(Relaxed) || Instant::now() >= end);
        }
        let placement = session.people.first().map(|first| &first.placement);
        let inference = (placement.and_then(|placement| placement.inference())).unwrap_or_default();
        // Pictures slow it down, and the frame that begins first may be of the performance before.
        let silence = LONGEST_SILENCE.saturating_add(inference.saturating_mul(4));
        if begun.elapsed() > silence {
            return Err(anyhow!("no frame came in {} s", silence.as_secs()));
        }
        Ok(self.stop.load(Relaxed))
    }
}

impl PictureObserver for Watch<'_> {
    fn prepared(&mut self) {
        self.onnx_runtime_bytes = resident_bytes()
            .zip(self.resident_before)
            .map(|(now, then)| now.saturating_sub(then));
    }

    fn is_over(
        &mut self,
        session: &LiveSession<'_>,
        first: Option<Instant>,
    ) -> Result<bool, SessionError> {
        self.look(session, first).map_err(display_error)
    }

    fn cameras(&mut self, people: &Standpoint) -> Vec<Camera> {
        let Size { width, height } = self.options.size;
        let camera = (self.viewpoint).camera(people.floor, people.heading, width, height);
        eyes(camera, self.options.views())
    }

    fn drawn(&mut self, _picture: DrawnPicture<'_>) -> Result<(), SessionError> {
        Ok(())
    }
}
