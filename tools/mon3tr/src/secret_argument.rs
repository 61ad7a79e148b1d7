//! Links and tokens on the command line, kept from other users of the machine: they may be given by standard input or a
//! file, those that were typed are overwritten where the system lists them, and no error repeats one.

use crate::terminal::is_unprintable;
use crate::typed::read_line;
use anyhow::{Context, bail};
use clap::ArgMatches;
use clap::error::{ContextKind, ErrorKind};
use link_protocol::ProtocolError;
use link_protocol::limits::MAX_LINK;
use std::convert::Infallible;
use std::fmt;
use std::io::{IsTerminal, Read};
use std::path::Path;
use std::str::FromStr;

/// Characters that a piece of an argument has at least to be taken for a token: the shortest token has more, few other
/// arguments have as many without a slash.
const TOKEN: usize = 48;

/// Characters of a secret at least: what is shorter, such as the 1 of `#1`, is no secret and may be part of any word.
const SHORTEST: usize = 4;

/// What an error has in the place of a secret.
const HIDDEN: &str = "[not repeated]";

/// A link or a token: itself, `-` for a line of standard input, or `@FILE` for the first line of a file. The command
/// line's parser takes any text for one, for it repeats what it refuses.
#[derive(Clone)]
pub struct SecretArgument(String);

impl FromStr for SecretArgument {
    type Err = Infallible;

    fn from_str(text: &str) -> Result<Self, Infallible> {
        Ok(Self(text.to_owned()))
    }
}

impl fmt::Debug for SecretArgument {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("...")
    }
}

impl SecretArgument {
    /// The text that was given, or that is where it says. `what` names it at a terminal and in errors.
    ///
    /// # Errors
    /// If the file cannot be read, or other users can read it; if there is nothing.
    pub fn read(&self, what: &str) -> anyhow::Result<String> {
        let text = match (self.0.as_str(), self.0.strip_prefix('@')) {
            ("-", _) => from_input(what)?,
            (_, Some(file)) => from_file(Path::new(file))
                .with_context(|| format!("the {what} cannot be read from a file"))?,
            (text, None) => text.trim().to_owned(),
        };
        if text.is_empty() {
            bail!("the {what} is empty");
        }
        Ok(text)
    }

    /// [`Self::read`] as a link or a token.
    ///
    /// # Errors
    /// As there, and if it is none.
    pub fn parse<T: FromStr<Err = ProtocolError>>(&self, what: &str) -> anyhow::Result<T> {
        Ok(self.read(what)?.parse()?)
    }

    /// The secret, where it was given by itself.
    fn typed(&self) -> Option<&str> {
        let is_elsewhere = self.0 == "-" || self.0.starts_with('@');
        (!is_elsewhere).then_some(&self.0)
    }
}

/// A line of standard input, which is asked for where that is a terminal. What follows it is left for the command.
fn from_input(what: &str) -> anyhow::Result<String> {
    let input = std::io::stdin();
    if input.is_terminal() {
        eprintln!("{what}:");
    }
    let line = read_line(input.lock(), MAX_LINK);
    let line = line.with_context(|| format!("cannot read the {what} from standard input"))?;
    Ok(line.unwrap_or_default().trim().to_owned())
}

/// The first line of `file`, which other users cannot read.
pub(crate) fn from_file(file: &Path) -> anyhow::Result<String> {
    let opened = identity::open_private(file)?;
    let mut text = String::new();
    // A longer one is refused by what it is parsed as.
    let longest = MAX_LINK as u64 + 1;
    let read = opened.take(longest).read_to_string(&mut text);
    read.with_context(|| format!("cannot read {}", file.display()))?;
    let first = text.lines().next().unwrap_or_default();
    Ok(first.trim().to_owned())
}

/// Overwrites, in the command line that every user of the machine can read, all secrets that were typed there. The
/// arguments of `matches` are copies.
pub(crate) fn hide(matches: &ArgMatches) {
    let mut typed = Vec::new();
    let mut at = Some(matches);
    while let Some(matches) = at {
        for id in matches.ids() {
            let given = matches.try_get_many::<SecretArgument>(id.as_str());
            let given = given.ok().flatten().into_iter().flatten();
            typed.extend(given.filter_map(SecretArgument::typed));
        }
        at = matches.subcommand().map(|(_, matches)| matches);
    }
    if typed.is_empty() {
        return;
    }
    #[cfg(target_os = "linux")]
    if let Err(error) = overwrite(&typed) {
        eprintln!(
            "warning: other users of this machine can read the link or token in the list of processes ({error}): give - or @FILE in its place"
        );
    }
}

