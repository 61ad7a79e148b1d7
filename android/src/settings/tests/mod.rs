use super::*;
use app_pipeline::plan::{PlacementRequest, Plan};
use app_pipeline::timeline::LatencyMode;
use log::LevelFilter;
use std::time::Duration;

mod fuzz;

const LINK: &str = "https://call.example:8480/rooms/R7#s3cret-token";

fn read(
    extras: &[(&str, &str)],
    link: Option<&str>,
    file: Option<&str>,
) -> Result<Settings, Vec<Problem>> {
    Sources::read(extras.iter().copied(), link, file).settings()
}

fn reported(extras: &[(&str, &str)], link: Option<&str>, file: Option<&str>) -> String {
    let problems = read(extras, link, file).expect_err("refused");
    let reported: Vec<String> = problems.iter().map(ToString::to_string).collect();
    assert!(
        reported
            .iter()
            .all(|line| !line.chars().any(char::is_control)),
        "one line each: {reported:?}"
    );
    reported.join(" | ")
}

fn rooms(settings: &Settings) -> Vec<String> {
    match &settings.task {
        Task::Call(rooms) => rooms.value.iter().map(ToString::to_string).collect(),
        Task::Member(_) | Task::Profile(_) => Vec::new(),
    }
}

#[test]
fn a_room_is_joined_the_same_way_whichever_source_names_it() {
    let by_parts = [
        ("server", "https://call.example:8480"),
        ("room", "R7"),
        ("token", "s3cret-token"),
    ];
    let file = format!("# my room\nroom = \"{LINK}\"\n");
    let deep = "mon3tr://room/https/call.example:8480/rooms/R7#s3cret-token";
    for (origin, settings) in [
        (Origin::Intent, read(&by_parts, None, None)),
        (Origin::Intent, read(&[("room", LINK)], None, None)),
        (Origin::Link, read(&[], Some(deep), None)),
        (Origin::File, read(&[], None, Some(&file))),
    ] {
        let settings = settings.expect("a room");
        assert_eq!(rooms(&settings), [LINK], "by {origin}");
        assert!(
            matches!(&settings.task, Task::Call(rooms) if rooms.origin == origin),
            "{settings:?}"
        );
        assert!(
            !format!("{settings:?}").contains("s3cret"),
            "the token is not shown"
        );
    }
}

#[test]
fn a_call_is_joined_the_same_way_whichever_source_names_it() {
    let link = "https://call.example:8480/calls/C7#s3cret-token";
    let file = format!("call = \"{link}\"\navatar = \"ada.m3a\"\nname = \"Ада\"\n");
    let deep = "mon3tr://call/https/call.example:8480/calls/C7#s3cret-token";
    for (origin, settings) in [
        (Origin::Intent, read(&[("call", link)], None, None)),
        (Origin::Link, read(&[], Some(deep), None)),
        (Origin::File, read(&[], None, Some(&file))),
    ] {
        let settings = settings.expect("a call");
        let Task::Member(call) = &settings.task else {
            panic!("by {origin}: {settings:?}");
        };
        assert_eq!(
            (call.value.to_string().as_str(), call.origin),
            (link, origin)
        );
        let (avatar, name) = match origin {
            Origin::File => ("ada.m3a", Some("Ада")),
            _ => ("avatar.m3a", None),
        };
        assert_eq!(settings.avatar.value.as_str(), avatar, "by {origin}");
        let given = settings.name.value.as_ref().map(|name| name.as_str());
        assert_eq!(given, name, "by {origin}");
        assert!(!format!("{settings:?}").contains("s3cret"), "not shown");
    }
    // What a stronger source names counts, be it a room or a call; of one source the call.
    let room = read(&[("room", LINK)], Some(deep), Some(&file)).expect("a room");
    assert_eq!(rooms(&room), [LINK], "the intent's");
    let both = read(&[("room", LINK), ("call", link)], None, None).expect("a call");
    assert!(matches!(both.task, Task::Member(_)), "{both:?}");
    let named = read(
        &[("name", "Ada"), ("avatar", "b-2.m3a")],
        Some(deep),
        Some(&file),
    );
    let named = named.expect("a call");
    assert_eq!(named.name.value.expect("a name").as_str(), "Ada");
    assert_eq!(named.avatar.value.as_str(), "b-2.m3a");
}

