//! Which sub-commands and options there are.

use crate::support::mon3tr;

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
