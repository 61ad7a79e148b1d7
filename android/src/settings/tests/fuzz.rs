//! Good links, altered links, and any text.

use super::{read, rooms};
use crate::settings::Task;
use crate::settings::{Destination, Key, deep_link, read_deep_link};
use proptest::prelude::*;
use url::Url;

/// Links to rooms and calls as servers print them.
fn good_links() -> impl Strategy<Value = String> {
    let host = prop_oneof![
        "[a-z][a-z0-9]{0,6}(-[a-z0-9]{1,4})?(\\.[a-z][a-z0-9]{0,6}){0,2}",
        "(10|192)\\.(0|168)\\.[1-9][0-9]?\\.[1-9][0-9]?",
        Just("[::1]".to_owned()),
    ];
    let port = prop_oneof![
        Just(String::new()),
        (1024..65_535_u16).prop_map(|port| format!(":{port}"))
    ];
    let prefix = "(/[a-z0-9_-]{1,8}){0,2}";
    let room = "[A-Za-z0-9_~-]{1,20}";
    let token = "[A-Za-z0-9._~+/=-]{1,60}";
    let place = prop::sample::select(vec!["rooms", "calls"]);
    (any::<bool>(), host, port, prefix, place, room, token).prop_map(
        |(secure, host, port, prefix, place, room, token)| {
            let scheme = if secure { "https" } else { "http" };
            format!("{scheme}://{host}{port}{prefix}/{place}/{room}#{token}")
        },
    )
}

/// A link of a place, `room` or `call`.
fn destination(link: &str) -> Destination {
    if link.contains("/calls/") {
        Destination::Call(link.parse().expect("a good link"))
    } else {
        Destination::Room(link.parse().expect("a good link"))
    }
}

/// The server that a link leads to, and the link.
fn server_and_link(of: &Destination) -> (String, String) {
    match of {
        Destination::Room(room) => (room.server().to_string(), room.to_string()),
        Destination::Call(call) => (call.server().to_string(), call.to_string()),
    }
}

/// Scheme, host and port of an address, by the WHATWG's parser alone.
fn origin(address: &str) -> Option<url::Origin> {
    Url::parse(address).ok().map(|url| url.origin())
}

/// What the deep link names as a person reads it: by splitting the text, without a parser.
fn named_by_eye(deep: &str) -> Option<String> {
    let rest = deep.strip_prefix("mon3tr://room/");
    let rest = rest.or_else(|| deep.strip_prefix("mon3tr://call/"))?;
    let (scheme, rest) = rest.split_once('/')?;
    let (host, _) = rest.split_once('/')?;
    Some(format!("{scheme}://{host}"))
}

/// Checks what was read from a text: it prints as that text, and names the server that stands there.
fn check_out(text: &str, room: &Destination) -> Result<(), TestCaseError> {
    let (server, link) = server_and_link(room);
    let again = deep_link(room);
    let read_again = read_deep_link(&again);
    prop_assert_eq!(read_again.as_ref(), Ok(room), "round trip of {}", text);
    let eye = named_by_eye(text);
    prop_assert!(eye.is_some(), "{} names a server", text);
    prop_assert_eq!(
        origin(&server),
        origin(&eye.unwrap_or_default()),
        "of {}",
        text
    );
    let host = server.to_lowercase();
    let bare = host
        .split("://")
        .nth(1)
        .and_then(|rest| rest.split('/').next())
        .unwrap_or_default();
    prop_assert!(
        text.to_lowercase().contains(bare),
        "{} stands in {}",
        bare,
        text
    );
    let token = link
        .split_once('#')
        .map(|(_, token)| token)
        .unwrap_or_default();
    // Short ones are found in any text.
    prop_assert!(
        token.len() < 8 || !format!("{room:?}").contains(token),
        "not shown"
    );
    Ok(())
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 2_000, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn every_link_has_a_deep_link_that_reads_back(text in good_links()) {
        let room = destination(&text);
        let deep = deep_link(&room);
        let read_back = read_deep_link(&deep);
        prop_assert_eq!(read_back.as_ref(), Ok(&room), "{}", deep);
        check_out(&deep, &room)?;
        let settings = read(&[], Some(&deep), None).expect("a room");
        let joined = match &settings.task {
            Task::Member(call) => vec![call.value.to_string()],
            _ => rooms(&settings),
        };
        prop_assert_eq!(joined, [text], "nothing else comes of it");
    }

    #[test]
    fn a_link_that_was_tampered_with_is_refused_or_means_what_it_says(
        text in good_links(),
        cuts in prop::collection::vec((any::<prop::sample::Index>(), 0..4_u8, "[ -~]{0,3}|[\\x00-\\x1f]|\\PC|(%[0-9a-fA-F]{2})|\\.\\./|//|@evil\\.example"), 1..4),
    ) {
        let room = destination(&text);
        let mut deep: Vec<char> = deep_link(&room).chars().collect();
        for (at, how, piece) in cuts {
            let at = at.index(deep.len() + 1).min(deep.len());
            let end = (at + usize::from(how)).min(deep.len());
            deep.splice(at..end, piece.chars());
        }
        let text: String = deep.into_iter().collect();
        match read_deep_link(&text) {
            Ok(room) => check_out(&text, &room)?,
            Err(problem) => {
                let reported = problem.to_string();
                prop_assert!(!reported.chars().any(char::is_control), "one line: {:?}", reported);
                prop_assert!(reported.len() < 400, "short: {}", reported);
            }
        }
    }

    #[test]
    fn no_text_at_all_makes_the_settings_panic(
        names in prop::collection::vec(prop_oneof![
            prop::sample::select(Key::ALL.map(Key::name).to_vec()).prop_map(str::to_owned),
            "\\PC{0,12}",
        ], 0..6),
        texts in prop::collection::vec("(?s).{0,40}|https?://[ -~]{0,20}", 6),
        link in prop::option::of("(?s).{0,60}|mon3tr://(room|call)/[ -~]{0,40}"),
        file in prop::option::of("(?s).{0,60}|((room|server|token|call|name|avatar|rate|seat) = \"?[ -~]{0,20}\"?\n){0,4}"),
    ) {
        let extras: Vec<(&str, &str)> = names.iter().map(String::as_str).zip(texts.iter().map(String::as_str)).collect();
        if let Err(problems) = read(&extras, link.as_deref(), file.as_deref()) {
            prop_assert!(!problems.is_empty(), "a refusal says why");
            for reported in problems.iter().map(ToString::to_string) {
                prop_assert!(!reported.chars().any(char::is_control) && reported.len() < 400, "one short line: {:?}", reported);
            }
        }
    }

    #[test]
    fn no_refusal_repeats_a_token(token in "[A-Za-z0-9]{24}", spoiled in "[ \"<>%\\\\\u{7}#]{1,2}", at in 0..24_usize) {
        let mut text = token.clone();
        text.insert_str(at, &spoiled);
        let link = format!("https://h/rooms/R#{text}");
        let deep = format!("mon3tr://room/https/h/rooms/R#{text}");
        let file = format!("server = \"https://h\"\nroom = \"R\"\ntoken = \"{text}\"\n");
        let (before, after) = token.split_at(at);
        for outcome in [
            read(&[("room", &link)], None, None),
            read(&[("server", "https://h"), ("room", "R"), ("token", &text)], None, None),
            read(&[], Some(&deep), None),
            read(&[], None, Some(&file)),
        ] {
            let reported = format!("{outcome:?}");
            for piece in [before, after] {
                prop_assert!(piece.len() < 8 || !reported.contains(piece), "{}", reported);
            }
        }
    }
}