#[test]
fn a_call_that_cannot_be_meant_and_an_avatar_elsewhere_are_refused() {
    for (call, why) in [
        ("https://me:pw@h/calls/C#s3cret", "user name"),
        ("https://0x7f.1/calls/C#s3cret", "would be understood as"),
        ("https://h/rooms/R#s3cret", "/calls/CALL"),
        ("https://h/calls/C", "#TOKEN"),
        ("https://h/calls/../C#s3cret", ""),
    ] {
        let reported = reported(&[("call", call)], None, None);
        assert!(
            reported.starts_with("call in the intent") && reported.contains(why),
            "{reported}"
        );
        assert!(!reported.contains("s3cret"), "{reported}");
    }
    let call = ("call", "https://h/calls/C#t");
    for avatar in [
        "../own/packages/x.m3a",
        "/data/x.m3a",
        ".m3a",
        "..m3a",
        ".x.m3a",
        "x.toml",
        "a b.m3a",
        "x.m3a\u{202e}",
        "",
    ] {
        let reported = reported(&[call, ("avatar", avatar)], None, None);
        assert!(reported.starts_with("avatar in the intent"), "{reported}");
    }
    for name in ["", "  ", "a\nb", "\u{202e}adA", &"x".repeat(41)] {
        let reported = reported(&[call, ("name", name)], None, None);
        assert!(reported.starts_with("name in the intent"), "{reported}");
    }
    for (link, why) in [
        ("mon3tr://call/https/h/rooms/R#s3cret", "/calls/CALL"),
        ("mon3tr://room/https/h/calls/C#s3cret", "/rooms/ROOM"),
        ("mon3tr://calls/https/h/calls/C#s3cret", "must begin with"),
    ] {
        let reported = reported(&[], Some(link), None);
        assert!(
            reported.contains(why) && !reported.contains("s3cret"),
            "{reported}"
        );
    }
}

#[test]
fn every_setting_is_read_from_extras_and_from_the_file() {
    let extras = [
        ("room", "https://a/rooms/A#t1, http://b:1/rooms/B#t2"),
        ("seat", "true"),
        ("rate", "90"),
        ("placement", "npu,npu=qnn"),
        ("latency", "extrapolate"),
        ("log", "debug"),
        ("cache_mb", "1000"),
        ("ca", "home.pem"),
    ];
    let file = "room = [\"https://a/rooms/A#t1\", \"http://b:1/rooms/B#t2\"]\nseat = true\nrate = 90\n\
                placement = \"npu,npu=qnn\"\nlatency = \"extrapolate\"\nlog = \"debug\"\ncache_mb = 1000\nca = \"home.pem\"\n";
    for (origin, settings) in [
        (Origin::Intent, read(&extras, None, None)),
        (Origin::File, read(&[], None, Some(file))),
    ] {
        let settings = settings.expect("all good");
        assert_eq!(rooms(&settings).len(), 2, "two rooms");
        assert_eq!(
            settings.seat,
            Sourced {
                value: true,
                origin
            },
            "seat"
        );
        assert_eq!(settings.rate.value, Some(DisplayRate::Hz90), "rate");
        let placement = PlacementRequest {
            plan: Some(Plan::Npu),
            provider: "npu=qnn".parse::<PlacementRequest>().expect("one").provider,
            ..PlacementRequest::default()
        };
        assert_eq!(
            settings.placement,
            Sourced {
                value: placement,
                origin
            },
            "placement"
        );
        assert_eq!(settings.latency.value, LatencyMode::Extrapolate, "latency");
        assert_eq!(settings.log.value, LevelFilter::Debug, "log");
        assert_eq!(settings.cache_bytes.value, 1_000_000_000, "cache");
        let ca = settings.ca.value.as_ref();
        assert_eq!(ca.map(|file| file.as_str()), Some("home.pem"), "ca");
    }
    let untold = read(&[("room", LINK)], None, None).expect("a room");
    assert_eq!(
        untold.seat,
        Sourced {
            value: false,
            origin: Origin::Default
        },
        "seat"
    );
    assert_eq!(untold.rate.value, None, "the rate that frames keep up with");
    assert_eq!(untold.cache_bytes.value, 512_000_000, "cache");
    assert_eq!(untold.ca.value, None, "public certificates alone");
    let measured = read(&[("profile", "60")], None, None).expect("no room is needed");
    assert_eq!(
        measured.task,
        Task::Profile(Sourced {
            value: Duration::from_secs(60),
            origin: Origin::Intent
        }),
        "a minute"
    );
}

