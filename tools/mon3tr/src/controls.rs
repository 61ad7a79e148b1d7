//! A call while it is held: who else is in it, and what keys of the window, or lines on the terminal, do.

use app_session::own_motion::OwnMotion;
use app_session::participant::Participant;
use call_member::{Member, Members};
use identity::PublicKey;
use link_call::door::Seen;
use link_call::{Door, Privacy};
use link_playout::Clock;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering::Relaxed};
use std::sync::mpsc::Receiver;

/// What keys do, as it is told at the start.
pub(crate) const KEYS: &str = "keys: m mute, h hide, s see yourself, w who is there, q hang up (in the window, or here with Enter); on this terminal only: l lock or unlock, x KEY send away the person whose key begins so, a N let person N in";

/// What may be typed instead of a key.
const WORDS: [(char, &str); 5] = [
    ('m', "mute"),
    ('h', "hide"),
    ('s', "see"),
    ('w', "who"),
    ('q', "quit"),
];
pub(crate) const LONGEST_WORD: usize = 64;

/// The other people of a call, as they come, for what shows them.
pub(crate) struct Others {
    pub(crate) newcomers: Receiver<Participant>,
    pub(crate) controls: Controls,
}

/// A person's controls of a call. Clones steer the same call.
#[derive(Debug, Clone)]
pub(crate) struct Controls {
    pub(crate) privacy: Privacy,
    pub(crate) members: Members,
    /// Who sees this side.
    pub(crate) door: Door,
    pub(crate) clock: Clock,
    /// A look at oneself.
    pub(crate) own: OwnMotion,
    pub(crate) stop: Arc<AtomicBool>,
    /// Whether this side is heard while the space bar is held, and else not.
    pub(crate) push_to_talk: bool,
}

impl Controls {
    /// The space bar is held from now on, or not any longer.
    pub(crate) fn hold_to_talk(&self, is_held: bool) {
        if self.push_to_talk {
            self.privacy.mute(!is_held);
        }
    }

    /// Does what `key` stands for; whether it stands for anything.
    pub(crate) fn press(&self, key: char) -> bool {
        match key.to_ascii_lowercase() {
            'm' => {
                let muted = self.privacy.toggle_mute().muted;
                println!(
                    "{}",
                    if muted {
                        "you are muted"
                    } else {
                        "you are heard"
                    }
                );
            }
            'h' => {
                let hidden = self.privacy.toggle_hide().hidden;
                println!(
                    "{}",
                    if hidden {
                        "you are hidden"
                    } else {
                        "you are seen"
                    }
                );
            }
            's' => {
                let seen = self.own.toggle();
                println!(
                    "{}",
                    if seen {
                        "you see yourself"
                    } else {
                        "you do not see yourself"
                    }
                );
            }
            'w' => self.print_who(),
            'q' => self.stop.store(true, Relaxed),
            _ => return false,
        }
        true
    }

    /// Whose voice is heard now.
    pub(crate) fn speakers(&self) -> Vec<String> {
        let all = self.members.all().into_iter();
        all.filter(|member| self.speaks(member))
            .map(|member| member.name)
            .collect()
    }

    fn speaks(&self, member: &Member) -> bool {
        member.voice.heard_offset_us(self.clock.now()).is_some()
    }

    fn print_who(&self) {
        let own = self.privacy.state();
        let mut lines = vec![format!("you{}", described(own.muted, own.hidden, false))];
        for member in self.members.all() {
            let state = member.watch.state();
            let described = described(state.muted, state.hidden, self.speaks(&member));
            let key = member.watch.key().flatten();
            let key = key.map(|key| format!(" [{}]", key.fingerprint()));
            let key = key.unwrap_or_default();
            lines.push(format!("{}{key}{described}", member.name));
        }
        println!("in the call: {}", lines.join("; "));
        if self.door.rules().locked {
            println!("the call is locked for you");
        }
        for Seen {
            number,
            visitor,
            waits,
            ..
        } in self.door.seen()
        {
            let members = self.members.all().into_iter();
            let name = members
                .filter(|member| visitor.key.is_some() && member.watch.key() == Some(visitor.key))
                .map(|member| member.name)
                .next();
            let named = name.map_or_else(String::new, |name| format!("{name}, "));
            // A member is sent away by their key: their seat has another number.
            if waits {
                println!("{number}: {named}{visitor} waits to be let in");
            } else {
                println!("{named}{visitor} sees and hears you");
            }
        }
    }

    /// The keys of the other members, as far as they are met.
    pub(crate) fn keys(&self) -> Vec<PublicKey> {
        let members = self.members.all().into_iter();
        members
            .filter_map(|member| member.watch.key().flatten())
            .collect()
    }

    /// Does what a line asks for, and says what could be asked for where it is nothing of it.
    pub(crate) fn obey(&self, line: &str) {
        let line = line.trim().to_ascii_lowercase();
        let word = WORDS.iter().find(|(_, word)| *word == line);
        let mut letters = line.chars();
        let key = match (letters.next(), letters.next()) {
            (None, _) => return,
            (Some(key), None) => Some(key),
            _ => word.map(|(key, _)| *key),
        };
        if !key.is_some_and(|key| self.press(key)) {
            println!("{KEYS}");
        }
    }
}

fn described(muted: bool, hidden: bool, speaks: bool) -> String {
    let words = [(muted, "muted"), (hidden, "hidden"), (speaks, "speaking")];
    let words: Vec<&str> = words
        .into_iter()
        .filter_map(|(holds, word)| holds.then_some(word))
        .collect();
    if words.is_empty() {
        String::new()
    } else {
        format!(" ({})", words.join(", "))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_line_is_a_key_or_its_word_and_nothing_else() {
        let controls = Controls {
            privacy: Privacy::default(),
            members: Members::default(),
            door: Door::default(),
            clock: Clock::start(),
            own: OwnMotion::default(),
            stop: Arc::default(),
            push_to_talk: false,
        };
        let obeys = |lines: &str| lines.lines().for_each(|line| controls.obey(line));
        obeys("mute\nhello\nH \n\nx\ns\nquite a long line that is no word\n");
        let state = controls.privacy.state();
        assert!(state.muted && state.hidden, "{state:?}");
        assert!(!controls.own.toggle(), "they saw themselves");
        assert!(!controls.stop.load(Relaxed), "goes on");
        obeys("m\nq");
        assert!(!controls.privacy.state().muted, "heard again");
        assert!(controls.stop.load(Relaxed), "hung up");
    }

    #[test]
    fn who_pushes_to_talk_is_heard_while_they_hold_and_others_by_their_mute_alone() {
        let controls = |push_to_talk| Controls {
            privacy: Privacy::default(),
            members: Members::default(),
            door: Door::default(),
            clock: Clock::start(),
            own: OwnMotion::default(),
            stop: Arc::default(),
            push_to_talk,
        };
        let pushes = controls(true);
        pushes.hold_to_talk(false);
        assert!(pushes.privacy.state().muted, "from the start");
        pushes.hold_to_talk(true);
        assert!(!pushes.privacy.state().muted, "while held");
        pushes.hold_to_talk(false);
        assert!(pushes.privacy.state().muted, "and no longer");
        let other = controls(false);
        other.hold_to_talk(false);
        assert!(!other.privacy.state().muted, "the bar does nothing");
    }
}
