//! The units for systemd that docs/operating.md describes.

use crate::support::{command, mon3tr, text};
use std::os::unix::net::UnixDatagram;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::Duration;
use test_support::program::Program;

const FOLDER: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../server/systemd");
const PROGRAM: &str = "/usr/local/bin/mon3tr-dev";

/// Names and texts of all units.
fn units() -> Vec<(PathBuf, String)> {
    let files = std::fs::read_dir(FOLDER).expect("the units");
    let paths = files.map(|file| file.expect("an entry").path());
    let services = paths.filter(|path| path.extension().is_some_and(|it| it == "service"));
    let units: Vec<_> = services
        .map(|path| {
            let text = std::fs::read_to_string(&path).expect("a text");
            (path, text)
        })
        .collect();
    assert_eq!(units.len(), 4, "signaling, relay, forwarder, canary");
    units
}

#[test]
fn each_unit_starts_a_sub_command_with_options_that_it_has() {
    for (path, unit) in units() {
        let line = unit
            .lines()
            .find_map(|line| line.strip_prefix("ExecStart="));
        let mut words = line.expect("it starts something").split_whitespace();
        assert_eq!(words.next(), Some(PROGRAM), "{}", path.display());
        let name = words.next().expect("a sub-command");
        let help = mon3tr(&[name, "--help"]).succeeds();
        for option in words.filter(|word| word.starts_with("--")) {
            let known = help
                .lines()
                .any(|line| line.trim_start().starts_with(&format!("{option} ")));
            assert!(known, "{name} has no {option}:\n{help}");
        }
    }
}

#[test]
fn each_unit_restarts_without_end_bounds_memory_and_leaves_no_core() {
    for (path, unit) in units() {
        for line in [
            "Restart=always",
            "StartLimitIntervalSec=0",
            "LimitCORE=0",
            "NoNewPrivileges=yes",
            "ProtectSystem=strict",
        ] {
            let has = unit.lines().any(|one| one == line);
            assert!(has, "{} has no {line}", path.display());
        }
        let bounds = unit.lines().any(|one| one.starts_with("MemoryMax="));
        assert!(bounds, "{} bounds no memory", path.display());
    }
}

#[test]
fn systemd_takes_the_units() {
    let there = Command::new("systemd-analyze")
        .arg("--version")
        .output()
        .is_ok();
    if !there {
        // No part of what `./run test` fetches.
        println!("skipped: there is no systemd-analyze");
        return;
    }
    let folder = tempfile::tempdir().expect("a folder");
    let copies: Vec<PathBuf> = (units().into_iter())
        .map(|(path, unit)| {
            let copy = folder.path().join(path.file_name().expect("a name"));
            // It has to be there.
            std::fs::write(&copy, unit.replace(PROGRAM, "/bin/true")).expect("it is written");
            copy
        })
        .collect();
    let verified = Command::new("systemd-analyze")
        .arg("verify")
        .args(copies)
        .output();
    let verified = verified.expect("it runs");
    let said = String::from_utf8_lossy(&verified.stderr);
    assert!(verified.status.success(), "{said}");
    // A key that it does not know is a line, and no failure.
    assert!(!said.contains("mon3tr-"), "{said}");
}

#[test]
fn each_process_of_a_server_reports_to_systemds_watchdog() {
    let folder = tempfile::tempdir().expect("a folder");
    let (data, socket) = (folder.path().join("data"), folder.path().join("socket"));
    let secret = data.join("secret");
    let serve = ["serve", "--listen", "127.0.0.1:0", "--data", text(&data)];
    let relay = [
        "relay",
        "--listen",
        "127.0.0.1:0",
        "--secret",
        text(&secret),
    ];
    let forwarder = ["forwarder", "--listen", text(&socket)];
    for (name, arguments) in [
        ("serve", &serve[..]),
        ("relay", &relay),
        ("forwarder", &forwarder),
    ] {
        assert_reports(&folder.path().join(name), arguments);
    }
}

fn assert_reports(notify: &Path, arguments: &[&str]) {
    let systemd = UnixDatagram::bind(notify).expect("a socket");
    let longest = test_support::service::LONGEST_WAIT;
    systemd.set_read_timeout(Some(longest)).expect("a time");
    let period = Duration::from_millis(200);
    let mut command = command(arguments);
    command
        .env("NOTIFY_SOCKET", notify)
        .env("WATCHDOG_USEC", period.as_micros().to_string());
    let _program = Program::start(&mut command);
    for _ in 0..3 {
        let mut said = [0; 64];
        let count = systemd.recv(&mut said).expect("it reports");
        assert_eq!(said.get(..count), Some(&b"WATCHDOG=1"[..]), "{arguments:?}");
    }
}
