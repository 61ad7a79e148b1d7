//! `mon3tr-dev canary` against a server of the test's own.

use crate::server::Server;
use crate::support::{Outcome, command, json, text};
use std::time::{Duration, Instant};

/// A canary's own bounds on one step, and more for a busy machine.
const NOTICED_WITHIN: Duration = Duration::from_secs(40);

#[test]
fn a_canary_says_that_a_server_works_and_by_which_ways() {
    let server = Server::start(&[]);
    let line = server.canary(&[]).succeeds();
    assert!(line.contains("works: direct after"), "{line}");
    assert!(line.contains("; no relay; no forwarder"), "{line}");

    let server = Server::start(&["--turn", "127.0.0.1:0", "--forward", "4"]);
    let (report, metrics) = (server.path("canary.json"), server.path("canary.prom"));
    let files = ["--json", text(&report), "--metrics", text(&metrics)];
    let line = server.canary(&files).succeeds();
    let ways = "; relay 127.0.0.1 over UDP; forwarded after";
    assert!(line.contains(ways), "{line}");
    let report = json(&report);
    let measured = &report[0]["succeeded"];
    assert!(
        measured["direct"]["frames"].as_u64() >= Some(30),
        "{report:#}"
    );
    assert!(
        measured["forwarded"]["join_s"].as_f64() > Some(0.0),
        "{report:#}"
    );
    let metrics = std::fs::read_to_string(metrics).expect("metrics");
    let up = format!("mon3tr_canary_up{{server=\"{}\"}} 1", server.url);
    assert!(metrics.lines().any(|line| line == up), "{metrics}");
}

#[test]
fn a_canary_names_the_step_that_fails() {
    let server = Server::start(&[]);
    let fails = |url: &str, words: &str| {
        let arguments = ["canary", url];
        Outcome::of(&mut server.owner(&arguments)).fails_naming(&[words]);
    };
    fails(&server.url.replace("http:", "https:"), "fails: TLS: ");
    fails("https://mon3tr.invalid", "fails: DNS: ");
    fails("http://mon3tr.invalid", "without TLS");
    let wrong = ["canary", &server.url];
    let mut wrong = command(&wrong);
    Outcome::of(wrong.env("MON3TR_OWNER_TOKEN", "wrong")).fails_naming(&["fails: token: "]);

    let (metrics, url) = (server.path("canary.prom"), server.url.clone());
    let arguments = ["canary", &url, "--metrics", text(&metrics)];
    let mut canary = server.owner(&arguments);
    let _folder = server.kill();
    let begun = Instant::now();
    Outcome::of(&mut canary).fails_naming(&["fails: connection: "]);
    assert!(
        begun.elapsed() < NOTICED_WITHIN,
        "after {:?}",
        begun.elapsed()
    );
    let metrics = std::fs::read_to_string(metrics).expect("metrics");
    let down = format!("mon3tr_canary_failed{{server=\"{url}\",step=\"connection\"}} 1");
    assert!(metrics.lines().any(|line| line == down), "{metrics}");
}

#[test]
fn a_canary_fails_while_the_server_takes_no_further_room() {
    let folder = tempfile::tempdir().expect("a folder");
    let limits = folder.path().join("limits.toml");
    std::fs::write(&limits, "rooms = 1\n").expect("it is written");
    let server = Server::start_in(folder, &["--limits", text(&limits)]);
    server.canary(&[]).succeeds();
    let (mut sender, _) = server.sender();
    server.canary(&[]).fails_naming(&["fails: presence: "]);
    sender.end();
    server.canary(&[]).succeeds();
}

#[test]
fn a_canary_holds_calls_again_and_again_until_it_is_asked_to_end() {
    let server = Server::start(&[]);
    let arguments = ["canary", &server.url, "--every", "1"];
    let mut canary = test_support::program::Program::start(&mut server.owner(&arguments));
    canary.says("works: direct after", 3);
    let status = canary.end();
    assert!(status.success(), "{status}: {}", canary.said());
}
