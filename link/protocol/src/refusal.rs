//! What a sender answers a viewer that it does not take.

/// A sender's reason.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Refusal {
    /// The viewer does not prove that it has the link.
    Link,
    /// The sender has as many viewers as it serves itself; a server that forwards hands this one over.
    Full,
}

const LINE: &str = "a=mon3tr-refused:";
const FULL: &str = "full";

impl Refusal {
    /// The answer that says so.
    #[must_use]
    pub fn answer(self) -> String {
        let why = match self {
            Self::Link => "link",
            Self::Full => FULL,
        };
        format!("v=0\r\n{LINE}{why}\r\n")
    }

    /// Whether this answer is one. A reason of a later version counts as [`Self::Link`], which trying again does not change.
    #[must_use]
    pub fn read(answer: &str) -> Option<Self> {
        let why = answer.lines().find_map(|line| line.strip_prefix(LINE))?;
        Some(match why.trim_end() {
            FULL => Self::Full,
            _ => Self::Link,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_refusal_is_read_as_it_is_written() {
        for refusal in [Refusal::Link, Refusal::Full] {
            assert_eq!(Refusal::read(&refusal.answer()), Some(refusal));
        }
        assert_eq!(
            Refusal::read("v=0\r\na=mon3tr-refused:later\r\n"),
            Some(Refusal::Link)
        );
        assert_eq!(Refusal::read("v=0\r\nm=application 9\r\n"), None);
    }
}
