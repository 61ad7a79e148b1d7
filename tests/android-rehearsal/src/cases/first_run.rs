//! The first launch: there are no settings, and the headset shows what to type.

use super::activities::shows_a_notice;
use super::{Figures, assert_well, figure};
use crate::environment::Environment;
use crate::screenshot::Screenshot;
use android_rehearsal::protocol::Intent;
use anyhow::ensure;
use renderer_splat::camera::Fov;
use test_support::monado::{Compositor, Driver, Scripted};

/// The fewest edges of letters in the mirror window's picture. A panel without text has some hundreds, one a row at its sides.
const LEAST_EDGES: usize = 1500;

/// A head that stands still, and whose eyes see little more than the panel: so that its letters can be read in a small window.
fn reader() -> Scripted {
    let mut scripted = Scripted::default();
    for eye in &mut scripted.eyes {
        eye.fov = Fov {
            left: -0.3,
            right: 0.3,
            up: 0.3,
            down: -0.3,
        };
    }
    scripted
}

pub(super) fn perform(environment: &Environment, name: &str) -> anyhow::Result<Figures> {
    let scene = environment.scene_of(name, Driver::Remote, Compositor::Window)?;
    // Held to the end: Monado writes answers, and ends when the other end is closed.
    let mut head = scene.monado.head();
    head.send(&reader());
    let mut process = scene.process()?;
    let activity = process.launch(Intent::default())?;
    shows_a_notice(&mut process)?;
    ensure!(
        process.logged("no room") + process.logged("`room`") + process.logged("room is missing")
            > 0,
        "the log does not say that there is no room:\n{}",
        process.logcat()
    );
    let mut shown = Screenshot::of(&scene.monado)?;
    let picture = scene.folder.join("notice.png");
    let letters = process.wait_until("a notice on the mirror", |_| {
        shown = Screenshot::of(&scene.monado)?;
        Ok(shown.edges() > LEAST_EDGES)
    });
    shown.save(&picture)?;
    letters?;
    process.leave(activity)?;
    assert_well(&mut process)?;
    process.quit()?;
    let mut figures = Figures::new();
    figure(&mut figures, "picture", picture.display().to_string());
    figure(&mut figures, "edges", shown.edges());
    Ok(figures)
}
