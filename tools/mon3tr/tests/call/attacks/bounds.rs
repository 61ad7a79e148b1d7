//! One owner, link holder or address exhausts what the server shares among all.

use super::{Times, extent};
use crate::command::command;
use crate::house::{House, wait_for};
use serde_json::Value;
use std::collections::BTreeMap;
use std::io::{BufRead, BufReader, Write};
use std::net::{SocketAddr, UdpSocket};
use std::process::Stdio;
use std::time::{Duration, Instant};
use tokio::io::{AsyncReadExt, AsyncWriteExt};
use tokio::net::{TcpSocket, TcpStream};

/// An honest request without an answer for so long has failed; [`Times`] prints how long answers took. All attackers
/// share the machine's cores with the server.
const HONEST: Duration = Duration::from_secs(10);

/// The server's answer to one request: its status and body; status 0 where the connection ended without one.
struct Answer {
    status: u16,
    body: Vec<u8>,
}

impl Answer {
    fn json(&self) -> Value {
        serde_json::from_slice(&self.body).expect("JSON")
    }
}

async fn connect(server: SocketAddr, from: [u8; 4]) -> std::io::Result<TcpStream> {
    let socket = TcpSocket::new_v4()?;
    socket.bind((from, 0).into())?;
    socket.connect(server).await
}

/// One request on a connection of its own, from an address of the loopback.
async fn ask(
    server: SocketAddr,
    from: [u8; 4],
    line: &str,
    token: &str,
    body: &[u8],
) -> std::io::Result<Answer> {
    let mut stream = connect(server, from).await?;
    let length = body.len();
    let head = format!(
        "{line} HTTP/1.1\r\nHost: server\r\nConnection: close\r\nAuthorization: Bearer {token}\r\nContent-Length: {length}\r\n\r\n"
    );
    stream.write_all(head.as_bytes()).await?;
    // A refusal may come before all of it is sent.
    let sent = stream.write_all(body).await;
    let mut answer = Vec::new();
    stream.read_to_end(&mut answer).await?;
    sent?;
    let end = answer.windows(4).position(|four| four == b"\r\n\r\n");
    let status = answer
        .get(9..12)
        .and_then(|code| std::str::from_utf8(code).ok());
    Ok(Answer {
        status: status.and_then(|code| code.parse().ok()).unwrap_or(0),
        body: end.map_or_else(Vec::new, |end| answer[end + 4..].to_vec()),
    })
}

/// The same for someone honest, who tries once more where the connection fails; each try has an answer in time.
async fn ask_honestly(
    server: SocketAddr,
    from: [u8; 4],
    line: &str,
    token: &str,
    body: &[u8],
) -> Answer {
    for _ in 0..2 {
        let answer = tokio::time::timeout(HONEST, ask(server, from, line, token, body));
        if let Ok(answer) = answer.await.expect("an answer in time") {
            return answer;
        }
    }
    panic!("{line}: both tries failed");
}

fn sha256(bytes: &[u8]) -> String {
    use sha2::{Digest, Sha256};
    let digest = Sha256::digest(bytes);
    digest.iter().map(|byte| format!("{byte:02x}")).collect()
}

fn put_line(bytes: &[u8]) -> String {
    format!("PUT /v1/packages/{}", sha256(bytes))
}

/// Opens a call: its member's token.
async fn open_call(server: SocketAddr, from: [u8; 4], owner: &str) -> String {
    let opened = ask(server, from, "POST /v1/calls", owner, b"").await;
    let opened = opened.expect("a call is opened").json();
    opened["member_token"].as_str().expect("a token").to_owned()
}

