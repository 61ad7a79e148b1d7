//! Prints the lab's accuracy on this machine: what it adds to the requested delay, and how near a TCP path comes to its rate.
//!
//! `cargo run -p netlab --example accuracy`

use std::{
    error::Error,
    net::{Ipv4Addr, SocketAddr},
    time::{Duration, Instant},
};

use axum::{Router, routing::post};
use netlab::{BitRate, Impairment, Lab, LabConfig, TcpImpairment, TcpRelay, report::LatencyMs};
use tokio::{
    io::{AsyncReadExt as _, AsyncWriteExt as _},
    net::{TcpListener, TcpStream, UdpSocket},
};

const DELAY: Duration = Duration::from_millis(20);

#[tokio::main]
async fn main() -> Result<(), Box<dyn Error>> {
    for (packets, hz) in [(600, 60), (5000, 1000)] {
        udp(packets, hz).await?;
    }
    tcp().await
}

/// Packets of 200 bytes from one socket to another through a lab.
async fn udp(packets: u32, hz: u32) -> Result<(), Box<dyn Error>> {
    let sender = UdpSocket::bind((Ipv4Addr::LOCALHOST, 0)).await?;
    let viewer = std::net::UdpSocket::bind((Ipv4Addr::LOCALHOST, 0))?;
    let answer = sdp(sender.local_addr()?);
    let (tell, mut offers) = tokio::sync::mpsc::unbounded_channel();
    let app = Router::new().route(
        "/whep",
        post(move |offer: String| async move {
            let _ = tell.send(offer);
            (axum::http::StatusCode::CREATED, answer)
        }),
    );
    let server = TcpListener::bind((Ipv4Addr::LOCALHOST, 0)).await?;
    let mut config = LabConfig::new(server.local_addr()?);
    tokio::spawn(axum::serve(server, app).into_future());
    config.down = Impairment {
        delay: DELAY,
        ..Impairment::default()
    };
    let lab = Lab::start(config).await?;
    let body = sdp(viewer.local_addr()?);
    let mut http = TcpStream::connect(lab.address()).await?;
    let head = format!(
        "POST /whep HTTP/1.1\r\nhost: lab\r\nconnection: close\r\ncontent-length: {}\r\n\r\n",
        body.len()
    );
    http.write_all((head + &body).as_bytes()).await?;
    http.read_to_end(&mut Vec::new()).await?;
    let offer = offers.recv().await.ok_or("no offer came")?;
    let to_viewer = candidate(&offer).ok_or("the offer has no candidate")?;

    let started = Instant::now();
    let receiving = std::thread::spawn(move || -> std::io::Result<Vec<f64>> {
        let mut buffer = [0; 200];
        let mut added = Vec::new();
        while added.len() < packets as usize {
            viewer.recv(&mut buffer)?;
            let now = started.elapsed();
            let sent = buffer.first_chunk().map_or(0, |b| u64::from_le_bytes(*b));
            let took = now.saturating_sub(Duration::from_nanos(sent));
            added.push((took.as_secs_f64() - DELAY.as_secs_f64()) * 1000.0);
        }
        Ok(added)
    });
    for n in 0..packets {
        let due = Duration::from_secs(1) / hz * n;
        tokio::time::sleep_until((started + due).into()).await;
        let mut packet = [0; 200];
        let now = u64::try_from(started.elapsed().as_nanos())?;
        packet[..8].copy_from_slice(&now.to_le_bytes());
        sender.send_to(&packet, to_viewer).await?;
    }
    let added = receiving.join().map_err(|_| "the receiver failed")??;
    let most = added.iter().copied().fold(0.0, f64::max);
    let least = added.iter().copied().fold(f64::INFINITY, f64::min);
    if let Some(LatencyMs { p50, p95, p99 }) = LatencyMs::of(&added) {
        println!(
            "UDP, {packets} packets at {hz} Hz, {} ms asked: added ms least {least:.3} p50 {p50:.3} p95 {p95:.3} p99 {p99:.3} most {most:.3}",
            DELAY.as_millis()
        );
    }
    let punctuality = lab.stop().await.punctuality;
    println!(
        "  of that the pacer: mean {:.3} ms, {} over 1 ms",
        punctuality.mean_ms(),
        punctuality.late_over_1_ms
    );
    Ok(())
}

/// 20 MB from a server that writes as soon as it is asked.
async fn tcp() -> Result<(), Box<dyn Error>> {
    const BYTES: usize = 20_000_000;
    let server = TcpListener::bind((Ipv4Addr::LOCALHOST, 0)).await?;
    let address = server.local_addr()?;
    tokio::spawn(async move {
        while let Ok((mut client, _)) = server.accept().await {
            let _ = client.read_u8().await;
            let _ = client.write_all(&vec![7; BYTES]).await;
        }
    });
    for (round_trip, mbit_s) in [(50, 100.0), (100, 100.0), (20, 400.0)] {
        let rate = BitRate::from_kbit_s(mbit_s * 1000.0)?;
        let path = TcpImpairment::symmetric(Duration::from_millis(round_trip), Some(rate));
        let relay = TcpRelay::start((Ipv4Addr::LOCALHOST, 0).into(), address, path).await?;
        let started = Instant::now();
        let mut client = TcpStream::connect(relay.address()).await?;
        client.write_u8(1).await?;
        let mut got = Vec::with_capacity(BYTES);
        client.read_to_end(&mut got).await?;
        let took = started.elapsed().as_secs_f64();
        let least = BYTES as f64 * 8.0 / (mbit_s * 1e6) * 1500.0 / 1448.0;
        println!(
            "TCP, {} bytes over a round trip of {round_trip} ms at {mbit_s} Mbit/s: {took:.3} s; its bytes alone take {least:.3} s",
            got.len()
        );
    }
    Ok(())
}

fn sdp(address: SocketAddr) -> String {
    format!(
        "v=0\r\ns=-\r\nm=application 9 UDP/DTLS/SCTP webrtc-datachannel\r\na=candidate:1 1 udp 1 {} {} typ host\r\n",
        address.ip(),
        address.port()
    )
}

fn candidate(sdp: &str) -> Option<SocketAddr> {
    let line = sdp.lines().find_map(|l| l.strip_prefix("a=candidate:"))?;
    let mut words = line.split(' ').skip(4);
    format!("{}:{}", words.next()?, words.next()?).parse().ok()
}
