//! The settings of one source: unparsed texts, by setting.

use super::{Destination, Key, Origin, Problem, plain, read_deep_link};
use std::collections::BTreeMap;
use std::fmt;
use toml::Value;

/// The longest `mon3tr.toml`.
pub(crate) const LONGEST_FILE: usize = 262_144;

/// Texts by setting. [`Debug`] shows their source, not their values.
#[derive(Clone, PartialEq, Eq)]
pub struct Given {
    origin: Origin,
    texts: BTreeMap<Key, String>,
}

impl fmt::Debug for Given {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{:?} gives {:?}", self.origin, self.texts.keys())
    }
}

impl Given {
    /// The settings in the intent's extras. Launchers and the system add extras of their own: what is no setting is logged.
    #[must_use]
    pub fn by_intent<'a>(extras: impl IntoIterator<Item = (&'a str, &'a str)>) -> Self {
        let mut texts = BTreeMap::new();
        for (name, text) in extras {
            match Key::named(name) {
                Some(key) => {
                    texts.insert(key, text.to_owned());
                }
                None => log::warn!(
                    "the intent's extra {} is no setting: there are {}",
                    plain::repeated(name),
                    Key::names()
                ),
            }
        }
        Self {
            origin: Origin::Intent,
            texts,
        }
    }

    /// The settings in the link that the app was opened with: a room, or a call of several.
    ///
    /// # Errors
    /// Those of [`read_deep_link`].
    pub fn by_link(text: &str) -> Result<Self, Problem> {
        let said = match read_deep_link(text)? {
            Destination::Room(room) => (Key::Room, room.to_string()),
            Destination::Call(call) => (Key::Call, call.to_string()),
        };
        Ok(Self {
            origin: Origin::Link,
            texts: BTreeMap::from([said]),
        })
    }

    /// The settings in `mon3tr.toml`: `key = value`, a value being a text, a whole number, true or false, or, for `room`, a list of texts.
    ///
    /// # Errors
    /// Every error of the file's form.
    pub fn by_file(text: &str) -> Result<Self, Vec<Problem>> {
        let origin = Origin::File;
        let unreadable = |why| vec![Problem::Unreadable { origin, why }];
        if text.len() > LONGEST_FILE {
            return Err(unreadable(format!(
                "it is longer than {LONGEST_FILE} bytes"
            )));
        }
        // Not the whole error: it shows the line, which may be a token's.
        let table: toml::Table = text.parse().map_err(|error: toml::de::Error| {
            let before = error.span().and_then(|span| text.get(..span.start));
            let line = before.map_or(1, |before| before.matches('\n').count() + 1);
            unreadable(format!(
                "line {line} is not TOML (settings look like: room = \"R7\")"
            ))
        })?;
        let (mut texts, mut problems) = (BTreeMap::new(), Vec::new());
        for (name, value) in table {
            let Some(key) = Key::named(&name) else {
                problems.push(Problem::Unknown {
                    name: plain::repeated(&name),
                    origin,
                });
                continue;
            };
            match text_of(key, value) {
                Ok(text) => {
                    texts.insert(key, text);
                }
                Err(why) => problems.push(Problem::Value { key, origin, why }),
            }
        }
        if problems.is_empty() {
            Ok(Self { origin, texts })
        } else {
            Err(problems)
        }
    }

    /// Their source.
    #[must_use]
    pub fn origin(&self) -> Origin {
        self.origin
    }

    /// The text of a setting.
    pub(super) fn text(&self, key: Key) -> Option<&str> {
        self.texts.get(&key).map(String::as_str)
    }
}

fn text_of(key: Key, value: Value) -> Result<String, String> {
    match value {
        Value::String(text) => Ok(text),
        Value::Integer(number) => Ok(number.to_string()),
        Value::Boolean(answer) => Ok(answer.to_string()),
        Value::Array(items) if key == Key::Room => {
            let texts: Option<Vec<&str>> = items.iter().map(Value::as_str).collect();
            texts
                .map(|texts| texts.join(" "))
                .ok_or_else(|| "a list of rooms holds links in quotes".to_owned())
        }
        other => Err(format!(
            "it must be a text in quotes, a whole number, true or false, not a {}",
            other.type_str()
        )),
    }
}
