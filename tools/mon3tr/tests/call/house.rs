//! A server of the test's own, and the programs of a call as processes.

use crate::command::{command, json, puppet};
use link_protocol::RoomLink;
use netlab::{Impairment, Lab, LabConfig};
use rustix::process::{Pid, Signal, kill_process};
use serde_json::Value;
use std::cell::Cell;
use std::io::{BufRead, BufReader, Read, Write};
use std::net::{SocketAddr, TcpStream};
use std::path::{Path, PathBuf};
use std::process::{Child, ChildStdin, Command, ExitStatus, Stdio};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};
use tempfile::TempDir;
use test_support::service::{LONGEST_WAIT, assert_all_live};
use tokio::runtime::Runtime;

/// Waits until `answer` is there.
pub(crate) fn wait_for<T>(what: &str, answer: impl FnMut() -> Option<T>) -> T {
    wait_while(what, || 0, answer)
}

/// The same, and no longer than [`LONGEST_WAIT`] after what is `heard` grew last.
fn wait_while<T>(
    what: &str,
    heard: impl Fn() -> usize,
    mut answer: impl FnMut() -> Option<T>,
) -> T {
    let mut last = (heard(), Instant::now());
    loop {
        if let Some(answer) = answer() {
            return answer;
        }
        assert_all_live();
        let now = heard();
        if now > last.0 {
            last = (now, Instant::now());
        }
        assert!(last.1.elapsed() < LONGEST_WAIT, "waited in vain for {what}");
        std::thread::sleep(Duration::from_millis(20));
    }
}

/// A `mon3tr` process; killed with the test if it has not ended.
pub(crate) struct Program {
    child: Child,
    said: Arc<Mutex<String>>,
    listeners: Vec<JoinHandle<()>>,
    report: PathBuf,
}

impl Program {
    fn start(house: &House, cache: &Path, arguments: &[&str]) -> Self {
        // What tells of the call's events, and nothing else.
        Self::start_as(
            house,
            cache,
            command(arguments).env("RUST_LOG", "link=info,sound_devices=info"),
        )
    }

    /// The same of a command with its arguments, and what it is to log.
    pub(crate) fn start_as(house: &House, cache: &Path, command: &mut Command) -> Self {
        Self::spawn(house, cache, command, Stdio::null())
    }

    /// The same of one that listens to its standard input.
    pub(crate) fn start_steered(
        house: &House,
        cache: &Path,
        command: &mut Command,
    ) -> (Self, ChildStdin) {
        let mut program = Self::spawn(house, cache, command, Stdio::piped());
        let stdin = program.child.stdin.take().expect("piped");
        (program, stdin)
    }

    /// How many threads it has.
    pub(crate) fn threads(&self) -> usize {
        let tasks = std::fs::read_dir(format!("/proc/{}/task", self.child.id()));
        tasks.expect("it runs").count()
    }

    fn spawn(house: &House, cache: &Path, command: &mut Command, stdin: Stdio) -> Self {
        let mut child = command
            .env("MON3TR_CACHE", cache)
            .env("PULSE_SERVER", format!("unix:{}", house.sound.display()))
            .env_remove("MON3TR_OWNER_TOKEN")
            // For the store of a server that is given one.
            .env("AWS_ACCESS_KEY_ID", "testing")
            .env("AWS_SECRET_ACCESS_KEY", "testing")
            .stdin(stdin)
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn()
            .expect("the command can be started");
        let said = Arc::<Mutex<String>>::default();
        let listeners = vec![
            listen(child.stdout.take().expect("piped"), &said),
            listen(child.stderr.take().expect("piped"), &said),
        ];
        Self {
            child,
            said,
            listeners,
            report: house.latest_report(),
        }
    }

    /// All that it has printed and logged so far.
    pub(crate) fn said(&self) -> String {
        self.said
            .lock()
            .unwrap_or_else(PoisonError::into_inner)
            .clone()
    }

    /// Waits until it has said `words` in so many lines.
    pub(crate) fn says(&mut self, words: &str, times: usize) {
        let said = Arc::clone(&self.said);
        let heard = || said.lock().unwrap_or_else(PoisonError::into_inner).len();
        wait_while(&format!("{times} times `{words}`"), heard, || {
            let said = self.said();
            let lines = said.lines().filter(|line| line.contains(words)).count();
            if lines < times {
                let ended = self.child.try_wait().expect("a child can be asked");
                assert!(
                    ended.is_none(),
                    "ended ({ended:?}) before it said `{words}` {times} times:\n{said}"
                );
            }
            (lines >= times).then_some(())
        });
    }

