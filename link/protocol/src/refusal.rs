//! What a sender answers a viewer that it does not take.

/// A sender's reason.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Refusal {
    /// The viewer does not prove that it has the link.
    Link,
    /// The sender has as many viewers as it serves itself; a server that forwards hands this one over.
    Full,
    /// The sender has as many viewers as it serves itself, and may not have this one handed over.
    Many,
    /// The performer is asked; the viewer is to offer again in a while.
    Wait,
    /// The room is locked: nobody new comes in.
    Locked,
    /// The performer has sent this viewer away.
    Removed,
    /// Only guests come in, each by a link of their own, and this one has none that holds.
    Guests,
    /// The guest's link has ended.
    Expired,
    /// The performer is asked about each viewer, and this one shows no key by which it could be told from others.
    Nameless,
    /// The room is a seat of a call, and the viewer's key sits in no seat of it.
    Seat,
}

impl Refusal {
    const ALL: [Self; 10] = [
        Self::Link,
        Self::Full,
        Self::Many,
        Self::Wait,
        Self::Locked,
        Self::Removed,
        Self::Guests,
        Self::Expired,
        Self::Nameless,
        Self::Seat,
    ];

    fn word(self) -> &'static str {
        match self {
            Self::Link => "link",
            Self::Full => "full",
            Self::Many => "many",
            Self::Wait => "wait",
            Self::Locked => "locked",
            Self::Removed => "removed",
            Self::Guests => "guests",
            Self::Expired => "expired",
            Self::Nameless => "nameless",
            Self::Seat => "seat",
        }
    }
}

/// How the line with the reason begins.
pub(crate) const REFUSAL_LINE: &str = "a=mon3tr-refused:";

impl Refusal {
    /// The answer that says so.
    #[must_use]
    pub fn answer(self) -> String {
        format!("v=0\r\n{REFUSAL_LINE}{}\r\n", self.word())
    }

    /// Whether this answer is one.
    #[must_use]
    pub fn read(answer: &str) -> Option<Self> {
        let why = answer
            .lines()
            .find_map(|line| line.strip_prefix(REFUSAL_LINE))?;
        Some(Self::of_word(why.trim_end()))
    }

    /// The reason of this word. One of a later version counts as [`Self::Link`], which trying again does not change.
    #[must_use]
    pub fn of_word(why: &str) -> Self {
        let known = Self::ALL.into_iter().find(|refusal| refusal.word() == why);
        known.unwrap_or(Self::Link)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_refusal_is_read_as_it_is_written() {
        for refusal in Refusal::ALL {
            assert_eq!(Refusal::read(&refusal.answer()), Some(refusal));
        }
        assert_eq!(
            Refusal::read("v=0\r\na=mon3tr-refused:later\r\n"),
            Some(Refusal::Link)
        );
        assert_eq!(Refusal::read("v=0\r\nm=application 9\r\n"), None);
    }
}