/// Overwrites the arguments that are one of `secrets`, or end with `=` and one, where `/proc/PID/cmdline` has them: in
/// this process's own memory.
#[cfg(target_os = "linux")]
fn overwrite(secrets: &[&str]) -> std::io::Result<()> {
    use std::os::unix::fs::FileExt;
    let stat = std::fs::read("/proc/self/stat")?;
    // proc_pid_stat(5): fields 48 and 49 are arg_start and arg_end. The second one, the program's name in brackets, may
    // have blanks.
    let stat = String::from_utf8_lossy(&stat);
    let fields = stat.rsplit_once(')').map_or("", |(_, fields)| fields);
    let mut bounds = fields.split_whitespace().skip(45).map(str::parse::<u64>);
    let (Some(Ok(begin)), Some(Ok(end))) = (bounds.next(), bounds.next()) else {
        return Err(std::io::Error::other("/proc/self/stat has no arg_start"));
    };
    let length = usize::try_from(end.saturating_sub(begin)).map_err(std::io::Error::other)?;
    let memory = std::fs::File::options();
    let memory = { memory }.read(true).write(true).open("/proc/self/mem")?;
    let mut arguments = vec![0; length];
    memory.read_exact_at(&mut arguments, begin)?;
    for range in places(&arguments, secrets) {
        memory.write_all_at(&vec![b'*'; range.len()], begin + range.start as u64)?;
    }
    Ok(())
}

/// Where `secrets` are among arguments that each end with a zero byte.
#[cfg(target_os = "linux")]
fn places(arguments: &[u8], secrets: &[&str]) -> Vec<std::ops::Range<usize>> {
    let (mut places, mut begin) = (Vec::new(), 0);
    for argument in arguments.split(|byte| *byte == 0) {
        let end = begin + argument.len();
        let held = secrets.iter().filter(|secret| {
            let before = argument.strip_suffix(secret.as_bytes());
            before.is_some_and(|before| before.is_empty() || before.ends_with(b"="))
        });
        places.extend(held.map(|secret| end - secret.len()..end));
        begin = end + 1;
    }
    places
}

/// What to print where the command line is refused, and the parser's own text may repeat a secret or steer the
/// terminal; nothing if it does neither.
pub(crate) fn refusal(error: &clap::Error, arguments: &[String]) -> Option<String> {
    let text = error.render().to_string();
    let secrets: Vec<&str> = (arguments.iter())
        .filter_map(|it| secret_part(it))
        .collect();
    if secrets.is_empty() {
        let steers = arguments.iter().any(|it| it.contains(is_unprintable));
        return steers.then_some(text);
    }
    if secrets.iter().any(|it| it.contains(is_unprintable)) {
        // It may not stand in the text as it was typed.
        return Some(without_values(error));
    }
    let hidden = |text: String, secret: &&str| text.replace(secret, HIDDEN);
    Some(secrets.iter().fold(text, hidden))
}

/// What is wrong, and with which option, without what was typed.
fn without_values(error: &clap::Error) -> String {
    let is_typed = matches!(
        error.kind(),
        ErrorKind::UnknownArgument | ErrorKind::InvalidSubcommand
    );
    let option = error.get(ContextKind::InvalidArg).filter(|_| !is_typed);
    let option = option.map_or_else(String::new, |option| format!(" for {option}"));
    format!(
        "error: {}{option}; what was typed is not repeated, for it may have a link or a token in it\n\nFor more information, try '--help'.\n",
        error.kind()
    )
}

/// The part of an argument that may be secret: of a link what follows the `#`, and all of what has a secret in another
/// place.
fn secret_part(argument: &str) -> Option<&str> {
    let value = match argument.split_once('=') {
        Some((_, value)) if argument.starts_with('-') => value,
        _ => argument,
    };
    let (address, rest) = value.split_once('#').unzip();
    let part = match (address.unwrap_or(value), rest) {
        (address, _) if has_secret(address) => value,
        (_, Some(rest)) => rest,
        (address, None) if ["/rooms/", "/calls/"].iter().any(|it| address.contains(it)) => value,
        _ => return None,
    };
    (part.len() >= SHORTEST).then_some(part)
}

/// Whether what should be a link's address, without a secret, has what follows the `#` of one.
fn has_secret(address: &str) -> bool {
    // A name and a password may stand before an address's host.
    let has_user = address.contains("://") && address.contains('@');
    let has_part = ["key=", "secret=", "guest="]
        .iter()
        .any(|it| address.contains(it));
    let of_token =
        |character: char| character.is_ascii_alphanumeric() || "-._~+".contains(character);
    has_user
        || has_part
        || address
            .split(|it| !of_token(it))
            .any(|piece| piece.len() >= TOKEN)
}

