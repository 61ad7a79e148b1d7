//! Listening: UDP, and TCP with or without TLS, on one port.

use crate::allocation::{Client, Way};
use crate::config::Config;
use crate::connections::{Connections, Place};
use crate::service::{Counts, MAX_PACKET, Service};
use socket2::{Domain, Protocol, Socket, Type};
use std::io;
use std::net::{IpAddr, SocketAddr};
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering::Relaxed};
use std::time::Duration;
use tokio::io::{AsyncRead, AsyncReadExt, AsyncWrite, AsyncWriteExt};
use tokio::net::{TcpListener, TcpStream, UdpSocket};
use tokio::sync::mpsc;
use tokio::time::{Instant, timeout};
use tokio_util::sync::CancellationToken;

/// Packets that may wait for a TCP client; more are dropped.
const WAITING: usize = 64;
/// Bytes of packets that may wait for the server, as far as the system allows: a flood that is dropped at once leaves
/// room for others' packets.
const RECEIVE_BUFFER: usize = 4 << 20;
/// How often a listener takes no other connection after an error (no file is free), so that it does not spin.
const AFTER_ERROR: Duration = Duration::from_millis(100);
/// How often a port is tried that is free for UDP, and not for TCP.
const TRIES: usize = 16;
/// The first byte of a TLS handshake; no STUN message and no channel begins with it.
#[cfg(feature = "tls")]
const TLS_HANDSHAKE: u8 = 22;

/// Why a server does not start.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum TurnError {
    /// The address cannot be listened on.
    #[error("cannot relay calls on {address} (UDP and TCP); choose another address or port")]
    Listen {
        /// The address.
        address: SocketAddr,
        /// Why.
        #[source]
        source: io::Error,
    },
    /// The system gives no random numbers.
    #[error("the system gives no random numbers")]
    Random(#[from] getrandom::Error),
}

/// A running server. Dropping it stops it.
#[derive(Debug)]
pub struct TurnServer {
    address: SocketAddr,
    service: Arc<Service>,
    stopping: CancellationToken,
}

impl TurnServer {
    /// Starts a server in the current Tokio runtime; when this returns, it takes packets.
    ///
    /// # Errors
    /// If the address cannot be listened on.
    pub fn start(config: Config) -> Result<Self, TurnError> {
        let failed = |source| TurnError::Listen {
            address: config.listen,
            source,
        };
        let (udp, tcp) = listen(config.listen).map_err(failed)?;
        let address = udp.local_addr().map_err(failed)?;
        let stopping = CancellationToken::new();
        let service = Arc::new(Service::new(config)?);
        tokio::spawn(serve_udp(
            Arc::clone(&service),
            Arc::new(udp),
            stopping.clone(),
        ));
        tokio::spawn(serve_tcp(Arc::clone(&service), tcp, stopping.clone()));
        log::info!("relaying calls on {address}, over UDP and TCP");
        Ok(Self {
            address,
            service,
            stopping,
        })
    }

    /// Where it listens, with the port it was given.
    #[must_use]
    pub fn address(&self) -> SocketAddr {
        self.address
    }
}

impl TurnServer {
    /// What it has refused since its start, and what it lends.
    #[must_use]
    pub fn counts(&self) -> Counts {
        self.service.counts()
    }

    /// Ends the allocations of whom [`Config::admission`] admits no longer. To be called when that has changed.
    pub fn end_refused(&self) {
        self.service.end_refused();
    }
}

impl Drop for TurnServer {
    fn drop(&mut self) {
        self.stopping.cancel();
        self.service.stop();
    }
}

/// A UDP socket and a TCP listener on one port.
fn listen(address: SocketAddr) -> io::Result<(UdpSocket, TcpListener)> {
    let mut tries = 0;
    loop {
        let udp = bound(address, Type::DGRAM, Protocol::UDP)?;
        let udp = UdpSocket::from_std(udp.into())?;
        let taken = SocketAddr::new(address.ip(), udp.local_addr()?.port());
        let tcp = bound(taken, Type::STREAM, Protocol::TCP).and_then(|tcp| {
            tcp.listen(128)?;
            TcpListener::from_std(tcp.into())
        });
        tries += 1;
        match tcp {
            Ok(tcp) => return Ok((udp, tcp)),
            Err(_) if address.port() == 0 && tries < TRIES => {}
            Err(error) => return Err(error),
        }
    }
}

fn bound(address: SocketAddr, kind: Type, protocol: Protocol) -> io::Result<Socket> {
    let socket = Socket::new(Domain::for_address(address), kind, Some(protocol))?;
    if address.ip() == IpAddr::V6(std::net::Ipv6Addr::UNSPECIFIED) {
        // "All addresses" means those of IPv4 too, whatever the system's default is.
        socket.set_only_v6(false)?;
    }
    if kind == Type::STREAM {
        socket.set_reuse_address(true)?;
    } else if let Err(error) = socket.set_recv_buffer_size(RECEIVE_BUFFER) {
        log::debug!("the buffer for packets stays as it is: {error}");
    }
    socket.bind(&address.into())?;
    socket.set_nonblocking(true)?;
    Ok(socket)
}

async fn serve_udp(service: Arc<Service>, socket: Arc<UdpSocket>, stopping: CancellationToken) {
    let mut buffer = vec![0; MAX_PACKET];
    loop {
        let received = tokio::select! {
            () = stopping.cancelled() => return,
            received = socket.recv_from(&mut buffer) => received,
        };
        match received {
            Ok((length, from)) => {
                let client = Client {
                    address: canonical(from),
                    connection: None,
                };
                if service.is_blocked(client.address.ip()) {
                    continue;
                }
                let way = Way::Udp(Arc::clone(&socket), from);
                service.handle(client, &way, buffer.get(..length).unwrap_or_default());
            }
            Err(error) => {
                log::debug!("receiving packets: {error}");
                tokio::time::sleep(AFTER_ERROR).await;
            }
        }
    }
}

