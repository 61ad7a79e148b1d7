//! TURN over TCP for a library that speaks it over UDP only: a UDP socket on the loopback, whose packets go to the server and back on a TCP
//! connection, one for each socket that uses it. The framing is that of RFC 8656, section 7.1: packets state their own length.

use std::collections::HashMap;
use std::io;
use std::net::{Ipv4Addr, SocketAddr};
use std::sync::Arc;
use std::time::Duration;
use tokio::io::{AsyncReadExt, AsyncWriteExt};
use tokio::net::{TcpStream, UdpSocket};
use tokio::sync::mpsc;
use tokio::task::{JoinHandle, JoinSet};
use tokio::time::timeout;

/// Bytes of the largest packet, and packets that may wait for the connection.
const MAX_PACKET: usize = 2048;
const WAITING: usize = 64;
/// Connections at once: one for each address of this machine and connection of the call.
const MOST: usize = 256;
/// How long a connection may take to be made, and how long it may carry nothing: a relay is refreshed more often.
const CONNECT: Duration = Duration::from_secs(3);
const IDLE: Duration = Duration::from_secs(900);

/// A way to one server. Dropping it closes its connections.
#[derive(Debug)]
pub(crate) struct Tunnel {
    address: SocketAddr,
    task: JoinHandle<()>,
}

impl Tunnel {
    /// Opens the socket; connections are made when packets come.
    pub(crate) async fn open(server: Vec<SocketAddr>) -> io::Result<Self> {
        let socket = UdpSocket::bind((Ipv4Addr::LOCALHOST, 0)).await?;
        let address = socket.local_addr()?;
        let task = tokio::spawn(carry(Arc::new(socket), server));
        Ok(Self { address, task })
    }

    /// Where the library finds the server.
    pub(crate) fn address(&self) -> SocketAddr {
        self.address
    }
}

impl Drop for Tunnel {
    fn drop(&mut self) {
        self.task.abort();
    }
}

async fn carry(socket: Arc<UdpSocket>, server: Vec<SocketAddr>) {
    let mut connections = JoinSet::new();
    let mut buffer = vec![0; MAX_PACKET];
    let mut senders: HashMap<SocketAddr, mpsc::Sender<Vec<u8>>> = HashMap::new();
    loop {
        let received = tokio::select! {
            received = socket.recv_from(&mut buffer) => received,
            Some(_) = connections.join_next(), if !connections.is_empty() => {
                senders.retain(|_, way| !way.is_closed());
                continue;
            }
        };
        let (length, from) = match received {
            Ok(received) => received,
            Err(error) => {
                log::debug!("a tunnel's socket: {error}");
                continue;
            }
        };
        let packet = buffer.get(..length).unwrap_or_default().to_vec();
        let way = senders.entry(from).or_insert_with(|| {
            let (way, packets) = mpsc::channel(WAITING);
            if connections.len() < MOST {
                let (socket, server) = (Arc::clone(&socket), server.clone());
                connections.spawn(async move {
                    if let Err(error) = connect(&socket, from, &server, packets).await {
                        log::debug!("the connection to {server:?} ends: {error}");
                    }
                });
            }
            way
        });
        // What does not fit is lost, as on any network.
        if way.try_send(packet).is_err() && way.is_closed() {
            senders.remove(&from);
        }
    }
}

/// Carries the packets of one socket, until the server closes the connection or nothing has come for long.
async fn connect(
    socket: &UdpSocket,
    from: SocketAddr,
    server: &[SocketAddr],
    mut packets: mpsc::Receiver<Vec<u8>>,
) -> io::Result<()> {
    let stream = timeout(CONNECT, TcpStream::connect(server)).await??;
    stream.set_nodelay(true)?;
    let (mut reader, mut writer) = stream.into_split();
    let out = async {
        while let Some(mut packet) = packets.recv().await {
            // A channel's data is filled up to four bytes here, which it need not be over UDP.
            packet.resize(packet.len().next_multiple_of(4), 0);
            writer.write_all(&packet).await?;
        }
        Ok::<_, io::Error>(())
    };
    let back = async {
        let mut packet = vec![0; MAX_PACKET];
        loop {
            let length = timeout(IDLE, read_packet(&mut reader, &mut packet)).await??;
            socket
                .send_to(packet.get(..length).unwrap_or_default(), from)
                .await?;
        }
    };
    tokio::select! {
        ended = out => ended,
        ended = back => ended,
    }
}

/// Reads the next packet into `packet`; returns its length.
async fn read_packet(
    reader: &mut (impl AsyncReadExt + Unpin),
    packet: &mut [u8],
) -> io::Result<usize> {
    let wrong = || io::Error::new(io::ErrorKind::InvalidData, "no TURN packet");
    let (head, rest) = packet.split_at_mut_checked(4).ok_or_else(wrong)?;
    reader.read_exact(head).await?;
    let [first, _, high, low] = *head else {
        return Err(wrong());
    };
    let length = usize::from(u16::from_be_bytes([high, low]));
    let more = match first {
        0x00..=0x3F => 16 + length,
        0x40..=0x7F => length.next_multiple_of(4),
        _ => return Err(wrong()),
    };
    reader
        .read_exact(rest.get_mut(..more).ok_or_else(wrong)?)
        .await?;
    Ok(4 + more)
}
