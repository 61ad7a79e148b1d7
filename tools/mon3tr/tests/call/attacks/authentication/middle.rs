//! A server in the middle: it hands requests and answers on to the genuine server, and changes text on the way.

use std::io::{BufRead, BufReader, Read, Write};
use std::net::{SocketAddr, TcpListener, TcpStream};
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering::Relaxed};

/// What passes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Passes {
    /// A viewer's offer, on its way to the server.
    Offer,
    /// The answer to it, on its way to the viewer.
    Answer,
    /// The people of a call.
    People,
    /// An event of a sender's presence, such as an offer in JSON.
    Event,
    /// A sender's answer, on its way to the server.
    SentAnswer,
}

/// The middle; it ends with the test's process.
pub(super) struct Middle {
    pub(super) address: SocketAddr,
    changed: Arc<AtomicUsize>,
}

impl Middle {
    /// In front of `server`, with `change` for all that passes.
    pub(super) fn start(
        server: SocketAddr,
        change: impl Fn(Passes, &str) -> String + Send + Sync + 'static,
    ) -> Self {
        let listener = TcpListener::bind("127.0.0.1:0").expect("a port");
        let address = listener.local_addr().expect("an address");
        let changed = Arc::<AtomicUsize>::default();
        let counted = Arc::clone(&changed);
        let change = Arc::new(move |passes: Passes, text: &str| {
            let text_after = change(passes, text);
            counted.fetch_add(usize::from(text_after != text), Relaxed);
            text_after
        });
        std::thread::spawn(move || {
            for stream in listener.incoming().map_while(Result::ok) {
                let change = Arc::clone(&change);
                // A connection that ends in the middle is one that a program has closed.
                std::thread::spawn(move || drop(pass(stream, server, &*change)));
            }
        });
        Self { address, changed }
    }

    /// How many texts it has changed.
    pub(super) fn changed(&self) -> usize {
        self.changed.load(Relaxed)
    }
}

/// The first line and the headers of a request or answer.
fn head(reader: &mut impl BufRead) -> std::io::Result<(String, Vec<String>)> {
    let mut lines = Vec::new();
    loop {
        let mut line = String::new();
        reader.read_line(&mut line)?;
        match line.trim_end() {
            "" => break,
            line => lines.push(line.to_owned()),
        }
    }
    let first = lines
        .first()
        .cloned()
        .ok_or(std::io::ErrorKind::UnexpectedEof)?;
    Ok((first, lines.split_off(1)))
}

fn header(headers: &[String], name: &str) -> Option<String> {
    let named = headers.iter().filter_map(|line| line.split_once(':'));
    let mut named = named.filter(|(it, _)| it.eq_ignore_ascii_case(name));
    named.next().map(|(_, value)| value.trim().to_owned())
}

fn write_head(
    writer: &mut impl Write,
    first: &str,
    headers: &[String],
    length: Option<usize>,
) -> std::io::Result<()> {
    let is_own = |line: &&String| {
        let name = line
            .split(':')
            .next()
            .unwrap_or_default()
            .to_ascii_lowercase();
        matches!(
            &*name,
            "connection" | "content-length" | "transfer-encoding" | "expect"
        )
    };
    let mut text = format!("{first}\r\nconnection: close\r\n");
    for line in headers.iter().filter(|line| !is_own(line)) {
        text.push_str(&format!("{line}\r\n"));
    }
    if let Some(length) = length {
        text.push_str(&format!("content-length: {length}\r\n"));
    }
    writer.write_all(format!("{text}\r\n").as_bytes())
}

/// One request and its answer.
fn pass(
    client: TcpStream,
    server: SocketAddr,
    change: &dyn Fn(Passes, &str) -> String,
) -> std::io::Result<()> {
    let mut from_client = BufReader::new(client.try_clone()?);
    let mut to_client = client;
    let (first, headers) = head(&mut from_client)?;
    if header(&headers, "expect").is_some() {
        to_client.write_all(b"HTTP/1.1 100 Continue\r\n\r\n")?;
    }
    let length = header(&headers, "content-length").and_then(|it| it.parse().ok());
    let mut body = vec![0; length.unwrap_or(0)];
    from_client.read_exact(&mut body)?;
    let path = first.split(' ').nth(1).unwrap_or_default().to_owned();
    let sent = match &*path {
        path if path.ends_with("/whep") => Some(Passes::Offer),
        path if path.ends_with("/answer") => Some(Passes::SentAnswer),
        _ => None,
    };
    if let Some(sent) = sent {
        let text = String::from_utf8(body).expect("SDP is text");
        body = change(sent, &text).into_bytes();
    }
    // By HTTP/1.0 the answer is not in chunks.
    let mut to_server = TcpStream::connect(server)?;
    let is_sent = length.map(|_| body.len());
    write_head(
        &mut to_server,
        &first.replace("HTTP/1.1", "HTTP/1.0"),
        &headers,
        is_sent,
    )?;
    to_server.write_all(&body)?;
    let mut from_server = BufReader::new(to_server);
    let (status, headers) = head(&mut from_server)?;
    let status = status.replace("HTTP/1.0", "HTTP/1.1");
    let is_events = header(&headers, "content-type").is_some_and(|it| it.contains("event-stream"));
    let returned = match sent {
        Some(Passes::Offer) => Some(Passes::Answer),
        _ if path.contains("/calls/") && first.starts_with("GET") => Some(Passes::People),
        _ => None,
    };
    if is_events {
        write_head(&mut to_client, &status, &headers, None)?;
        let mut line = String::new();
        while from_server.read_line(&mut line)? > 0 {
            to_client.write_all(change(Passes::Event, &line).as_bytes())?;
            line.clear();
        }
    } else if let Some(returned) = returned {
        let mut text = String::new();
        from_server.read_to_string(&mut text)?;
        let text = change(returned, &text);
        write_head(&mut to_client, &status, &headers, Some(text.len()))?;
        to_client.write_all(text.as_bytes())?;
    } else {
        let length = header(&headers, "content-length").and_then(|it| it.parse().ok());
        write_head(&mut to_client, &status, &headers, length)?;
        std::io::copy(&mut from_server, &mut to_client)?;
    }
    Ok(())
}
