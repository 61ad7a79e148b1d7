//! Clients and servers close connections at every moment.
//!
//! The test's own process ignores SIGPIPE, and its children have the default disposition, as those of a shell:
//! `Command` resets it.

use super::extent;
use crate::command::{command, text};
use crate::house::{House, Program, count, wait_for};
use link_protocol::PackageId;
use rcgen::{CertifiedKey, generate_simple_self_signed};
use rustix::process::{Pid, Signal, kill_process};
use rustls::pki_types::ServerName;
use rustls::{ClientConfig, ClientConnection, RootCertStore, StreamOwned};
use socket2::{Domain, SockRef, Socket, Type};
use std::io::{BufRead, BufReader, Read, Write};
use std::net::{Shutdown, SocketAddr, TcpListener, TcpStream};
use std::process::Stdio;
use std::sync::Arc;
use std::thread::sleep;
use std::time::Duration;
use synthetic_person::{Puppet, PuppetSize};

const HEALTH: &str = "GET /healthz HTTP/1.1\r\nHost: server\r\n\r\n";

fn connect(address: SocketAddr) -> TcpStream {
    TcpStream::connect(address).expect("the server takes connections")
}

/// Closes a connection by a reset, whatever was sent and received.
fn reset(stream: &TcpStream) {
    let linger = SockRef::from(stream).set_linger(Some(Duration::ZERO));
    linger.expect("a socket");
}

/// Asks whether the server is well, on a connection of its own.
fn answers(address: SocketAddr) -> bool {
    let mut stream = connect(address);
    let ask = "GET /healthz HTTP/1.1\r\nHost: server\r\nConnection: close\r\n\r\n";
    let mut answer = String::new();
    let asked = stream.write_all(ask.as_bytes());
    asked.is_ok() && stream.read_to_string(&mut answer).is_ok() && answer.contains(" 200 ")
}

/// A way to hang up on a server.
type HangUp<'a> = (&'a str, Box<dyn Fn(u32) + 'a>);

