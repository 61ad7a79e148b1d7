//! The panel that the headset shows while a setting is missing: short lines, and exactly what to type on the PC.

use crate::package::{COMPONENT, FILES_FOLDER, SETTINGS_FILE};
use crate::settings::{DEEP_LINK, Key, Problem};

/// Characters of a line that the panel has room for.
pub const WIDTH: usize = app_session::overlay::NOTICE_LETTERS as usize;

/// The lines to show when the app was launched with a missing or refused setting.
#[must_use]
pub fn lines(problems: &[Problem]) -> Vec<String> {
    let mut lines = Vec::new();
    let refused = problems
        .iter()
        .filter(|problem| !matches!(problem, Problem::Missing(_)));
    for problem in refused.clone() {
        wrap(&problem.to_string(), &mut lines);
        lines.push(String::new());
    }
    let missing = |key| problems.contains(&Problem::Missing(key));
    if missing(Key::Room) {
        lines.push("Mon3tr does not know yet which room to join.".to_owned());
        lines.push(String::new());
    }
    for key in [Key::Server, Key::Token] {
        if missing(key) {
            lines.push(format!("The room's {key} is missing."));
            lines.push(String::new());
        }
    }
    if refused.clone().next().is_some() {
        lines.push("Mend that, or start again with the viewers' link".to_owned());
    } else {
        lines.push("Start a call on the PC: it prints the viewers' link,".to_owned());
    }
    lines.push("https://HOST/rooms/ROOM#TOKEN. Then type on the PC:".to_owned());
    lines.push(String::new());
    lines.extend(start_command("LINK"));
    lines.push(String::new());
    lines.push("Or open in the headset's browser:".to_owned());
    lines.push(format!("  {DEEP_LINK}https/HOST/rooms/ROOM#TOKEN"));
    lines.push(String::new());
    lines.push(format!("Or put room = \"LINK\" into {SETTINGS_FILE}:"));
    lines.push(format!("  adb push {SETTINGS_FILE} \\"));
    lines.push(format!("    {FILES_FOLDER}/"));
    lines.push("To measure the demo person: --es profile 60".to_owned());
    lines
}

/// The lines to show where a call of several is opened, and there is no avatar `name` in the app's folder.
#[must_use]
pub fn without_avatar(name: &str) -> Vec<String> {
    let mut lines = wrapped(
        "The others see your avatar, and there is none on this headset yet. Make one on the PC (./run bake makes one to begin with), and \
         type there:",
    );
    lines.push(String::new());
    lines.push("  adb push me.m3a \\".to_owned());
    wrap(&format!("{FILES_FOLDER}/{name}"), &mut lines);
    lines.push(String::new());
    lines.extend(wrapped(
        "Then close Mon3tr and open the call's link again. Another file of that folder is taken with avatar = \"NAME.m3a\" in mon3tr.toml.",
    ));
    lines
}

/// The command that starts the app with a room, in lines that the panel has room for.
fn start_command(room: &str) -> [String; 3] {
    // -S: an app that runs already would not see the new extras.
    [
        "  adb shell am start -S \\".to_owned(),
        format!("    -n {COMPONENT} \\"),
        format!("    -e room '{room}'"),
    ]
}

/// A text in lines that the panel has room for.
#[must_use]
pub fn wrapped(text: &str) -> Vec<String> {
    let mut lines = Vec::new();
    wrap(text, &mut lines);
    lines
}

