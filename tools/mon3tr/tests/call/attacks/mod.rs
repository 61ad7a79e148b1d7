//! Attacks on the running programs, by clients without a link, by holders of a link, by members, owners and servers.
//!
//! Each attack runs in a bounded form with the other tests, and in its whole length by `./run attacks`.

mod authentication;
mod bounds;
mod hang_up;
mod ipv6;
mod membership;
mod packets;
mod relay;
mod secrets;
mod soak;

use std::time::Duration;

/// How long something took each time it was done; printed at the end.
pub(crate) struct Times {
    what: &'static str,
    all: Vec<Duration>,
}

impl Times {
    pub(crate) fn of(what: &'static str) -> Self {
        let all = Vec::new();
        Self { what, all }
    }

    pub(crate) fn add(&mut self, took: Duration) {
        self.all.push(took);
    }

    pub(crate) fn count(&self) -> usize {
        self.all.len()
    }
}

impl Drop for Times {
    fn drop(&mut self) {
        self.all.sort();
        let (count, middle) = (self.all.len(), self.all.get(self.all.len() / 2));
        let [median, longest] = [middle, self.all.last()].map(|it| it.copied().unwrap_or_default());
        println!(
            "{}: {count}, median {median:.3?}, longest {longest:.3?}",
            self.what
        );
    }
}

/// How often an attack is repeated, or how many seconds it lasts: `bounded` among the other tests, `whole` by `./run attacks`.
pub(crate) fn extent(bounded: u32, whole: u32) -> u32 {
    match std::env::var_os("MON3TR_ATTACKS") {
        Some(extent) if extent == "whole" => whole,
        _ => bounded,
    }
}
