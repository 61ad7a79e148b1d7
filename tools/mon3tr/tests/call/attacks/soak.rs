//! A call of two for an hour, while visitors come and go, packets are lost, addresses change, the server's disk fills
//! up and a member's clock is set: it stays, and takes no more memory.

use super::extent;
use crate::command::json;
use serde_json::Value;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::{Duration, Instant, SystemTime};
use synthetic_person::{Puppet, PuppetSize};
use tempfile::TempDir;
use test_support::internet::{Home, HomeKind, Internet, SERVER};
use test_support::program::{Program, through_runner};
use test_support::service::LONGEST_WAIT;

/// Of the whole, minutes; of the bounded form as many seconds for each fault as this has seconds a minute.
const MINUTES: u32 = 60;
const BOUNDED_SECONDS: u32 = 75;

/// Of all UDP packets at each member's router.
const LOST_PERCENT: u32 = 2;

/// The server's disk.
const DISK_MB: u64 = 24;

/// What a member may grow by in an hour once it is warm, bytes; in the bounded form, whose start is part of it, more.
const GROWTH: u64 = 1 << 20;
const GROWTH_BOUNDED: u64 = 6 << 20;

/// The longest without motion for one fault.
const INTERRUPTED: f64 = 10.0;

/// How far a clock is set, as libfaketime reads it.
const STEPS: [&str; 3] = ["+1800", "-1800", "+0"];

/// The clock of a program, which libfaketime reads from a file.
struct Clock {
    library: String,
    file: PathBuf,
}

impl Clock {
    /// A clock that is right.
    fn open(file: &Path) -> Option<Self> {
        let library = std::env::var("MON3TR_FAKETIME").ok();
        let Some(library) = library.filter(|library| !library.is_empty()) else {
            println!(
                "skipped: no clock is set: MON3TR_FAKETIME names no libfaketime.so.1 (`./run test` sets it)"
            );
            let is_ci = std::env::var("CI").is_ok_and(|ci| ci == "true");
            assert!(!is_ci, "CI must have libfaketime");
            return None;
        };
        let file = file.to_owned();
        let clock = Self { library, file };
        // A library that the programs cannot load is left out by the loader, with a warning.
        for (step, seconds) in [("+1800", 1800), ("+0", 0)] {
            clock.set(step);
            let mut date = through_runner("/bin/date");
            clock.attach(date.arg("+%s"));
            let date = date.output().expect("date runs");
            let shown: i64 = (String::from_utf8_lossy(&date.stdout).trim().parse())
                .unwrap_or_else(|_| panic!("{date:?}"));
            let now = SystemTime::now().duration_since(SystemTime::UNIX_EPOCH);
            let now = i64::try_from(now.expect("after 1970").as_secs()).expect("small");
            let off = (shown - now - seconds).abs();
            assert!(off < 60, "the clock is {off} s from what was set: {date:?}");
        }
        Some(clock)
    }

    /// Has a program, which is not started yet, go by this clock.
    fn attach(&self, command: &mut Command) {
        command
            .env("LD_PRELOAD", &self.library)
            .env("FAKETIME_TIMESTAMP_FILE", &self.file)
            .env("FAKETIME_NO_CACHE", "1")
            .env("FAKETIME_DONT_FAKE_MONOTONIC", "1");
    }

    /// Sets it, as libfaketime reads it: `+1800` is half an hour from now.
    fn set(&self, step: &str) {
        std::fs::write(&self.file, step).expect("it is written");
    }
}

/// The members' networks, the server and its disk.
struct World {
    // Dropped in this order.
    server: Program,
    folder: TempDir,
    ada: Home,
    bob: Home,
    visitors: Home,
    _internet: Internet,
    avatar: PathBuf,
    /// `None` where libfaketime is missing.
    clock: Option<Clock>,
}

impl World {
    fn open() -> Option<Self> {
        let mut internet = Internet::open()?;
        let folder = tempfile::tempdir().expect("a folder");
        let avatar = folder.path().join("puppet.m3a");
        Puppet::small().avatar().save(&avatar).expect("a package");
        let data = folder.path().join("server");
        std::fs::create_dir(&data).expect("a folder");
        // A disk of its own.
        let mut serve = Command::new("unshare");
        let mount = format!("mount -t tmpfs -o size={DISK_MB}m tmpfs \"$0\" && exec \"$@\"");
        serve.args(["--mount", "sh", "-c", &mount]).arg(&data);
        serve
            .arg(crate::PROGRAM)
            .args(["serve", "--insecure", "--listen", "0.0.0.0:8080"]);
        serve.args(["--turn", "0.0.0.0:3478", "--data"]).arg(&data);
        serve.env("MON3TR_CACHE", folder.path().join("cache"));
        let mut server = Program::start(&mut internet.server().enter(&serve));
        server.says("serving on http://", 1);
        let [ada, bob, visitors] = [(); 3].map(|()| internet.home(HomeKind::Cone));
        ada.lose(LOST_PERCENT);
        bob.lose(LOST_PERCENT);
        Some(Self {
            clock: Clock::open(&folder.path().join("clock")),
            server,
            ada,
            bob,
            visitors,
            _internet: internet,
            avatar,
            folder,
        })
    }

