//! The lines of a description, by the strict half of RFC 8866: a small letter, `=`, and a value that begins with a
//! visible character.
//!
//! The WebRTC library's reader is lenient: it skips any line ends before a line and any blanks around a value, those of
//! Unicode included. A line that only one of two readers understands is how a certificate or an address would pass
//! unchecked, so such lines are errors here.

/// Bytes of a description, as the server bounds them too; lines of it, and bytes of one. Chromium's offer with audio
/// and video has some 250 lines.
const MAX_BYTES: usize = 64 << 10;
const MAX_LINES: usize = 512;
const MAX_LINE_BYTES: usize = 1024;

/// Why a description is refused.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum SdpError {
    /// A line is malformed, or contradicts another one.
    #[error("line {line}: {why}")]
    Line {
        /// The line's number, from 1.
        line: usize,
        /// What is wrong with it.
        why: &'static str,
    },
    /// Something is missing that every connection needs.
    #[error("it lacks {0}")]
    Lacks(&'static str),
}

/// A line of a description.
#[derive(Debug, Clone, Copy)]
pub(super) struct Line<'a> {
    pub(super) number: usize,
    pub(super) kind: u8,
    pub(super) value: &'a str,
}

impl<'a> Line<'a> {
    pub(super) fn wrong(&self, why: &'static str) -> SdpError {
        let line = self.number;
        SdpError::Line { line, why }
    }

    /// The name of an attribute and its value, if this line is an attribute.
    pub(super) fn attribute(&self) -> Option<(&'a str, Option<&'a str>)> {
        (self.kind == b'a').then(|| match self.value.split_once(':') {
            Some((name, value)) => (name, Some(value)),
            None => (self.value, None),
        })
    }
}

/// The lines of `text`, each of which ends with CR LF or LF.
pub(super) fn lines(text: &str) -> Result<Vec<Line<'_>>, SdpError> {
    let wrong = |line, why| SdpError::Line { line, why };
    if text.len() > MAX_BYTES {
        return Err(wrong(1, "the description is longer than 64 KiB"));
    }
    let mut lines = Vec::new();
    for (number, line) in (1..).zip(text.split_inclusive('\n')) {
        let line = line
            .strip_suffix('\n')
            .map(|it| it.strip_suffix('\r').unwrap_or(it));
        let line = line.ok_or_else(|| wrong(number, "the line has no end"))?;
        if number > MAX_LINES || line.len() > MAX_LINE_BYTES {
            return Err(wrong(
                number,
                "there are too many lines, or this one is too long",
            ));
        }
        if !line
            .bytes()
            .all(|byte| byte == b' ' || byte.is_ascii_graphic())
        {
            return Err(wrong(
                number,
                "a character is neither visible ASCII nor a blank",
            ));
        }
        match (line.as_bytes(), line.get(2..)) {
            ([kind @ b'a'..=b'z', b'=', first, ..], Some(value)) if *first != b' ' => {
                let kind = *kind;
                lines.push(Line {
                    number,
                    kind,
                    value,
                });
            }
            _ => {
                let why = "a line is a small letter, `=`, and a value that begins with a visible character";
                return Err(wrong(number, why));
            }
        }
    }
    Ok(lines)
}

/// The value of the one attribute `name` in `text`, if it is there.
pub(crate) fn only<'a>(text: &'a str, name: &str) -> Result<Option<&'a str>, SdpError> {
    let mut found = None;
    for line in lines(text)? {
        if let Some((_, Some(value))) = line.attribute().filter(|(it, _)| *it == name)
            && found.replace(value).is_some()
        {
            return Err(line.wrong("the attribute is there twice"));
        }
    }
    Ok(found)
}
