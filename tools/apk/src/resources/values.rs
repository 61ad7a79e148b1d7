//! `values/*.xml`: strings, colours, booleans and integers.

use std::path::Path;

use roxmltree::Node;

use super::folder::check_name;
use crate::ApkError;
use crate::binary_xml::{BOOLEAN, COLOR, INTEGER, Resolve, Value, parse_plain, reference};
use crate::text::{Xml, string_resource};

/// What `<string>` and its like say, before references in it are resolved.
#[derive(Clone, Debug)]
pub(crate) struct Said {
    pub(crate) kind: &'static str,
    pub(crate) name: String,
    file: String,
    line: u32,
    text: String,
}

impl Said {
    /// What it means.
    pub(crate) fn value(&self, resolve: &Resolve<'_>) -> Result<Value, ApkError> {
        let value = match reference(&self.text, resolve) {
            Ok(Some(other)) => Ok(Value::Typed(other)),
            Ok(None) if self.kind == "string" => string_resource(&self.text).map(Value::Text),
            Ok(None) => parse_plain(&self.text, formats(self.kind)),
            Err(why) => Err(why),
        };
        value.map_err(|why| ApkError::Xml {
            file: self.file.clone(),
            line: self.line,
            why: format!("{} {}: {why}", self.kind, self.name),
        })
    }
}

/// What kinds of value a type holds.
fn formats(kind: &str) -> u8 {
    match kind {
        "color" => COLOR,
        "bool" => BOOLEAN,
        _ => INTEGER,
    }
}

/// The file's values, in its order.
pub(crate) fn read(path: &Path, text: &str) -> Result<Vec<Said>, ApkError> {
    let file = path.display().to_string();
    let xml = Xml::parse(&file, text)?;
    let root = xml.document.root_element();
    if !root.has_tag_name("resources") {
        return Err(xml.error(root, "a file of values has <resources> as its root"));
    }
    root.children()
        .filter(|node| {
            node.is_element()
                || node
                    .text()
                    .is_some_and(|text| node.is_text() && !text.trim().is_empty())
        })
        .map(|node| said(&xml, node))
        .collect()
}

fn said(xml: &Xml<'_>, node: Node<'_, '_>) -> Result<Said, ApkError> {
    let tag = node.tag_name().name();
    let Some(kind) = ["string", "color", "bool", "integer"]
        .into_iter()
        .find(|kind| *kind == tag)
    else {
        return Err(xml.error(node, format!("<{tag}> is none of the values that this packager knows: string, color, bool, integer")));
    };
    let name = node
        .attribute("name")
        .ok_or_else(|| xml.error(node, format!("<{kind}> has no name")))?;
    check_name(name).map_err(|why| xml.error(node, why))?;
    if let Some(other) = node
        .attributes()
        .find(|one| !["name", "translatable", "formatted"].contains(&one.name()))
    {
        return Err(xml.error(
            node,
            format!(
                "<{kind}> {name} has an attribute that this packager does not know: {}",
                other.name()
            ),
        ));
    }
    if let Some(child) = node.children().find(Node::is_element) {
        return Err(xml.error(
            child,
            format!("<{kind}> {name} is styled, and this packager writes plain text"),
        ));
    }
    let text = node
        .children()
        .filter(Node::is_text)
        .filter_map(|part| part.text())
        .collect();
    Ok(Said {
        kind,
        name: name.to_owned(),
        file: xml.file.to_owned(),
        line: xml.line(node),
        text,
    })
}
