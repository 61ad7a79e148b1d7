//! Other users of the machine read command lines, files and errors.

use super::extent;
use crate::command::{Outcome, command, text};
use crate::house::{House, Program, wait_for};
use rustix::process::{Pid, Signal, kill_process};
use std::io::Write;
use std::net::TcpListener;
use std::os::unix::fs::PermissionsExt;
use std::os::unix::process::CommandExt;
use std::path::Path;
use std::process::{Child, Command, Output, Stdio};
use std::time::{Duration, Instant};

/// What a token, a link's secret and a key's hash look like.
const TOKEN: &str = "AgTq0J3mZ5vX8rLw2nB7yKcD4fH6sA1eGuIoPpQhRtYbNjMk9WxVzCdElTq0J3mZ5vX8rLw2nB7yKcD4fH6sA1eGuIoPpQhRtYbNjMk9WxVzCdEl";
const SECRET: &str = "xB4fQm8ZpLr2VtYw7NcKjA";
const KEY: &str = "k7qf2mxd3paahjwabcdefgh234";

/// A user with no rights on this machine.
const STRANGER: u32 = 65_534;

/// What another user of the machine reads in the file of a process; as the test's own user where that cannot become
/// another one.
fn read_by_stranger(process: u32, file: &str) -> Output {
    let mut command = Command::new("cat");
    command.arg(format!("/proc/{process}/{file}"));
    if rustix::process::geteuid().is_root() {
        command.uid(STRANGER).gid(STRANGER);
    }
    command.output().expect("cat is there")
}

/// A server that takes connections and answers none, and a link that leads to it by `path`.
fn silent(path: &str) -> (TcpListener, String) {
    let listener = TcpListener::bind("127.0.0.1:0").expect("a port");
    let address = listener.local_addr().expect("bound");
    (
        listener,
        format!("http://{address}/{path}#{TOKEN}:key={KEY}:secret={SECRET}"),
    )
}

fn start(arguments: &[&str], cache: &Path) -> Child {
    command(arguments)
        .env("MON3TR_CACHE", cache)
        .env("PULSE_SERVER", "unix:/nowhere")
        .stdin(Stdio::null())
        .stdout(Stdio::null())
        .stderr(Stdio::null())
        .spawn()
        .expect("started")
}

#[test]
fn no_other_user_reads_a_link_or_a_token_in_the_list_of_processes() {
    let house = House::open();
    let avatar = text(&house.avatar);
    let (_rooms, room) = silent("rooms/0123456789abcdef0123456789abcdef");
    let (_calls, call) = silent("calls/0123456789abcdef0123456789abcdef");
    let server = room.split("/rooms").next().expect("an address").to_owned();
    let (by_value, also) = (format!("--owner-token={TOKEN}"), format!("--room={room}"));
    let quiet = ["--display", "none"];
    let commands: [Vec<&str>; 8] = [
        [&["receive", &room][..], &quiet].concat(),
        [&["call", &call, "--avatar", avatar][..], &quiet].concat(),
        [
            &[
                "call",
                "--server",
                &server,
                "--owner-token",
                TOKEN,
                "--avatar",
                avatar,
            ][..],
            &quiet,
        ]
        .concat(),
        vec![
            "send",
            "--avatar",
            avatar,
            "--server",
            &server,
            "--owner-token",
            TOKEN,
        ],
        vec!["send", "--avatar", avatar, "--server", &server, &by_value],
        vec!["send", "--avatar", avatar, "--room", &room],
        vec!["send", "--avatar", avatar, &also, &by_value],
        vec!["doctor", &call],
    ];
    for arguments in commands {
        let begun = Instant::now();
        let mut child = start(&arguments, house.folder.path());
        let id = child.id();
        let shown = || {
            let read = read_by_stranger(id, "cmdline");
            String::from_utf8_lossy(&read.stdout).replace('\0', " ")
        };
        let is_hidden = |line: &str| {
            let has_begun = line.contains(&format!(" {} ", arguments[0]));
            has_begun && !line.contains(TOKEN) && !line.contains(SECRET)
        };
        wait_for("a command line without secrets", || {
            is_hidden(&shown()).then_some(())
        });
        println!(
            "{}: hidden after {:.0} ms",
            arguments[0],
            begun.elapsed().as_secs_f64() * 1e3
        );
        for _ in 0..10 {
            std::thread::sleep(Duration::from_millis(20));
            let line = shown();
            assert!(
                is_hidden(&line) || child.try_wait().expect("a child").is_some(),
                "{line}"
            );
        }
        if rustix::process::geteuid().is_root() {
            assert!(
                !read_by_stranger(id, "environ").status.success(),
                "{arguments:?}"
            );
        }
        let limits = std::fs::read_to_string(format!("/proc/{}/limits", child.id()));
        let limits = limits.unwrap_or_default();
        let core = limits
            .lines()
            .find(|line| line.starts_with("Max core file size"));
        let soft = core.and_then(|line| line.split_whitespace().nth(4));
        assert_eq!(
            soft,
            Some("0"),
            "no crash leaves secrets on the disk: {limits}"
        );
        // Some have come to their end by now.
        let _ = kill_process(Pid::from_child(&child), Signal::KILL);
        child.wait().expect("ended");
    }
}

