//! Long texts, as lines that logcat takes whole.

/// Bytes of one line. Logcat cuts an entry at about 4,000, and readers at far less.
pub const LONGEST_LINE: usize = 1_000;

/// The lines of a text that are not blank, cut where they are too long.
pub fn lines(text: &str) -> impl Iterator<Item = &str> {
    text.lines()
        .filter(|line| !line.trim().is_empty())
        .flat_map(|line| {
            let mut rest = line;
            std::iter::from_fn(move || {
                let cut = rest.floor_char_boundary(LONGEST_LINE);
                let (piece, after) = rest.split_at(cut);
                rest = after;
                (!piece.is_empty()).then_some(piece)
            })
        })
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::default() })]

        #[test]
        fn no_character_is_lost_and_no_line_is_too_long(text in "(?s).{0,5000}") {
            let cut: Vec<&str> = lines(&text).collect();
            prop_assert!(cut.iter().all(|line| (1..=LONGEST_LINE).contains(&line.len())), "bounds");
            let kept: String = text.lines().filter(|line| !line.trim().is_empty()).collect();
            prop_assert_eq!(cut.concat(), kept, "all of it");
        }
    }
}
