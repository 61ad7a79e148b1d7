//! Standard output and standard error.
//!
//! `print!`, `println!` and `eprintln!` of this crate and of `mon3tr-dev` are these, not the standard library's: a call
//! goes on when the reader of its output is gone (`mon3tr send | head`), where the standard ones panic, and no name or
//! text of others moves the cursor or changes the terminal.

use std::fmt::{Arguments, Write as _};
use std::io::{self, ErrorKind, Write};
use std::sync::OnceLock;

/// Why a text could not be written, where its reader has not gone: a full disk, as a rule.
static FAILURE: OnceLock<String> = OnceLock::new();

/// Where a text goes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Stream {
    /// Standard output.
    Output,
    /// Standard error.
    Error,
}

/// Writes to standard output, as the standard library's macro of this name, but never panics.
#[macro_export]
macro_rules! print {
    ($($text:tt)*) => {
        $crate::terminal::write_text($crate::terminal::Stream::Output, ::std::format_args!($($text)*))
    };
}

/// Writes a line to standard output, as the standard library's macro of this name, but never panics.
#[macro_export]
macro_rules! println {
    () => { $crate::print!("\n") };
    ($($line:tt)*) => { $crate::print!("{}\n", ::std::format_args!($($line)*)) };
}

/// Writes a line to standard error, as the standard library's macro of this name, but never panics.
#[macro_export]
macro_rules! eprintln {
    () => { $crate::eprintln!("") };
    ($($line:tt)*) => {
        $crate::terminal::write_text(
            $crate::terminal::Stream::Error,
            ::std::format_args!("{}\n", ::std::format_args!($($line)*)),
        )
    };
}

/// Writes `text` to `stream`. A reader that has gone is no failure; any other one is kept for `failure`.
pub fn write_text(stream: Stream, text: Arguments<'_>) {
    let text = printable(&text.to_string());
    let written = match stream {
        Stream::Output => write(&mut io::stdout().lock(), &text),
        Stream::Error => write(&mut io::stderr().lock(), &text),
    };
    if let Err(error) = written {
        // The first one is enough.
        FAILURE.get_or_init(|| error.to_string());
    }
}

fn write(stream: &mut impl Write, text: &str) -> io::Result<()> {
    let written = stream.write_all(text.as_bytes());
    match written.and_then(|()| stream.flush()) {
        Err(error) if error.kind() == ErrorKind::BrokenPipe => Ok(()),
        written => written,
    }
}

/// Why not all could be written, if that is so.
pub(crate) fn failure() -> Option<&'static str> {
    FAILURE.get().map(String::as_str)
}

/// `text` with control characters, and those that reorder the text around them, escaped as in Rust's strings. Lines and
/// tabs stay.
pub(crate) fn printable(text: &str) -> String {
    let mut shown = String::with_capacity(text.len());
    for character in text.chars() {
        if is_unprintable(character) {
            // Writing to a string does not fail.
            let _ = write!(shown, "{}", character.escape_unicode());
        } else {
            shown.push(character);
        }
    }
    shown
}

/// Whether a terminal does something else than show `character`.
pub(crate) fn is_unprintable(character: char) -> bool {
    match character {
        '\n' | '\t' => false,
        // Unicode Standard Annex 9: marks, embeddings, overrides and isolates.
        '\u{61c}' | '\u{200e}' | '\u{200f}' | '\u{202a}'..='\u{202e}' | '\u{2066}'..='\u{2069}' => {
            true
        }
        '\u{2028}' | '\u{2029}' => true,
        other => other.is_control(),
    }
}

/// A log whose records are [`printable`].
pub(crate) struct PrintableLog(pub(crate) env_logger::Logger);

impl log::Log for PrintableLog {
    fn enabled(&self, metadata: &log::Metadata<'_>) -> bool {
        self.0.enabled(metadata)
    }

    fn log(&self, record: &log::Record<'_>) {
        // A record that is not logged is not formatted.
        if !self.0.matches(record) {
            return;
        }
        let text = printable(&record.args().to_string());
        self.0.log(
            &log::Record::builder()
                .metadata(record.metadata().clone())
                .module_path(record.module_path())
                .file(record.file())
                .line(record.line())
                .args(format_args!("{text}"))
                .build(),
        );
    }

    fn flush(&self) {
        self.0.flush();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_steers_a_terminal_is_escaped_and_lines_stay() {
        let text = "a\x1b[31m\u{9b}5m\u{202e}b\r\u{7f}\nü\t漢";
        let shown = r"a\u{1b}[31m\u{9b}5m\u{202e}b\u{d}\u{7f}";
        assert_eq!(printable(text), format!("{shown}\nü\t漢"));
    }

    #[test]
    fn a_reader_that_has_gone_is_no_failure_and_a_full_disk_is_one() {
        struct Broken(ErrorKind);
        impl Write for Broken {
            fn write(&mut self, _: &[u8]) -> io::Result<usize> {
                Err(self.0.into())
            }
            fn flush(&mut self) -> io::Result<()> {
                Ok(())
            }
        }
        assert!(write(&mut Broken(ErrorKind::BrokenPipe), "line\n").is_ok());
        assert!(write(&mut Broken(ErrorKind::StorageFull), "line\n").is_err());
    }
}
