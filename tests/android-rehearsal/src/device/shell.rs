//! The little of Android's shell that programs which talk to a headset use: commands one after another, quotes, and the options of `am start`.

use android_rehearsal::protocol::{Extra, Intent};
use anyhow::{Context, bail, ensure};

/// A word of a command, without its quotes.
pub(super) type Word = String;

/// The commands of a line, each as its words.
pub(super) fn commands(line: &str) -> anyhow::Result<Vec<Vec<Word>>> {
    let mut commands = vec![Vec::new()];
    let mut word: Option<String> = None;
    let mut quote: Option<char> = None;
    let end = |word: &mut Option<String>, commands: &mut Vec<Vec<Word>>| {
        if let (Some(word), Some(command)) = (word.take(), commands.last_mut()) {
            command.push(word);
        }
    };
    for one in line.chars() {
        match (quote, one) {
            (Some(open), _) if one == open => quote = None,
            (None, '\'' | '"') => {
                quote = Some(one);
                word.get_or_insert_default();
            }
            (None, ' ' | '\t') => end(&mut word, &mut commands),
            (None, ';') => {
                end(&mut word, &mut commands);
                commands.push(Vec::new());
            }
            (None, '$' | '`' | '|' | '&' | '>' | '<' | '\\') => {
                bail!("the rehearsal's shell knows no {one}: {line}")
            }
            _ => word.get_or_insert_default().push(one),
        }
    }
    ensure!(quote.is_none(), "a quote is open: {line}");
    end(&mut word, &mut commands);
    Ok(commands)
}

/// What `am start` is asked for.
#[derive(Debug, Default)]
pub(super) struct Start {
    /// The app is stopped before (`-S`).
    pub(super) stops_first: bool,
    /// With what it starts.
    pub(super) intent: Intent,
}

/// Of its options.
pub(super) fn start(options: &[&str]) -> anyhow::Result<Start> {
    let mut start = Start::default();
    let mut rest = options.iter();
    let mut next = |what: &str| {
        let next = rest.next().copied();
        next.with_context(|| format!("{what} is missing"))
    };
    while let Ok(option) = next("an option") {
        match option {
            "-S" => start.stops_first = true,
            "-n" | "-a" => {
                next("the value of -n or -a")?;
            }
            "-d" => start.intent.data = Some(next("the value of -d")?.to_owned()),
            "-e" | "--es" | "--ei" | "--ez" => {
                let (name, value) = (next("an extra's name")?, next("an extra's value")?);
                let value = match option {
                    "--ei" => Extra::Integer(value.parse().context("no whole number")?),
                    "--ez" => Extra::Boolean(value == "true"),
                    _ => Extra::Text(value.to_owned()),
                };
                start.intent.extras.push((name.to_owned(), value));
            }
            other => bail!("the rehearsal knows no am start {other}"),
        }
    }
    Ok(start)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_line_is_taken_apart_as_a_shell_would() {
        let found = commands("am force-stop a.b; rm -f '/x y/z'  \"\"").expect("commands");
        assert_eq!(
            found,
            [
                vec!["am", "force-stop", "a.b"],
                vec!["rm", "-f", "/x y/z", ""]
            ]
        );
        assert!(commands("cat $HOME").is_err(), "variables are not known");
        assert!(commands("cat 'a").is_err(), "the quote is open");
    }

    #[test]
    fn an_intent_is_made_of_the_options_of_am_start() {
        let words = [
            "-S",
            "-n",
            "a/b",
            "-d",
            "mon3tr://x#y",
            "--es",
            "profile",
            "5",
        ];
        let start = start(&words).expect("a start");
        assert!(start.stops_first, "-S");
        assert_eq!(start.intent.data.as_deref(), Some("mon3tr://x#y"));
        assert_eq!(start.intent.extras.len(), 1, "{:?}", start.intent);
        assert!(super::start(&["--es", "profile"]).is_err(), "no value");
        assert!(super::start(&["-W"]).is_err(), "not known");
    }
}
