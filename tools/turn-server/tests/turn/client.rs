//! A TURN client for tests, by the STUN codec of the WebRTC library, which shares no code with the server.

use rtc::crypto::default_provider;
use rtc::stun::attributes::{
    ATTR_CHANNEL_NUMBER, ATTR_DATA, ATTR_LIFETIME, ATTR_NONCE, ATTR_REALM,
    ATTR_REQUESTED_TRANSPORT, ATTR_USERNAME, ATTR_XOR_PEER_ADDRESS, ATTR_XOR_RELAYED_ADDRESS,
    AttrType,
};
use rtc::stun::error_code::ErrorCodeAttribute;
use rtc::stun::fingerprint::FINGERPRINT;
use rtc::stun::integrity::MessageIntegrity;
use rtc::stun::message::{
    CLASS_INDICATION, CLASS_REQUEST, CLASS_SUCCESS_RESPONSE, Getter, METHOD_ALLOCATE,
    METHOD_BINDING, METHOD_CHANNEL_BIND, METHOD_CREATE_PERMISSION, METHOD_DATA, METHOD_REFRESH,
    METHOD_SEND, Message, MessageType, Method, Setter, TransactionId,
};
use rtc::stun::textattrs::TextAttribute;
use rtc::stun::xoraddr::XorMappedAddress;
use std::net::SocketAddr;
use std::time::Duration;
use tokio::io::{AsyncReadExt, AsyncWriteExt};
use tokio::net::{TcpStream, UdpSocket};
use tokio::time::timeout;
use turn_server::credentials::Credentials;

/// How long an answer may take on a busy machine, and how long nothing must come.
const ANSWER: Duration = Duration::from_secs(10);
const NOTHING: Duration = Duration::from_millis(300);

/// What carries the packets.
#[derive(Debug)]
enum Carrier {
    Udp(UdpSocket),
    Tcp(TcpStream),
}

/// A client of a server.
#[derive(Debug)]
pub(crate) struct Client {
    carrier: Carrier,
    credentials: Credentials,
    realm: String,
    nonce: String,
}

/// The number of an error response, or 0 where there was no answer at all.
pub(crate) type Refused = u16;

impl Client {
    pub(crate) async fn udp(server: SocketAddr, credentials: Credentials) -> Self {
        let any = if server.is_ipv4() {
            "127.0.0.1:0"
        } else {
            "[::1]:0"
        };
        let socket = UdpSocket::bind(any).await.expect("a socket");
        socket.connect(server).await.expect("a way to the server");
        Self::new(Carrier::Udp(socket), credentials)
    }

    /// The same from this address.
    pub(crate) async fn udp_from(
        from: [u8; 4],
        server: SocketAddr,
        credentials: Credentials,
    ) -> Self {
        let from = SocketAddr::from((from, 0));
        let socket = UdpSocket::bind(from).await.expect("a socket");
        socket.connect(server).await.expect("a way to the server");
        Self::new(Carrier::Udp(socket), credentials)
    }

    pub(crate) fn tcp_on(stream: TcpStream, credentials: Credentials) -> Self {
        Self::new(Carrier::Tcp(stream), credentials)
    }

    pub(crate) async fn tcp(server: SocketAddr, credentials: Credentials) -> Self {
        let stream = TcpStream::connect(server).await.expect("a connection");
        Self::new(Carrier::Tcp(stream), credentials)
    }

    fn new(carrier: Carrier, credentials: Credentials) -> Self {
        Self {
            carrier,
            credentials,
            realm: String::new(),
            nonce: String::new(),
        }
    }

    pub(crate) fn use_credentials(&mut self, credentials: Credentials) {
        self.credentials = credentials;
    }

    pub(crate) fn address(&self) -> SocketAddr {
        match &self.carrier {
            Carrier::Udp(socket) => socket.local_addr(),
            Carrier::Tcp(stream) => stream.local_addr(),
        }
        .expect("an address")
    }

    pub(crate) async fn send(&mut self, packet: &[u8]) {
        match &mut self.carrier {
            Carrier::Udp(socket) => {
                socket.send(packet).await.expect("sent");
            }
            // A server may close it at any time.
            Carrier::Tcp(stream) => drop(stream.write_all(packet).await),
        }
    }

