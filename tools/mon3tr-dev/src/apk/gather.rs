//! What goes into the package, checked.

use android_native::elf::{Library, Platform, check_library};
use android_native::native::{Built, Route};
use android_native::parts::{self, PARTS, Part, QNN_PARTS};
use anyhow::{Context, bail, ensure};
use mon3tr::device_options::cache;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

/// What Android's loader and the glue under the app call in its library.
const ENTRY_POINTS: [&str; 2] = ["ANativeActivity_onCreate", "android_main"];
/// The app's own library, as the manifest names it.
const OWN: &str = "libmain.so";

/// A library in the package.
pub(super) struct Member {
    pub(super) part: Part,
    /// What the loader sees of it; the NPU's own are none of Android's business.
    pub(super) elf: Option<Library>,
}

/// All of them.
pub(super) struct Gathered {
    pub(super) members: Vec<Member>,
}

/// Others' libraries, where the environment says or `./run` leaves them.
pub(super) fn parts(repo: &Path, with_qnn: bool) -> anyhow::Result<Vec<Part>> {
    let mut all = parts::read(&fetched(repo, PARTS, "android-parts")?)?;
    if with_qnn {
        let folder = fetched(repo, QNN_PARTS, "android-parts-qnn")?;
        let qnn = parts::read(&folder).context(
            "the libraries for the NPU come from Maven Central alone, fetched by ./run apk --with-qnn",
        )?;
        all.extend(qnn);
    }
    Ok(all)
}

/// What `./run` leaves at `name` in its cache, or the environment names instead.
pub(super) fn fetched(repo: &Path, variable: &str, name: &str) -> anyhow::Result<PathBuf> {
    if let Some(folder) = std::env::var_os(variable).filter(|value| !value.is_empty()) {
        return Ok(folder.into());
    }
    let here = repo.join(".cache").join(name);
    if here.exists() {
        return Ok(here);
    }
    Ok(cache()?.join(name))
}

impl Gathered {
    /// The library that was built and others', if Android will load every one of them.
    pub(super) fn new(built: &Built, parts: Vec<Part>) -> anyhow::Result<Self> {
        let data = fs::read(&built.library)
            .with_context(|| format!("could not read {}", built.library.display()))?;
        let own = Part {
            file: OWN.to_owned(),
            version: env!("CARGO_PKG_VERSION").to_owned(),
            from: "this repository".to_owned(),
            sha256: parts::hash(&data),
            for_npu: false,
            data,
        };
        let members = std::iter::once(own)
            .chain(parts)
            .map(|part| {
                let elf = if part.for_npu {
                    None
                } else {
                    Some(Library::read(&part.file, &part.data)?)
                };
                Ok(Member { part, elf })
            })
            .collect::<anyhow::Result<Vec<_>>>()?;
        let gathered = Self { members };
        gathered.check()?;
        Ok(gathered)
    }

    fn check(&self) -> anyhow::Result<()> {
        let libraries: Vec<Library> = self.libraries().cloned().collect();
        let platform = Platform::api_29();
        let mut wrong = Vec::new();
        for library in &libraries {
            let own = (library.name == OWN).then_some(ENTRY_POINTS.as_slice());
            for fault in check_library(library, &libraries, &platform, own) {
                wrong.push(format!("{} {fault}", library.name));
            }
        }
        ensure!(
            wrong.is_empty(),
            "the headset would not load the package: {}",
            wrong.join("; ")
        );
        Ok(())
    }

    /// What Android loads.
    pub(super) fn libraries(&self) -> impl Iterator<Item = &Library> {
        self.members.iter().filter_map(|member| member.elf.as_ref())
    }

    /// The package's manifest, with a record of how the package came to be.
    pub(super) fn manifest(&self, repo: &Path, route: &Route) -> anyhow::Result<String> {
        let path = repo.join("android/AndroidManifest.xml");
        let manifest = fs::read_to_string(&path)
            .with_context(|| format!("could not read {}", path.display()))?;
        let mut metadata = vec![
            ("org.mon3tr.build.route".to_owned(), route.describe()),
            ("org.mon3tr.build.commit".to_owned(), commit(repo)?),
        ];
        for Member { part, .. } in &self.members[1..] {
            metadata.push((
                format!("org.mon3tr.part.{}", part.file),
                format!("{} sha256:{}", part.version, part.sha256),
            ));
        }
        with_metadata(&manifest, &metadata)
            .with_context(|| format!("{} has no </application>", path.display()))
    }
}

/// The commit the app was built from, with a mark where files differ from it.
fn commit(repo: &Path) -> anyhow::Result<String> {
    if !repo.join(".git").exists() {
        return Ok("unknown: not a clone".to_owned());
    }
    let git = |arguments: &[&str]| -> anyhow::Result<String> {
        let output = Command::new("git")
            .arg("-C")
            .arg(repo)
            .args(arguments)
            .output()
            .context("git could not be started: apt-get install git")?;
        if !output.status.success() {
            bail!(
                "git {} failed: {}",
                arguments.join(" "),
                String::from_utf8_lossy(&output.stderr).trim()
            );
        }
        Ok(String::from_utf8_lossy(&output.stdout).trim().to_owned())
    };
    let commit = git(&["rev-parse", "HEAD"])?;
    let changed = git(&["status", "--porcelain", "--untracked-files=no"])?;
    Ok(if changed.is_empty() {
        commit
    } else {
        format!("{commit} with changes")
    })
}

/// `manifest` with names and strings as `<meta-data>` of its application, which it has to have.
fn with_metadata(manifest: &str, metadata: &[(String, String)]) -> Option<String> {
    let (before, after) = manifest.rsplit_once("</application>")?;
    let entries = metadata.iter().map(|(name, value)| {
        let (name, value) = (escaped(name), escaped(value));
        format!("<meta-data android:name=\"{name}\" android:value=\"{value}\"/>")
    });
    let entries: String = entries.collect();
    Some(format!("{before}{entries}</application>{after}"))
}

/// For an attribute's value in XML.
fn escaped(text: &str) -> String {
    let text = text.replace('&', "&amp;").replace('<', "&lt;");
    text.replace('"', "&quot;")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn metadata_stand_in_the_application() {
        let manifest = "<manifest>\n<application>\n</application></manifest>";
        let metadata = [("a".to_owned(), "<\"b\" & c>".to_owned())];
        assert_eq!(
            with_metadata(manifest, &metadata).as_deref(),
            Some(
                "<manifest>\n<application>\n<meta-data android:name=\"a\" \
                 android:value=\"&lt;&quot;b&quot; &amp; c>\"/></application></manifest>"
            )
        );
        assert_eq!(with_metadata("<manifest/>", &metadata), None);
    }
}