/// Links and tokens as they are mistyped, each with a secret in it.
fn mistyped(kind: &str) -> Vec<String> {
    let other = if kind == "rooms" { "calls" } else { "rooms" };
    let rest = format!("{TOKEN}:key={KEY}:secret={SECRET}");
    vec![
        format!("http://127.0.0.1:9/{kind}/r#{rest}:secret={SECRET}"),
        format!("http://127.0.0.1:9/{kind}/r#{rest}:guest={SECRET}"),
        format!("http://127.0.0.1:9/{kind}/r#{TOKEN}:key={SECRET}:secret={SECRET}"),
        format!("http://127.0.0.1:9/{other}/r#{rest}"),
        format!("http://127.0.0.1:9/room/r#{rest}"),
        format!("http://127.0.0.1:9/{kind}/r%23{rest}"),
        format!("http://127.0.0.1:9/{kind}/r\u{ff03}{rest}"),
        format!("http://127.0.0.1:9/{kind}/r {rest}"),
        format!("ftp://127.0.0.1:9/{kind}/r#{rest}"),
        format!("http//127.0.0.1:9/{kind}/r#{rest}"),
        format!("http://me:{SECRET}@127.0.0.1:9/{kind}/r#{rest}"),
        format!("http://127.0.0.1:9/{kind}/r#{TOKEN}\x1b[31m:secret={SECRET}"),
        format!("{TOKEN}:secret={SECRET}#http://127.0.0.1:9/{kind}/r"),
        format!("{}:secret={SECRET}/{kind}/r#x", &TOKEN[..24]),
        rest,
        TOKEN.to_owned(),
    ]
}

fn assert_says_no_secret(arguments: &[&str]) {
    let mut command = command(arguments);
    command.env("MON3TR_CACHE", "/nowhere").stdin(Stdio::null());
    let output = test_support::service::finish(&mut command);
    assert!(!output.status.success(), "{arguments:?} is refused");
    let said =
        [output.stdout, output.stderr].map(|said| String::from_utf8_lossy(&said).into_owned());
    let said = said.concat();
    assert!(said.contains("error:"), "{arguments:?}: {said}");
    assert!(!said.contains("panicked"), "{arguments:?}: {said}");
    // In small letters, too: an address is written so.
    let small = said.to_lowercase();
    for part in [TOKEN, &TOKEN[..20], SECRET, &SECRET[..12], KEY] {
        assert!(
            !small.contains(&part.to_lowercase()),
            "{arguments:?}: {said}"
        );
    }
    assert!(!said.contains('\x1b'), "{arguments:?}: {said:?}");
}

#[test]
fn no_error_repeats_a_mistyped_link_or_token() {
    let house = House::open();
    let avatar = text(&house.avatar);
    // All of them with each link are a matter of minutes.
    let each = extent(2, 8) as usize;
    for (number, link) in mistyped("rooms").iter().enumerate() {
        let by_value = format!("--size={link}");
        let commands: [Vec<&str>; 8] = [
            vec!["receive", link, "--display", "none"],
            vec!["send", "--avatar", avatar, "--room", link],
            // With a mistake in another argument.
            vec!["receive", link, "--display", "none", "--frames", "x"],
            // As another argument than it should be.
            vec!["send", "--avatar", avatar, "--server", link],
            vec!["send", link, "--avatar", avatar],
            vec![link],
            vec!["receive", "--size", link, "a"],
            vec!["receive", &by_value, "a"],
        ];
        for arguments in commands.iter().cycle().skip(number).take(each) {
            assert_says_no_secret(arguments);
        }
    }
    for link in &mistyped("calls") {
        assert_says_no_secret(&["call", link, "--avatar", avatar, "--display", "none"]);
        assert_says_no_secret(&["call", link, link]);
    }
    assert_says_no_secret(&["doctor", &mistyped("calls")[0]]);
    let data = house.path("server");
    for token in [TOKEN, &format!("{TOKEN}\x1b[31m")] {
        assert_says_no_secret(&["serve", "--data", &data, "--revoke", token]);
    }
    let server = format!("http://{}", house.address);
    let wrong = format!("{TOKEN} {SECRET}");
    assert_says_no_secret(&[
        "send",
        "--avatar",
        avatar,
        "--server",
        &server,
        "--owner-token",
        &wrong,
    ]);
    assert_says_no_secret(&[
        "send",
        "--avatar",
        avatar,
        "--server",
        &server,
        "--owner-token",
        TOKEN,
    ]);
}

