//! The first launch: nothing is known, and the headset says what to type.

use super::activities::shows_a_notice;
use super::{Figures, assert_well, figure};
use crate::screenshot::Screenshot;
use crate::stage::Stage;
use android_rehearsal::protocol::Intent;
use anyhow::ensure;
use mon3tr_tests::monado::Compositor;

/// Of the mirror window's picture, the least share that is text or panel rather than the surface behind.
const LEAST_SHARE: f64 = 0.05;

pub(super) fn perform(stage: &Stage, name: &str) -> anyhow::Result<Figures> {
    let scene = stage.scene(name, Compositor::Window)?;
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
    process.wait_until("a notice on the mirror", |_| {
        shown = Screenshot::of(&scene.monado)?;
        Ok(shown.share_unlike_the_corner() > LEAST_SHARE)
    })?;
    let picture = scene.folder.join("notice.png");
    shown.save(&picture)?;
    process.leave(activity)?;
    assert_well(&mut process)?;
    process.quit()?;
    let mut figures = Figures::new();
    figure(&mut figures, "picture", picture.display().to_string());
    figure(
        &mut figures,
        "share_of_the_picture",
        shown.share_unlike_the_corner(),
    );
    Ok(figures)
}