    /// What follows `words` on the line that says it.
    pub(crate) fn word_after(&mut self, words: &str) -> String {
        self.says(words, 1);
        let said = self.said();
        let rest = said.split_once(words).expect("it was said").1;
        let word = rest.split_whitespace().next().expect("something follows");
        word.trim_matches('\'').to_owned()
    }

    /// Whether it has not ended.
    pub(crate) fn is_running(&mut self) -> bool {
        let ended = self.child.try_wait().expect("a child can be asked");
        ended.is_none()
    }

    /// As `kill -9`: it can say goodbye to nobody.
    pub(crate) fn kill(mut self) {
        self.child.kill().expect("a child can be killed");
        self.child.wait().expect("it has ended");
    }

    /// Asks it to end, as Ctrl-C does.
    pub(crate) fn ask_to_end(&self) {
        kill_process(Pid::from_child(&self.child), Signal::TERM).expect("it is still there");
    }

    /// Presses Ctrl-C; how it ended, how long that took, and all that it said.
    pub(crate) fn interrupted(self) -> (ExitStatus, Duration, String) {
        let asked = Instant::now();
        kill_process(Pid::from_child(&self.child), Signal::INT).expect("it is still there");
        let (status, said) = self.ended();
        (status, asked.elapsed(), said)
    }

    /// The process's number.
    pub(crate) fn id(&self) -> u32 {
        self.child.id()
    }

    /// The most memory it has had so far, bytes.
    pub(crate) fn peak_memory(&self) -> u64 {
        self.memory("VmHWM:")
    }

    /// The memory that it has now, bytes.
    pub(crate) fn resident_memory(&self) -> u64 {
        self.memory("VmRSS:")
    }

    fn memory(&self, name: &str) -> u64 {
        let status = std::fs::read_to_string(format!("/proc/{}/status", self.child.id()));
        let status = status.expect("it runs");
        let line = status.lines().find_map(|line| line.strip_prefix(name));
        let kilobytes = line.and_then(|line| line.trim().strip_suffix(" kB"));
        let kilobytes: u64 = kilobytes
            .and_then(|it| it.trim().parse().ok())
            .expect("a size");
        kilobytes << 10
    }

    /// Waits for its good end and returns the JSON it wrote.
    pub(crate) fn report(self) -> Value {
        self.report_and_said().0
    }

    /// The same, and all that it said.
    pub(crate) fn report_and_said(self) -> (Value, String) {
        let report = self.report.clone();
        let (status, said) = self.ended();
        assert!(status.success(), "it failed ({status}):\n{said}");
        (json(&report), said)
    }

    /// Waits for its end; returns how that was, and all that it said.
    fn ended(mut self) -> (ExitStatus, String) {
        let said = Arc::clone(&self.said);
        let heard = || said.lock().unwrap_or_else(PoisonError::into_inner).len();
        let status = wait_while("the end of a program", heard, || {
            self.child.try_wait().expect("a child can be asked")
        });
        for listener in self.listeners.drain(..) {
            listener.join().expect("it only listens");
        }
        let said = self.said();
        assert!(!said.contains("panicked"), "it panicked:\n{said}");
        (status, said)
    }

    /// Asks it to end and returns the JSON it wrote.
    pub(crate) fn ends(self) -> Value {
        self.ask_to_end();
        self.report()
    }

    /// Waits for its end, which is to be a failure; returns all that it said.
    pub(crate) fn fails(self) -> String {
        let (status, said) = self.ended();
        assert!(!status.success(), "it did not fail:\n{said}");
        said
    }
}

