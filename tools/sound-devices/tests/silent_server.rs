//! Against a sound server by a script: one that accepts connections and says nothing, and ones that fall silent in the middle of a stream.

use pulseaudio::protocol::{
    self, AuthReply, Command, CreatePlaybackStreamReply, CreateRecordStreamReply, SampleFormat,
    SampleSpec, ServerInfo, SetClientNameReply, SinkInfo, SourceInfo,
};
use sound_devices::{Loudspeaker, Microphone, RATE, SoundError, SoundServer};
use std::io::{BufReader, Write};
use std::os::unix::net::{UnixListener, UnixStream};
use std::sync::mpsc::{Receiver, Sender, channel};
use std::time::Duration;

const VERSION: u16 = protocol::MAX_VERSION;
/// Of the one stream of a connection.
const CHANNEL: u32 = 0;
/// Samples that are taken at a time.
const FRAME: usize = 960;
/// Samples that a server records before it falls silent: half a second.
const RECORDED: usize = 24_000;
/// Bytes that it asks for before: 40 ms.
const ASKED: u32 = 7_680;

/// The longest that it may take to give up a silent server: several times what it takes, for a busy machine.
const NOTICED: Duration = Duration::from_secs(30);

/// How far a server goes with every connection before it says nothing more.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Until {
    /// It only accepts.
    Accepted,
    /// It has a microphone or a loudspeaker, and stops after the beginning of a stream.
    MidStream,
}

/// What the test sees of the server.
#[derive(Debug, PartialEq, Eq)]
enum Seen {
    Connected,
    Began,
}

/// A server that is scripted to fall silent. Its threads end with the test's process.
struct SilentServer {
    folder: tempfile::TempDir,
    seen: Receiver<Seen>,
}

impl SilentServer {
    fn start(until: Until) -> Self {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let listener = UnixListener::bind(folder.path().join("socket")).expect("a socket");
        let (tell, seen) = channel();
        std::thread::spawn(move || {
            // Sockets stay open: a closed one would be noticed without a timeout.
            for socket in listener.incoming() {
                let (socket, tell) = (socket.expect("a connection"), tell.clone());
                std::thread::spawn(move || serve(socket, until, &tell));
            }
        });
        Self { folder, seen }
    }

    fn address(&self) -> SoundServer {
        SoundServer::at(self.folder.path().join("socket"))
    }

    fn sees(&self, what: &Seen) {
        let seen = self.seen.recv_timeout(NOTICED);
        assert_eq!(seen.as_ref(), Ok(what), "within {NOTICED:?}");
    }
}

fn reply<R: protocol::CommandReply>(socket: &mut impl Write, sequence: u32, reply: &R) {
    // The other side may have hung up by now.
    let _ = protocol::write_reply_message(socket, sequence, reply, VERSION);
}