    /// The next packet; nothing if none comes.
    async fn receive(&mut self, within: Duration) -> Option<Vec<u8>> {
        let mut packet = vec![0; 4096];
        let received = async {
            match &mut self.carrier {
                Carrier::Udp(socket) => socket.recv(&mut packet).await.ok(),
                Carrier::Tcp(stream) => {
                    let (head, rest) = packet.split_at_mut(4);
                    stream.read_exact(head).await.ok()?;
                    let length = usize::from(u16::from_be_bytes([head[2], head[3]]));
                    let length = if head[0] < 0x40 {
                        length + 16
                    } else {
                        length.next_multiple_of(4)
                    };
                    stream.read_exact(&mut rest[..length]).await.ok()?;
                    Some(length + 4)
                }
            }
        };
        let length = timeout(within, received).await.ok()??;
        packet.truncate(length);
        Some(packet)
    }

    /// What STUN says this client's address is.
    pub(crate) async fn binding(&mut self) -> Option<SocketAddr> {
        let answer = self.exchange(METHOD_BINDING, &[], false).await.ok()?;
        let mut mapped = XorMappedAddress::default();
        mapped.get_from(&answer).expect("a mapped address");
        Some(SocketAddr::new(mapped.ip, mapped.port))
    }

    /// Asks for an allocation as clients do: without credentials first, then as the server asks for them.
    pub(crate) async fn allocate(&mut self) -> Result<SocketAddr, Refused> {
        let udp = Plain(ATTR_REQUESTED_TRANSPORT, vec![17, 0, 0, 0]);
        if self.nonce.is_empty() {
            let refused = self.exchange(METHOD_ALLOCATE, &[&udp], false).await;
            assert_eq!(refused.err(), Some(401), "without credentials");
        }
        let answer = self.exchange(METHOD_ALLOCATE, &[&udp], true).await?;
        let mut relayed = XorMappedAddress::default();
        relayed
            .get_from_as(&answer, ATTR_XOR_RELAYED_ADDRESS)
            .expect("a relayed address");
        Ok(SocketAddr::new(relayed.ip, relayed.port))
    }

    /// Asks for another lifetime, and returns the one that it has.
    pub(crate) async fn refresh(&mut self, seconds: u32) -> Result<u32, Refused> {
        let lifetime = Plain(ATTR_LIFETIME, seconds.to_be_bytes().to_vec());
        let answer = self.exchange(METHOD_REFRESH, &[&lifetime], true).await?;
        let lifetime = answer.get(ATTR_LIFETIME).expect("a lifetime");
        Ok(u32::from_be_bytes(lifetime.try_into().expect("four bytes")))
    }

    pub(crate) async fn permit(&mut self, peer: SocketAddr) -> Result<(), Refused> {
        let attributes: [&dyn Setter; 1] = [&Peer(peer)];
        let answer = self.exchange(METHOD_CREATE_PERMISSION, &attributes, true);
        answer.await.map(drop)
    }

    pub(crate) async fn bind(&mut self, number: u16, peer: SocketAddr) -> Result<(), Refused> {
        let [a, b] = number.to_be_bytes();
        let number = Plain(ATTR_CHANNEL_NUMBER, vec![a, b, 0, 0]);
        let attributes: [&dyn Setter; 2] = [&number, &Peer(peer)];
        let answer = self.exchange(METHOD_CHANNEL_BIND, &attributes, true);
        answer.await.map(drop)
    }

    /// Sends data to a peer in an indication.
    pub(crate) async fn indicate(&mut self, peer: SocketAddr, data: &[u8]) {
        let mut message = Message::new();
        let data = Plain(ATTR_DATA, data.to_vec());
        set(
            &mut message,
            &MessageType::new(METHOD_SEND, CLASS_INDICATION),
        );
        set(&mut message, &TransactionId::new());
        set(&mut message, &Peer(peer));
        set(&mut message, &data);
        message.encode();
        self.send(&message.raw).await;
    }

    /// Sends data on a channel.
    pub(crate) async fn send_on(&mut self, number: u16, data: &[u8]) {
        let mut packet = number.to_be_bytes().to_vec();
        packet.extend(u16::try_from(data.len()).expect("short").to_be_bytes());
        packet.extend(data);
        packet.resize(packet.len().next_multiple_of(4), 0);
        self.send(&packet).await;
    }

    /// The next data: whose it is (an address, or a channel as a port of 0.0.0.0), and what; nothing if none comes.
    pub(crate) async fn data(&mut self) -> Option<(SocketAddr, Vec<u8>)> {
        self.data_within(ANSWER).await
    }

