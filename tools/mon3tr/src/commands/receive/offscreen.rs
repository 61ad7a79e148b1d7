//! `--display offscreen`: the call as pictures on disk, as a display of 60 Hz would show it.

use super::Options;
use crate::film::{Film, write_png};
use crate::live::{LiveView, Moment};
use crate::moments::Moments;
use crate::screen::Screen;
use crate::stills::{compose_views, read_views};
use crate::until::Until;
use crate::viewpoint::{Viewpoint, eyes};
use app_pipeline::lanes::Drawn;
use image::{RgbImage, imageops};
use std::time::{Duration, Instant};

/// Pause before looking again whether there is somebody to be seen.
const WAITING: Duration = Duration::from_millis(5);

/// Draws the call until it is over.
pub(super) fn run(screen: &mut Screen<'_>, options: &Options, until: &Until) -> anyhow::Result<()> {
    let folder = options.folder();
    let mut film = Film::start(folder.join("animation.webp"));
    let mut moments = Moments::default();
    let mut first = None;
    let mut last = None;
    while !until.is_over() && !screen.live.lanes.is_over() {
        screen.live.display.wait();
        let begun = Instant::now();
        let Some(moment) = screen.begin()? else {
            std::thread::sleep(WAITING);
            continue;
        };
        let viewpoint = screen.seen_from(options.camera);
        let Some(picture) = draw(&mut screen.live, &viewpoint, &moment)? else {
            continue;
        };
        moments.offer(&picture);
        film.offer(&picture, begun - *first.get_or_insert(begun));
        last = Some(picture);
    }
    let Some(last) = last else {
        return Ok(());
    };
    screen.pictures.push(film.finish()?);
    for (name, picture) in [("moments.png", &moments.sheet()), ("last.png", &last)] {
        let file = folder.join(name);
        write_png(&file, picture)?;
        screen.pictures.push(file);
    }
    Ok(())
}

/// One picture of the moment; both eyes' side by side. Nothing if the device was lost meanwhile.
fn draw(
    live: &mut LiveView,
    viewpoint: &Viewpoint,
    moment: &Moment,
) -> anyhow::Result<Option<RgbImage>> {
    let setting = live.setting().clone();
    let size = setting.size;
    let camera = viewpoint.camera(moment.floor, moment.heading, size.width, size.height);
    if let Drawn::Renewed(_) = live.draw(camera)? {
        return Ok(None);
    }
    let splatted = match read_views(live.lanes.renderer()) {
        // The next picture finds that out again, and opens another.
        Err(error) if error.is_device_lost() => return Ok(None),
        views => views?,
    };
    live.displayed();
    let skeleton = &live.avatar().skeleton;
    let cameras = eyes(camera, setting.views);
    let mut drawn = compose_views(&splatted, &cameras, skeleton, &moment.motion, &setting)?;
    if drawn.len() == 1 {
        return Ok(Some(drawn.swap_remove(0)));
    }
    let mut both = RgbImage::new(size.width * setting.views.count(), size.height);
    for (picture, x) in drawn.iter().zip([0, i64::from(size.width)]) {
        imageops::replace(&mut both, picture, x, 0);
    }
    Ok(Some(both))
}
