//! A minimal headset program: draws a static scene, and prints what happens. Tests run
//! it against a real runtime, which is chosen by the environment of a process.
//!
//! `headset-frames FRAMES [OPTION..]`: ends after so many frames shown, or on a command. Options, in [`options`], come as
//! `--name=value`. With `--steered` it executes the commands on its standard input, a line each (see [`Steering`]), and ends when that
//! does. Every line it prints is JSON with an `event`: `opened`, `shown`, `told`, `lost`, `failed`, `over`.

mod failure;
mod options;
mod steering;

use std::path::Path;
use std::process::ExitCode;
use std::sync::Arc;
use std::time::{Duration, Instant};

use renderer_openxr::error::XrError;
use renderer_openxr::frame::{Eyes, Frame};
use renderer_openxr::headset::{Headset, HeadsetOptions};
use renderer_openxr::runtime::Runtime;
use renderer_openxr::session::{Session, SessionEnd, SessionOptions};
use renderer_splat::drawing::{Drawing, Foreground, Part};
use renderer_splat::error::RenderError;
use renderer_splat::gaussian::PackedGaussian;
use renderer_splat::options::RendererOptions;
use renderer_splat::renderer::SplatRenderer;
use renderer_vulkan::error::VulkanError;
use serde_json::{Value, json};

use failure::Failure;
use options::Options;
use steering::{Command, Steering, camera_json, controls_json, wearer_json};

/// Longer than any test runs: a program that no test ends ends itself.
const LIFE: Duration = Duration::from_secs(240);

fn main() -> ExitCode {
    env_logger::init();
    let mut program = match Options::parse(std::env::args().skip(1)) {
        Ok(options) => Program::new(options),
        Err(why) => {
            eprintln!("{why}");
            return ExitCode::from(2);
        }
    };
    match program.run() {
        Ok(()) => ExitCode::SUCCESS,
        Err(why) => {
            say(&why.told("failed"));
            ExitCode::FAILURE
        }
    }
}

/// Prints a line.
fn say(line: &Value) {
    println!("{line}");
}

/// The totals over all sessions.
struct Program {
    options: Options,
    steering: Option<Steering>,
    ends_at: Instant,
    opened: u32,
    shown: u64,
    unseen: u64,
    overlay_toggles: u32,
    predicted: Vec<Instant>,
    periods: Vec<Duration>,
}

impl Program {
    fn new(options: Options) -> Self {
        Self {
            steering: options.steered.then(Steering::start),
            options,
            ends_at: Instant::now() + LIFE,
            opened: 0,
            shown: 0,
            unseen: 0,
            overlay_toggles: 0,
            predicted: Vec::new(),
            periods: Vec::new(),
        }
    }

    fn run(&mut self) -> Result<(), Failure> {
        loop {
            let Err(why) = self.session() else {
                return Ok(());
            };
            let comes_back = why.is_loss() || self.opened > 0 && why.may_pass();
            if !(self.options.reopens && comes_back) {
                return Err(why);
            }
            say(&why.told("lost"));
            self.check_time()?;
            std::thread::sleep(Duration::from_millis(250));
        }
    }

    /// Opens the headset and shows frames to the end.
    fn session(&mut self) -> Result<(), Failure> {
        let runtime = Runtime::load()?;
        let open = |validation| {
            let eye_size = self.options.eye_size;
            let options = HeadsetOptions {
                eye_size,
                validation,
            };
            Headset::open(&runtime, options)
        };
        let (headset, validated) = match open(true) {
            Err(XrError::Render(RenderError::Vulkan(VulkanError::NoValidationLayer))) => {
                (open(false)?, false)
            }
            headset => (headset?, true),
        };
        let mut session = Session::new(
            &headset,
            SessionOptions {
                room: false,
                read_back: self.options.folder.is_some(),
                display_hz: None,
            },
        )?;
        let mut renderer = self.renderer(&headset, &session)?;
        self.opened += 1;
        say(&json!({
            "event": "opened",
            "times": self.opened,
            "runtime": headset.info().runtime,
            "headset": headset.info().name,
            "device": headset.gpu().info().name,
            "size": headset.info().eye_size,
            "granted": headset.extensions().granted(),
            "missing": headset.extensions().missing(),
            "validated": validated,
        }));
        let mut leaving = false;
        loop {
            self.check_time()?;
            if let Some(steering) = &mut self.steering {
                steering.listen();
            }
            match session.poll()?.end {
                Some(SessionEnd::Exited) => break,
                Some(SessionEnd::Lost) => return Err(Failure::Pending),
                None => {}
            }
            if !session.lifecycle().is_running() {
                std::thread::sleep(Duration::from_millis(5));
                continue;
            }
            self.frame(&mut session, &mut renderer, leaving)?;
            let enough = self.shown >= self.options.frames;
            let told_to = self.steering.as_ref().is_some_and(Steering::is_over);
            if !leaving && (enough || told_to) {
                session.request_exit()?;
                leaving = true;
            }
        }
        self.conclude(&headset, &session, &renderer);
        Ok(())
    }

