//! A video with what the networks saw in it, and beside it the avatar that follows, from the same camera.

use crate::composed::{Composition, Facing};
use crate::film::Film;
use crate::progress;
use crate::recording::{DRAWN, TrackedRecording};
use crate::size::Views;
use crate::stills::{RenderSettings, StillRenderer};
use anyhow::Context;
use app_session::display::Still;
use renderer_splat::options::Filter;
use std::path::Path;
use std::sync::atomic::{AtomicBool, Ordering::Relaxed};
use std::time::Duration;
use tracker::source::{self, Picture, SourceChoice};

/// Height of the animation, pixels.
const HEIGHT: u32 = 480;

/// Reads the recording again and draws it beside the avatar into the animation `file`: all of it, or as much as there is when `stop`
/// becomes true.
pub(crate) fn draw(
    choice: &SourceChoice,
    recording: &TrackedRecording,
    renderer: &StillRenderer<'_>,
    stop: &AtomicBool,
    file: &Path,
) -> anyhow::Result<()> {
    let TrackedRecording { seen, camera, .. } = recording;
    let mut source = source::open(choice)?;
    let composition = Composition::of_height(camera, HEIGHT);
    let shown = &seen[..seen.len().min(DRAWN)];
    let asked = shown.iter().take_while(|_| !stop.load(Relaxed));
    let stills = asked.map(|seen| Still {
        motion: seen.fitted.motion.clone(),
        cameras: vec![composition.eye(seen.fitted.camera_from_room)],
    });
    let setting = RenderSettings {
        size: composition.half(),
        views: Views::Mono,
        background: None,
        filter: Filter::Dilation,
    };
    let mut film = Film::start(file.to_owned());
    let bar = progress::bar("drawing side by side", shown.len());
    let mut picture = Picture::empty();
    let first = shown.first().map_or(0.0, |seen| seen.seconds);
    renderer.draw(&setting, stills, |k, views| {
        let seen = shown
            .get(k)
            .context("the renderer drew more than was asked for")?;
        anyhow::ensure!(
            source.next(&mut picture)?,
            "the video is shorter when it is read again"
        );
        let view = views.first().context("the renderer returned no picture")?;
        let seen_there = seen.observation.as_ref();
        let both = composition.compose(&picture, seen_there, view, Facing::AsSeen)?;
        film.add(
            both,
            Duration::from_secs_f64((seen.seconds - first).max(0.0)),
        );
        bar.inc(1);
        Ok(())
    })?;
    bar.finish_and_clear();
    film.finish()?;
    if seen.len() > shown.len() {
        println!(
            "{} shows the first {} of {} pictures",
            file.display(),
            shown.len(),
            seen.len()
        );
    }
    Ok(())
}