#[test]
fn failed_uploads_of_one_member_and_thousands_of_calls_of_one_owner_keep_no_member_out() {
    let house = House::open();
    let (server, host) = (house.address, house.owner_token());
    let avatar = std::fs::read(&house.avatar).expect("the avatar");
    let eve = command(&[
        "serve",
        "--data",
        &house.path("server"),
        "--new-owner",
        "eve",
    ])
    .output();
    let eve = String::from_utf8(eve.expect("it runs").stdout).expect("a token");
    let eve = eve.trim().to_owned();
    house.runtime.block_on(async {
        // Of other addresses, each of which may ask 500 times at once.
        for number in 0..extent(400, 4096) {
            let from = [127, 0, 1, u8::try_from(number % 40 + 1).expect("small")];
            let call = open_call(server, from, &eve).await;
            let wrong = ask(server, from, &put_line(b"x"), &call, b"y").await;
            assert_eq!(wrong.expect("an answer").status, 422);
        }
        let call = open_call(server, [127, 0, 0, 1], &host).await;
        let mut statuses = BTreeMap::<u16, usize>::new();
        for number in 0..200_u32 {
            let wrong = number.to_le_bytes();
            let line = match number % 3 {
                0 => put_line(b"other bytes"),
                _ => put_line(&wrong),
            };
            let put = ask(server, [127, 0, 0, 9], &line, &call, &wrong).await;
            *statuses.entry(put.expect("an answer").status).or_default() += 1;
        }
        assert_eq!(statuses.get(&422), Some(&96), "{statuses:?}");
        let put = put_line(&avatar);
        let honest = ask_honestly(server, [127, 0, 0, 10], &put, &call, &avatar).await;
        assert_eq!(honest.status, 201, "the same call's other member");
    });
}

/// Bodies and heads that are never finished, from many addresses and renewed as they end, with a genuine token and
/// without.
async fn hold(server: SocketAddr, from: [u8; 4], most: usize, slow: String, until: Instant) {
    let mut held = std::collections::VecDeque::new();
    let mut number = 0_usize;
    while Instant::now() < until {
        number += 1;
        let bytes: &[u8] = match number % 4 {
            0 => b"GET /healthz HTTP/1.1\r\nX: ",
            1 => b"",
            _ => slow.as_bytes(),
        };
        if let Ok(mut stream) = connect(server, from).await
            && stream.write_all(bytes).await.is_ok()
        {
            held.push_back(stream);
        }
        if held.len() >= most {
            held.pop_front();
            tokio::time::sleep(Duration::from_millis(20)).await;
        }
    }
}

#[test]
fn slow_connections_from_ten_addresses_keep_no_honest_client_out() {
    let limits = tempfile::NamedTempFile::new().expect("a file");
    let (connections, each) = (extent(256, 4096), extent(30, 505));
    let text = format!("connections = {connections}\nrequest_burst = 100000\n");
    std::fs::write(limits.path(), text).expect("written");
    let limits = limits.path().to_str().expect("UTF-8").to_owned();
    let house = House::open_with(&["--limits", &limits]);
    let (server, host) = (house.address, house.owner_token());
    let seconds = u64::from(extent(6, 60));
    house.runtime.block_on(async {
        let room = ask(server, [127, 0, 0, 1], "POST /v1/rooms", &host, b"").await;
        let room = room.expect("a room").json();
        let text = |name: &str| room[name].as_str().expect("text").to_owned();
        let (room, sender) = (text("room"), text("sender_token"));
        let slow = format!(
            "POST /v1/rooms/{room}/presence HTTP/1.1\r\nHost: x\r\nAuthorization: Bearer {sender}\r\nContent-Length: 100\r\n\r\n{{"
        );
        let until = Instant::now() + Duration::from_secs(seconds);
        let attackers: Vec<_> = (20..30)
            .map(|last| {
                let most = usize::try_from(each).expect("small");
                let held = hold(server, [127, 0, 0, last], most, slow.clone(), until);
                tokio::spawn(held)
            })
            .collect();
        tokio::time::sleep(Duration::from_secs(seconds / 3)).await;
        let mut answers = Times::of("honest requests beside slow connections");
        while Instant::now() < until {
            let from = [127, 0, 0, 99];
            for (line, token, status) in [("GET /healthz", "", 200), ("POST /v1/rooms", &host, 201)] {
                let begun = Instant::now();
                let answer = ask_honestly(server, from, line, token, b"").await;
                assert_eq!(answer.status, status, "{line}");
                answers.add(begun.elapsed());
            }
            tokio::time::sleep(Duration::from_millis(100)).await;
        }
        assert!(answers.count() > 0, "the flood was over too soon");
        for attacker in attackers {
            attacker.await.expect("it only connects");
        }
    });
    let closed = house.metric("mon3tr_connections_replaced_total ");
    assert!(closed > 0, "the places were never all taken");
}

