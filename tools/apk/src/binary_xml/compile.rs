//! A document's chunks: strings, the numbers of its attributes, elements in the order of the text.

use std::collections::BTreeMap;

use roxmltree::{Attribute as Written, Node};

use super::attribute::{Attribute, attribute};
use super::value::{Resolve, Typed, Value};
use crate::ApkError;
use crate::chunk::{chunk, kind, short, words};
use crate::string_pool::{Encoding, StringPool};
use crate::text::{ANDROID, Xml, unescape};

/// No string.
const NONE: u32 = u32::MAX;
/// What an element's place for attributes may count.
const MAX_ATTRIBUTES: usize = 1000;

/// Names and strings that stand as `<meta-data>` in `<application>` besides what the text says.
type Metadata<'a> = &'a [(String, String)];

/// The document in binary. References are resolved by `resolve`.
pub(crate) fn compile(
    xml: &Xml<'_>,
    resolve: &Resolve<'_>,
    metadata: Metadata<'_>,
    encoding: Encoding,
) -> Result<Vec<u8>, ApkError> {
    let root = xml.document.root_element();
    let names = attribute_names(xml, metadata)?;
    let mut strings = StringPool::default();
    let mut indices = BTreeMap::new();
    for (id, name) in &names {
        indices.insert(*id, strings.add_apart(name));
    }
    let prefix = strings.add(root.lookup_prefix(ANDROID).unwrap_or("android"));
    let uri = strings.add(ANDROID);
    let line = xml.line(root);
    let mut writer = Writer {
        xml,
        resolve,
        metadata,
        indices,
        uri,
        strings,
        nodes: Vec::new(),
    };
    let namespace = [prefix, uri];
    writer.node(kind::XML_START_NAMESPACE, line, &words(namespace));
    writer.element(root)?;
    writer.node(kind::XML_END_NAMESPACE, line, &words(namespace));

    let mut body = writer.strings.encode(encoding);
    body.extend(chunk(
        kind::XML_RESOURCE_MAP,
        &[],
        &words(names.into_keys()),
    ));
    body.extend(writer.nodes);
    Ok(chunk(kind::XML, &[], &body))
}

/// Every attribute of Android's that the document says, by number: so they come first among the strings, in the order in which
/// Android looks for them.
fn attribute_names(
    xml: &Xml<'_>,
    metadata: Metadata<'_>,
) -> Result<BTreeMap<u32, &'static str>, ApkError> {
    let mut names = BTreeMap::new();
    for node in xml.document.descendants().filter(Node::is_element) {
        for written in node.attributes() {
            if let Some(known) = known(xml, node, &written)? {
                names.insert(known.id, known.name);
            }
        }
    }
    if !metadata.is_empty() {
        for known in ["name", "value"].into_iter().filter_map(attribute) {
            names.insert(known.id, known.name);
        }
    }
    Ok(names)
}

/// What Android knows the attribute as; nothing for one without a namespace, which is a plain string.
fn known(
    xml: &Xml<'_>,
    node: Node<'_, '_>,
    written: &Written<'_, '_>,
) -> Result<Option<&'static Attribute>, ApkError> {
    let at = |why: String| attribute_error(xml, node, written, &why);
    match written.namespace() {
        None => Ok(None),
        Some(ANDROID) => attribute(written.name())
            .map(Some)
            .ok_or_else(|| at("is not an attribute that this packager knows; those it knows are in tools/apk/src/binary_xml/table.rs".into())),
        Some(other) => Err(at(format!("is of the namespace {other}, and a package has only {ANDROID}"))),
    }
}

fn attribute_error(
    xml: &Xml<'_>,
    node: Node<'_, '_>,
    written: &Written<'_, '_>,
    why: &str,
) -> ApkError {
    let prefix = written
        .namespace()
        .and_then(|namespace| node.lookup_prefix(namespace))
        .map_or(String::new(), |prefix| format!("{prefix}:"));
    ApkError::Xml {
        file: xml.file.to_owned(),
        line: xml.document.text_pos_at(written.range().start).row,
        why: format!(
            "{prefix}{} of <{}>: {why}",
            written.name(),
            node.tag_name().name()
        ),
    }
}

struct Writer<'a> {
    xml: &'a Xml<'a>,
    resolve: &'a Resolve<'a>,
    metadata: Metadata<'a>,
    /// The attributes' names among the strings, by number.
    indices: BTreeMap<u32, u32>,
    /// Android's namespace among the strings.
    uri: u32,
    strings: StringPool,
    nodes: Vec<u8>,
}

/// An attribute as it is stored: number for the order, namespace, name, the text if it is one, value.
struct Stored {
    id: Option<u32>,
    namespace: u32,
    name: u32,
    text: u32,
    value: Typed,
}

