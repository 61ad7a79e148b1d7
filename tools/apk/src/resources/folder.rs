//! A folder `res/`: what is in it, and the numbers its resources have.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};

use super::config::Config;
use super::values::{self, Said};
use crate::ApkError;
use crate::binary_xml::compile;
use crate::small;
use crate::string_pool::Encoding;
use crate::text::Xml;

/// Resources of one package have this in their highest byte.
const PACKAGE: u32 = 0x7f00_0000;
/// What a folder may hold; far below what the table's words count.
const MAX_FILES: usize = 1000;

/// What a resource is on one kind of device.
#[derive(Debug)]
pub(crate) enum Resource {
    /// Said in a file of values.
    Said(Said),
    /// A file of the package, by its name there.
    File(String),
}

/// A resource by configuration, and resources by name.
pub(crate) type Variants = BTreeMap<Config, Resource>;
pub(crate) type Entries = BTreeMap<String, Variants>;

/// Everything of a folder, by type. Types and names are numbered in alphabetical order.
#[derive(Debug, Default)]
pub(crate) struct Resources {
    pub(crate) types: BTreeMap<String, Entries>,
    /// Name in the package and path.
    files: Vec<(String, PathBuf)>,
    /// How many files were read.
    read: usize,
}

impl Resources {
    pub(crate) fn read(folder: &Path) -> Result<Self, ApkError> {
        let mut resources = Self::default();
        for (name, path) in sorted(folder)? {
            if !path.is_dir() {
                return Err(ApkError::resource(
                    &path,
                    "lies beside the folders of resources, and belongs into one of them",
                ));
            }
            let (kind, config) =
                Config::parse(&name).map_err(|why| ApkError::resource(&path, why))?;
            match kind {
                "values" => resources.read_values(&path, config)?,
                "mipmap" | "drawable" => resources.read_files(&path, &name, kind, config)?,
                other => {
                    let why = format!(
                        "this packager does not know folders of {other:?}: it knows values, mipmap and drawable"
                    );
                    return Err(ApkError::resource(&path, why));
                }
            }
        }
        resources.check_defaults(folder)?;
        Ok(resources)
    }

    fn count(&mut self, path: &Path) -> Result<(), ApkError> {
        self.read += 1;
        if self.read > MAX_FILES {
            return Err(ApkError::resource(
                path,
                format!("there are more than {MAX_FILES} files"),
            ));
        }
        Ok(())
    }

    fn read_values(&mut self, folder: &Path, config: Config) -> Result<(), ApkError> {
        for (name, path) in sorted(folder)? {
            self.count(&path)?;
            if !name.ends_with(".xml") {
                return Err(ApkError::resource(
                    &path,
                    "a file of values is called NAME.xml",
                ));
            }
            for said in values::read(&path, &read_text(&path)?)? {
                let (kind, name) = (said.kind, said.name.clone());
                self.add(&path, kind, name, config, Resource::Said(said))?;
            }
        }
        Ok(())
    }

    fn read_files(
        &mut self,
        folder: &Path,
        folder_name: &str,
        kind: &str,
        config: Config,
    ) -> Result<(), ApkError> {
        for (name, path) in sorted(folder)? {
            self.count(&path)?;
            let Some((stem, "png" | "xml")) = name.split_once('.') else {
                return Err(ApkError::resource(
                    &path,
                    "a picture is called NAME.png or NAME.xml, with no other dot",
                ));
            };
            check_name(stem).map_err(|why| ApkError::resource(&path, why))?;
            let member = format!("res/{folder_name}/{name}");
            self.add(
                &path,
                kind,
                stem.to_owned(),
                config,
                Resource::File(member.clone()),
            )?;
            self.files.push((member, path));
        }
        Ok(())
    }

    fn add(
        &mut self,
        path: &Path,
        kind: &str,
        name: String,
        config: Config,
        resource: Resource,
    ) -> Result<(), ApkError> {
        let variants = self
            .types
            .entry(kind.to_owned())
            .or_default()
            .entry(name.clone())
            .or_default();
        if variants.insert(config, resource).is_some() {
            return Err(ApkError::resource(
                path,
                format!("{kind} {name} is there twice for the same devices"),
            ));
        }
        Ok(())
    }

    /// A resource that some device would not find crashes the application there.
    fn check_defaults(&self, folder: &Path) -> Result<(), ApkError> {
        for (kind, entries) in &self.types {
            if entries.len() > usize::from(u16::MAX) {
                return Err(ApkError::resource(
                    folder,
                    format!("there are more than {} of type {kind}", u16::MAX),
                ));
            }
            let pictures = matches!(kind.as_str(), "mipmap" | "drawable");
            for (name, variants) in entries {
                if !variants.keys().any(|config| config.is_for_all(pictures)) {
                    let why = format!(
                        "{kind} {name} is there for some languages or versions only: add one without these qualifiers"
                    );
                    return Err(ApkError::resource(folder, why));
                }
            }
        }
        Ok(())
    }

    /// The resource's number.
    pub(crate) fn id(&self, kind: &str, name: &str) -> Option<u32> {
        let type_index = self.types.keys().position(|one| one == kind)?;
        let entry = self.types.get(kind)?.keys().position(|one| one == name)?;
        Some(PACKAGE | u32::try_from(type_index + 1).ok()? << 16 | u32::try_from(entry).ok()?)
    }

    /// The files as they are packaged, by name: pictures as they are, XML in binary.
    pub(crate) fn packaged_files(&self) -> Result<Vec<(String, Vec<u8>)>, ApkError> {
        self.files
            .iter()
            .map(|(name, path)| Ok((name.clone(), self.packaged(path)?)))
            .collect()
    }

