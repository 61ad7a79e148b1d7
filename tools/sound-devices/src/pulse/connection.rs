//! A connection to a sound server: PulseAudio's native protocol over its local socket. For one thread; every wait has an end.

use crate::SoundError;
use pulseaudio::protocol::{
    self, AuthParams, AuthReply, Command, CommandReply, DESCRIPTOR_SIZE, Descriptor,
    DescriptorFlags, Prop, Props, ProtocolError, SetClientNameReply,
};
use socket2::{Domain, SockAddr, Socket, Type};
use std::ffi::CString;
use std::io::{Cursor, ErrorKind, Read, Write};
use std::ops::Range;
use std::os::fd::OwnedFd;
use std::os::unix::net::UnixStream;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

/// For a reply, and for the server to take what is written.
const PATIENCE: Duration = Duration::from_secs(2);
/// The longest message that is taken: lists of devices are some thousand bytes, pieces of sound less.
const MAX_MESSAGE_BYTES: usize = 1 << 20;
const READ_BYTES: usize = 16 << 10;
/// A server refuses a cookie of another length, also where it needs none.
const COOKIE_BYTES: usize = 256;
/// A descriptor's channel where there is a command behind it.
const COMMANDS: u32 = u32::MAX;

/// What the server sends.
#[derive(Debug)]
#[allow(
    clippy::large_enum_variant,
    reason = "it is looked at where it is made, and a box would be an allocation for each"
)]
pub(crate) enum Message {
    /// Samples of a stream, in the bytes of [`Connection::payload`].
    Samples(Range<usize>),
    /// The answer to a command, for [`Connection::read`].
    Reply {
        /// The command's.
        sequence: u32,
        /// The whole message.
        bytes: Range<usize>,
    },
    /// What the server says of its own accord.
    Command(Command),
}

/// A sound server on this machine, by its socket.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct SoundServer(PathBuf);

impl SoundServer {
    /// The one that the environment names.
    ///
    /// # Errors
    /// If there is none.
    pub fn find() -> Result<Self, SoundError> {
        let path = pulseaudio::socket_path_from_env();
        Ok(Self(path.ok_or(SoundError::NoServer)?))
    }

    /// The one with this socket.
    #[must_use]
    pub fn at(path: PathBuf) -> Self {
        Self(path)
    }
}

/// Connects within [`PATIENCE`]: a server that hangs lets connections wait once its queue is full. What is written has as long.
fn connect(path: &Path) -> std::io::Result<UnixStream> {
    let socket = Socket::new(Domain::UNIX, Type::STREAM, None)?;
    socket.set_write_timeout(Some(PATIENCE))?;
    socket.connect(&SockAddr::unix(path)?)?;
    Ok(OwnedFd::from(socket).into())
}

/// A server that takes nothing within [`PATIENCE`] is as slow as one that does not answer.
fn failed(error: std::io::Error) -> SoundError {
    match error.kind() {
        ErrorKind::WouldBlock | ErrorKind::TimedOut => SoundError::Slow,
        _ => error.into(),
    }
}

/// A connection that is ready for commands.
#[derive(Debug)]
pub(crate) struct Connection {
    socket: UnixStream,
    version: u16,
    sequence: u32,
    /// What arrived; the first `taken` bytes are of messages that were handed out.
    received: Vec<u8>,
    taken: usize,
    out: Vec<u8>,
}

impl Connection {
    /// Connects to a server.
    pub(crate) fn open(server: &SoundServer) -> Result<Self, SoundError> {
        let unreachable = |source| SoundError::Unreachable {
            path: server.0.clone(),
            source,
        };
        let socket = connect(&server.0).map_err(unreachable)?;
        let mut connection = Self::over(socket);
        // A server on this machine may know its user without it.
        let cookie = pulseaudio::cookie_path_from_env().and_then(|path| std::fs::read(path).ok());
        let answer: AuthReply = connection.ask(&Command::Auth(AuthParams {
            version: protocol::MAX_VERSION,
            supports_shm: false,
            supports_memfd: false,
            cookie: cookie.unwrap_or_else(|| vec![0; COOKIE_BYTES]),
        }))?;
        if answer.version < protocol::MIN_VERSION {
            return Err(ProtocolError::UnsupportedVersion(answer.version).into());
        }
        connection.version = answer.version.min(protocol::MAX_VERSION);
        let mut props = Props::new();
        props.set(Prop::ApplicationName, c"Mon3tr");
        let process = std::process::id().to_string();
        if let Ok(process) = CString::new(process) {
            props.set(Prop::ApplicationProcessId, process);
        }
        let _: SetClientNameReply = connection.ask(&Command::SetClientName(props))?;
        Ok(connection)
    }