#[cfg(test)]
mod tests {
    use super::*;
    use clap::{CommandFactory, FromArgMatches, Parser};

    const TOKEN: &str = "AgTq0J3mZ5vX8rLw2nB7yKcD4fH6sA1eGuIoPpQhRtYbNjMk9WxVzCdEl";

    #[derive(Parser)]
    struct Arguments {
        link: SecretArgument,
        #[arg(long)]
        token: Option<SecretArgument>,
        #[arg(long, value_parser = clap::value_parser!(u8))]
        number: Option<u8>,
    }

    fn parse(arguments: &[&str]) -> Result<ArgMatches, clap::Error> {
        Arguments::command().try_get_matches_from([&["program"], arguments].concat())
    }

    fn refused(arguments: &[&str]) -> String {
        let error = parse(arguments).expect_err("it is refused");
        let arguments: Vec<String> = arguments.iter().map(|&it| it.to_owned()).collect();
        refusal(&error, &arguments).unwrap_or_else(|| error.render().to_string())
    }

    #[test]
    fn the_parser_takes_any_text_for_a_secret_and_no_refusal_repeats_one() {
        let secret = "xB4fQm8ZpLr2VtYw7NcKjA";
        let rest = format!("{TOKEN}:key=k7qf2mxd3paahjwabcdefgh234:secret={secret}");
        let links = [
            format!("http://h/rooms/r#{rest}"),
            format!("http://h/room/r#{rest}"),
            format!("http://h/rooms/r%23{rest}"),
            format!("http://h/rooms/r\u{ff03}{rest}"),
            format!("http://h/rooms/r {rest}"),
            format!("{rest}#http://h/rooms/r"),
            format!("http://h/rooms/r#{TOKEN}\x1b[31m:secret={secret}\x1b[0m"),
            format!("http://h/rooms/r#{rest}:secret={secret}"),
            rest.clone(),
            TOKEN.to_owned(),
        ];
        for link in &links {
            assert!(parse(&[link]).is_ok(), "{link}");
            for (arguments, word) in [
                (vec!["a", link], "unexpected argument"),
                (vec![link, link], "unexpected argument"),
                (vec!["a", "--number", link], "invalid value"),
                (vec!["a", "--numbers", link], "unexpected argument"),
            ] {
                let text = refused(&arguments);
                assert!(text.contains(word), "{arguments:?}: {text}");
                for part in [TOKEN, secret, &TOKEN[..20], &secret[..12]] {
                    assert!(!text.contains(part), "{arguments:?}: {text}");
                }
            }
            let text = refused(&[link, "--number", "many"]);
            assert!(text.contains("--number"), "the option is named: {text}");
        }
        let plain = refused(&["a", "--number", "many"]);
        assert!(
            plain.contains("'many'"),
            "other values are repeated: {plain}"
        );
    }

    #[cfg(target_os = "linux")]
    #[test]
    fn only_whole_arguments_and_values_are_overwritten() {
        let arguments = b"program\0abc\0--token=abc\0xabc\0abcd\0\0abc";
        let found = places(arguments, &["abc"]);
        assert_eq!(found, [8..11, 20..23, 35..38]);
    }

    #[test]
    fn a_secret_is_read_from_a_file_that_others_cannot_read() {
        let folder = tempfile::tempdir().expect("a folder");
        let file = folder.path().join("link");
        let given = format!("@{}", file.display());
        let matches = parse(&[&given, "--token", TOKEN]).expect("arguments");
        let arguments = Arguments::from_arg_matches(&matches).expect("arguments");
        assert!(arguments.number.is_none());
        let token = arguments.token.expect("given");
        assert_eq!(token.read("token").expect("itself"), TOKEN);
        assert_eq!(token.typed(), Some(TOKEN));
        assert_eq!(format!("{token:?}"), "...");
        let link = arguments.link;
        assert_eq!(link.typed(), None, "a file's name is no secret");
        assert!(link.read("link").is_err(), "there is no such file");
        std::fs::write(&file, "  the link \nmore\n").expect("written");
        #[cfg(unix)]
        {
            use std::os::unix::fs::PermissionsExt;
            let set = |mode| {
                let mode = std::fs::Permissions::from_mode(mode);
                std::fs::set_permissions(&file, mode).expect("its owner's");
            };
            for mode in [0o644, 0o640, 0o604, 0o622] {
                set(mode);
                let why = format!("{:#}", link.read("link").expect_err("others can"));
                assert!(why.contains("chmod 600"), "{mode:o}: {why}");
            }
            set(0o600);
        }
        assert_eq!(link.read("link").expect("the first line"), "the link");
        std::fs::write(&file, "\n").expect("written");
        assert!(link.read("link").is_err(), "there is nothing in it");
    }
}
