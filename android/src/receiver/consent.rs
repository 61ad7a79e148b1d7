//! Whether the wearer wants to go where a link leads: any web page and any app can have the app opened with one. Of rooms, where others are only watched, the
//! wearer is asked once a server; of calls, in which they are seen and heard, once a call.

use super::TaskContext;
use crate::first_run;
use crate::settings::{Origin, Settings, Task};
use anyhow::bail;
use app_session::headset::{NoticeBoard, show_notice};
use app_session::overlay::{NOTICE_LETTERS, Notice};
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
        if server.authority().len() > LONGEST_HOST {
            bail!(
                "the link's server has a name of {} letters, longer than any on the internet: ask for another link",
                server.authority().len()
            );
        }
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

/// Letters of a host's name (RFC 1035: 253), with a colon and a port.
const LONGEST_HOST: usize = 253 + 6;

/// Lines of the notice that an address has at most: a longer one is cut in its middle.
const ADDRESS_LINES: usize = 3;

/// Whether the wearer agrees to go to this server.
fn ask(task: &TaskContext<'_>, server: &ServerUrl, is_member: bool) -> anyhow::Result<bool> {
    let Some(headset) = task.find()? else {
        return Ok(false);
    };
    let board = NoticeBoard::default();
    board.ask(question(server, is_member));
    show_notice(headset, &board, task.control, || board.is_answered())?;
    Ok(board.is_answered())
}

/// What the wearer reads: where the link leads, how to go there and how not to, and the whole address last. All of it
/// fits, however long the address is.
fn question(server: &ServerUrl, is_member: bool) -> Notice {
    let what = if is_member {
        "A link asks you into a call. Whoever is there will hear you, and see your avatar move as you do."
    } else {
        "A link asks you into a room. Whoever is there will stand before you, and you will hear them."
    };
    let host = server.authority();
    let mut lines = first_run::wrapped(&format!("The server: {host}"));
    let paragraphs = [
        what,
        "You have not been in it with this headset. To go there, squeeze a controller's grip, or pinch, and hold for a second. \
         To stay out, close the app.",
    ];
    for paragraph in paragraphs {
        lines.push(String::new());
        lines.extend(first_run::wrapped(paragraph));
    }
    let address = server.to_string();
    let rest = address.split_once("://").map(|(_, rest)| rest);
    if rest != Some(host) {
        lines.push(String::new());
        let address = format!("The whole address: {address}");
        lines.extend(first_run::wrapped(&shortened(&address)));
    }
    Notice {
        title: "Do you want to go there?".to_owned(),
        lines,
    }
}

/// A text of ASCII in [`ADDRESS_LINES`] lines at most, by leaving out its middle.
fn shortened(text: &str) -> String {
    let longest = ADDRESS_LINES * NOTICE_LETTERS as usize;
    let half = longest / 2 - NOTICE_LETTERS as usize / 2;
    let ends = text
        .get(..half)
        .zip(text.get(text.len().saturating_sub(half)..));
    match ends {
        Some((begin, end)) if text.len() > longest => format!("{begin}[...]{end}"),
        _ => text.to_owned(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use app_session::overlay::NOTICE_LINES;

    /// Where the notice has all of `words` in a row, as a line's number.
    fn line_of(notice: &Notice, words: &str) -> usize {
        let from = |at: &usize| {
            let rest = notice.lines[*at..].join(" ");
            rest.contains(words)
        };
        (0..notice.lines.len())
            .rev()
            .find(from)
            .unwrap_or_else(|| panic!("no `{words}` in {:#?}", notice.lines))
    }

    #[test]
    fn a_wearer_reads_the_host_and_what_to_do_however_long_the_address_is() {
        let labels = vec!["m".repeat(62); 4].join(".");
        let hosts = [
            "example.com",
            "192.0.2.1:8080",
            "[2001:db8::1]:8080",
            "login.example.com.a.b.c.example.org",
            // Cyrillic letters, and a right-to-left script: the address has both in ASCII.
            "ex\u{430}mple.com",
            "\u{5d0}\u{5d1}\u{5d2}.example",
            &labels,
        ];
        let paths = [
            String::new(),
            "/a".to_owned(),
            format!("/{}", "squeeze/".repeat(30)),
            format!("/{}", "x".repeat(1_700)),
            "/https://other.example/".repeat(60),
            format!("/{}", "\u{202e}".repeat(150)),
            format!("/{}", "%20".repeat(500)),
        ];
        for host in hosts {
            for path in &paths {
                for is_member in [false, true] {
                    let server: ServerUrl = (format!("https://{host}{path}").parse())
                        .unwrap_or_else(|why| panic!("{host}{path}: {why}"));
                    let notice = question(&server, is_member);
                    assert!(notice.lines.len() <= NOTICE_LINES, "{:#?}", notice.lines);
                    for line in &notice.lines {
                        assert!(line.len() <= NOTICE_LETTERS as usize, "{line}");
                        assert!(line.is_ascii(), "{line}");
                    }
                    let text = notice.lines.concat().replace(' ', "");
                    assert!(text.starts_with(&format!("Theserver:{}", server.authority())));
                    let [go, stay] =
                        ["hold for a second.", "close the app."].map(|it| line_of(&notice, it));
                    assert!(go <= stay);
                    if !path.is_empty() {
                        assert!(
                            stay < line_of(&notice, "The whole address:"),
                            "the instruction is first"
                        );
                    }
                }
            }
        }
    }

    #[test]
    fn an_address_of_2048_characters_fits_with_its_ends() {
        let address = format!("https://example.com/{}/end", "y".repeat(2_024));
        assert_eq!(address.len(), 2_048);
        let server: ServerUrl = address.parse().expect("an address");
        let lines = question(&server, true).lines;
        let text = lines.concat();
        assert!(
            text.contains("[...]") && text.ends_with("/end"),
            "{lines:#?}"
        );
        assert!(lines.len() <= NOTICE_LINES);
    }
}