/// Hangs up in each way; the server answers afterwards each time, in the same process.
fn assert_outlives(
    server: &mut Program,
    ways: &[HangUp<'_>],
    times: u32,
    answers: impl Fn() -> bool,
) {
    for (way, hang_up) in ways {
        for time in 0..times {
            hang_up(time);
        }
        // What was closed last may not have reached the server yet.
        sleep(Duration::from_millis(100));
        assert!(
            server.is_running(),
            "{way}: the server has ended:\n{}",
            server.said()
        );
        wait_for(way, || answers().then_some(()));
        println!("{way}: {times} times");
    }
}

/// A server that counts no requests: what is tried here is not how many there are.
fn serve(house: &House, name: &str, options: &[&str]) -> Program {
    let (data, limits) = (house.path(name), house.path("limits.toml"));
    std::fs::write(&limits, "requests_per_second = 0\n").expect("written");
    let mut command = command(&["serve", "--listen", "127.0.0.1:0", "--data", &data]);
    command.args(["--limits", &limits]).args(options);
    Program::start_as(house, house.folder.path(), &mut command)
}

#[test]
fn a_server_outlives_clients_that_hang_up_at_any_moment() {
    let mut house = House::open();
    // One with other options serves the same folder.
    house.kill_server();
    let mut server = serve(&house, "server", &["--turn", "127.0.0.1:0"]);
    let url = format!("http://{}", server.word_after("serving on http://"));
    let address: SocketAddr = url["http://".len()..].parse().expect("an address");
    let port = server.word_after("direct way on port ");
    let relay = SocketAddr::new(
        address.ip(),
        port.trim_end_matches(',').parse().expect("a port"),
    );
    // Something to download.
    let avatar = text(&house.avatar);
    let mut sender = house.send(&["--server", &url, "--avatar", avatar]);
    sender.says("in the room", 1);
    drop(sender);
    let package = std::fs::read(&house.avatar).expect("a package");
    let download = format!(
        "GET /v1/packages/{} HTTP/1.1\r\nHost: server\r\nAuthorization: Bearer {}\r\n\r\n",
        PackageId::of_bytes(&package),
        house.owner_token()
    );
    let send = |text: &str| {
        let mut stream = connect(address);
        // The server may have closed it.
        let _ = stream.write_all(text.as_bytes());
        stream
    };
    let server_id = Pid::from_raw(i32::try_from(server.id()).expect("a number")).expect("not zero");
    let signal = |signal| kill_process(server_id, signal).expect("the server is there");
    let ways: Vec<HangUp<'_>> = vec![
        ("no request", Box::new(|_| drop(connect(address)))),
        ("no request, reset", Box::new(|_| reset(&connect(address)))),
        ("one request", Box::new(|_| drop(send(HEALTH)))),
        (
            "two pipelined requests",
            Box::new(|_| drop(send(&HEALTH.repeat(2)))),
        ),
        (
            "fifty pipelined requests, reset",
            Box::new(|_| reset(&send(&HEALTH.repeat(50)))),
        ),
        (
            "requests, and some bytes of the answers are read",
            Box::new(|time| {
                let mut stream = send(&HEALTH.repeat(20));
                let _ = stream.read(&mut [0; 10]);
                if time % 2 == 0 {
                    reset(&stream);
                }
            }),
        ),
        (
            "requests, and only the reading side is closed",
            Box::new(|_| {
                let stream = send(&HEALTH.repeat(20));
                let _ = stream.shutdown(Shutdown::Read);
            }),
        ),
        (
            "half a request",
            Box::new(|time| {
                let stream = send(&HEALTH[..20 + time as usize % 20]);
                if time % 2 == 0 {
                    reset(&stream);
                }
            }),
        ),
        (
            "half a body",
            Box::new(|_| {
                let head =
                    "POST /v1/rooms HTTP/1.1\r\nHost: server\r\nContent-Length: 5000000\r\n\r\n";
                drop(send(&format!("{head}{}", "x".repeat(2_000))));
            }),
        ),
        (
            "what is no HTTP",
            Box::new(|_| drop(send("\x16\x03\x01\x02\x00\x01\x00\x01\x03\x03"))),
        ),
        (
            "a download",
            Box::new(|time| {
                let mut stream = send(&download.repeat(3));
                let _ = stream.read(&mut [0; 1_000]);
                if time % 2 == 0 {
                    reset(&stream);
                }
            }),
        ),
        (
            "a relay's connection",
            Box::new(|time| {
                let mut stream = connect(relay);
                // A binding request, and a part of one.
                let ask = [
                    b"\x00\x01\x00\x00\x21\x12\xa4\x42abcdefghijkl".repeat(8),
                    vec![0, 1],
                ]
                .concat();
                let _ = stream.write_all(&ask);
                if time % 2 == 0 {
                    reset(&stream);
                }
            }),
        ),
    ];
    assert_outlives(&mut server, &ways, extent(300, 3_000), || answers(address));
    // A server that is slower than the network: it finds each connection closed when it writes.
    let slow: HangUp<'_> = (
        "a download from a server that is stopped for a moment",
        Box::new(|time| {
            signal(Signal::STOP);
            let stream = send(&download.repeat(4));
            if time % 2 == 0 {
                reset(&stream);
            }
            drop(stream);
            signal(Signal::CONT);
            sleep(Duration::from_millis(2));
        }),
    );
    assert_outlives(&mut server, &[slow], extent(50, 1_000), || answers(address));
}

