//! Which sub-commands and options there are.

use crate::support::{command, mon3tr};

#[test]
fn it_has_every_sub_command_of_mon3tr_and_its_own() {
    let help = mon3tr(&["--help"]).succeeds();
    for name in [
        "demo",
        "bake",
        "inspect",
        "render",
        "serve",
        "send",
        "receive",
        "profile",
        "apk",
        "bench",
        "canary",
        "forwarder",
        "netlab",
        "relay",
        "soak",
    ] {
        assert!(
            help.contains(&format!("\n  {name} ")),
            "{name} is missing in:\n{help}"
        );
    }
}

#[test]
fn its_server_has_an_operators_options() {
    let help = mon3tr(&["serve", "--help"]).succeeds();
    for option in [
        "--s3 ",
        "--nats ",
        "--tls-cert ",
        "--listen ",
        "--turn-at ",
        "--forward-at ",
    ] {
        assert!(help.contains(option), "{option} is missing in:\n{help}");
    }
    mon3tr(&["serve", "--tls-cert", "a.pem"]).fails_naming(&["required arguments"]);
}

#[test]
fn no_error_of_a_forwarder_repeats_a_mistyped_link() {
    let token = "AgTq0J3mZ5vX8rLw2nB7yKcD4fH6sA1eGuIoPpQhRtYbNjMk9WxVzCdEl";
    let link =
        |path: &str| format!("http://127.0.0.1:9/{path}#{token}:secret=xB4fQm8ZpLr2VtYw7NcKjA");
    let (wrong, right) = (link("room/r"), link("rooms/r"));
    for arguments in [
        &["audience", &wrong][..],
        &["audience", &right, "--into", &wrong],
        &["audience", &right, &right],
        &["audience", "--viewers", &right, &right],
    ] {
        let mut command = command(arguments);
        command.env("MON3TR_OWNER_TOKEN", token);
        let output = test_support::service::finish(&mut command);
        let said = [output.stdout, output.stderr].concat();
        let said = String::from_utf8_lossy(&said).into_owned();
        assert!(
            !output.status.success() && said.contains("error:"),
            "{said}"
        );
        assert!(!said.contains(token) && !said.contains("xB4f"), "{said}");
    }
}
