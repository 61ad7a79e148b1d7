//! PulseAudio in a test: a real sound server, whose devices play and record nothing.

use crate::service::LONGEST_WAIT;
use pulseaudio::protocol::{self, Command, LoadModuleParams};
use std::ffi::CString;
use std::io::BufReader;
use std::os::unix::net::UnixStream;
use std::path::PathBuf;
use std::process::{Child, Command as Program, Stdio};
use std::time::{Duration, Instant};
use tempfile::TempDir;

const VERSION: u16 = protocol::MAX_VERSION;

/// A server of the test's own, without the devices of the machine. It ends with this.
#[derive(Debug)]
pub struct Pulse {
    folder: TempDir,
    child: Child,
}

impl Pulse {
    /// By which programs find it: `unix:` and this is `PULSE_SERVER`.
    #[must_use]
    pub fn socket(&self) -> PathBuf {
        self.folder.path().join("socket")
    }

    /// Without a device; `None`, and a line that says why, where the machine has no such server.
    #[must_use]
    pub fn start() -> Option<Self> {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let child = spawn(&folder)?;
        let pulse = Self { folder, child };
        pulse.wait();
        Some(pulse)
    }

    fn wait(&self) {
        let begun = Instant::now();
        while UnixStream::connect(self.socket()).is_err() {
            assert!(begun.elapsed() < LONGEST_WAIT, "the server does not answer");
            std::thread::sleep(Duration::from_millis(20));
        }
    }

    /// Ends it as a crash would.
    pub fn kill(&mut self) {
        self.child.kill().expect("it runs");
        self.child.wait().expect("it has ended");
        let _ = std::fs::remove_file(self.socket());
    }

    /// After a crash, without the devices that it had.
    pub fn start_again(&mut self) {
        self.child = spawn(&self.folder).expect("it was there before");
        self.wait();
    }

    /// A connection of the test's own, on which commands can be sent from number 2 on.
    fn connected(&self) -> BufReader<UnixStream> {
        let socket = UnixStream::connect(self.socket()).expect("a server");
        for set in [UnixStream::set_read_timeout, UnixStream::set_write_timeout] {
            set(&socket, Some(LONGEST_WAIT)).expect("a time");
        }
        let mut socket = BufReader::new(socket);
        let auth = Command::Auth(protocol::AuthParams {
            version: VERSION,
            supports_shm: false,
            supports_memfd: false,
            cookie: vec![0; 256],
        });
        protocol::write_command_message(socket.get_mut(), 0, &auth, VERSION).expect("a command");
        let _: (u32, protocol::AuthReply) =
            protocol::read_reply_message(&mut socket, VERSION).expect("it knows this user");
        let name = Command::SetClientName(protocol::Props::new());
        protocol::write_command_message(socket.get_mut(), 1, &name, VERSION).expect("a command");
        let _: (u32, protocol::SetClientNameReply) =
            protocol::read_reply_message(&mut socket, VERSION).expect("an answer");
        socket
    }

    /// Adds a device; returns by what it can be taken away.
    pub fn add(&self, module: &str, arguments: &str) -> u32 {
        let text = |text: &str| CString::new(text).expect("no zero");
        let add = Command::LoadModule(LoadModuleParams {
            name: text(module),
            arguments: Some(text(arguments)),
        });
        let mut socket = self.connected();
        protocol::write_command_message(socket.get_mut(), 2, &add, VERSION).expect("a command");
        let (_, added): (u32, protocol::LookupReply) =
            protocol::read_reply_message(&mut socket, VERSION).expect("it adds the device");
        added.0
    }

    /// Takes a device away.
    pub fn remove(&self, module: u32) {
        let mut socket = self.connected();
        let remove = Command::UnloadModule(module);
        protocol::write_command_message(socket.get_mut(), 2, &remove, VERSION).expect("a command");
        protocol::read_ack_message(&mut socket).expect("it takes the device away");
    }
}

impl Drop for Pulse {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

fn spawn(folder: &TempDir) -> Option<Child> {
    let program = std::env::var("MON3TR_PULSEAUDIO").unwrap_or_else(|_| "pulseaudio".to_owned());
    let socket = folder.path().join("socket");
    let child = Program::new(program)
        .args([
            "-n",
            "--daemonize=no",
            "--exit-idle-time=-1",
            "--use-pid-file=no",
            "--system=no",
        ])
        .args(["--high-priority=no", "--disable-shm=yes", "-L"])
        .arg(format!(
            "module-native-protocol-unix auth-anonymous=1 socket={}",
            socket.display()
        ))
        .env("XDG_RUNTIME_DIR", folder.path())
        .env("HOME", folder.path())
        .stdin(Stdio::null())
        .stdout(Stdio::null())
        .stderr(Stdio::null())
        .spawn();
    match child {
        Ok(child) => Some(child),
        Err(error) => {
            // `./run test` fetches it.
            assert!(
                std::env::var("CI").as_deref() != Ok("true"),
                "no PulseAudio: {error}"
            );
            println!("skipped: no PulseAudio: {error}");
            None
        }
    }
}
