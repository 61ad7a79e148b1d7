//! Whether the wearer wants to go where a link leads: any web page and any app can have the app opened with one. Of rooms, where others are only watched, the
//! wearer is asked once a server; of calls, in which they are seen and heard, once a call.

use super::TaskContext;
use crate::first_run;
use crate::settings::{Origin, Settings, Task};
use anyhow::bail;
use app_session::headset::{NoticeBoard, show_notice};
use app_session::overlay::Notice;
use link_protocol::room_link::ServerUrl;

/// Asks the wearer about every server, or call, that is new here, unless they have named it in `mon3tr.toml`. Whether they agree; if not, the app was closed.
pub(super) fn is_given(task: &TaskContext<'_>, settings: &Settings) -> anyhow::Result<bool> {
    let (servers, origin, call): (Vec<&ServerUrl>, _, _) = match &settings.task {
        Task::Call(rooms) => {
            let servers = rooms.value.iter().map(|room| room.server()).collect();
            (servers, rooms.origin, None)
        }
        Task::Member(call) => (
            vec![call.value.server()],
            call.origin,
            Some(call.value.call()),
        ),
        Task::Profile(_) => return Ok(true),
    };
    for server in &servers {
        if server.is_unprotected() {
            bail!(
                "{server} is on the internet and speaks plain HTTP, which anyone on the way can read and change: ask for a link that begins with https"
            );
        }
    }
    if origin == Origin::File {
        return Ok(true);
    }
    let known = task.launch.folders.servers();
    for server in servers {
        if known.has(server, call) {
            continue;
        }
        log::info!("asking whether to go to {server}");
        if !ask(task, server, call.is_some())? {
            return Ok(false);
        }
        log::info!("the wearer agrees to go to {server}");
        if let Err(error) = known.add(server, call) {
            log::warn!("{server} is asked about again the next time: {error}");
        }
    }
    Ok(true)
}

/// Whether the wearer agrees to go to this server.
fn ask(task: &TaskContext<'_>, server: &ServerUrl, is_member: bool) -> anyhow::Result<bool> {
    let Some(headset) = task.find()? else {
        return Ok(false);
    };
    let what = if is_member {
        "A link asks you into a call. Whoever is there will hear you, and see your avatar move as you do."
    } else {
        "A link asks you into a room. Whoever is there will stand before you, and you will hear them."
    };
    let mut lines = first_run::wrapped(what);
    lines.push(String::new());
    lines.extend(first_run::wrapped(&format!("The server: {server}")));
    lines.push(String::new());
    lines.extend(first_run::wrapped(
        "You have not been in it with this headset. To go there, squeeze a controller's grip, or pinch, and hold for a second. \
         To stay out, close the app.",
    ));
    let board = NoticeBoard::default();
    board.ask(Notice {
        title: "Do you want to go there?".to_owned(),
        lines,
    });
    show_notice(headset, &board, task.control, || board.is_answered())?;
    Ok(board.is_answered())
}
