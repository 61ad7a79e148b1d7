//! The manifest's text against what Quest needs, and against what the documentation says of it.

use main::package::{COMPONENT, FILES_FOLDER, PACKAGE};
use roxmltree::{Document, Node};
use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

const ANDROID: &str = "http://schemas.android.com/apk/res/android";

fn path(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join(name)
}

fn text(name: &str) -> String {
    std::fs::read_to_string(path(name)).unwrap_or_else(|error| panic!("{name}: {error}"))
}

fn get<'a>(node: Node<'a, '_>, attribute: &str) -> &'a str {
    node.attribute((ANDROID, attribute)).unwrap_or_default()
}

fn all<'a>(node: Node<'a, 'a>, tag: &'a str) -> impl Iterator<Item = Node<'a, 'a>> {
    node.descendants()
        .filter(move |node| node.has_tag_name(tag))
}

fn one<'a>(node: Node<'a, 'a>, tag: &'a str) -> Node<'a, 'a> {
    let found: Vec<_> = all(node, tag).collect();
    assert_eq!(found.len(), 1, "one {tag}");
    found[0]
}

fn names<'a>(node: Node<'a, 'a>, tag: &'a str) -> BTreeSet<&'a str> {
    all(node, tag).map(|node| get(node, "name")).collect()
}

/// Value of a `meta-data` that stands in `node` itself.
fn meta<'a>(node: Node<'a, 'a>, name: &str) -> &'a str {
    let mut data = node
        .children()
        .filter(|child| child.has_tag_name("meta-data"));
    let found = data.find(|data| get(*data, "name") == name);
    found.map_or("", |data| get(data, "value"))
}

#[test]
fn every_entry_that_quest_needs_is_there() {
    let manifest = text("AndroidManifest.xml");
    let document = Document::parse(&manifest).expect("XML");
    let root = document.root_element();
    assert_eq!(
        get(root, "installLocation"),
        "auto",
        "where it is installed"
    );
    let sdk = one(root, "uses-sdk");
    assert_eq!(
        (get(sdk, "minSdkVersion"), get(sdk, "targetSdkVersion")),
        ("29", "32"),
        "systems"
    );
    let application = one(root, "application");
    for (attribute, value) in [
        ("hasCode", "false"),
        ("allowBackup", "false"),
        ("extractNativeLibs", "true"),
        ("icon", "@mipmap/ic_launcher"),
        ("label", "@string/app_name"),
    ] {
        assert_eq!(
            get(application, attribute),
            value,
            "application's {attribute}"
        );
    }
    assert_eq!(
        application.attribute((ANDROID, "debuggable")),
        None,
        "the packager's to say"
    );
    let devices: BTreeSet<&str> = meta(application, "com.oculus.supportedDevices")
        .split('|')
        .collect();
    assert_eq!(
        devices,
        BTreeSet::from(["quest2", "quest3", "quest3s", "questpro"]),
        "headsets"
    );
    let library = one(application, "uses-native-library");
    assert_eq!(
        (get(library, "name"), get(library, "required")),
        ("libcdsprpc.so", "false"),
        "the NPU"
    );
    let activity = one(application, "activity");
    for (attribute, value) in [
        ("name", "android.app.NativeActivity"),
        ("exported", "true"),
        ("launchMode", "standard"),
        ("resizeableActivity", "false"),
        ("screenOrientation", "landscape"),
    ] {
        assert_eq!(get(activity, attribute), value, "activity's {attribute}");
    }
    assert_eq!(meta(activity, "android.app.lib_name"), "main", "libmain.so");
    assert_eq!(
        meta(activity, "com.oculus.vr.focusaware"),
        "true",
        "drawing under the menu"
    );
    // All of android.R.attr.configChanges up to the target, 32, that Quest can have.
    let changes: BTreeSet<&str> = get(activity, "configChanges").split('|').collect();
    for change in "mcc mnc locale touchscreen keyboard keyboardHidden navigation orientation screenLayout uiMode screenSize \
                   smallestScreenSize density layoutDirection colorMode fontScale"
        .split_whitespace()
    {
        assert!(changes.contains(change), "{change} recreates the activity");
    }
}

