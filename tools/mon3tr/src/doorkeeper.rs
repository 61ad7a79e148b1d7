//! The performer's hand at the door of a room: what is told of who comes and goes, what lines on the terminal do, and what is kept for when the room is entered
//! again.

mod book;

use crate::heap;
use crate::network::Line;
use crate::typed::take_lines;
use anyhow::Context;
use book::Book;
use identity::PublicKey;
use link_call::door::{DoorEvent, DoorRules, Seen};
use link_call::{Credentials, Door, Venue};
use link_http::Client;
use link_protocol::{Name, RoomLink};
use sender::{Invitation, invite};
use std::collections::VecDeque;
use std::io::{BufRead, IsTerminal};
use std::sync::atomic::{AtomicBool, Ordering::Relaxed};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};
use tokio::runtime::Handle;

/// Characters of a key's fingerprint that name a member, at least: fewer may be a number.
const SHORTEST_KEY: usize = 4;

/// What lines on the terminal do, as it is told at the start.
const LINES: &str = "type w: who is there; a N: let N in; x N: send N away; l: lock or unlock; g NAME[,TIME][,see|hear]: a link for a guest; q: leave";

/// The longest line that is taken.
const LONGEST_LINE: usize = 200;

/// Between two looks at what happens.
const LOOK: Duration = Duration::from_millis(20);

/// After people have left, the memory that they took is returned to the system; so often, at most.
const TRIMMED_APART: Duration = Duration::from_secs(60);

/// So many lines in such a time, at most: whoever has the link may come and go as they like.
const MOST_LINES: usize = 20;
const LINES_WITHIN: Duration = Duration::from_secs(10);

/// Who may come in.
#[derive(Debug, Clone, Default, clap::Args)]
pub(crate) struct DoorOptions {
    /// Ask about each newcomer, who waits until you let them in
    #[arg(long)]
    ask: bool,
    /// Make a link for this guest alone, and let nobody in but guests; may be given several times. TIME is like 90m, 12h or 7d; `see` and `hear` let them have
    /// your motion or your voice only
    #[arg(long, value_name = "NAME[,TIME][,see|hear]")]
    guest: Vec<Invitation>,
}

/// What a room's performer does at its door.
pub(crate) struct Doorkeeper {
    door: Door,
    venue: Venue,
    credentials: Credentials,
    client: Client,
    network: Handle,
    stop: Arc<AtomicBool>,
    book: Option<Book>,
    kept: Mutex<DoorRules>,
    /// In a call its roster tells who comes and goes.
    is_of_call: bool,
}

/// The door of a call, which is open if `asks` does not say otherwise, with what was decided in it before.
///
/// # Errors
/// If decisions were kept and cannot be read: nobody would know who was sent away.
pub(crate) fn door_of_call(call: &Name, asks: bool) -> anyhow::Result<Door> {
    let mut rules = Book::of(call)?.read()?;
    rules.ask |= asks;
    Ok(Door::new(rules))
}

impl DoorOptions {
    /// The door of a room that is not open yet, or of `room`, where decisions were kept.
    ///
    /// # Errors
    /// If decisions were kept and cannot be read: nobody would know who was sent away.
    pub(crate) fn door(&self, room: Option<&RoomLink>) -> anyhow::Result<Door> {
        let mut rules = match room {
            Some(room) => Book::of(room.room())?.read()?,
            None => DoorRules::default(),
        };
        rules.ask |= self.ask;
        rules.guests_only |= !self.guest.is_empty();
        Ok(Door::new(rules))
    }

    /// Makes the guests' links.
    ///
    /// # Errors
    /// If the server makes none.
    pub(crate) fn print_guests(&self, keeper: &Doorkeeper) -> anyhow::Result<()> {
        for guest in &self.guest {
            keeper.print_guest(guest)?;
        }
        Ok(())
    }
}

impl Doorkeeper {
    /// The keeper of `door` for whoever is met at `venue`, in a seat of `call` if one is said.
    pub(crate) fn new(
        door: Door,
        venue: Venue,
        call: Option<&Name>,
        credentials: Credentials,
        line: &Line,
    ) -> Self {
        // The seat may be another one the next time.
        let book = match call {
            Some(call) => Book::of(call),
            None => Book::of(venue.room().room()),
        };
        let book = book
            .inspect_err(|why| log::warn!("who is sent away is forgotten when you leave: {why:#}"));
        Self {
            door,
            venue,
            credentials,
            client: line.client.clone(),
            network: line.network.handle(),
            stop: Arc::clone(&line.stop),
            book: book.ok(),
            kept: Mutex::default(),
            is_of_call: call.is_some(),
        }
    }

