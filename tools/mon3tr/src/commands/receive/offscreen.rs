//! `--display offscreen`: the session as pictures on disk, as a display of 60 Hz would show it.

use super::ShowOptions;
use crate::film::{Film, write_png};
use crate::flat::{self, display_error};
use crate::gaze::Gaze;
use crate::moments::Moments;
use crate::size::{Size, Views};
use crate::stills::{compose_views, read_views};
use crate::until::Until;
use crate::viewpoint::{Viewpoint, eyes};
use app_session::display::{DrawnPicture, LiveSession, PictureObserver, SessionError, Standpoint};
use image::{RgbImage, imageops};
use renderer_splat::camera::Camera;
use std::path::{Path, PathBuf};
use std::time::Instant;

/// Keeps pictures of a session.
pub(super) struct Pictures<'a> {
    until: &'a Until,
    viewpoint: Viewpoint,
    size: Size,
    views: Views,
    /// Moves the camera, if there is one.
    pub(super) gaze: Option<Gaze>,
    film: Film,
    moments: Moments,
    last: Option<RgbImage>,
    first: Option<Instant>,
    shown: u64,
}

impl<'a> Pictures<'a> {
    pub(super) fn new(
        options: &ShowOptions,
        size: Size,
        folder: &Path,
        gaze: Option<Gaze>,
        until: &'a Until,
    ) -> Self {
        Self {
            until,
            viewpoint: options.viewpoint(),
            size,
            views: options.views(),
            gaze,
            film: Film::start(folder.join("animation.webp")),
            moments: Moments::default(),
            last: None,
            first: None,
            shown: 0,
        }
    }

    /// Writes an animation of all of it, moments on one sheet, and the last picture. None if there was none.
    pub(super) fn write(self, folder: &Path) -> anyhow::Result<Vec<PathBuf>> {
        let Some(last) = self.last else {
            return Ok(Vec::new());
        };
        let mut written = vec![self.film.finish()?];
        for (name, picture) in [("moments.png", &self.moments.sheet()), ("last.png", &last)] {
            let file = folder.join(name);
            write_png(&file, picture)?;
            written.push(file);
        }
        Ok(written)
    }

    fn keep(&mut self, picture: DrawnPicture<'_>) -> anyhow::Result<()> {
        let splatted = match read_views(picture.renderer) {
            // The next picture finds that out again, and opens another.
            Err(error) if error.is_device_lost() => return Ok(()),
            views => views?,
        };
        let people = (picture.people.iter())
            .map(|(avatar, motion, place)| (&avatar.skeleton, motion, *place));
        let has_scene = picture.renderer.options().background.is_some();
        let drawn = compose_views(&splatted, picture.cameras, people, has_scene)?;
        let picture_of_all = beside(&drawn);
        let since_first = picture.begun - *self.first.get_or_insert(picture.begun);
        self.moments.offer(&picture_of_all);
        self.film.offer(&picture_of_all, since_first);
        self.last = Some(picture_of_all);
        self.shown += 1;
        Ok(())
    }
}

impl PictureObserver for Pictures<'_> {
    fn is_over(
        &mut self,
        _session: &LiveSession<'_>,
        _first: Option<Instant>,
    ) -> Result<bool, SessionError> {
        Ok(self.until.is_over(self.shown))
    }

    fn cameras(&mut self, people: &Standpoint) -> Vec<Camera> {
        let viewpoint = flat::around(self.viewpoint, people, self.size);
        let camera = flat::camera(viewpoint, self.gaze.as_mut(), people, self.size);
        eyes(camera, self.views)
    }

    fn drawn(&mut self, picture: DrawnPicture<'_>) -> Result<(), SessionError> {
        self.keep(picture).map_err(display_error)
    }
}

/// Views side by side.
fn beside(views: &[RgbImage]) -> RgbImage {
    let width = views.iter().map(RgbImage::width).sum();
    let height = views.iter().map(RgbImage::height).max().unwrap_or(0);
    let mut all = RgbImage::new(width, height);
    let mut x = 0;
    for view in views {
        imageops::replace(&mut all, view, x, 0);
        x += i64::from(view.width());
    }
    all
}