#[test]
fn a_flood_of_requests_without_credentials_silences_its_own_address_alone() {
    let house = House::open_with(&["--turn", "127.0.0.1:0"]);
    let words = "relaying calls that find no direct way on port ";
    house.server_says(words, 1);
    let said = house.said_by_server();
    let port = said
        .split(words)
        .nth(1)
        .and_then(|rest| rest.split(',').next());
    let relay: u16 = port.and_then(|port| port.parse().ok()).expect("a port");
    let socket = |last| {
        let from = SocketAddr::from(([127, 0, 0, last], 0));
        let socket = UdpSocket::bind(from).expect("a socket");
        socket.connect(("127.0.0.1", relay)).expect("a way");
        socket
    };
    let until = Instant::now() + Duration::from_secs(extent(3, 40).into());
    let flood = std::thread::spawn({
        let flood = socket(9);
        move || {
            flood.set_nonblocking(true).expect("it waits for nothing");
            let (mut answers, mut packet) = (0, [0; 256]);
            while Instant::now() < until {
                for number in 0..10_u8 {
                    let transaction = [number; 12];
                    drop(flood.send(&stun(u16::from(number % 2) * 2 + 1, transaction)));
                }
                while flood.recv(&mut packet).is_ok() {
                    answers += 1;
                }
                // Some 20,000 a second: what one core can handle is not what is tried here.
                std::thread::sleep(Duration::from_micros(500));
            }
            answers
        }
    });
    let mut last = 50;
    let mut answers = Times::of("the relay's answers beside a flood");
    while Instant::now() < until {
        let honest = socket(last);
        last = if last < 90 { last + 1 } else { 50 };
        let begun = Instant::now();
        assert!(is_answered(&honest), "no answer to 127.0.0.{last}");
        answers.add(begun.elapsed());
        std::thread::sleep(Duration::from_millis(100));
    }
    let flooded: u32 = flood.join().expect("it only sends");
    // Five seconds' worth at once, and then 20 a second.
    let most = 100 + 20 * (extent(3, 40) + 5);
    assert!(
        (1..=most).contains(&flooded),
        "{flooded} answers to the flood"
    );
}

/// A request without attributes: 1 asks for one's address, 3 for an allocation.
fn stun(kind: u16, transaction: [u8; 12]) -> Vec<u8> {
    let mut request = kind.to_be_bytes().to_vec();
    request.extend([0, 0, 0x21, 0x12, 0xA4, 0x42]);
    request.extend(transaction);
    request
}

/// Asks for its address as clients do: again after half a second, a second and two.
fn is_answered(client: &UdpSocket) -> bool {
    let request = stun(1, *b"twelve bytes");
    [500, 1000, 2000].into_iter().any(|ms| {
        client.send(&request).expect("sent");
        let wait = Some(Duration::from_millis(ms));
        client.set_read_timeout(wait).expect("a time");
        let mut answer = [0; 256];
        client
            .recv(&mut answer)
            .is_ok_and(|length| answer[..length].starts_with(&[1, 1]))
    })
}

