//! What is missing, told in the headset.

use super::Stage;
use app_session::headset::{NoticeBoard, show_notice};
use app_session::overlay::Notice;

/// Shows this until the app is closed.
pub(super) fn show_until_closed(
    stage: &Stage<'_>,
    title: &str,
    lines: Vec<String>,
) -> anyhow::Result<()> {
    let board = NoticeBoard::default();
    board.write(Notice {
        title: title.to_owned(),
        lines,
    });
    if let Some(found) = stage.find()? {
        show_notice(found, &board, stage.control, || false)?;
    }
    Ok(())
}