impl Drop for Program {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

/// Keeps what a process says, line by line, so that it never waits for a reader.
fn listen(stream: impl Read + Send + 'static, said: &Arc<Mutex<String>>) -> JoinHandle<()> {
    let said = Arc::clone(said);
    std::thread::spawn(move || {
        for line in BufReader::new(stream).lines().map_while(Result::ok) {
            let mut said = said.lock().unwrap_or_else(PoisonError::into_inner);
            said.push_str(&line);
            said.push('\n');
        }
    })
}

/// A sender in a room that it opened.
pub(crate) struct Sender {
    pub(crate) program: Program,
    /// With which others join.
    pub(crate) viewers: String,
    /// With which it comes back.
    pub(crate) own: String,
}

/// A server, a package to send, and a place for everybody's files.
pub(crate) struct House {
    pub(crate) folder: TempDir,
    pub(crate) avatar: PathBuf,
    pub(crate) address: SocketAddr,
    /// `None` while it is down.
    server: Option<Program>,
    /// What it is started with besides.
    serving: Vec<String>,
    reports: Cell<u32>,
    pub(crate) runtime: Runtime,
    /// The sound server of the programs that are started from now on; there is none at first.
    pub(crate) sound: PathBuf,
}

impl House {
    pub(crate) fn open() -> Self {
        Self::open_with(&[])
    }

    /// The same, with these options of the server's.
    pub(crate) fn open_with(serving: &[&str]) -> Self {
        let folder = TempDir::new().expect("a temporary folder");
        let runtime = tokio::runtime::Builder::new_multi_thread()
            .worker_threads(1)
            .enable_all()
            .build()
            .expect("a runtime for the lab");
        let mut house = Self {
            avatar: puppet(&folder),
            sound: folder.path().join("no-sound-server"),
            folder,
            address: ([127, 0, 0, 1], 0).into(),
            server: None,
            serving: serving.iter().map(|&option| option.to_owned()).collect(),
            reports: Cell::new(0),
            runtime,
        };
        house.start_server();
        house
    }

    /// Starts the server: again on the same port and with the same data, if it has run before.
    pub(crate) fn start_server(&mut self) {
        let mut server = self.serve(self.address);
        let address = server.word_after("serving on http://");
        self.address = address.parse().expect("it says an address");
        self.server = Some(server);
    }

    /// One more on the same data.
    pub(crate) fn another_server(&self) -> Program {
        self.serve(([127, 0, 0, 1], 0).into())
    }

    fn serve(&self, address: SocketAddr) -> Program {
        let (data, listen) = (self.path("server"), address.to_string());
        let first = ["serve", "--listen", &listen, "--data", &data];
        let serving = self.serving.iter().map(String::as_str);
        let arguments: Vec<&str> = first.into_iter().chain(serving).collect();
        Program::start(self, self.folder.path(), &arguments)
    }

    /// The server's process.
    pub(crate) fn server(&self) -> &Program {
        self.server.as_ref().expect("it runs")
    }

    /// All that the server has said so far.
    pub(crate) fn said_by_server(&self) -> String {
        self.server().said()
    }

    /// Waits until the server has said `words` in so many lines.
    pub(crate) fn server_says(&self, words: &str, times: usize) {
        wait_for(&format!("{times} times `{words}`"), || {
            let said = self.said_by_server();
            let lines = said.lines().filter(|line| line.contains(words)).count();
            (lines >= times).then_some(())
        });
    }

    /// As `kill -9`.
    pub(crate) fn kill_server(&mut self) {
        self.server.take().expect("it runs").kill();
    }

    /// The token that `serve` keeps for whoever runs it.
    pub(crate) fn owner_token(&self) -> String {
        let token = std::fs::read_to_string(self.folder.path().join("server/owner-token"));
        token
            .expect("the server has left it there")
            .trim()
            .to_owned()
    }

    /// A path below the test's folder.
    pub(crate) fn path(&self, name: &str) -> String {
        let path = self.folder.path().join(name);
        path.to_str().expect("temporary paths are UTF-8").to_owned()
    }

    /// A sender in a new room.
    pub(crate) fn sender(&self, arguments: &[&str]) -> Sender {
        let server = format!("http://{}", self.address);
        let avatar = self.avatar.to_str().expect("UTF-8").to_owned();
        let first = ["--server", &server, "--avatar", &avatar];
        let mut program = self.send(&[&first, arguments].concat());
        let viewers = program.word_after("mon3tr receive ");
        let own = program.word_after("comes back with --room ");
        Sender {
            program,
            viewers,
            own,
        }
    }