/// Reads commands until the other side hangs up.
fn serve(socket: UnixStream, until: Until, tell: &Sender<Seen>) {
    let mut out = socket.try_clone().expect("a socket");
    let mut socket = BufReader::new(socket);
    let _ = tell.send(Seen::Connected);
    let format = SampleSpec {
        format: SampleFormat::Float32Le,
        channels: 1,
        sample_rate: RATE,
    };
    let mut is_silent = until == Until::Accepted;
    while let Ok((number, command)) = protocol::read_command_message(&mut socket, VERSION) {
        if is_silent {
            continue;
        }
        match command {
            Command::Auth(_) => {
                let auth = AuthReply {
                    version: VERSION,
                    use_memfd: false,
                    use_shm: false,
                };
                reply(&mut out, number, &auth);
            }
            Command::SetClientName(_) => {
                reply(&mut out, number, &SetClientNameReply { client_id: 1 });
            }
            Command::GetSourceInfoList => {
                let source = SourceInfo {
                    name: c"mouth".into(),
                    sample_spec: format,
                    ..SourceInfo::default()
                };
                reply(&mut out, number, &vec![source]);
            }
            Command::GetSinkInfoList => {
                let sink = SinkInfo {
                    name: c"ear".into(),
                    sample_spec: format,
                    ..SinkInfo::default()
                };
                reply(&mut out, number, &vec![sink]);
            }
            Command::GetServerInfo => {
                let info = ServerInfo {
                    sample_spec: format,
                    ..ServerInfo::default()
                };
                reply(&mut out, number, &info);
            }
            Command::CreateRecordStream(_) => {
                let stream = CreateRecordStreamReply {
                    channel: CHANNEL,
                    sample_spec: format,
                    ..CreateRecordStreamReply::default()
                };
                reply(&mut out, number, &stream);
                let samples = 0.25f32.to_le_bytes().repeat(RECORDED);
                let _ = protocol::write_memblock(&mut out, CHANNEL, &samples, 0);
                is_silent = true;
                let _ = tell.send(Seen::Began);
            }
            Command::CreatePlaybackStream(_) => {
                let stream = CreatePlaybackStreamReply {
                    channel: CHANNEL,
                    requested_bytes: ASKED,
                    sample_spec: format,
                    ..CreatePlaybackStreamReply::default()
                };
                reply(&mut out, number, &stream);
                let _ = tell.send(Seen::Began);
                // From here on samples come, which this does not read as commands.
                std::thread::sleep(10 * NOTICED);
                return;
            }
            other => panic!("{other:?} is not in the script"),
        }
    }
}

/// What `open` says, within the time that giving up may take.
fn within<T: Send + 'static>(open: impl FnOnce() -> T + Send + 'static) -> T {
    let (tell, told) = channel();
    std::thread::spawn(move || tell.send(open()));
    told.recv_timeout(NOTICED)
        .expect("an answer in time: it waits for a silent server")
}

#[test]
fn a_server_that_accepts_and_says_nothing_is_given_up() {
    let server = SilentServer::start(Until::Accepted);
    let address = server.address();
    let microphone = within(move || Microphone::open(&address, None).map(drop));
    assert!(
        matches!(microphone, Err(SoundError::Slow)),
        "{microphone:?}"
    );
    server.sees(&Seen::Connected);
    let address = server.address();
    let silence = Box::new(|_, _, out: &mut [[f32; 2]]| out.fill([0.0; 2]));
    let loudspeaker = within(move || Loudspeaker::begin(&address, None, silence).map(drop));
    assert!(
        matches!(loudspeaker, Err(SoundError::Slow)),
        "{loudspeaker:?}"
    );
    server.sees(&Seen::Connected);
}

#[test]
fn a_microphone_notices_that_its_server_says_nothing_more() {
    let server = SilentServer::start(Until::MidStream);
    let address = server.address();
    let mut microphone = Microphone::open(&address, None).expect("a microphone");
    let mut frame = [0.0; FRAME];
    for number in 0..RECORDED / FRAME {
        let spoken = microphone.next(&mut frame, NOTICED);
        assert!(spoken.is_some(), "frame {number} of what was recorded");
        assert!(frame.iter().all(|sample| *sample == 0.25), "{frame:?}");
    }
    // A thread of its own, so that a microphone that waits without end does not hold up the test.
    std::thread::spawn(move || {
        loop {
            microphone.next(&mut frame, Duration::from_millis(100));
        }
    });
    // It comes back: it has let go of the silent stream.
    for seen in [Seen::Connected, Seen::Began, Seen::Connected, Seen::Began] {
        server.sees(&seen);
    }
}

#[test]
fn a_loudspeaker_notices_that_its_server_says_nothing_more() {
    let server = SilentServer::start(Until::MidStream);
    let address = server.address();
    let silence = Box::new(|_, _, out: &mut [[f32; 2]]| out.fill([0.0; 2]));
    let loudspeaker = Loudspeaker::begin(&address, None, silence).expect("a loudspeaker");
    assert_eq!(loudspeaker.name(), "ear");
    for seen in [Seen::Connected, Seen::Began, Seen::Connected, Seen::Began] {
        server.sees(&seen);
    }
    within(move || drop(loudspeaker));
}
