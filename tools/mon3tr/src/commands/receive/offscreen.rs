//! `--display offscreen`: the call as pictures on disk, drawn as fast as this machine can.

use super::{Options, Prepared, Until, Watched};
use crate::film::{Film, write_png};
use crate::live::{Live, Moment};
use crate::moments::Moments;
use crate::stage::{Setting, Stage};
use crate::viewpoint::{Viewpoint, eyes};
use image::{RgbImage, imageops};
use std::time::{Duration, Instant};

/// Time from one picture to the next at least, as of a display of 60 Hz.
const REFRESH: Duration = Duration::from_micros(16_667);

/// Draws the call until it is over.
pub(super) fn run(
    live: &mut Live,
    mut prepared: Prepared<'_>,
    options: &Options,
    until: &Until,
) -> anyhow::Result<Watched> {
    let mut film = Film::start(options.out.join("animation.webp"));
    let mut moments = Moments::default();
    let mut shown = Watched::default();
    let mut first = None;
    let mut last = None;
    while !until.is_over() && shown.end.is_none() {
        let begun = Instant::now();
        if let Some(moment) = live.now() {
            let stage = prepared.stage(&moment)?;
            let picture = draw(stage, &options.camera, &moment)?;
            let since = *first.get_or_insert(begun);
            moments.offer(&picture);
            film.offer(&picture, begun - since);
            last = Some(picture);
            shown.drawn += 1;
            shown.seconds = since.elapsed().as_secs_f64();
        }
        shown.end = live.call.end();
        std::thread::sleep(REFRESH.saturating_sub(begun.elapsed()));
    }
    let Some(last) = last else {
        return Ok(shown);
    };
    shown.stages = prepared.times();
    shown.pictures.push(film.finish()?);
    for (name, picture) in [("moments.png", &moments.sheet()), ("last.png", &last)] {
        let file = options.out.join(name);
        write_png(&file, picture)?;
        shown.pictures.push(file);
    }
    Ok(shown)
}

/// One picture of the moment; both eyes' side by side.
fn draw(stage: &mut Stage, viewpoint: &Viewpoint, moment: &Moment) -> anyhow::Result<RgbImage> {
    let &Setting { size, views, .. } = stage.setting();
    let camera = viewpoint.camera(moment.floor, moment.heading, size.width, size.height);
    let mut drawn = stage.picture(&moment.motion, &eyes(camera, views))?;
    if drawn.len() == 1 {
        return Ok(drawn.swap_remove(0));
    }
    let mut both = RgbImage::new(size.width * views.count(), size.height);
    for (picture, x) in drawn.iter().zip([0, i64::from(size.width)]) {
        imageops::replace(&mut both, picture, x, 0);
    }
    Ok(both)
}