#[test]
fn a_server_with_tls_outlives_clients_that_hang_up_after_the_handshake() {
    let house = House::open();
    let made = generate_simple_self_signed(["localhost".to_owned()]).expect("a certificate");
    let CertifiedKey { cert, signing_key } = made;
    let [cert_file, key_file] = ["cert.pem", "key.pem"].map(|name| house.path(name));
    std::fs::write(&cert_file, cert.pem()).expect("written");
    std::fs::write(&key_file, signing_key.serialize_pem()).expect("written");
    let options = [
        "--turn",
        "127.0.0.1:0",
        "--tls-cert",
        &cert_file,
        "--tls-key",
        &key_file,
    ];
    let mut server = serve(&house, "with-tls", &options);
    let address = server.word_after("serving on https://");
    let address: SocketAddr = address.parse().expect("an address");
    let port = server.word_after("direct way on port ");
    let relay = SocketAddr::new(
        address.ip(),
        port.trim_end_matches(',').parse().expect("a port"),
    );
    let mut roots = RootCertStore::empty();
    roots.add(cert.der().clone()).expect("a certificate");
    let provider = Arc::new(rustls::crypto::ring::default_provider());
    let config = ClientConfig::builder_with_provider(provider);
    let config = config
        .with_safe_default_protocol_versions()
        .expect("versions");
    let config = Arc::new(config.with_root_certificates(roots).with_no_client_auth());
    let shake = |to: SocketAddr| {
        let name = ServerName::try_from("localhost").expect("a name");
        let mut session = ClientConnection::new(Arc::clone(&config), name).expect("TLS");
        let mut stream = connect(to);
        while session.is_handshaking() {
            session.complete_io(&mut stream).expect("a handshake");
        }
        StreamOwned::new(session, stream)
    };
    let well = || {
        let mut stream = shake(address);
        let ask = HEALTH.replace("Host", "Connection: close\r\nHost");
        let mut answer = [0; 15];
        stream.write_all(ask.as_bytes()).is_ok()
            && stream.read_exact(&mut answer).is_ok()
            && answer.starts_with(b"HTTP/1.1 200")
    };
    let ways: Vec<HangUp<'_>> = vec![
        ("before the handshake", Box::new(|_| drop(connect(address)))),
        ("after the handshake", Box::new(|_| drop(shake(address)))),
        (
            "after the handshake, reset",
            Box::new(|_| reset(&shake(address).sock)),
        ),
        (
            "after the handshake, said",
            Box::new(|_| {
                let mut stream = shake(address);
                stream.conn.send_close_notify();
                let _ = stream.flush();
            }),
        ),
        (
            "after three requests",
            Box::new(|time| {
                let mut stream = shake(address);
                let _ = stream.write_all(HEALTH.repeat(3).as_bytes());
                let _ = stream.flush();
                if time % 2 == 0 {
                    reset(&stream.sock);
                }
            }),
        ),
        (
            "after a relay's handshake",
            Box::new(|_| drop(shake(relay))),
        ),
        (
            "after a relay's handshake, reset",
            Box::new(|_| reset(&shake(relay).sock)),
        ),
    ];
    // A handshake takes milliseconds of both sides.
    assert_outlives(&mut server, &ways, extent(60, 1_000), well);
}

/// A server whose store lacks every package, and which reads so many bytes of an upload before it closes the
/// connection.
fn closes_in_mid_upload(bytes: usize, by_reset: bool) -> SocketAddr {
    let socket = Socket::new(Domain::IPV4, Type::STREAM, None).expect("a socket");
    // So that the sender's writes wait for this side.
    socket.set_recv_buffer_size(8 << 10).expect("a size");
    let any: SocketAddr = ([127, 0, 0, 1], 0).into();
    socket.bind(&any.into()).expect("a port");
    socket.listen(16).expect("a listener");
    let listener = TcpListener::from(socket);
    let address = listener.local_addr().expect("bound");
    std::thread::spawn(move || {
        for stream in listener.incoming().map_while(Result::ok) {
            std::thread::spawn(move || serve_upload(stream, bytes, by_reset));
        }
    });
    address
}

fn serve_upload(mut stream: TcpStream, bytes: usize, by_reset: bool) {
    let mut head = Vec::new();
    loop {
        let mut byte = [0];
        if stream.read_exact(&mut byte).is_err() {
            return;
        }
        head.push(byte[0]);
        if !head.ends_with(b"\r\n\r\n") {
            continue;
        }
        if head.starts_with(b"PUT") {
            let _ = stream.read_exact(&mut vec![0; bytes]);
            if by_reset {
                reset(&stream);
            }
            return;
        }
        let _ = stream.write_all(b"HTTP/1.1 404 Not Found\r\nContent-Length: 0\r\n\r\n");
        head.clear();
    }
}

#[test]
fn a_sender_says_in_words_that_its_server_went_away_in_mid_upload() {
    let mut house = House::open();
    let large = PuppetSize {
        gaussians: 60_000,
        ..PuppetSize::SMALL
    };
    house.avatar = house.folder.path().join("large.m3a");
    Puppet::new(large)
        .avatar()
        .save(&house.avatar)
        .expect("saved");
    let avatar = house.avatar.to_str().expect("UTF-8").to_owned();
    for attempt in 0..extent(6, 60) as usize {
        let address = closes_in_mid_upload(attempt * 40_000, attempt % 2 == 0);
        let server = format!("http://{address}");
        let said = house
            .send(&["--server", &server, "--avatar", &avatar])
            .fails();
        // A program that a signal ends says nothing.
        let line = said.lines().find(|line| line.starts_with("error:"));
        let line = line.unwrap_or_else(|| panic!("no error in words:\n{said}"));
        assert!(line.contains("cannot enter the room"), "{said}");
    }
}