    /// `send` with these arguments, the owner's token and a report.
    pub(crate) fn send(&self, arguments: &[&str]) -> Program {
        let (token, json) = (self.owner_token(), self.new_report());
        let first = ["send", "--owner-token", &token, "--json", &json];
        Program::start(self, self.folder.path(), &[&first, arguments].concat())
    }

    /// Somebody with this link, and a cache of their own by that name.
    pub(crate) fn receiver(&self, link: &str, cache: &str, arguments: &[&str]) -> Program {
        let json = self.new_report();
        let first = ["receive", link, "--display", "none", "--json", &json];
        let cache = self.folder.path().join(cache);
        Program::start(self, &cache, &[&first, arguments].concat())
    }

    /// The lab before the server.
    pub(crate) fn lab(&self, down: Impairment, up: Impairment) -> Lab {
        let config = LabConfig {
            down,
            up,
            ..LabConfig::new(self.address)
        };
        self.runtime
            .block_on(Lab::start(config))
            .expect("the lab starts")
    }

    /// One counter of the server's.
    pub(crate) fn metric(&self, name: &str) -> u64 {
        let mut stream = TcpStream::connect(self.address).expect("the server is there");
        let ask = "GET /metrics HTTP/1.1\r\nHost: server\r\nConnection: close\r\n\r\n";
        stream.write_all(ask.as_bytes()).expect("asked");
        let mut answer = String::new();
        stream.read_to_string(&mut answer).expect("answered");
        let line = answer.lines().find_map(|line| line.strip_prefix(name));
        let value = line.unwrap_or_else(|| panic!("no {name} in:\n{answer}"));
        value.trim().parse().expect("a counter is a number")
    }

    /// A file for the next program's report.
    pub(crate) fn new_report(&self) -> String {
        self.reports.set(self.reports.get() + 1);
        let report = self.latest_report();
        report.to_str().expect("UTF-8").to_owned()
    }

    fn latest_report(&self) -> PathBuf {
        let name = format!("report-{}.json", self.reports.get());
        self.folder.path().join(name)
    }
}

/// The same link by way of the lab.
pub(crate) fn through(lab: &Lab, link: &str) -> String {
    let link: RoomLink = link.parse().expect("a room's link");
    let lab = format!("http://{}", lab.address())
        .parse()
        .expect("an address");
    link.at(lab).to_string()
}

/// Somebody who has joined by way of the lab, and sees the person move.
pub(crate) fn joined(house: &House, lab: &Lab, link: &str, cache: &str) -> Program {
    let mut receiver = house.receiver(link, cache, &[]);
    receiver.says("joined (session", 1);
    frames_come(lab);
    receiver
}

/// Waits until some more frames have come through the lab.
pub(crate) fn frames_come(lab: &Lab) {
    let delivered = || lab.statistics().down.delivered.packets;
    let before = delivered();
    wait_for("frames", || (delivered() > before + 60).then_some(()));
}

/// A count of a report.
pub(crate) fn count(value: &Value, name: &str) -> u64 {
    let count = value[name].as_u64();
    count.unwrap_or_else(|| panic!("no count {name} in {value:#}"))
}

/// A figure of a report.
pub(crate) fn number(value: &Value, name: &str) -> f64 {
    let number = value[name].as_f64();
    number.unwrap_or_else(|| panic!("no figure {name} in {value:#}"))
}

/// The longest time between two frames, in milliseconds, if there was any worth telling.
pub(crate) fn longest_gap(call: &Value) -> Option<f64> {
    let gaps = call["gaps"].as_array().expect("a list of gaps");
    let gaps = gaps.iter().map(|gap| number(gap, "ms"));
    gaps.fold(None, |longest, gap| {
        Some(longest.map_or(gap, |longest: f64| longest.max(gap)))
    })
}

/// That no message was refused.
pub(crate) fn assert_nothing_refused(call: &Value) {
    let refused = call["received"]["refused"].as_object();
    assert!(
        refused.is_some_and(serde_json::Map::is_empty),
        "{refused:?}"
    );
}

/// That a viewer misses no frame but such as the sender left out, as it does where a machine is too busy to keep its pace.
pub(crate) fn assert_only_skipped(call: &Value, sent: &Value) {
    assert!(
        count(call, "lost") <= count(sent, "skipped"),
        "frames that were sent are lost: {call:#} {sent:#}"
    );
}