#[test]
fn where_the_wearer_looks_is_sent_only_where_the_file_says() {
    let file = format!("room = \"{LINK}\"\ngaze_to = \"192.168.1.20:7215\"\n");
    let settings = read(&[], None, Some(&file)).expect("good");
    let screen = Some(([192, 168, 1, 20], 7215).into());
    assert_eq!(settings.gaze_to.value, screen, "the file's");
    // What any app may say does not get it: the app joins nothing then, and says why.
    let by_app = reported(&[("gaze_to", "127.0.0.1:7215")], None, Some(&file));
    assert!(
        by_app.contains("gaze_to in the intent") && by_app.contains("mon3tr.toml"),
        "{by_app}"
    );
    let named = file.replace("192.168.1.20", "screen");
    let refused = reported(&[], None, Some(&named));
    assert!(refused.contains("192.168.1.20:7215"), "{refused}");
    let untold = read(&[("room", LINK)], None, None).expect("a room");
    assert_eq!(untold.gaze_to.value, None, "nobody is told");
}

#[test]
fn an_extra_comes_before_the_link_and_the_link_before_the_file() {
    let deep = "mon3tr://room/https/link.example/rooms/L#t";
    let file = "room = \"https://file.example/rooms/F#t\"\nrate = 72\nseat = true\n";
    let whole = "https://intent.example/rooms/I#t";
    let by_all = read(&[("room", whole), ("rate", "120")], Some(deep), Some(file)).expect("good");
    assert_eq!(rooms(&by_all), [whole], "the extra's room");
    assert_eq!(
        by_all.rate,
        Sourced {
            value: Some(DisplayRate::Hz120),
            origin: Origin::Intent
        },
        "rate"
    );
    assert_eq!(
        by_all.seat.origin,
        Origin::File,
        "no other source says whether to sit"
    );
    let by_link = read(&[], Some(deep), Some(file)).expect("good");
    assert_eq!(
        rooms(&by_link),
        ["https://link.example/rooms/L#t"],
        "the link's room"
    );
    // A room that is named now is meant, whatever the file has the app do otherwise.
    let file = "profile = 60";
    let called = read(&[], Some(deep), Some(file)).expect("good");
    assert_eq!(rooms(&called).len(), 1, "a call");
    let measured = read(&[("profile", "60")], Some(deep), None).expect("good");
    assert!(
        matches!(measured.task, Task::Profile(_)),
        "asked for by the stronger"
    );
}

#[test]
fn a_token_goes_to_no_server_that_a_stronger_source_named() {
    let file = "server = \"https://mine.example\"\nroom = \"R\"\ntoken = \"s3cret\"\n";
    let good = read(&[("room", "R2")], None, Some(file)).expect("another room there");
    assert_eq!(
        rooms(&good),
        ["https://mine.example/rooms/R2#s3cret"],
        "the file's server"
    );
    let good = read(&[("token", "other")], None, Some(file)).expect("another token there");
    assert_eq!(
        rooms(&good),
        ["https://mine.example/rooms/R#other"],
        "the file's server"
    );
    let reported = reported(&[("server", "https://evil.example")], None, Some(file));
    assert!(
        reported.contains("token in mon3tr.toml is not sent"),
        "{reported}"
    );
    assert!(!reported.contains("s3cret"), "{reported}");
}

#[test]
fn a_whole_link_allows_no_other_server_or_token() {
    for (key, value) in [("server", "https://other"), ("token", "t")] {
        let reported = reported(&[("room", LINK), (key, value)], None, None);
        assert!(
            reported.contains(key) && reported.contains("whole link"),
            "{reported}"
        );
        // A weaker one's belongs to its own room.
        let file = format!("{key} = \"{value}\"");
        let good = read(&[("room", LINK)], None, Some(&file)).expect("overruled");
        assert_eq!(rooms(&good), [LINK], "the extra's");
    }
}