#[test]
fn features_are_those_of_quest_and_only_what_is_needed_is_required() {
    let manifest = text("AndroidManifest.xml");
    let document = Document::parse(&manifest).expect("XML");
    let features: BTreeSet<_> = all(document.root_element(), "uses-feature")
        .map(|feature| {
            (
                get(feature, "name"),
                get(feature, "required"),
                get(feature, "version"),
            )
        })
        .collect();
    assert_eq!(
        features,
        BTreeSet::from([
            ("android.hardware.microphone", "false", ""),
            ("android.hardware.vr.headtracking", "true", "1"),
            ("android.hardware.vulkan.version", "true", "0x401000"),
            ("com.oculus.feature.PASSTHROUGH", "false", ""),
            ("com.oculus.software.body_tracking", "false", ""),
            ("oculus.software.eye_tracking", "false", ""),
            ("oculus.software.face_tracking", "false", ""),
            ("oculus.software.handtracking", "false", ""),
        ]),
        "Pro and 2 are allowed"
    );
}

#[test]
fn the_app_is_started_as_an_immersive_one_and_by_its_own_links_only() {
    let manifest = text("AndroidManifest.xml");
    let document = Document::parse(&manifest).expect("XML");
    let activity = one(document.root_element(), "activity");
    let filters: Vec<_> = all(activity, "intent-filter").collect();
    let [launcher, link] = filters.as_slice() else {
        panic!("two filters, not {}", filters.len());
    };
    assert_eq!(
        names(*launcher, "action"),
        BTreeSet::from(["android.intent.action.MAIN"]),
        "launched"
    );
    assert_eq!(
        names(*launcher, "category"),
        BTreeSet::from([
            "android.intent.category.LAUNCHER",
            "com.oculus.intent.category.VR",
            "org.khronos.openxr.intent.category.IMMERSIVE_HMD",
        ]),
        "as an immersive app"
    );
    assert_eq!(
        names(*link, "action"),
        BTreeSet::from(["android.intent.action.VIEW"]),
        "opened"
    );
    assert_eq!(
        names(*link, "category"),
        BTreeSet::from([
            "android.intent.category.BROWSABLE",
            "android.intent.category.DEFAULT"
        ]),
        "from a browser"
    );
    let prefixes: Vec<String> = all(*link, "data")
        .map(|data| {
            let named: BTreeSet<_> = data.attributes().map(|one| one.name()).collect();
            assert_eq!(named, BTreeSet::from(["host", "scheme"]), "nothing else");
            format!("{}://{}/", get(data, "scheme"), get(data, "host"))
        })
        .collect();
    assert_eq!(
        prefixes,
        [main::settings::DEEP_LINK, main::settings::DEEP_CALL_LINK],
        "as the settings read them, and nothing else's links"
    );
    let queries = one(document.root_element(), "queries");
    let brokers: BTreeSet<_> = get(one(queries, "provider"), "authorities")
        .split(';')
        .collect();
    assert_eq!(
        brokers,
        BTreeSet::from([
            "org.khronos.openxr.runtime_broker",
            "org.khronos.openxr.system_runtime_broker"
        ]),
        "where the loader finds the runtime"
    );
    assert!(
        names(queries, "action").contains("org.khronos.openxr.OpenXRRuntimeService"),
        "the runtime's service"
    );
}