    fn over(socket: UnixStream) -> Self {
        Self {
            socket,
            version: protocol::MAX_VERSION,
            sequence: 0,
            received: Vec::with_capacity(2 * READ_BYTES),
            taken: 0,
            out: Vec::with_capacity(READ_BYTES),
        }
    }

    /// Sends a command; returns its number, which its reply has.
    pub(crate) fn send(&mut self, command: &Command) -> Result<u32, SoundError> {
        self.sequence = self.sequence.wrapping_add(1);
        self.out.clear();
        protocol::write_command_message(&mut self.out, self.sequence, command, self.version)?;
        self.socket.write_all(&self.out).map_err(failed)?;
        Ok(self.sequence)
    }

    /// Sends a command and waits for its reply; what else comes meanwhile is dropped.
    pub(crate) fn ask<R: CommandReply>(&mut self, command: &Command) -> Result<R, SoundError> {
        let asked = self.send(command)?;
        let until = Instant::now() + PATIENCE;
        loop {
            match self.next(until)? {
                Some(Message::Reply { sequence, bytes }) if sequence == asked => {
                    return self.read(bytes);
                }
                Some(_) => {}
                None => return Err(SoundError::Slow),
            }
        }
    }

    /// Sends samples to a stream.
    pub(crate) fn play(&mut self, channel: u32, samples: &[f32]) -> Result<(), SoundError> {
        let bytes = size_of_val(samples);
        let descriptor = Descriptor {
            length: u32::try_from(bytes)
                .map_err(|_| ProtocolError::Invalid("too many samples".to_owned()))?,
            channel,
            offset: 0,
            flags: DescriptorFlags::empty(),
        };
        self.out.clear();
        protocol::write_descriptor(&mut self.out, &descriptor)?;
        for sample in samples {
            self.out.extend_from_slice(&sample.to_le_bytes());
        }
        self.socket.write_all(&self.out).map_err(failed)
    }

    /// The next message; nothing if there is none `until` then. What the one before referred to is gone.
    pub(crate) fn next(&mut self, until: Instant) -> Result<Option<Message>, SoundError> {
        loop {
            if let Some(message) = self.whole_message()? {
                return Ok(Some(message));
            }
            if !self.receive(until)? {
                return Ok(None);
            }
        }
    }

    /// The bytes of a message.
    pub(crate) fn payload(&self, bytes: Range<usize>) -> &[u8] {
        self.received.get(bytes).unwrap_or_default()
    }

    /// What a reply says.
    pub(crate) fn read<R: CommandReply>(&self, bytes: Range<usize>) -> Result<R, SoundError> {
        let mut message = Cursor::new(self.payload(bytes));
        let (_, reply) = protocol::read_reply_message(&mut message, self.version)?;
        Ok(reply)
    }

    /// Takes a message that is here as a whole, and that this side understands.
    fn whole_message(&mut self) -> Result<Option<Message>, SoundError> {
        loop {
            let waiting = self.received.get(self.taken..).unwrap_or_default();
            if waiting.len() < DESCRIPTOR_SIZE {
                return Ok(None);
            }
            let descriptor = protocol::read_descriptor(&mut Cursor::new(waiting))?;
            let length = usize::try_from(descriptor.length).unwrap_or(usize::MAX);
            if length > MAX_MESSAGE_BYTES {
                let why = format!("a message of {length} bytes");
                return Err(ProtocolError::Invalid(why).into());
            }
            let payload = self.taken + DESCRIPTOR_SIZE..self.taken + DESCRIPTOR_SIZE + length;
            if self.received.len() < payload.end {
                return Ok(None);
            }
            let whole = self.taken..payload.end;
            self.taken = payload.end;
            if descriptor.channel != COMMANDS {
                return Ok(Some(Message::Samples(payload)));
            }
            let mut command = Cursor::new(self.payload(payload));
            match Command::read_tag_prefixed(&mut command, self.version) {
                Ok((sequence, Command::Reply | Command::Error(_))) => {
                    return Ok(Some(Message::Reply {
                        sequence,
                        bytes: whole,
                    }));
                }
                Ok((_, command)) => return Ok(Some(Message::Command(command))),
                // Servers tell more than this side knows of.
                Err(error) => log::debug!("ignored what the sound server says: {error}"),
            }
        }
    }

    /// Waits for some bytes; whether there are any.
    fn receive(&mut self, until: Instant) -> Result<bool, SoundError> {
        self.received.drain(..self.taken);
        self.taken = 0;
        let begin = self.received.len();
        self.received.resize(begin + READ_BYTES, 0);
        let got = self.read_some(begin, until);
        let bytes = *got.as_ref().unwrap_or(&0);
        self.received.truncate(begin + bytes);
        Ok(got? > 0)
    }