    fn renderer(&self, headset: &Headset, session: &Session) -> Result<SplatRenderer, Failure> {
        let gaussians: Vec<_> = (self.options.figure.gaussians().iter())
            .map(PackedGaussian::from)
            .collect();
        let count = u32::try_from(gaussians.len()).unwrap_or(u32::MAX);
        let [width, height] = headset.info().eye_size;
        let options = RendererOptions {
            depth: session.takes_depth(),
            back_end: self.options.back_end,
            ..RendererOptions::new(count, width, height, 2)
        };
        let mut renderer = SplatRenderer::new(Arc::clone(headset.gpu()), &options)?;
        renderer.set_foreground(&gaussians)?;
        Ok(renderer)
    }

    /// One frame, shown or skipped.
    fn frame(
        &mut self,
        session: &mut Session,
        renderer: &mut SplatRenderer,
        leaving: bool,
    ) -> Result<(), Failure> {
        let frame = session.wait()?;
        let eyes = session.locate_views(&frame)?;
        let controls = session.controls(&frame)?;
        self.overlay_toggles += u32::from(controls.overlay_toggled);
        let (true, Some(eyes)) = (frame.should_render && !leaving, eyes) else {
            session.skip(frame)?;
            self.unseen += 1;
            return Ok(());
        };
        let command = self.steering.as_mut().and_then(Steering::next);
        let reads = matches!(command, Some(Command::Read(_)));
        let wearer = match &command {
            Some(_) => wearer_json(&session.wearer(&frame)?),
            None => Value::Null,
        };
        let mut canvas = session.canvas(&eyes, self.options.surround, reads)?;
        let parts = [Part::here(Foreground::Set)];
        renderer.draw_onto(&Drawing::new(&eyes.cameras, &parts), &mut canvas)?;
        let pictures = session.show(frame)?;
        if let Some(command) = command {
            let name = command.name();
            let (turn, place) = head(&eyes);
            for (eye, picture) in ["left", "right"].iter().zip(pictures.iter().flatten()) {
                let folder = self.options.folder.as_deref().unwrap_or(Path::new("."));
                image::save_buffer(
                    folder.join(format!("{name}-{eye}.png")),
                    &picture.rgba,
                    picture.width,
                    picture.height,
                    image::ColorType::Rgba8,
                )?;
            }
            say(&json!({
                "event": "told",
                "name": name,
                "frame": self.shown,
                "head": { "rotation": turn, "position": place },
                "eyes": eyes.cameras.map(|camera| camera_json(&camera)),
                "controls": controls_json(&controls),
                "wearer": wearer,
                "overlay_toggles": self.overlay_toggles,
                "back_end": renderer.back_end().to_string(),
                "lenses_show": session.lenses_show(),
                "way": session.render_path().map(|way| way.to_string()),
            }));
        }
        self.note(frame, session);
        Ok(())
    }

    fn note(&mut self, frame: Frame, session: &Session) {
        self.predicted.push(frame.predicted);
        self.periods.push(frame.period);
        self.shown += 1;
        if self.shown.is_multiple_of(5) {
            let life = session.lifecycle().now().to_string();
            say(
                &json!({ "event": "shown", "frames": self.shown, "times": self.opened, "life": life }),
            );
        }
    }

    fn conclude(&self, headset: &Headset, session: &Session, renderer: &SplatRenderer) {
        let milliseconds = |time: Duration| time.as_secs_f64() * 1e3;
        let first = self.predicted.first().copied();
        let since = |time: &Instant| first.map(|first| milliseconds(time.duration_since(first)));
        let passed = session.lifecycle().passed().iter();
        say(&json!({
            "event": "over",
            "opened": self.opened,
            "floor": session.floor().to_string(),
            "states": passed.map(ToString::to_string).collect::<Vec<_>>(),
            "shown": self.shown,
            "unseen": self.unseen,
            "predicted_ms": self.predicted.iter().map(since).collect::<Vec<_>>(),
            "periods_ms": self.periods.iter().copied().map(milliseconds).collect::<Vec<_>>(),
            "rises": self.predicted.windows(2).all(|pair| pair[1] > pair[0]),
            "has_depth": session.takes_depth(),
            "tracks_hands": session.tracks().hands,
            "back_end": renderer.back_end().to_string(),
            "validation_messages": headset.gpu().validation_messages(),
        }));
    }

    fn check_time(&self) -> Result<(), Failure> {
        if Instant::now() > self.ends_at {
            return Err(Failure::Late);
        }
        Ok(())
    }
}

/// How the head is turned (x, y, z, w), and where it is (metres), in floor space.
fn head(eyes: &Eyes) -> ([f32; 4], [f32; 3]) {
    let turn = glam::Quat::from_mat3a(&eyes.floor_from_head.matrix3);
    (turn.to_array(), eyes.floor_from_head.translation.to_array())
}