#[test]
fn permissions_are_exactly_the_documented_ones() {
    let manifest = text("AndroidManifest.xml");
    let document = Document::parse(&manifest).expect("XML");
    let asked: BTreeSet<_> = document
        .descendants()
        .filter(|node| node.tag_name().name().starts_with("uses-permission"))
        .map(|node| get(node, "name"))
        .collect();
    let page = text("../docs/android.md");
    let section = page
        .split("\n## ")
        .find(|section| section.starts_with("Permissions\n"));
    let rows: Vec<(&str, &str)> = section
        .expect("a section on permissions")
        .lines()
        .filter_map(|line| line.strip_prefix("| `")?.split_once("` |"))
        .collect();
    let documented: BTreeSet<_> = rows.iter().map(|(name, _)| *name).collect();
    assert_eq!(asked, documented, "the manifest's and docs/android.md's");
    assert_eq!(rows.len(), documented.len(), "none twice");
    assert!(
        rows.iter().all(|(_, why)| why.len() > 20),
        "each with its reason"
    );
}

#[test]
fn names_and_version_are_the_same_everywhere() {
    let manifest = text("AndroidManifest.xml");
    let document = Document::parse(&manifest).expect("XML");
    let root = document.root_element();
    assert_eq!(root.attribute("package"), Some(PACKAGE), "the package");
    assert_eq!(
        COMPONENT,
        format!("{PACKAGE}/{}", get(one(root, "activity"), "name")),
        "what adb starts"
    );
    assert_eq!(
        FILES_FOLDER,
        format!("/sdcard/Android/data/{PACKAGE}/files"),
        "what adb pushes to"
    );
    assert_eq!(
        get(root, "versionName"),
        env!("CARGO_PKG_VERSION"),
        "the workspace's version"
    );
    let version = env!("CARGO_PKG_VERSION")
        .split('.')
        .map(|part| part.parse::<u32>().expect("a number"));
    let code = version.fold(0, |code, part| code * 100 + part);
    assert_eq!(
        get(root, "versionCode"),
        code.to_string(),
        "two digits for each part"
    );
    let strings = text("res/values/strings.xml");
    let strings = Document::parse(&strings).expect("XML");
    let name = one(strings.root_element(), "string");
    assert_eq!(
        (name.attribute("name"), name.text()),
        (Some("app_name"), Some("Mon3tr")),
        "its name"
    );
    let page = text("../docs/android.md");
    for what in [PACKAGE, COMPONENT, FILES_FOLDER, "adb logcat -s mon3tr"] {
        assert!(page.contains(what), "docs/android.md names {what}");
    }
    for key in main::settings::Key::ALL {
        assert!(
            page.contains(&format!("| `{key}` |")),
            "docs/android.md has the setting {key}"
        );
    }
}

#[test]
fn there_is_an_icon_of_every_density_with_something_on_it() {
    // https://developer.android.com/training/multiscreen/screendensities: 48 dp.
    for (density, size) in [
        ("mdpi", 48),
        ("hdpi", 72),
        ("xhdpi", 96),
        ("xxhdpi", 144),
        ("xxxhdpi", 192),
    ] {
        let name = format!("res/mipmap-{density}/ic_launcher.png");
        let icon = image::open(path(&name)).expect(&name).into_rgba8();
        assert_eq!(icon.dimensions(), (size, size), "{density}");
        assert_eq!(icon.get_pixel(0, 0)[3], 0, "{density}: round corners");
        let colours: BTreeSet<[u8; 4]> = icon.pixels().map(|pixel| pixel.0).collect();
        assert!(colours.len() > 200, "{density}: {} colours", colours.len());
    }
}

#[test]
fn launchers_that_cut_icons_to_their_shape_find_two_layers_that_fill_it() {
    let icon = text("res/mipmap-anydpi-v26/ic_launcher.xml");
    let icon = Document::parse(&icon).expect("XML");
    for layer in ["background", "foreground"] {
        let drawn = get(one(icon.root_element(), layer), "drawable");
        let name = drawn.strip_prefix("@drawable/").expect("a drawable");
        let drawing = text(&format!("res/drawable/{name}.xml"));
        let drawing = Document::parse(&drawing).expect("XML");
        let drawing = drawing.root_element();
        for (attribute, value) in [("width", "108dp"), ("viewportHeight", "108")] {
            assert_eq!(get(drawing, attribute), value, "{layer}'s {attribute}");
        }
        assert!(all(drawing, "path").count() > 0, "{layer} shows something");
    }
}