#[test]
fn an_invalid_value_is_refused_with_its_source_and_the_reason() {
    for (extras, link, file, why) in [
        (
            vec![("rate", "60")],
            None,
            None,
            "rate in the intent: `60` is no display rate: give auto, 72, 80, 90 or 120",
        ),
        (vec![("seat", "yes")], None, None, "seat in the intent"),
        (
            vec![("placement", "warp")],
            None,
            None,
            "placement in the intent",
        ),
        (
            vec![("latency", "none")],
            None,
            None,
            "latency in the intent",
        ),
        (vec![("log", "loud")], None, None, "log in the intent"),
        (vec![("profile", "0")], None, None, "whole seconds"),
        (vec![("profile", "+60")], None, None, "whole seconds"),
        (
            vec![("profile", "99999999999999999999")],
            None,
            None,
            "whole seconds",
        ),
        (vec![("cache_mb", "-1")], None, None, "whole megabytes"),
        (
            vec![("ca", "../key.pem")],
            None,
            None,
            "file of certificates",
        ),
        (
            vec![("ca", "mon3tr.toml")],
            None,
            None,
            "file of certificates",
        ),
        (vec![("rate", "90\u{0}")], None, None, "U+0000"),
        (vec![("rate", "\u{202e}09")], None, None, "U+202E"),
        (vec![("room", "R\u{301}")], None, None, "U+0301"),
        (vec![("room", "")], None, None, "room is missing"),
        (
            vec![("room", ".."), ("server", "https://h"), ("token", "t")],
            None,
            None,
            "room's name",
        ),
        (
            vec![("room", "a%2fb"), ("server", "https://h"), ("token", "t")],
            None,
            None,
            "room's name",
        ),
        (
            vec![("room", "R"), ("token", "t")],
            None,
            None,
            "server is missing",
        ),
        (
            vec![("room", "R"), ("server", "https://h")],
            None,
            None,
            "token is missing",
        ),
        (
            vec![("room", "R"), ("server", "https://h"), ("token", "a b")],
            None,
            None,
            "token in the intent",
        ),
        (
            vec![("room", "R"), ("server", "https://h"), ("token", "a#b")],
            None,
            None,
            "token in the intent",
        ),
        (
            vec![("room", "R"), ("server", "file:///sdcard"), ("token", "t")],
            None,
            None,
            "http",
        ),
        (
            vec![("room", "R"), ("server", "https://me:pw@h"), ("token", "t")],
            None,
            None,
            "user name",
        ),
        (
            vec![("room", "R"), ("server", "https://h/../x"), ("token", "t")],
            None,
            None,
            "understood as https://h/x",
        ),
        (
            vec![("room", "R"), ("server", "http://0x7f.1"), ("token", "t")],
            None,
            None,
            "understood as http://127.0.0.1",
        ),
        (
            vec![("room", "R"), ("server", "https://%68ost"), ("token", "t")],
            None,
            None,
            "percent-encoded",
        ),
        (
            vec![
                ("room", "R"),
                ("server", "https://h\\@evil"),
                ("token", "t"),
            ],
            None,
            None,
            "character",
        ),
        (vec![("room", "https://h/rooms/R")], None, None, "#TOKEN"),
        (
            vec![],
            None,
            Some("rom = \"R\"\nspeed = 3\n"),
            "`rom` in mon3tr.toml is no setting: there are server, room",
        ),
        (
            vec![],
            None,
            Some("room = \"R\"\nspeed = 3\n"),
            "`speed` in mon3tr.toml is no setting",
        ),
        (vec![], None, Some("room = 1.5\n"), "not a float"),
        (vec![], None, Some("room = [1]\n"), "links in quotes"),
        (vec![], None, Some("rate = [90]\n"), "not a array"),
        (vec![], None, Some("[room]\nname = \"R\"\n"), "not a table"),
        (
            vec![],
            None,
            Some("seat = true\ntoken = s3cret\n"),
            "line 2 is not TOML",
        ),
        (
            vec![],
            None,
            Some("rate = 72\nrate = 90\n"),
            "line 2 is not TOML",
        ),
        (
            vec![],
            Some("https://h/rooms/R#s3cret"),
            None,
            "must begin with mon3tr:",
        ),
    ] {
        let reported = reported(&extras, link, file);
        assert!(reported.contains(why), "wanted `{why}`: {reported}");
        assert!(!reported.contains("s3cret"), "{reported}");
    }
    let long = "R".repeat(70_000);
    let long_reported = reported(&[("room", &long)], None, None);
    assert!(
        long_reported.contains("longer than") && long_reported.len() < 200,
        "{long_reported}"
    );
    let many = [LINK; 8].join(" ");
    assert!(
        reported(&[("room", &many)], None, None).contains("more than 7 rooms"),
        "too many"
    );
    let file = "#".repeat(300_000);
    assert!(
        reported(&[], None, Some(&file)).contains("longer than"),
        "a long file"
    );
}

