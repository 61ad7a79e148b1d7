//! Figures as words: short enough for their place whatever the value is, and a dash where there is none.

/// What stands where nothing is known.
pub(super) const NONE: &str = "\u{2013}";

/// A number with so many decimals while it is small; dashes for what is no number.
pub(super) fn number(value: Option<f64>, decimals: usize) -> String {
    let Some(value) = value.filter(|value| value.is_finite()) else {
        return NONE.to_owned();
    };
    let written = match value.abs() {
        0.0..100.0 => format!("{value:.decimals$}"),
        ..100_000.0 => format!("{value:.0}"),
        ..1e6 => format!("{:.0}k", value / 1e3),
        ..1e9 => format!("{:.0}M", value / 1e6),
        _ => "\u{221e}".to_owned(),
    };
    // Never "-0.0".
    let is_zero = written.chars().all(|c| matches!(c, '-' | '0' | '.'));
    match written.strip_prefix('-') {
        Some(zero) if is_zero => zero.to_owned(),
        _ => written,
    }
}

/// A count with a comma for thousands.
pub(super) fn count(value: Option<u64>) -> String {
    match value {
        None => NONE.to_owned(),
        Some(value @ ..1_000) => value.to_string(),
        Some(value @ ..1_000_000) => format!("{},{:03}", value / 1_000, value % 1_000),
        Some(value) => number(Some(value as f64), 0),
    }
}

/// `text` in `most` characters: cut, with an ellipsis for what is left out.
pub(super) fn cut(text: &str, most: usize) -> String {
    if text.chars().count() <= most {
        return text.to_owned();
    }
    let kept: String = text.chars().take(most.saturating_sub(1)).collect();
    format!("{}\u{2026}", kept.trim_end())
}
