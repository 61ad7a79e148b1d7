//! Which bytes of a package a request asks for (RFC 9110, 13 and 14): one range, or all.

use axum::http::{HeaderMap, HeaderName, header};
use link_protocol::PackageId;

/// Consecutive bytes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct ByteRange {
    pub(crate) first: u64,
    pub(crate) count: u64,
}

/// The outcome of a request's conditions.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Conditions {
    /// The client has it: 304.
    NotModified,
    /// All of it: 200.
    Whole,
    /// One range: 206.
    Range(ByteRange),
    /// A range beyond the end: 416.
    Unsatisfiable,
}

impl Conditions {
    /// Reads the headers of a request for the package of this hash and size.
    pub(crate) fn of(headers: &HeaderMap, hash: PackageId, size: u64) -> Self {
        let tag = format!("\"{hash}\"");
        let none_match = headers.get_all(header::IF_NONE_MATCH);
        let mut tags = none_match
            .iter()
            .filter_map(|value| value.to_str().ok())
            .flat_map(|value| value.split(','))
            .map(|one| one.trim());
        // Weak comparison, as the RFC has it for this header.
        if tags.any(|one| one == "*" || one.strip_prefix("W/").unwrap_or(one) == tag) {
            return Self::NotModified;
        }
        match single(headers, &header::IF_RANGE) {
            Some(Some(condition)) if condition.trim() == tag => {}
            None => {}
            // A date, or another tag: the client's part is of something else.
            Some(_) => return Self::Whole,
        }
        match single(headers, &header::RANGE) {
            Some(Some(range)) => parse(range, size),
            _ => Self::Whole,
        }
    }
}

/// `None`: no such header. `Some(None)`: more than one, or not text.
fn single<'a>(headers: &'a HeaderMap, name: &HeaderName) -> Option<Option<&'a str>> {
    let mut values = headers.get_all(name).iter();
    let first = values.next()?;
    Some(match values.next() {
        None => first.to_str().ok(),
        Some(_) => None,
    })
}

/// What is no single range of bytes is as if it were not there, which the RFC allows.
fn parse(range: &str, size: u64) -> Conditions {
    let Some((unit, range)) = range.trim().split_once('=') else {
        return Conditions::Whole;
    };
    let Some((first, last)) = range.trim().split_once('-') else {
        return Conditions::Whole;
    };
    let number = |text: &str| {
        let digits = !text.is_empty() && text.bytes().all(|b| b.is_ascii_digit());
        // Longer than any number is far beyond any end.
        digits.then(|| text.parse::<u64>().unwrap_or(u64::MAX))
    };
    let (first, last) = (first.trim(), last.trim());
    if !unit.trim().eq_ignore_ascii_case("bytes") {
        return Conditions::Whole;
    }
    match (number(first), number(last)) {
        (Some(first), last) if last.is_some() || range.trim().ends_with('-') => {
            let last = last.unwrap_or(u64::MAX);
            if last < first {
                Conditions::Whole
            } else if first >= size {
                Conditions::Unsatisfiable
            } else {
                let end = last.saturating_add(1).min(size);
                Conditions::Range(ByteRange {
                    first,
                    count: end - first,
                })
            }
        }
        (None, Some(count)) if first.is_empty() => {
            if count == 0 || size == 0 {
                return Conditions::Unsatisfiable;
            }
            let count = count.min(size);
            Conditions::Range(ByteRange {
                first: size - count,
                count,
            })
        }
        _ => Conditions::Whole,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn part(first: u64, count: u64) -> Conditions {
        Conditions::Range(ByteRange { first, count })
    }

    #[test]
    fn ranges_are_read_as_rfc_9110_has_them() {
        for (text, expected) in [
            ("bytes=0-0", part(0, 1)),
            ("bytes=0-", part(0, 100)),
            ("bytes=10-19", part(10, 10)),
            ("bytes=90-1000", part(90, 10)),
            ("Bytes= 5 - 6 ", part(5, 2)),
            ("bytes=-1", part(99, 1)),
            ("bytes=-1000", part(0, 100)),
            ("bytes=99-99999999999999999999999", part(99, 1)),
            ("bytes=100-", Conditions::Unsatisfiable),
            ("bytes=99999999999999999999999-", Conditions::Unsatisfiable),
            ("bytes=-0", Conditions::Unsatisfiable),
            ("bytes=2-1", Conditions::Whole),
            ("bytes=0-1,3-4", Conditions::Whole),
            ("bytes=-", Conditions::Whole),
            ("bytes=a-b", Conditions::Whole),
            ("bytes=1-b", Conditions::Whole),
            ("bytes=--1", Conditions::Whole),
            ("bytes", Conditions::Whole),
            ("lines=1-2", Conditions::Whole),
            ("", Conditions::Whole),
        ] {
            assert_eq!(parse(text, 100), expected, "{text:?}");
        }
    }
}