#[test]
fn one_wrong_source_stops_the_app() {
    let reported = reported(&[("room", LINK)], Some("mon3tr://evil/x"), Some("rom = 1"));
    assert!(
        reported.contains("not with mon3tr://evil") && reported.contains("`rom`"),
        "both are reported: {reported}"
    );
}

#[test]
fn an_ambiguous_link_is_refused() {
    for (text, why) in [
        ("", "no link"),
        (
            "mon3tr:room/https/h/rooms/R#s3cret",
            "must begin with mon3tr://room/",
        ),
        (
            "MON3TR://room/https/h/rooms/R#s3cret",
            "not written as links are",
        ),
        (
            "mon3tr://rooms/https/h/rooms/R#s3cret",
            "must begin with mon3tr://room/",
        ),
        (
            "mon3tr://room.evil/https/h/rooms/R#s3cret",
            "must begin with mon3tr://room/",
        ),
        ("mon3tr://me:pw@room/https/h/rooms/R#s3cret", "user name"),
        ("mon3tr://room:80/https/h/rooms/R#s3cret", "port"),
        ("mon3tr://room/https/h/rooms/R?x=1#s3cret", "`?`"),
        ("mon3tr://room/ftp/h/rooms/R#s3cret", "https/ or http/"),
        ("mon3tr://room/file//data/rooms/R#s3cret", "https/ or http/"),
        ("mon3tr://room/https://h/rooms/R#s3cret", "https/ or http/"),
        ("mon3tr://room/h/rooms/R#s3cret", "https/ or http/"),
        ("mon3tr://room/https/me:pw@h/rooms/R#s3cret", "user name"),
        (
            "mon3tr://room/https/h/../evil/rooms/R#s3cret",
            "not written as links are",
        ),
        (
            "mon3tr://room/https/h/%2e%2e/rooms/R#s3cret",
            "not written as links are",
        ),
        (
            "mon3tr://room/https/h/a%2fb/rooms/R#s3cret",
            "percent-encoded",
        ),
        ("mon3tr://room/https/h\\evil/rooms/R#s3cret", "character"),
        (
            "mon3tr://room/https/h/rooms/..#s3cret",
            "not written as links are",
        ),
        ("mon3tr://room/https/h/rooms/R#s3cret#more", "token"),
        ("mon3tr://room/https/h/rooms/R#", "token"),
        ("mon3tr://room/https/h/rooms/R", "#TOKEN"),
        ("mon3tr://room/https//rooms/R#s3cret", "empty host"),
        (
            "mon3tr://room/https/0177.0.0.1/rooms/R#s3cret",
            "understood as https://127.0.0.1",
        ),
        (
            "mon3tr://room/https/2130706433/rooms/R#s3cret",
            "understood as https://127.0.0.1",
        ),
        (
            "mon3tr://room/https/h:0443/rooms/R#s3cret",
            "understood as https://h",
        ),
        (
            " mon3tr://room/https/h/rooms/R#s3cret",
            "not written as links are",
        ),
        (
            "mon3tr://room/https/h/rooms/R#s3cret ",
            "not written as links are",
        ),
        ("mon3tr://room/https/h/rooms/R#s3\ncret", "U+000A"),
        (
            "mon3tr://room/https/\u{434}.example/rooms/R#s3cret",
            "U+0434",
        ),
        ("mon3tr://room/https/h/rooms/R#s3cret\u{202e}", "U+202E"),
        (
            "intent://room/https/h/rooms/R#Intent;scheme=mon3tr;end",
            "must begin with mon3tr:",
        ),
        ("javascript:alert(1)", "must begin with mon3tr:"),
        ("content://settings/secure", "must begin with mon3tr:"),
        (
            "file:///sdcard/Android/data/mon3tr.toml",
            "must begin with mon3tr:",
        ),
    ] {
        let reported = read_deep_link(text).expect_err(text).to_string();
        assert!(
            reported.contains(why),
            "`{text}`: wanted `{why}`: {reported}"
        );
        assert!(
            !reported.contains("cret") && !reported.contains('\n'),
            "`{text}`: {reported}"
        );
    }
    let long = format!("mon3tr://room/https/{}/rooms/R#t", "h".repeat(9_000));
    let reported = read_deep_link(&long).expect_err("too long").to_string();
    assert!(
        reported.contains("longer than") && reported.len() < 200,
        "{reported}"
    );
}