    /// Whether it is of a call.
    pub(crate) fn is_of_call(&self) -> bool {
        self.is_of_call
    }

    /// Does what a line asks for in a call whose members have these `keys`; whether it asks for anything of the door's.
    pub(crate) fn obey_in_call(&self, line: &str, keys: &[PublicKey]) -> bool {
        let (word, rest) = line
            .trim()
            .split_once(char::is_whitespace)
            .unwrap_or((line.trim(), ""));
        let is_short = rest.trim().len() < SHORTEST_KEY;
        let number = rest.trim().parse().ok().filter(|_| is_short);
        match (word.to_ascii_lowercase().as_str(), number) {
            ("l" | "lock", _) if rest.is_empty() => self.obey(line),
            ("a" | "admit", Some(_)) => self.obey(line),
            ("x" | "remove", Some(number)) => self.remove_waiting(number),
            ("x" | "remove", None) if !rest.is_empty() => self.remove_member(rest.trim(), keys),
            _ => return false,
        }
        true
    }

    /// Sends away the person who waits with this number. Members have the numbers of their seats beside those of
    /// viewers, and are sent away by their keys.
    fn remove_waiting(&self, number: u32) {
        let waits = |seen: &Seen| seen.waits && seen.number == number;
        if self.door.seen().iter().any(waits) {
            self.obey(&format!("x {number}"));
        } else {
            self.decided(format!(
                "no person with the number {number} waits; one who is in the call is sent away by their key: x KEY; w: who is there"
            ));
        }
    }

    /// Sends away the one member whose fingerprint begins so.
    fn remove_member(&self, fingerprint: &str, keys: &[PublicKey]) {
        if fingerprint.len() < SHORTEST_KEY {
            self.decided(format!(
                "say at least {SHORTEST_KEY} characters of the key; w: who is there"
            ));
            return;
        }
        let viewers = self.door.seen().into_iter();
        let viewers = viewers.filter_map(|seen| seen.visitor.key);
        let mut found: Vec<PublicKey> = (keys.iter().copied().chain(viewers))
            .filter(|key| key.fingerprint().starts_with(fingerprint))
            .collect();
        found.sort_unstable();
        found.dedup();
        self.decided(match found[..] {
            [key] => {
                self.door.remove_member(key);
                format!(
                    "{} is sent away, and does not come in again",
                    key.fingerprint()
                )
            }
            [] => format!("no member has a key that begins with {fingerprint}; w: who is there"),
            _ => format!("more than one member has a key that begins with {fingerprint}"),
        });
    }

    fn print_guest(&self, invitation: &Invitation) -> anyhow::Result<()> {
        let room = self.venue.room();
        let (client, own) = (&self.client, &self.credentials);
        let invited = invite(client, &room, own, &self.door, invitation);
        let link = (self.network.block_on(invited))
            .with_context(|| format!("cannot invite {}", invitation.name.as_str()))?;
        println!(
            "{} joins with\n  mon3tr receive '{link}'",
            invitation.name.as_str()
        );
        Ok(())
    }

    /// Takes lines from the terminal, in a thread that ends with the process: nothing ends a read of the terminal.
    ///
    /// # Errors
    /// If there is no such thread.
    pub(crate) fn listen_to_terminal(self: &Arc<Self>) -> anyhow::Result<()> {
        if !may_listen() {
            return Ok(());
        }
        if std::io::stdin().is_terminal() {
            println!("{LINES}");
        }
        let keeper = Arc::clone(self);
        std::thread::Builder::new()
            .name("lines".to_owned())
            .spawn(move || keeper.listen(std::io::stdin().lock()))
            .context("cannot start a thread for what is typed")?;
        Ok(())
    }

    /// Does what the lines of `input` ask for, until it ends.
    fn listen(&self, input: impl BufRead) {
        take_lines(input, LONGEST_LINE, |line| self.obey(line));
    }