impl Writer<'_> {
    fn node(&mut self, kind: u16, line: u32, body: &[u8]) {
        self.nodes.extend(chunk(kind, &words([line, NONE]), body));
    }

    fn element(&mut self, node: Node<'_, '_>) -> Result<(), ApkError> {
        let tag = node.tag_name();
        if let Some(other) = tag.namespace() {
            return Err(self.xml.error(
                node,
                format!(
                    "<{}> is of the namespace {other}, and a package's elements are of none",
                    tag.name()
                ),
            ));
        }
        let mut stored = Vec::new();
        for written in node.attributes() {
            stored.push(self.attribute(node, &written)?);
        }
        if stored.len() > MAX_ATTRIBUTES {
            return Err(self.xml.error(
                node,
                format!("<{}> has more than {MAX_ATTRIBUTES} attributes", tag.name()),
            ));
        }
        let line = self.xml.line(node);
        self.start(line, tag.name(), stored);
        for child in node.children() {
            if child.is_element() {
                self.element(child)?;
            } else if child.is_text() && child.text().is_some_and(|text| !text.trim().is_empty()) {
                return Err(self.xml.error(
                    child,
                    format!(
                        "there is text in <{}>, where only elements are read",
                        tag.name()
                    ),
                ));
            }
        }
        if tag.name() == "application"
            && node
                .parent_element()
                .is_some_and(|parent| parent.has_tag_name("manifest"))
        {
            self.add_metadata(line);
        }
        self.end(line, tag.name());
        Ok(())
    }

    fn attribute(
        &mut self,
        node: Node<'_, '_>,
        written: &Written<'_, '_>,
    ) -> Result<Stored, ApkError> {
        let Some(known) = known(self.xml, node, written)? else {
            let text = unescape(written.value())
                .map_err(|why| attribute_error(self.xml, node, written, &why))?;
            let (name, text) = (self.strings.add(written.name()), self.strings.add(&text));
            return Ok(Stored {
                id: None,
                namespace: NONE,
                name,
                text,
                value: Typed::string(text),
            });
        };
        let value = known
            .parse(written.value(), self.resolve)
            .map_err(|why| attribute_error(self.xml, node, written, &why))?;
        Ok(self.stored(known, value))
    }

    fn stored(&mut self, known: &Attribute, value: Value) -> Stored {
        let (text, value) = match value {
            Value::Typed(value) => (NONE, value),
            Value::Text(text) => {
                let text = self.strings.add(&text);
                (text, Typed::string(text))
            }
        };
        let name = self.indices.get(&known.id).copied().unwrap_or(NONE);
        Stored {
            id: Some(known.id),
            namespace: self.uri,
            name,
            text,
            value,
        }
    }

    fn add_metadata(&mut self, line: u32) {
        for (name, value) in self.metadata {
            let stored = [("name", name), ("value", value)]
                .into_iter()
                .filter_map(|(attribute_name, text)| {
                    Some(self.stored(attribute(attribute_name)?, Value::Text(text.clone())))
                })
                .collect();
            self.start(line, "meta-data", stored);
            self.end(line, "meta-data");
        }
    }

    fn start(&mut self, line: u32, name: &str, mut stored: Vec<Stored>) {
        // Android looks attributes up by number in one pass; those without one come last.
        stored.sort_by_key(|one| one.id.unwrap_or(u32::MAX));
        let name = self.strings.add(name);
        let count = u32::from(short(stored.len()));
        // Attributes start after 20 bytes and have 20 each; which of them are id, class and style is said only of layouts.
        let mut body = words([NONE, name, 20 << 16 | 20, count, 0]);
        for one in stored {
            let [kind, data] = one.value.words();
            body.extend(words([one.namespace, one.name, one.text, kind, data]));
        }
        self.node(kind::XML_START_ELEMENT, line, &body);
    }

    fn end(&mut self, line: u32, name: &str) {
        let name = self.strings.add(name);
        self.node(kind::XML_END_ELEMENT, line, &words([NONE, name]));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn error(text: &str) -> String {
        let xml = Xml::parse("m.xml", text).expect("well-formed");
        compile(&xml, &|_, _| None, &[], Encoding::Utf16)
            .expect_err("not for a package")
            .to_string()
    }

    #[test]
    fn what_a_package_cannot_say_is_refused_by_line_and_name() {
        let android = "xmlns:android='http://schemas.android.com/apk/res/android'";
        for (text, want) in [
            (
                format!("<manifest {android}>\n<a\n android:nmae='x'/></manifest>"),
                "m.xml:3: android:nmae of <a>: is not an attribute",
            ),
            (
                format!("<manifest {android}>\n<a android:exported='ja'/></manifest>"),
                "m.xml:2: android:exported of <a>: \"ja\" is no boolean",
            ),
            (
                format!("<manifest {android}>\n\n<a android:icon='@mipmap/x'/></manifest>"),
                "m.xml:3: android:icon of <a>: there is no resource @mipmap/x",
            ),
            (
                "<manifest xmlns:tools='http://t'>\n<a tools:replace='x'/></manifest>".into(),
                "m.xml:2: tools:replace of <a>: is of the namespace http://t",
            ),
            (
                "<manifest xmlns:tools='http://t'>\n<tools:a/></manifest>".into(),
                "m.xml:2: <a> is of the namespace http://t",
            ),
            (
                "<manifest>\n<a>text</a></manifest>".into(),
                "m.xml:2: there is text in <a>",
            ),
        ] {
            let error = error(&text);
            assert!(error.starts_with(want), "{error} should be {want}");
        }
        let many: String = (0..1001).map(|one| format!(" a{one}='x'")).collect();
        assert!(error(&format!("<manifest{many}/>")).contains("more than 1000 attributes"));
    }
}
