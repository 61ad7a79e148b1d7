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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_are_taken_whole_or_cut_and_the_last_without_its_end() {
        let mut taken = Vec::new();
        let input = &b"one\n\nmuch too long\n\xffx\nlast"[..];
        take_lines(input, 4, |line| taken.push(line.to_owned()));
        assert_eq!(taken, ["one", "", "much ", "\u{fffd}x", "last"]);
    }
}