    pub(crate) async fn hears_nothing(&mut self) -> bool {
        self.data_within(NOTHING).await.is_none()
    }

    async fn data_within(&mut self, within: Duration) -> Option<(SocketAddr, Vec<u8>)> {
        let packet = self.receive(within).await?;
        if packet[0] >= 0x40 {
            let [number, length] =
                [0, 2].map(|at| u16::from_be_bytes([packet[at], packet[at + 1]]));
            let data = packet[4..4 + usize::from(length)].to_vec();
            return Some((([0, 0, 0, 0], number).into(), data));
        }
        let message = read(&packet);
        assert_eq!(
            message.typ,
            MessageType::new(METHOD_DATA, CLASS_INDICATION),
            "neither an answer nor anything else"
        );
        let mut peer = XorMappedAddress::default();
        peer.get_from_as(&message, ATTR_XOR_PEER_ADDRESS)
            .expect("a peer");
        let data = message.get(ATTR_DATA).expect("data");
        Some((SocketAddr::new(peer.ip, peer.port), data))
    }

    /// Sends a request and returns its answer, whose integrity is checked where the request has one.
    pub(crate) async fn exchange(
        &mut self,
        method: Method,
        attributes: &[&dyn Setter],
        signed: bool,
    ) -> Result<Message, Refused> {
        let provider = default_provider().expect("cryptography");
        let Credentials { username, password } = self.credentials.clone();
        let (realm, nonce) = (self.realm.clone(), self.nonce.clone());
        let key = MessageIntegrity::long_term_integrity_key(
            username.clone(),
            realm.clone(),
            password,
            provider.crypto(),
        )
        .expect("a key");
        let mut message = Message::new();
        set(&mut message, &MessageType::new(method, CLASS_REQUEST));
        set(&mut message, &TransactionId::new());
        message.write_header();
        for attribute in attributes {
            set(&mut message, *attribute);
        }
        if signed {
            set(&mut message, &TextAttribute::new(ATTR_USERNAME, username));
            set(&mut message, &TextAttribute::new(ATTR_REALM, realm));
            set(&mut message, &TextAttribute::new(ATTR_NONCE, nonce));
            let integrity =
                MessageIntegrity::new_raw_integrity_with_provider(key.clone(), provider.crypto());
            set(&mut message, &integrity);
        }
        set(&mut message, &FINGERPRINT);
        self.send(&message.raw).await;
        let packet = self.receive(ANSWER).await.ok_or(0_u16)?;
        let mut answer = read(&packet);
        assert_eq!(answer.transaction_id, message.transaction_id, "its answer");
        FINGERPRINT.check(&answer).expect("a good fingerprint");
        for (attribute, value) in [(ATTR_REALM, &mut self.realm), (ATTR_NONCE, &mut self.nonce)] {
            if let Ok(text) = TextAttribute::get_from_as(&answer, attribute) {
                *value = text.text;
            }
        }
        if answer.typ.class != CLASS_SUCCESS_RESPONSE {
            let mut code = ErrorCodeAttribute::default();
            code.get_from(&answer).expect("an error code");
            return Err(code.code.0);
        }
        if signed {
            MessageIntegrity::check(&mut answer, &key, provider.crypto())
                .expect("an answer of who knows the password");
        }
        Ok(answer)
    }
}

fn read(packet: &[u8]) -> Message {
    let mut message = Message::new();
    message.unmarshal_binary(packet).expect("a STUN message");
    message
}

fn set(message: &mut Message, attribute: &dyn Setter) {
    attribute.add_to(message).expect("it fits");
}

/// An attribute by its bytes.
pub(crate) struct Plain(pub(crate) AttrType, pub(crate) Vec<u8>);

impl Setter for Plain {
    fn add_to(&self, message: &mut Message) -> Result<(), rtc::shared::error::Error> {
        message.add(self.0, &self.1);
        Ok(())
    }
}

struct Peer(SocketAddr);

impl Setter for Peer {
    fn add_to(&self, message: &mut Message) -> Result<(), rtc::shared::error::Error> {
        XorMappedAddress {
            ip: self.0.ip(),
            port: self.0.port(),
        }
        .add_to_as(message, ATTR_XOR_PEER_ADDRESS)
    }
}