    /// A path on the server's disk, as this process reaches it.
    fn on_disk(&self, name: &str) -> PathBuf {
        let root = PathBuf::from(format!("/proc/{}/root", self.server.id()));
        let data = self.folder.path().join("server").join(name);
        root.join(data.strip_prefix("/").expect("absolute"))
    }

    fn command(&self, name: &str, arguments: &[&str]) -> Command {
        let token = std::fs::read_to_string(self.on_disk("owner-token")).expect("a token");
        let files = self.folder.path().join(name);
        let mut command = through_runner(crate::PROGRAM);
        command
            .args(arguments)
            .arg("--insecure")
            .env("MON3TR_CACHE", files.join("cache"))
            .env("MON3TR_KEY", files.join("key"))
            .env("MON3TR_OWNER_TOKEN", token.trim())
            .env("PULSE_SERVER", "unix:/no-sound-server");
        command
    }

    /// A member of a call, who opens it without a link.
    fn member(&self, home: &Home, name: &str, link: Option<&str>, arguments: &[&str]) -> Program {
        let (report, server) = (self.report(name), format!("http://{SERVER}:8080"));
        let mut words = vec!["call"];
        match link {
            Some(link) => words.push(link),
            None => words.extend(["--server", &server]),
        }
        let (avatar, report) = (path(&self.avatar), path(&report));
        words.extend([
            "--name",
            name,
            "--avatar",
            avatar,
            "--display",
            "none",
            "--json",
            report,
        ]);
        words.extend(arguments);
        let mut command = self.command(name, &words);
        if let (None, Some(clock)) = (link, &self.clock) {
            clock.attach(&mut command);
        }
        Program::start(home.machine().enter(&command).stdin(Stdio::null()))
    }

    fn report(&self, name: &str) -> PathBuf {
        self.folder.path().join(format!("{name}.json"))
    }

    /// Fills the server's disk; it is full until the file is removed.
    fn fill_disk(&self) -> PathBuf {
        let file = self.on_disk("fills-the-disk");
        let bytes = vec![0; usize::try_from(DISK_MB << 20).expect("some MB")];
        std::fs::write(&file, bytes).expect_err("the disk is smaller");
        file
    }

    /// That a package which the server does not have is put, or is not because the disk is full.
    fn put(&self, number: usize, is_full: bool) {
        let package = self.folder.path().join(format!("other-{number}.m3a"));
        let size = PuppetSize {
            gaussians: 500 + number,
            ..PuppetSize::SMALL
        };
        Puppet::new(size)
            .avatar()
            .save(&package)
            .expect("a package");
        let server = format!("http://{SERVER}:8080");
        let words = ["send", "--server", &server, "--avatar", path(&package)];
        let mut command = self
            .visitors
            .machine()
            .enter(&self.command("other", &words));
        let mut sender = Program::start(command.stdin(Stdio::null()));
        if !is_full {
            sender.says("mon3tr receive ", 1);
            sender.end();
            return;
        }
        let status = sender.ended_within(LONGEST_WAIT).expect("it ends");
        let said = sender.said();
        assert!(!status.success() && said.contains("is full"), "{said}");
    }
}

fn path(path: &Path) -> &str {
    path.to_str().expect("temporary paths are UTF-8")
}

/// What goes wrong in turn; where that takes a while, what ends it.
fn harm(world: &mut World, turn: usize) -> Option<PathBuf> {
    match turn % 4 {
        0 => world.ada.move_machine(),
        1 => world.bob.move_router(),
        2 => {
            let file = world.fill_disk();
            world.put(turn, true);
            return Some(file);
        }
        _ => {
            let step = STEPS.get(turn / 4 % STEPS.len()).copied().unwrap_or("+0");
            if let Some(clock) = &world.clock {
                clock.set(step);
            }
        }
    }
    None
}