async fn serve_tcp(service: Arc<Service>, listener: TcpListener, stopping: CancellationToken) {
    let open = Connections::default();
    let numbers = AtomicU64::new(0);
    loop {
        let accepted = tokio::select! {
            () = stopping.cancelled() => return,
            accepted = listener.accept() => accepted,
        };
        let (stream, from) = match accepted {
            Ok(accepted) => accepted,
            Err(error) => {
                log::debug!("accepting a connection: {error}");
                tokio::time::sleep(AFTER_ERROR).await;
                continue;
            }
        };
        let number = numbers.fetch_add(1, Relaxed);
        let client = Client {
            address: canonical(from),
            connection: Some(number),
        };
        if service.is_blocked(client.address.ip()) {
            continue;
        }
        let place = open.enter(number, client.address.ip(), &service.config().limits);
        let Some(place) = place else {
            log::debug!("a connection of {from} is refused: there are too many");
            service.count(|counts| &mut counts.connections_refused);
            continue;
        };
        let (service, stopping) = (Arc::clone(&service), stopping.clone());
        tokio::spawn(async move {
            let served = serve_stream(&service, stream, client, &place);
            tokio::select! {
                () = stopping.cancelled() => {}
                () = place.closed() => {}
                ended = served => if let Err(error) = ended {
                    log::debug!("the connection of {from} ends: {error}");
                }
            }
            service.forget(&client);
        });
    }
}

/// Serves a connection, which may begin with a TLS handshake.
async fn serve_stream(
    service: &Arc<Service>,
    stream: TcpStream,
    client: Client,
    place: &Place,
) -> io::Result<()> {
    stream.set_nodelay(true)?;
    #[cfg(feature = "tls")]
    if let Some(tls) = &service.config().tls {
        let idle = service.config().limits.idle;
        let mut first = [0];
        timeout(idle, stream.peek(&mut first)).await??;
        if first == [TLS_HANDSHAKE] {
            let acceptor = tokio_rustls::TlsAcceptor::from(Arc::clone(tls));
            let stream = timeout(idle, acceptor.accept(stream)).await??;
            return serve_packets(service, stream, client, place).await;
        }
    }
    serve_packets(service, stream, client, place).await
}

/// Serves the packets on a connection, until it ends, is idle without an allocation, or brings what is no packet.
async fn serve_packets(
    service: &Arc<Service>,
    stream: impl AsyncRead + AsyncWrite,
    client: Client,
    place: &Place,
) -> io::Result<()> {
    let idle = service.config().limits.idle;
    let (mut reader, mut writer) = tokio::io::split(stream);
    let (packets, mut outgoing) = mpsc::channel::<Vec<u8>>(WAITING);
    let write = async {
        while let Some(packet) = outgoing.recv().await {
            // A client that takes nothing for this long is gone.
            timeout(idle, async {
                writer.write_all(&packet).await?;
                writer.flush().await
            })
            .await??;
        }
        Ok::<_, io::Error>(())
    };
    let way = Way::Tcp(packets);
    let read = async {
        let mut packet = Vec::with_capacity(MAX_PACKET);
        let mut deadline = Instant::now() + idle;
        let mut established = false;
        loop {
            let next = read_packet(&mut reader, &mut packet);
            let more = if established {
                // A client refreshes its allocation well before it expires, which is later than this.
                timeout(service.config().limits.lifetime, next).await??
            } else {
                tokio::time::timeout_at(deadline, next).await??
            };
            if !more {
                return Ok::<_, io::Error>(());
            }
            // The client may have been blocked since it connected.
            if service.is_blocked(client.address.ip()) {
                return Ok(());
            }
            let had = established;
            established = service.handle(client, &way, &packet);
            place.has_allocation(established);
            if had && !established {
                deadline = Instant::now() + idle;
            }
        }
    };
    tokio::select! {
        ended = read => ended,
        ended = write => ended,
    }
}

/// Reads the next STUN message or ChannelData message; returns whether there was one.
async fn read_packet(
    reader: &mut (impl AsyncRead + Unpin),
    packet: &mut Vec<u8>,
) -> io::Result<bool> {
    let mut head = [0; 4];
    match reader.read_exact(&mut head).await {
        Ok(_) => {}
        Err(error) if error.kind() == io::ErrorKind::UnexpectedEof => return Ok(false),
        Err(error) => return Err(error),
    }
    let [first, _, high, low] = head;
    let length = usize::from(u16::from_be_bytes([high, low]));
    let rest = match first {
        // The rest of a STUN header, and the attributes; a channel's data, filled up to four bytes.
        0x00..=0x3F => 16 + length,
        0x40..=0x4F => length.next_multiple_of(4),
        _ => return Err(io::Error::new(io::ErrorKind::InvalidData, "no TURN packet")),
    };
    if rest > MAX_PACKET - head.len() {
        return Err(io::Error::new(
            io::ErrorKind::InvalidData,
            "too long a packet",
        ));
    }
    packet.clear();
    packet.extend_from_slice(&head);
    packet.resize(head.len() + rest, 0);
    reader
        .read_exact(packet.get_mut(head.len()..).unwrap_or_default())
        .await?;
    Ok(true)
}

fn canonical(address: SocketAddr) -> SocketAddr {
    SocketAddr::new(address.ip().to_canonical(), address.port())
}
