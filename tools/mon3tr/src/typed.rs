//! Lines that are typed while a program runs.

use std::io::BufRead;

/// Hands each line of `input` to `take`, until it ends; of one that is longer, so many bytes and one more, for it is none that was meant, and is not read into
/// memory whole.
pub(crate) fn take_lines(input: impl BufRead, longest: usize, mut take: impl FnMut(&str)) {
    let mut line = Vec::with_capacity(longest + 1);
    for byte in input.bytes() {
        let Ok(byte) = byte else { break };
        if byte == b'\n' {
            take(&String::from_utf8_lossy(&line));
            line.clear();
        } else if line.len() <= longest {
            line.push(byte);
        }
    }
    take(&String::from_utf8_lossy(&line));
}

/// One line of `input`, without its end and of `longest` bytes and one more at most; nothing where `input` has ended.
/// What follows the line is not read.
///
/// # Errors
/// If it cannot be read, or is no text.
pub(crate) fn read_line(input: impl BufRead, longest: usize) -> std::io::Result<Option<String>> {
    let mut line = Vec::new();
    let read = input
        .take(longest as u64 + 1)
        .read_until(b'\n', &mut line)?;
    if line.ends_with(b"\n") {
        line.pop();
    }
    let line = String::from_utf8(line).map_err(|_| std::io::Error::other("it is no text"))?;
    Ok((read > 0).then_some(line))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_line_is_read_and_the_ones_after_it_are_left() {
        let mut input = &b"the link\nm\nq"[..];
        let mut line = |longest| read_line(&mut input, longest).expect("text");
        assert_eq!(line(8).as_deref(), Some("the link"));
        assert_eq!(line(8).as_deref(), Some("m"));
        assert_eq!(line(8).as_deref(), Some("q"), "the last one has no end");
        assert_eq!(line(8), None);
        let long = read_line(&mut &b"longer than that"[..], 4);
        assert_eq!(long.expect("text").as_deref(), Some("longe"));
        assert!(read_line(&mut &b"\xff\n"[..], 4).is_err());
    }

    #[test]
    fn lines_are_taken_whole_or_cut_and_the_last_without_its_end() {
        let mut taken = Vec::new();
        let input = &b"one\n\nmuch too long\n\xffx\nlast"[..];
        take_lines(input, 4, |line| taken.push(line.to_owned()));
        assert_eq!(taken, ["one", "", "much ", "\u{fffd}x", "last"]);
    }
}