#[test]
fn a_call_stays_as_it_was_through_losses_moves_a_full_disk_and_clock_steps() {
    let Some(mut world) = World::open() else {
        return;
    };
    let seconds = extent(BOUNDED_SECONDS, MINUTES * 60);
    let is_whole = seconds > BOUNDED_SECONDS;
    let mut ada = world.member(&world.ada, "Ada", None, &[]);
    let link = ada.word_after("mon3tr call ");
    let mut bob = world.member(&world.bob, "Bob", Some(&link), &[]);
    ada.says("Bob", 1);
    bob.says("Ada", 1);
    let (begun, length) = (Instant::now(), Duration::from_secs(seconds.into()));
    // A turn for each fault in the bounded form, several of each in the whole.
    let turn_length = if is_whole {
        Duration::from_secs(150)
    } else {
        length / 5
    };
    let warm = length / 5;
    let mut memory: Vec<[u64; 2]> = Vec::new();
    let (mut turns, mut visits) = (0_usize, 0_u32);
    let mut disk: Option<PathBuf> = None;
    while begun.elapsed() < length {
        if begun.elapsed() >= turn_length * (u32::try_from(turns).expect("few") + 1) {
            if let Some(file) = disk.take() {
                std::fs::remove_file(file).expect("it is there");
                world.put(turns, false);
            }
            disk = harm(&mut world, turns);
            turns += 1;
        }
        visits += 1;
        let name = format!("Visitor{visits}");
        let mut visitor = world.member(&world.visitors, &name, Some(&link), &["--seconds", "3"]);
        let ended = visitor.ended_within(LONGEST_WAIT).expect("it ends");
        assert!(ended.success(), "a visit failed:\n{}", visitor.said());
        let now = [&ada, &bob].map(own_memory);
        if begun.elapsed() > warm {
            memory.push(now);
        }
        println!(
            "{:.0} s: {visits} visits, {turns} faults, {now:?} bytes",
            begun.elapsed().as_secs_f64()
        );
        std::thread::sleep(Duration::from_secs(if is_whole { 5 } else { 1 }));
    }
    let most = if is_whole { GROWTH } else { GROWTH_BOUNDED };
    // Memory that people who left have freed is given back once a minute: of the first quarter and of the last.
    let quarter = memory.len().div_ceil(4);
    for (number, name) in ["Ada", "Bob"].into_iter().enumerate() {
        let all: Vec<u64> = memory.iter().map(|it| it[number]).collect();
        let [first, last] = [&all[..quarter], &all[all.len() - quarter..]].map(median);
        println!("{name}: {first} bytes at first, {last} at the end, medians");
        assert!(
            last <= first + most,
            "{name} grew from {first} to {last} bytes"
        );
    }
    assert!(turns >= 4, "each fault at least once: {turns}");
    for (name, member) in [("Ada", &mut ada), ("Bob", &mut bob)] {
        let status = member.end();
        assert!(status.success(), "{name}:\n{}", member.said());
        let report = json(&world.report(name));
        // Visitors, who come for three seconds, have reports of their own.
        let live = report["received"]["call"]["live_seconds"].as_f64();
        let is_whole = live.is_some_and(|live| live > f64::from(seconds) * 0.8);
        assert!(is_whole, "not of the one who stayed: {report:#}");
        assert_stayed(name, &report, turns);
    }
}

/// The memory that a program has taken, bytes: what is resident without the pages of its files, which the system reads
/// as their code is first used.
fn own_memory(program: &Program) -> u64 {
    let status = std::fs::read_to_string(format!("/proc/{}/status", program.id()));
    let status = status.expect("it runs");
    let line = status
        .lines()
        .find_map(|line| line.strip_prefix("RssAnon:"));
    let kilobytes = line.and_then(|line| line.trim().strip_suffix("kB"));
    let kilobytes: Option<u64> = kilobytes.and_then(|number| number.trim().parse().ok());
    kilobytes.expect("Linux says it") << 10
}

fn median(of: &[u64]) -> u64 {
    let mut sorted = of.to_vec();
    sorted.sort_unstable();
    sorted.get(sorted.len() / 2).copied().expect("some samples")
}

/// That the call with the first person went on through all of it.
fn assert_stayed(name: &str, report: &Value, turns: usize) {
    let call = &report["received"]["call"];
    let without = call["seconds_without_motion"].as_f64().expect("a figure");
    let most = INTERRUPTED * turns as f64;
    assert!(
        without < most,
        "{name} saw nothing for {without} s: {call:#}"
    );
    let [released, lost] = ["released", "lost"].map(|key| call[key].as_u64().expect("a figure"));
    assert!(released > 0, "{name} saw nothing: {call:#}");
    assert!(
        lost < released / 10,
        "{name} lost {lost} of {released}: {call:#}"
    );
}