#[test]
fn a_token_is_revoked_while_the_disk_is_full() {
    let folder = tempfile::tempdir().expect("a folder");
    let disk = folder.path().join("disk");
    std::fs::create_dir(&disk).expect("a folder");
    let disk = disk.to_str().expect("UTF-8");
    let mount = format!("mount -t tmpfs -o size=2m none {disk}");
    let may = std::process::Command::new("unshare")
        .args(["--user", "--map-root-user", "--mount", "sh", "-c", &mount])
        .output();
    if !may.is_ok_and(|may| may.status.success()) {
        println!("skipped: no mount namespace may be made here, so no small disk either");
        assert_ne!(
            std::env::var("CI").as_deref(),
            Ok("true"),
            "CI must have one"
        );
        return;
    }
    // A shell that sees the small disk, and is told what to do line by line.
    let program = crate::PROGRAM;
    let mut shell = std::process::Command::new("unshare")
        .args(["--user", "--map-root-user", "--mount", "sh"])
        .env("MON3TR_CACHE", disk)
        .env_remove("MON3TR_OWNER_TOKEN")
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .stderr(Stdio::inherit())
        .spawn()
        .expect("a shell");
    let mut orders = shell.stdin.take().expect("piped");
    let mut said = BufReader::new(shell.stdout.take().expect("piped")).lines();
    let mut until = |word: &str| {
        said.by_ref()
            .map(|line| line.expect("text"))
            .find_map(|line| Some(line.split_once(word)?.1.trim().to_owned()))
            .expect("it goes on")
    };
    writeln!(
        orders,
        "{mount}\n{program} serve --listen 127.0.0.1:0 --data {disk}/server & server=$!"
    )
    .expect("told");
    let address: SocketAddr = until("serving on http://").parse().expect("an address");
    writeln!(
        orders,
        "echo token $(cat {disk}/server/owner-token)\nhead -c 4m /dev/zero > {disk}/fill; echo x > {disk}/more || echo full"
    )
    .expect("told");
    let token = until("token ");
    until("full");
    let runtime = tokio::runtime::Runtime::new().expect("a runtime");
    let open = || {
        let opened = ask(address, [127, 0, 0, 1], "POST /v1/rooms", &token, b"");
        runtime.block_on(opened).expect("an answer").status
    };
    assert_eq!(open(), 201, "it holds");
    writeln!(
        orders,
        "{program} serve --data {disk}/server --revoke $(cat {disk}/server/owner-token) && echo revoked || echo failed"
    )
    .expect("told");
    assert_eq!(until("the token called ").split(' ').nth(1), Some("holds"));
    let begun = Instant::now();
    while open() != 401 {
        assert!(begun.elapsed() < Duration::from_secs(60), "it holds on");
        std::thread::sleep(Duration::from_millis(200));
    }
    writeln!(orders, "kill $server; wait").expect("told");
    drop(orders);
    shell.wait().expect("it ends");
}

#[test]
fn an_operator_blocks_addresses_and_replaces_the_secret_while_tokens_hold() {
    let mut house = House::open_with(&["--turn", "127.0.0.1:0"]);
    let words = "relaying calls that find no direct way on port ";
    house.server_says(words, 1);
    let said = house.said_by_server();
    let port = said
        .split(words)
        .nth(1)
        .and_then(|rest| rest.split(',').next());
    let relay: u16 = port.and_then(|port| port.parse().ok()).expect("a port");
    let client = |last| {
        let from = SocketAddr::from(([127, 0, 0, last], 0));
        let socket = UdpSocket::bind(from).expect("a socket");
        socket.connect(("127.0.0.1", relay)).expect("a way");
        socket
    };
    let (server, before) = (house.address, house.owner_token());
    let status = |house: &House, from, line: &str, token: &str| {
        let asked = ask(server, from, line, token, b"");
        house
            .runtime
            .block_on(asked)
            .map_or(0, |answer| answer.status)
    };
    let (hostile, honest) = ([127, 0, 0, 66], [127, 0, 0, 72]);
    let health = "GET /healthz";
    assert_eq!(status(&house, hostile, health, ""), 200, "not blocked");
    assert!(is_answered(&client(66)), "nor by the relay");
    std::fs::write(house.path("server/blocked"), "127.0.0.64/29 # case 1\n").expect("written");
    wait_for("the end of service", || {
        (status(&house, hostile, health, "") == 0).then_some(())
    });
    assert!(!is_answered(&client(66)), "nor does the relay answer");
    assert_eq!(status(&house, honest, health, ""), 200, "another address");
    assert!(is_answered(&client(72)), "of another address");

    let open = "POST /v1/rooms";
    let (secret, previous) = (
        house.path("server/secret"),
        house.path("server/secret.previous"),
    );
    house.kill_server();
    std::fs::rename(&secret, &previous).expect("renamed");
    house.start_server();
    let after = house.owner_token();
    assert_ne!(after, before, "another secret signed it");
    for token in [&before, &after] {
        assert_eq!(status(&house, honest, open, token), 201, "both hold");
    }
    house.kill_server();
    std::fs::remove_file(&previous).expect("removed");
    house.start_server();
    assert_eq!(
        status(&house, honest, open, &before),
        401,
        "of the one before"
    );
    assert_eq!(status(&house, honest, open, &after), 201, "of the new one");
}
