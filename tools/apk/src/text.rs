//! XML as it is written by people: parsing it within bounds, and the escapes of Android's strings.

use roxmltree::{Document, Node, ParsingOptions};

use crate::ApkError;
use crate::small::MAX_BYTES;

/// Elements lie no deeper in one another, because they are walked by recursion.
const MAX_DEPTH: usize = 64;

/// The namespace of the attributes that Android defines.
pub(crate) const ANDROID: &str = "http://schemas.android.com/apk/res/android";

/// A parsed file, and its name for errors.
#[derive(Debug)]
pub(crate) struct Xml<'a> {
    pub(crate) file: &'a str,
    pub(crate) document: Document<'a>,
}

impl<'a> Xml<'a> {
    pub(crate) fn parse(file: &'a str, text: &'a str) -> Result<Self, ApkError> {
        let wrong = |line: u32, why: String| ApkError::Xml {
            file: file.to_owned(),
            line,
            why,
        };
        if text.len() > MAX_BYTES {
            return Err(wrong(
                1,
                format!(
                    "is {} bytes long, and no more than {MAX_BYTES} are read",
                    text.len()
                ),
            ));
        }
        let options = ParsingOptions {
            nodes_limit: 100_000,
            ..ParsingOptions::default()
        };
        let document = Document::parse_with_options(text, options)
            .map_err(|error| wrong(error.pos().row, error.to_string()))?;
        let xml = Self { file, document };
        let deep = xml.document.descendants().find(|node| {
            node.is_element() && node.ancestors().take(MAX_DEPTH + 2).count() > MAX_DEPTH + 1
        });
        match deep {
            Some(node) => Err(xml.error(
                node,
                format!("elements lie more than {MAX_DEPTH} deep in one another"),
            )),
            None => Ok(xml),
        }
    }

    /// The line on which the node begins.
    pub(crate) fn line(&self, node: Node<'_, '_>) -> u32 {
        self.document.text_pos_at(node.range().start).row
    }

    pub(crate) fn error(&self, node: Node<'_, '_>, why: impl Into<String>) -> ApkError {
        ApkError::Xml {
            file: self.file.to_owned(),
            line: self.line(node),
            why: why.into(),
        }
    }
}

/// What stands for characters in Android's strings: `\n`, `\t`, `\'`, `\"`, `\\`, `\@`, `\?`, `\#`, `\uXXXX`.
pub(crate) fn unescape(text: &str) -> Result<String, String> {
    let mut out = String::with_capacity(text.len());
    let mut rest = text.chars();
    while let Some(one) = rest.next() {
        if one == '\\' {
            out.push(escaped(&mut rest)?);
        } else {
            out.push(one);
        }
    }
    Ok(out)
}

/// A string resource's text: blanks run together unless they are between double quotes.
pub(crate) fn string_resource(text: &str) -> Result<String, String> {
    let mut out = String::with_capacity(text.len());
    let (mut quoted, mut blank) = (false, false);
    let mut rest = text.trim_matches([' ', '\t', '\r', '\n']).chars();
    while let Some(one) = rest.next() {
        if !quoted && matches!(one, ' ' | '\t' | '\r' | '\n') {
            blank = true;
            continue;
        }
        if blank {
            out.push(' ');
            blank = false;
        }
        match one {
            '"' => quoted = !quoted,
            '\'' if !quoted => return Err(r"an apostrophe is written \'".into()),
            '\\' => out.push(escaped(&mut rest)?),
            one => out.push(one),
        }
    }
    if quoted {
        return Err(r#"a double quote is not closed; one that is meant is written \""#.into());
    }
    Ok(out)
}

fn escaped(rest: &mut std::str::Chars<'_>) -> Result<char, String> {
    match rest.next() {
        Some('n') => Ok('\n'),
        Some('t') => Ok('\t'),
        Some(same @ ('\'' | '"' | '\\' | '@' | '?' | '#')) => Ok(same),
        Some('u') => {
            let hex: String = rest.take(4).collect();
            u32::from_str_radix(&hex, 16)
                .ok()
                .filter(|_| hex.len() == 4 && !hex.starts_with('+'))
                .and_then(char::from_u32)
                .ok_or_else(|| format!(r"\u{hex} is not a character"))
        }
        Some(other) => Err(format!(
            r"\{other} stands for nothing; a backslash is written \\"
        )),
        None => Err(r"a backslash is written \\".into()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn strings_follow_androids_rules_of_blanks_quotes_and_escapes() {
        for (text, want) in [
            ("  a \n\t b ", "a b"),
            (r#"" a  b ""#, " a  b "),
            (r"a\nb\tc\\d\@e\?f", "a\nb\tc\\d@e?f"),
            (r"\u00e4\u20AC", "ä€"),
            (r#"it\'s "it's" \""#, "it's it's \""),
            ("", ""),
        ] {
            assert_eq!(string_resource(text).as_deref(), Ok(want), "{text}");
        }
        for text in [
            "it's", r"a\", r"\q", r"\u12", r"\ud800", r"\u+123", "\"open",
        ] {
            assert!(string_resource(text).is_err(), "{text}");
        }
    }

    #[test]
    fn hostile_texts_are_refused_by_line() {
        let deep = format!("{}{}", "<a>".repeat(65), "</a>".repeat(65));
        let laughs = "<!DOCTYPE a [<!ENTITY b \"bbbb\">]>\n<a>&b;</a>";
        let huge = " ".repeat(MAX_BYTES + 1);
        for (text, why) in [
            (deep.as_str(), "deep"),
            (laughs, "DTD"),
            (huge.as_str(), "bytes long"),
            ("", "root"),
            ("<a", "root"),
            ("<a>\n<b></a>", "expected 'b' tag"),
            ("<a b='1' b='2'/>", "already defined"),
        ] {
            let error = Xml::parse("m.xml", text)
                .map(|_| ())
                .expect_err("this is no manifest")
                .to_string();
            assert!(
                error.starts_with("m.xml:") && error.contains(why),
                "{error} should speak of {why}"
            );
        }
        let many = format!("<a>{}</a>", "<b/>".repeat(100_001));
        assert!(
            Xml::parse("m.xml", &many).is_err(),
            "100001 elements are refused"
        );
    }
}
