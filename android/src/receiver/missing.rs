//! Shows missing settings in the headset.

use super::TaskContext;
use app_session::headset::{NoticeBoard, show_notice};
use app_session::overlay::Notice;

/// Shows this until the app is closed.
pub(super) fn show_until_closed(
    task: &TaskContext<'_>,
    title: &str,
    lines: Vec<String>,
) -> anyhow::Result<()> {
    let board = NoticeBoard::default();
    board.write(Notice {
        title: title.to_owned(),
        lines,
    });
    if let Some(found) = task.find()? {
        show_notice(found, &board, task.control, || false)?;
    }
    Ok(())
}