    fn read_some(&mut self, begin: usize, until: Instant) -> Result<usize, SoundError> {
        loop {
            // Zero would mean without end.
            let left = until.saturating_duration_since(Instant::now());
            let left = left.max(Duration::from_millis(1));
            self.socket.set_read_timeout(Some(left))?;
            let space = self.received.get_mut(begin..).unwrap_or_default();
            match self.socket.read(space) {
                Ok(0) => return Err(SoundError::Ended),
                Ok(bytes) => return Ok(bytes),
                Err(error) if error.kind() == ErrorKind::Interrupted => {}
                Err(error)
                    if matches!(error.kind(), ErrorKind::WouldBlock | ErrorKind::TimedOut) =>
                {
                    return Ok(0);
                }
                Err(error) => return Err(error.into()),
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use pulseaudio::protocol::{LookupReply, PulseError};

    fn soon() -> Instant {
        Instant::now() + Duration::from_millis(20)
    }

    /// What a server writes: samples of a stream, an event, and the reply to command 1.
    fn said() -> Vec<u8> {
        let mut bytes = Vec::new();
        let descriptor = Descriptor {
            length: 8,
            channel: 3,
            offset: 0,
            flags: DescriptorFlags::empty(),
        };
        protocol::write_descriptor(&mut bytes, &descriptor).expect("bytes");
        bytes.extend_from_slice(&[1, 2, 3, 4, 5, 6, 7, 8]);
        let event = Command::RecordStreamKilled(3);
        protocol::write_command_message(&mut bytes, u32::MAX, &event, protocol::MAX_VERSION)
            .expect("bytes");
        protocol::write_reply_message(&mut bytes, 1, &LookupReply(7), protocol::MAX_VERSION)
            .expect("bytes");
        bytes
    }

    #[test]
    fn messages_are_understood_in_whatever_pieces_they_come() {
        for piece in [1, 7, 19, 1_000] {
            let (mut server, socket) = UnixStream::pair().expect("a pair of sockets");
            let mut connection = Connection::over(socket);
            let mut messages = Vec::new();
            for bytes in said().chunks(piece) {
                server.write_all(bytes).expect("it is open");
                while let Some(message) = connection.next(Instant::now()).expect("it makes sense") {
                    messages.push(match message {
                        Message::Samples(bytes) => format!("{:?}", connection.payload(bytes)),
                        Message::Command(command) => format!("{command:?}"),
                        Message::Reply { sequence, bytes } => {
                            let reply: LookupReply = connection.read(bytes).expect("an answer");
                            format!("{sequence}: {}", reply.0)
                        }
                    });
                }
            }
            let wanted = ["[1, 2, 3, 4, 5, 6, 7, 8]", "RecordStreamKilled(3)", "1: 7"];
            assert_eq!(messages, wanted, "in pieces of {piece}");
            drop(server);
            let ended = connection.next(soon());
            assert!(matches!(ended, Err(SoundError::Ended)), "{ended:?}");
        }
    }

    #[test]
    fn what_makes_no_sense_is_ignored_or_refused_and_never_waited_for() {
        let (mut server, socket) = UnixStream::pair().expect("a pair of sockets");
        let mut connection = Connection::over(socket);
        assert!(matches!(connection.next(soon()), Ok(None)), "nothing came");
        // A command that no one knows.
        let descriptor = |length, channel| Descriptor {
            length,
            channel,
            offset: 0,
            flags: DescriptorFlags::empty(),
        };
        protocol::write_descriptor(&mut server, &descriptor(4, COMMANDS)).expect("bytes");
        server.write_all(b"what").expect("bytes");
        server.write_all(&said()).expect("bytes");
        let next = connection.next(soon());
        assert!(matches!(next, Ok(Some(Message::Samples(_)))), "{next:?}");
        // A refusal is the answer to what was asked.
        let mut refusing = server.try_clone().expect("a socket");
        let refuse = std::thread::spawn(move || {
            let error = Command::Error(PulseError::NoEntity);
            protocol::write_command_message(&mut refusing, 1, &error, protocol::MAX_VERSION)
                .expect("bytes");
        });
        connection.taken = connection.received.len();
        let asked: Result<LookupReply, _> = connection.ask(&Command::LookupSink(c"x".into()));
        refuse.join().expect("it only writes");
        assert!(matches!(asked, Err(SoundError::Refused(_))), "{asked:?}");
        // A message that has no end.
        protocol::write_descriptor(&mut server, &descriptor(u32::MAX, 3)).expect("bytes");
        let next = connection.next(soon());
        assert!(matches!(next, Err(SoundError::Protocol(_))), "{next:?}");
    }
}
