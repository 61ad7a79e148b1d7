//! What Android asks of a manifest, beyond XML and known attributes, before it installs a package.

use roxmltree::Node;

use crate::ApkError;
use crate::resources::PACKAGE_NAME_UNITS;
use crate::text::{ANDROID, Xml};

/// Android 7.0, the first that reads the signatures that packages get here.
const OLDEST_SDK: u32 = 24;
/// From Android 12 on, what listens to others says whether it does.
const SDK_OF_EXPORTED: u32 = 31;

/// The application's name, of a manifest that Android can install.
pub(crate) fn check_manifest<'a>(xml: &'a Xml<'_>) -> Result<&'a str, ApkError> {
    let root = xml.document.root_element();
    if !root.has_tag_name("manifest") {
        return Err(xml.error(root, "a manifest has <manifest> as its root"));
    }
    let package = root.attribute("package").ok_or_else(|| {
        xml.error(
            root,
            "<manifest> has no package=\"...\", the application's name",
        )
    })?;
    check_package(package).map_err(|why| xml.error(root, why))?;
    one_child(xml, root, "application")?;
    let sdk = one_child(xml, root, "uses-sdk")?;
    let oldest = level(xml, sdk, "minSdkVersion")?;
    if oldest < OLDEST_SDK {
        let why = format!(
            "android:minSdkVersion is {oldest}, and Android before {OLDEST_SDK} does not read the signatures written here"
        );
        return Err(xml.error(sdk, why));
    }
    if level(xml, sdk, "targetSdkVersion")? >= SDK_OF_EXPORTED {
        check_exported(xml)?;
    }
    Ok(package)
}

fn check_package(name: &str) -> Result<(), String> {
    let good_part = |part: &str| {
        part.starts_with(|one: char| one.is_ascii_alphabetic())
            && part
                .bytes()
                .all(|one| one.is_ascii_alphanumeric() || one == b'_')
    };
    if name.contains('.') && name.split('.').all(good_part) && name.len() < PACKAGE_NAME_UNITS {
        return Ok(());
    }
    Err(format!(
        "{name:?} is no name of an application: two or more words with dots between, each letters, digits and _ after a letter"
    ))
}

fn one_child<'a>(
    xml: &'a Xml<'_>,
    root: Node<'a, 'a>,
    name: &str,
) -> Result<Node<'a, 'a>, ApkError> {
    let mut found = root.children().filter(|node| node.has_tag_name(name));
    let first = found
        .next()
        .ok_or_else(|| xml.error(root, format!("<manifest> has no <{name}>")))?;
    match found.next() {
        None => Ok(first),
        Some(second) => Err(xml.error(second, format!("<manifest> has more than one <{name}>"))),
    }
}

fn level(xml: &Xml<'_>, sdk: Node<'_, '_>, name: &str) -> Result<u32, ApkError> {
    let text = sdk
        .attribute((ANDROID, name))
        .ok_or_else(|| xml.error(sdk, format!("<uses-sdk> has no android:{name}")))?;
    text.trim().parse().map_err(|_| {
        xml.error(
            sdk,
            format!(
                "android:{name} is {text:?}, and this packager wants the number of an API level"
            ),
        )
    })
}

fn check_exported(xml: &Xml<'_>) -> Result<(), ApkError> {
    let listens = |node: &Node<'_, '_>| {
        ["activity", "activity-alias", "service", "receiver"]
            .iter()
            .any(|name| node.has_tag_name(*name))
            && node
                .children()
                .any(|child| child.has_tag_name("intent-filter"))
    };
    match xml
        .document
        .descendants()
        .find(|node| listens(node) && !node.has_attribute((ANDROID, "exported")))
    {
        None => Ok(()),
        Some(node) => {
            let why = format!(
                "<{}> has an <intent-filter>, so Android 12 wants android:exported on it",
                node.tag_name().name()
            );
            Err(xml.error(node, why))
        }
    }
}

/// Names and values that come from elsewhere than the manifest are bounded as it is.
pub(crate) fn check_metadata(metadata: &[(String, String)]) -> Result<(), ApkError> {
    for (name, value) in metadata {
        if name.is_empty() || name.len() + value.len() > 10_000 {
            let why =
                "as metadata, name and value have together 1 to 10000 bytes, and there is a name"
                    .into();
            return Err(ApkError::Member {
                name: name.chars().take(100).collect(),
                why,
            });
        }
    }
    if metadata.len() > 1000 {
        return Err(ApkError::Member {
            name: "metadata".into(),
            why: "there are more than 1000 pairs".into(),
        });
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn manifest(sdk: &str, rest: &str) -> String {
        format!(
            "<manifest xmlns:android=\"http://schemas.android.com/apk/res/android\" package=\"org.example.app\">\n{sdk}\n{rest}\n</manifest>"
        )
    }

    #[test]
    fn a_manifest_that_android_would_not_install_is_refused_with_the_reason() {
        let sdk = "<uses-sdk android:minSdkVersion=\"29\" android:targetSdkVersion=\"32\"/>";
        let application = "<application/>";
        let listening =
            "<application><activity android:name=\"a\"><intent-filter/></activity></application>";
        for (text, why) in [
            (
                "<application/>".to_owned(),
                "m.xml:1: a manifest has <manifest>",
            ),
            ("<manifest/>".into(), "m.xml:1: <manifest> has no package"),
            ("<manifest package='one'/>".into(), "\"one\" is no name"),
            ("<manifest package='a.1b'/>".into(), "\"a.1b\" is no name"),
            (
                format!("<manifest package='a.{}'/>", "b".repeat(126)),
                "is no name",
            ),
            (
                manifest(sdk, ""),
                "m.xml:1: <manifest> has no <application>",
            ),
            (manifest("", application), "has no <uses-sdk>"),
            (
                manifest(sdk, &application.repeat(2)),
                "m.xml:3: <manifest> has more than one <application>",
            ),
            (
                manifest("<uses-sdk android:minSdkVersion=\"29\"/>", application),
                "m.xml:2: <uses-sdk> has no android:targetSdkVersion",
            ),
            (
                manifest("<uses-sdk android:minSdkVersion=\"23\"/>", application),
                "m.xml:2: android:minSdkVersion is 23",
            ),
            (
                manifest("<uses-sdk android:minSdkVersion=\"Q\"/>", application),
                "number of an API level",
            ),
            (
                manifest(sdk, listening),
                "m.xml:3: <activity> has an <intent-filter>",
            ),
        ] {
            let xml = Xml::parse("m.xml", &text).expect("well-formed");
            let error = check_manifest(&xml).expect_err(why).to_string();
            assert!(error.contains(why), "{error} should speak of {why}");
        }
        let text = manifest(sdk, application);
        let xml = Xml::parse("m.xml", &text).expect("well-formed");
        assert_eq!(check_manifest(&xml).expect("a manifest"), "org.example.app");
    }
}