    fn packaged(&self, path: &Path) -> Result<Vec<u8>, ApkError> {
        if path.extension().is_some_and(|one| one == "xml") {
            let (file, text) = (path.display().to_string(), read_text(path)?);
            let xml = Xml::parse(&file, &text)?;
            return compile(&xml, &|kind, name| self.id(kind, name), &[], Encoding::Utf8);
        }
        let bytes = fs::read(path).map_err(ApkError::io("could not read", path))?;
        if !bytes.starts_with(b"\x89PNG\r\n\x1a\n") {
            return Err(ApkError::resource(path, "is not a PNG file"));
        }
        Ok(bytes)
    }
}

/// What a resource may be called.
pub(crate) fn check_name(name: &str) -> Result<(), String> {
    let good = name.starts_with(|one: char| one.is_ascii_lowercase())
        && name
            .bytes()
            .all(|one| one.is_ascii_lowercase() || one.is_ascii_digit() || one == b'_')
        && name.len() <= 100;
    if good {
        Ok(())
    } else {
        Err(format!(
            "{name:?} is no name of a resource: small letters, digits and _, a letter first"
        ))
    }
}

/// A folder's members by name, without hidden ones.
fn sorted(folder: &Path) -> Result<Vec<(String, PathBuf)>, ApkError> {
    let failed = |source| ApkError::Io {
        what: "could not read the folder",
        path: folder.to_owned(),
        source,
    };
    let mut members = Vec::new();
    for member in fs::read_dir(folder).map_err(failed)? {
        let path = member.map_err(failed)?.path();
        let name = path
            .file_name()
            .and_then(|name| name.to_str())
            .map(str::to_owned);
        let name = name.ok_or_else(|| ApkError::resource(&path, "its name is not UTF-8"))?;
        if !name.starts_with('.') {
            members.push((name, path));
        }
    }
    members.sort();
    Ok(members)
}

fn read_text(path: &Path) -> Result<String, ApkError> {
    small::read_text(path).map_err(ApkError::io("could not read", path))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn error(files: &[(&str, &str)]) -> String {
        let folder = tempfile::tempdir().expect("a temporary folder");
        for (name, text) in files {
            let path = folder.path().join(name);
            fs::create_dir_all(path.parent().expect("below the folder")).expect("a folder");
            fs::write(path, text).expect("a file");
        }
        let read = Resources::read(folder.path()).and_then(|resources| {
            resources.packaged_files()?;
            resources.table("a.b")
        });
        read.expect_err("not for a package").to_string()
    }

    #[test]
    fn what_a_resource_folder_must_not_hold_is_refused_by_file() {
        let string = "<resources><string name='a'>A</string></resources>";
        for (files, why) in [
            (vec![("strings.xml", string)], "belongs into one of them"),
            (
                vec![("layout/a.xml", "<a/>")],
                "does not know folders of \"layout\"",
            ),
            (vec![("values-night/a.xml", string)], "qualifier \"night\""),
            (
                vec![("values-de/a.xml", string)],
                "string a is there for some languages or versions only",
            ),
            (
                vec![("values/a.xml", string), ("values/b.xml", string)],
                "string a is there twice",
            ),
            (vec![("values/a.txt", string)], "NAME.xml"),
            (
                vec![("values/a.xml", "<strings/>")],
                "<resources> as its root",
            ),
            (
                vec![("values/a.xml", "<resources><style name='a'/></resources>")],
                "none of the values",
            ),
            (
                vec![("values/a.xml", "<resources><string>x</string></resources>")],
                "has no name",
            ),
            (
                vec![(
                    "values/a.xml",
                    "<resources><string name='A b'>x</string></resources>",
                )],
                "no name of a resource",
            ),
            (
                vec![(
                    "values/a.xml",
                    "<resources>\n<string name='a'><b>x</b></string></resources>",
                )],
                "a.xml:2: <string> a is styled",
            ),
            (
                vec![(
                    "values/a.xml",
                    "<resources>\n<string name='a'>it's</string></resources>",
                )],
                "a.xml:2: string a: an apostrophe",
            ),
            (
                vec![(
                    "values/a.xml",
                    "<resources>\n<string name='a'>@string/b</string></resources>",
                )],
                "there is no resource @string/b",
            ),
            (
                vec![(
                    "values/a.xml",
                    "<resources><color name='a'>red</color></resources>",
                )],
                "no colour",
            ),
            (
                vec![(
                    "values/a.xml",
                    "<resources><integer name='a'>1.5</integer></resources>",
                )],
                "no integer",
            ),
            (vec![("mipmap/a.gif", "")], "NAME.png or NAME.xml"),
            (vec![("drawable/a.9.png", "")], "NAME.png or NAME.xml"),
            (vec![("drawable/A.png", "")], "no name of a resource"),
            (vec![("mipmap-mdpi/a.png", "GIF89a")], "is not a PNG file"),
            (
                vec![("mipmap/a.png", ""), ("mipmap/a.xml", "<a/>")],
                "mipmap a is there twice",
            ),
            (vec![("drawable/a.xml", "<a")], "a.xml:1:"),
        ] {
            let error = error(&files);
            assert!(error.contains(why), "{error} should speak of {why}");
        }
    }

    #[test]
    fn a_resource_folder_that_is_not_there_is_named() {
        let error = Resources::read(Path::new("no/such/res"))
            .expect_err("there is none")
            .to_string();
        assert!(error.contains("no/such/res"), "{error}");
    }
}
