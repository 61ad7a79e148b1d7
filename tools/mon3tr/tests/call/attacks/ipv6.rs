//! One IPv6 network, which has 2^72 addresses, takes the server's connections.

use super::extent;
use crate::house::count;
use crate::interop::{program, python, said};
use std::process::Command;
use test_support::internet::Internet;
use test_support::program::Program;
use test_support::service;

#[test]
fn connections_from_thousands_of_addresses_of_one_ipv6_network_keep_no_other_network_out() {
    let Some(internet) = Internet::open() else {
        return;
    };
    let Some(python) = python() else {
        return;
    };
    let ip = std::env::var("MON3TR_IP").ok().filter(|ip| !ip.is_empty());
    let mut route = Command::new(ip.as_deref().unwrap_or("ip"));
    route.args(["-6", "route", "add", "local", "2001:db8::/32", "dev", "lo"]);
    let routed = internet.server().enter(&route).output();
    if !routed.as_ref().is_ok_and(|routed| routed.status.success()) {
        println!("skipped: no IPv6 network: {routed:?}");
        assert_ne!(
            std::env::var("CI").as_deref(),
            Ok("true"),
            "CI must have one"
        );
        return;
    }

    let folder = tempfile::tempdir().expect("a folder");
    let limits = folder.path().join("limits.toml");
    // Fewer than one network may have: it takes all of them.
    std::fs::write(&limits, "connections = 60\n").expect("written");
    let mut serve = Command::new(crate::PROGRAM);
    serve.args(["serve", "--insecure", "--listen", "[::]:8080"]);
    serve.arg("--limits").arg(&limits);
    serve.arg("--data").arg(folder.path().join("server"));
    let mut server = Program::start(&mut internet.server().enter(&serve));
    server.says("serving on http://", 1);

    let mut holder = Command::new(python);
    holder
        .arg(program("ipv6_connections.py"))
        .args(["8080", "--held", "100", "--seconds"])
        .arg(extent(6, 60).to_string());
    let mut holder = internet.server().enter(&holder);
    let counts = said(&service::output("the holder of connections", &mut holder));
    println!("{counts}");
    assert!(count(&counts, "opened") > 200, "too few: {counts}");
    assert!(count(&counts, "asked") > 0, "{counts}");
    assert_eq!(count(&counts, "unanswered"), 0, "{counts}");
    assert!(server.end().success(), "{}", server.said());
}