/// Breaks a text at blanks, and where there is none within a line.
fn wrap(text: &str, lines: &mut Vec<String>) {
    let mut line = String::new();
    for word in text.split(' ').filter(|word| !word.is_empty()) {
        let mut word = word;
        if !line.is_empty() && line.chars().count() + 1 + word.chars().count() > WIDTH {
            lines.push(std::mem::take(&mut line));
        }
        while let Some((at, _)) = word.char_indices().nth(WIDTH) {
            let (piece, rest) = word.split_at(at);
            lines.push(piece.to_owned());
            word = rest;
        }
        if !line.is_empty() {
            line.push(' ');
        }
        line.push_str(word);
    }
    if !line.is_empty() {
        lines.push(line);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::settings::{Origin, Sources, Task};
    use proptest::prelude::*;

    fn of(extras: &[(&str, &str)], link: Option<&str>, file: Option<&str>) -> Vec<String> {
        let sources = Sources::read(extras.iter().copied(), link, file);
        lines(&sources.settings().expect_err("something is wrong"))
    }

    #[test]
    fn the_first_run_says_what_to_type() {
        let shown = of(&[], None, None);
        assert_eq!(
            shown.join("\n"),
            "Mon3tr does not know yet which room to join.\n\
             \n\
             Start a call on the PC: it prints the viewers' link,\n\
             https://HOST/rooms/ROOM#TOKEN. Then type on the PC:\n\
             \n\
             \x20 adb shell am start -S \\\n\
             \x20   -n org.mon3tr.quest/android.app.NativeActivity \\\n\
             \x20   -e room 'LINK'\n\
             \n\
             Or open in the headset's browser:\n\
             \x20 mon3tr://room/https/HOST/rooms/ROOM#TOKEN\n\
             \n\
             Or put room = \"LINK\" into mon3tr.toml:\n\
             \x20 adb push mon3tr.toml \\\n\
             \x20   /sdcard/Android/data/org.mon3tr.quest/files/\n\
             To measure the demo person: --es profile 60",
            "all of it"
        );
    }

    #[test]
    fn the_command_shown_to_type_is_read_by_the_settings() {
        let room = "https://call.example/rooms/R7#TOKEN";
        let command = start_command(room).join("\n").replace("\\\n", " ");
        let mut words = command.split_whitespace();
        let given = words
            .rfind(|word| word.starts_with('\''))
            .map(|word| word.trim_matches('\''));
        assert_eq!(given, Some(room), "as it was given");
        let (room, typed) = ("room", given.unwrap_or_default());
        let link = of(&[], None, None);
        let link = link
            .iter()
            .find_map(|line| line.trim().strip_prefix("mon3tr://"));
        let link = format!(
            "mon3tr://{}",
            link.expect("the link's form")
                .replace("HOST", "call.example")
        );
        let file = format!("room = \"{typed}\"");
        for (extras, link, file) in [
            (vec![(room, typed)], None, None),
            (vec![], Some(link.as_str()), None),
            (vec![], None, Some(file.as_str())),
            (vec![("profile", "60")], None, None),
        ] {
            let task = Sources::read(extras.iter().copied(), link, file).settings();
            let task = task.expect("as the panel says").task;
            if let Task::Call(rooms) = task {
                assert_eq!(
                    rooms.value[0].server().to_string(),
                    "https://call.example",
                    "its server"
                );
            }
        }
    }

    #[test]
    fn who_has_no_avatar_reads_where_to_put_it_within_the_panel() {
        let long = format!("{}.m3a", "x".repeat(60));
        for name in ["avatar.m3a", &long] {
            let shown = without_avatar(name);
            for line in &shown {
                assert!(line.chars().count() <= WIDTH, "{line}");
            }
            let place = format!("{FILES_FOLDER}/{name}");
            assert!(shown.concat().contains(&place), "{shown:?}");
        }
    }

    #[test]
    fn problems_come_first_and_no_token_is_shown() {
        let shown = of(
            &[("server", "https://h"), ("room", "R")],
            None,
            Some("token = \"s3cret\"\nrat = 90\n"),
        );
        let text = shown.join("\n");
        assert!(
            text.starts_with("`rat` in mon3tr.toml is no setting"),
            "{text}"
        );
        assert!(text.contains("The room's token is missing."), "{text}");
        assert!(!text.contains("s3cret"), "{text}");
    }

    proptest! {
        #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::default() })]

        #[test]
        fn every_line_has_room_on_the_panel(why in "[ -~]{0,300}", key in 0..Key::ALL.len()) {
            let problem = Problem::Value { key: Key::ALL[key], origin: Origin::Intent, why: why.clone() };
            let shown = lines(&[problem.clone(), Problem::Missing(Key::Room)]);
            for line in &shown {
                prop_assert!(line.chars().count() <= WIDTH, "{line}");
            }
            let end = shown.iter().position(String::is_empty).unwrap_or(shown.len());
            let squeezed = |text: &str| text.replace(' ', "");
            prop_assert_eq!(squeezed(&shown[..end].concat()), squeezed(&problem.to_string()), "nothing is left out");
        }
    }
}