#[test]
fn a_command_whose_output_is_not_read_ends_quietly() {
    let house = House::open();
    for arguments in [
        &["inspect", text(&house.avatar)][..],
        &["keys"],
        &["licences"],
        &["--help"],
        &["receive"],
    ] {
        let mut child = command(arguments)
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn()
            .expect("started");
        drop(child.stdout.take());
        let output = child.wait_with_output().expect("it ends");
        let said = String::from_utf8_lossy(&output.stderr);
        let is_refused = arguments == ["receive"];
        assert_eq!(
            output.status.code(),
            Some(if is_refused { 2 } else { 0 }),
            "{arguments:?}: {said}"
        );
        assert_eq!(said.is_empty(), !is_refused, "{arguments:?}: {said}");
    }
    // Nor does one whose errors are not read panic.
    let mut child = command(&["inspect", "/nowhere"])
        .stderr(Stdio::piped())
        .spawn()
        .expect("started");
    drop(child.stderr.take());
    assert_eq!(child.wait().expect("it ends").code(), Some(1));
}

#[test]
fn a_command_whose_output_finds_no_room_fails() {
    let full = std::fs::File::options().write(true).open("/dev/full");
    let Ok(full) = full else {
        println!("skipped: there is no /dev/full");
        return;
    };
    let mut command = command(&["licences"]);
    let output = command
        .stdout(full)
        .stderr(Stdio::piped())
        .output()
        .expect("started");
    let said = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(1), "{said}");
    assert!(said.contains("could be written: No space left"), "{said}");
}

#[test]
fn a_sender_whose_output_is_not_read_any_more_goes_on() {
    let house = House::open();
    let server = format!("http://{}", house.address);
    let token = house.path("server/owner-token");
    let mut child = command(&["send", "--server", &server, "--avatar", text(&house.avatar)])
        .args(["--owner-token", &format!("@{token}")])
        .env("MON3TR_CACHE", house.folder.path())
        .stdout(Stdio::piped())
        .stderr(Stdio::null())
        .stdin(Stdio::null())
        .spawn()
        .expect("started");
    let mut lines = BufReader::new(child.stdout.take().expect("piped")).lines();
    let link = lines.find_map(|line| {
        let line = line.expect("text");
        line.trim()
            .strip_prefix("mon3tr receive ")
            .map(|link| link.trim_matches('\'').to_owned())
    });
    // As `head` does.
    drop(lines);
    // The sender prints that a viewer has come, and that they have left.
    for _ in 0..2 {
        let viewer = house.receiver(
            &link.clone().expect("a link"),
            "viewer",
            &["--seconds", "1"],
        );
        assert!(count(&viewer.report()["call"]["received"], "frames") > 0);
        sleep(Duration::from_millis(2_500));
    }
    assert!(child.try_wait().expect("a child").is_none(), "it has ended");
    kill_process(Pid::from_child(&child), Signal::TERM).expect("it is there");
    assert!(child.wait().expect("it ends").success());
}

/// Runs a command that is to fail, and print nothing that steers a terminal.
fn assert_steers_no_terminal(arguments: &[&str]) {
    let output = test_support::service::finish(&mut command(arguments));
    assert!(!output.status.success(), "{arguments:?} is refused");
    assert!(!output.stderr.is_empty(), "{arguments:?}: it says why");
    for said in [output.stdout, output.stderr] {
        let said = String::from_utf8_lossy(&said);
        let steers = |c: char| c.is_control() && c != '\n' || c == '\u{202e}';
        assert!(!said.contains(steers), "{arguments:?}: {said:?}");
        assert!(!said.contains("panicked"), "{arguments:?}: {said}");
    }
}

#[test]
fn a_files_name_does_not_steer_the_terminal() {
    let folder = tempfile::tempdir().expect("a folder");
    let name = folder.path().join("clip\x1b[31m\u{202e}\r.m3a");
    let name = text(&name);
    assert_steers_no_terminal(&["keys", "sign", name]);
    assert_steers_no_terminal(&["licences", name]);
    for command in ["inspect", "render"] {
        assert_steers_no_terminal(&[command, name]);
    }
    std::fs::write(name, "something else").expect("written");
    for command in ["inspect", "render"] {
        assert_steers_no_terminal(&[command, name]);
    }
}