#[test]
fn links_and_tokens_are_read_from_files_and_from_standard_input() {
    let house = House::open();
    let (server, token) = (
        format!("http://{}", house.address),
        house.path("server/owner-token"),
    );
    let json = house.new_report();
    let avatar = text(&house.avatar);
    let sending = [
        "send", "--server", &server, "--avatar", avatar, "--json", &json,
    ];
    let mut sending = command(&[&sending[..], &["--owner-token", &format!("@{token}")]].concat());
    let mut sender = Program::start_as(&house, house.folder.path(), &mut sending);
    let link = sender.word_after("mon3tr receive ");
    let file = house.path("link");
    std::fs::write(&file, format!("{link}\n")).expect("written");
    set_mode(Path::new(&file), 0o600);
    let by_file = house.receiver(&format!("@{file}"), "by-file", &["--seconds", "1"]);
    by_file.report();

    let json = house.new_report();
    let mut by_input = command(&[
        "receive",
        "-",
        "--display",
        "none",
        "--seconds",
        "1",
        "--json",
        &json,
    ]);
    let cache = house.folder.path().join("by-input");
    let (by_input, mut input) = Program::start_steered(&house, &cache, &mut by_input);
    writeln!(input, "{link}").expect("it reads");
    by_input.report();

    // What follows the link on standard input is the call's.
    let json = house.new_report();
    let calling = [
        "call",
        "--server",
        &server,
        "--avatar",
        avatar,
        "--display",
        "none",
        "--json",
        &json,
    ];
    let mut calling = command(&[&calling[..], &["--owner-token", "-"]].concat());
    let (mut calling, mut input) =
        Program::start_steered(&house, house.folder.path(), &mut calling);
    writeln!(input, "{}", house.owner_token()).expect("it reads");
    let call = calling.word_after("mon3tr call ");
    let json = house.new_report();
    let mut joining = command(&[
        "call",
        "-",
        "--avatar",
        avatar,
        "--display",
        "none",
        "--json",
        &json,
    ]);
    let (mut joining, mut other) =
        Program::start_steered(&house, house.folder.path(), &mut joining);
    writeln!(other, "{call}").expect("it reads");
    joining.says("you are in the call", 1);
    for input in [&mut input, &mut other] {
        writeln!(input, "quit").expect("it reads");
    }
    joining.report();
    calling.report();
    sender.ends();
}

fn set_mode(path: &Path, mode: u32) {
    let mode = std::fs::Permissions::from_mode(mode);
    std::fs::set_permissions(path, mode).expect("the test's own file");
}

#[test]
fn files_with_secrets_that_others_may_read_are_refused() {
    let house = House::open();
    let folder = house.folder.path();
    let [key, link, data] = ["key", "link", "server"].map(|name| folder.join(name));
    let run = |arguments: &[&str]| {
        let mut command = command(arguments);
        command.env("MON3TR_KEY", &key).env("MON3TR_CACHE", folder);
        Outcome::of(&mut command)
    };
    let refused = |file: &Path, arguments: &[&str]| {
        let words = format!("chmod 600 '{}'", file.display());
        for mode in [0o640, 0o604, 0o660] {
            set_mode(file, mode);
            run(arguments).fails_naming(&[&words]);
        }
        set_mode(file, 0o600);
    };
    run(&["keys"]).succeeds();
    refused(&key, &["keys"]);
    run(&["keys"]).succeeds();
    let avatar = text(&house.avatar);
    refused(
        &key,
        &[
            "send",
            "--avatar",
            avatar,
            "--server",
            "http://127.0.0.1:9",
            "--owner-token",
            TOKEN,
        ],
    );
    let permits = key.with_extension("permits");
    std::fs::write(&permits, "").expect("written");
    refused(
        &permits,
        &[
            "send",
            "--avatar",
            avatar,
            "--server",
            "http://127.0.0.1:9",
            "--owner-token",
            TOKEN,
        ],
    );

    std::fs::write(&link, format!("http://127.0.0.1:9/rooms/r#{TOKEN}")).expect("written");
    let by_file = format!("@{}", link.display());
    refused(&link, &["receive", &by_file, "--display", "none"]);
    let of_call = format!("http://127.0.0.1:9/calls/r#{TOKEN}");
    std::fs::write(&link, of_call).expect("written");
    refused(
        &link,
        &["call", &by_file, "--avatar", avatar, "--display", "none"],
    );

    // That of a server on this machine, which is found without being given.
    let server = format!("http://{}", house.address);
    refused(
        &data.join("owner-token"),
        &["send", "--avatar", avatar, "--server", &server],
    );
    refused(
        &data.join("secret"),
        &["serve", "--listen", "127.0.0.1:0", "--data", text(&data)],
    );
}