    fn obey(&self, line: &str) {
        let line = line.trim();
        let (word, rest) = line.split_once(char::is_whitespace).unwrap_or((line, ""));
        let number = || rest.trim().parse::<u32>().ok();
        match (word.to_ascii_lowercase().as_str(), number()) {
            ("", _) => {}
            ("w" | "who", None) => self.print_who(),
            ("a" | "admit", Some(number)) => self.decided(match self.door.admit(number) {
                Some(visitor) => format!("{visitor} is let in"),
                None => format!("nobody of the number {number} waits; w: who is there"),
            }),
            ("x" | "remove", Some(number)) => self.decided(match self.door.remove(number) {
                Some(visitor) if visitor.who().is_some() => {
                    format!("{visitor} is sent away, and does not come in again")
                }
                Some(visitor) => {
                    format!("{visitor} is sent away, and nobody comes in without a key any more")
                }
                None => format!("nobody has the number {number}; w: who is there"),
            }),
            ("l" | "lock", None) => self.decided(
                match (self.door.toggle_lock(), self.is_of_call) {
                    (true, false) => "the room is locked: nobody new comes in",
                    (false, false) => "the room is open again",
                    (true, true) => {
                        "the call is locked for you: you neither see nor are seen by new members"
                    }
                    (false, true) => "the call is open for you again",
                }
                .to_owned(),
            ),
            ("g" | "guest", _) => match rest.parse() {
                Ok(invitation) => {
                    if let Err(why) = self.print_guest(&invitation) {
                        println!("{why:#}");
                    }
                }
                Err(why) => println!("{why}"),
            },
            ("q" | "quit", None) => self.stop.store(true, Relaxed),
            _ => println!("{LINES}"),
        }
    }

    /// Keeps what was decided before `said` says so: it holds whatever happens next.
    fn decided(&self, said: String) {
        self.keep();
        println!("{said}");
    }

    fn print_who(&self) {
        let seen = self.door.seen();
        let rules = self.door.rules();
        if rules.locked {
            println!("the room is locked");
        }
        if seen.is_empty() {
            println!("nobody is there");
        }
        for Seen {
            number,
            visitor,
            waits,
            handed_over,
        } in seen
        {
            let how = match (waits, handed_over) {
                (true, _) => "waits to be let in",
                (false, true) => "was handed over to the server",
                (false, false) => "sees you",
            };
            println!("{number}: {visitor} {how}");
        }
    }

    /// Tells the performer who comes and goes, and keeps what was decided, until it is `over`.
    pub(crate) fn watch(&self, over: &AtomicBool) {
        let mut told: VecDeque<Instant> = VecDeque::new();
        let mut untold = 0;
        let (mut has_freed, mut trimmed) = (false, Instant::now());
        loop {
            let is_over = over.load(Relaxed);
            while let Some(event) = self.door.next_event() {
                has_freed |= matches!(event, DoorEvent::Left(..) | DoorEvent::GaveUp(..));
                if self.is_of_call && matches!(event, DoorEvent::Entered(..) | DoorEvent::Left(..))
                {
                    continue;
                }
                let line = told_of(&event);
                told.retain(|at| at.elapsed() < LINES_WITHIN);
                if told.len() < MOST_LINES {
                    told.push_back(Instant::now());
                    println!("{line}");
                } else {
                    untold += 1;
                    log::debug!("{line}");
                }
            }
            told.retain(|at| at.elapsed() < LINES_WITHIN);
            if untold > 0 && told.len() < MOST_LINES {
                println!("{untold} more came, waited or left; w: who is there");
                untold = 0;
            }
            if has_freed && trimmed.elapsed() >= TRIMMED_APART {
                heap::trim();
                (has_freed, trimmed) = (false, Instant::now());
            }
            // The last time is after everything else.
            self.keep();
            if is_over {
                break;
            }
            std::thread::sleep(LOOK);
        }
    }

    /// Keeps what was decided, if that is something new.
    fn keep(&self) {
        let mut kept = self.kept.lock().unwrap_or_else(PoisonError::into_inner);
        let rules = self.door.rules();
        if *kept != rules
            && let Some(book) = &self.book
        {
            if let Err(why) = book.write(&rules) {
                log::warn!("who is sent away is forgotten when you leave: {why:#}");
            }
            // Said once for each decision.
            *kept = rules;
        }
    }
}

fn told_of(event: &DoorEvent) -> String {
    match event {
        DoorEvent::Waits(number, visitor) => format!(
            "{visitor} wants to come in: type a {number} to let them in, x {number} to send them away"
        ),
        DoorEvent::GaveUp(_, visitor) => format!("{visitor} waits no longer"),
        DoorEvent::Crowded => "more want to come in than can wait: g NAME makes a link for someone whom you expect, and they find room".to_owned(),
        DoorEvent::Entered(number, visitor) => format!("{visitor} sees you (number {number})"),
        DoorEvent::Left(_, visitor) => format!("{visitor} has left"),
    }
}

/// Whether lines may be read from the terminal: a program in the background that tries is stopped by it.
fn may_listen() -> bool {
    #[cfg(unix)]
    {
        let terminal = rustix::termios::tcgetpgrp(std::io::stdin());
        // Of no terminal, anything may be read.
        terminal.is_err() || terminal.ok() == Some(rustix::process::getpgrp())
    }
    #[cfg(not(unix))]
    true
}
