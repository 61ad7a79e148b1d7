//! Texts from outside: which characters they may have, and how much of them a message repeats.

/// How much of a text is repeated in a line.
const REPEATED: usize = 40;

/// Refuses what is too long or has a character that could hide what a text says: control characters, bidirectional marks, letters
/// that look like others. Addresses in other scripts have an ASCII form.
pub(super) fn check(text: &str, longest: usize) -> Result<(), String> {
    if text.len() > longest {
        return Err(format!("it is longer than {longest} characters"));
    }
    match text.chars().find(|c| !matches!(c, ' '..='~')) {
        Some(strange) => Err(format!(
            "it has the character U+{:04X}: only plain ASCII is taken",
            u32::from(strange)
        )),
        None => Ok(()),
    }
}

/// A text that is no secret, short and harmless enough to stand in a line.
pub(super) fn repeated(text: &str) -> String {
    let mut short: String = text
        .chars()
        .take(REPEATED)
        .flat_map(|c| {
            let plain = matches!(c, ' '..='~') && c != '\\';
            plain
                .then_some(c)
                .into_iter()
                .chain((!plain).then(|| c.escape_unicode()).into_iter().flatten())
        })
        .collect();
    if text.chars().nth(REPEATED).is_some() {
        short.push_str("...");
    }
    format!("`{short}`")
}

/// Another library's message, on one line.
pub(super) fn one_line(text: &str) -> String {
    let line: Vec<&str> = text
        .split(|c: char| c.is_control())
        .map(str::trim)
        .collect();
    line.join(" ").trim().to_owned()
}
