//! Android's own programs for packages: where they are, and running them.

use super::gather::fetched;
use anyhow::{Context, bail};
use std::ffi::OsString;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

/// Names a folder that has all of them.
const FOLDER: &str = "MON3TR_ANDROID_TOOLS";
/// Names a Java for those that are written in it.
const JAVA: &str = "MON3TR_JAVA";
/// Where the environment may name an SDK, in the order asked.
const SDK: [&str; 2] = ["ANDROID_HOME", "ANDROID_SDK_ROOT"];
/// Java's programs get a key store's password in this variable: every user of a machine sees arguments.
pub(super) const PASSWORD: &str = "MON3TR_KEY_PASS";

/// aapt2, apksigner and keytool, and what they need.
#[derive(Debug, PartialEq, Eq)]
pub(super) struct Tools {
    aapt2: PathBuf,
    /// The folder of apksigner's classes.
    jars: PathBuf,
    /// Android's own resources, which a package's are linked against.
    pub(super) framework: PathBuf,
    java: PathBuf,
}

impl Tools {
    /// Those in the folder that the environment names, else in the SDK that it names, else those that `./run` fetched.
    pub(super) fn find(repo: &Path) -> anyhow::Result<Self> {
        let variable = |name: &str| std::env::var_os(name).filter(|value| !value.is_empty());
        let java = fetched(repo, JAVA, "java/run")?;
        Self::of(
            &variable,
            &fetched(repo, FOLDER, "android-tools")?,
            if java.is_file() { java } else { "java".into() },
        )
    }

    /// As [`Self::find`], in another environment; without an SDK those in `folder`.
    fn of(
        variable: &dyn Fn(&str) -> Option<OsString>,
        folder: &Path,
        java: PathBuf,
    ) -> anyhow::Result<Self> {
        let of_sdk = |name| {
            let sdk = PathBuf::from(variable(name)?);
            let build_tools = newest(&sdk.join("build-tools"), "lib/apksigner.jar")?;
            let platform = newest(&sdk.join("platforms"), "android.jar")?;
            Some((build_tools, platform.join("android.jar")))
        };
        let (folder, framework) = SDK
            .into_iter()
            .filter(|_| variable(FOLDER).is_none())
            .find_map(of_sdk)
            .unwrap_or_else(|| (folder.to_owned(), folder.join("framework-res.apk")));
        let (aapt2, jars) = (folder.join("aapt2"), folder.join("lib"));
        for file in [&aapt2, &jars.join("apksigner.jar"), &framework] {
            if !file.is_file() {
                bail!(
                    "{} is not there, and packages are made with it: ./run apk fetches it (and needs dpkg-deb for that), or set \
                     ANDROID_HOME to an Android SDK that has build-tools and a platform",
                    file.display()
                );
            }
        }
        Ok(Self {
            aapt2,
            jars,
            framework,
            java,
        })
    }

    /// Makes and links resources.
    pub(super) fn aapt2(&self) -> Command {
        Command::new(&self.aapt2)
    }

    /// Signs packages.
    pub(super) fn apksigner(&self, password: &str) -> Command {
        let mut command = self.java(password);
        command
            .arg("-cp")
            .arg(self.jars.join("*"))
            .arg("com.android.apksigner.ApkSignerTool");
        command
    }

    /// Makes and lists key stores. Part of every Java, also of those that have no program of that name.
    pub(super) fn keytool(&self, password: &str) -> Command {
        let mut command = self.java(password);
        command.args(["-m", "java.base/sun.security.tools.keytool.Main"]);
        command.args(["-storepass:env", PASSWORD]);
        command
    }

    fn java(&self, password: &str) -> Command {
        let mut command = Command::new(&self.java);
        // What keytool prints is read here, so it has to be English; passwords may be in any script.
        command.env("LC_ALL", "C.UTF-8").env(PASSWORD, password);
        // For programs that run a second, starting takes half as long.
        command.args(["-XX:TieredStopAtLevel=1", "-XX:+UseSerialGC"]);
        command
    }
}

/// Runs a program.
pub(super) fn run(command: &mut Command) -> anyhow::Result<Output> {
    command.output().with_context(|| {
        let program = command.get_program().display();
        format!("{program} does not start, and packages are made with it: ./run apk fetches what is missing")
    })
}

/// Runs a program that has to end well.
pub(super) fn succeed(command: &mut Command) -> anyhow::Result<()> {
    let output = run(command)?;
    if !output.status.success() {
        bail!("the package could not be made: {}", printed(&output));
    }
    Ok(())
}

/// All that a program printed.
pub(super) fn printed(output: &Output) -> String {
    let text = [output.stdout.as_slice(), &output.stderr].concat();
    String::from_utf8_lossy(&text).trim().to_owned()
}

/// Of the folders in `parent` that have `file` the one with the highest version in its name.
fn newest(parent: &Path, file: &str) -> Option<PathBuf> {
    let version = |folder: &PathBuf| -> Option<Vec<u64>> {
        let name = folder.file_name()?.to_str()?;
        let numbers = name.trim_start_matches("android-").split('.');
        numbers.map(|part| part.parse().ok()).collect()
    };
    std::fs::read_dir(parent)
        .ok()?
        .filter_map(|entry| Some(entry.ok()?.path()))
        .filter(|folder| version(folder).is_some() && folder.join(file).is_file())
        .max_by_key(version)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::fs;

    fn make(folder: &Path, files: &[&str]) {
        for file in files {
            let file = folder.join(file);
            fs::create_dir_all(file.parent().expect("a folder")).expect("a folder");
            fs::write(file, "").expect("a file");
        }
    }

    fn of(variables: &[(&str, &Path)], folder: &Path) -> anyhow::Result<Tools> {
        let variable = |name: &str| {
            let found = variables.iter().find(|(other, _)| *other == name);
            found.map(|(_, path)| path.as_os_str().to_owned())
        };
        Tools::of(&variable, folder, "java".into())
    }

    const FETCHED: [&str; 3] = ["aapt2", "lib/apksigner.jar", "framework-res.apk"];

    #[test]
    fn an_sdk_goes_before_what_was_fetched_with_its_newest_release_by_number() {
        let folder = tempfile::tempdir().expect("a folder");
        let (sdk, fetched) = (folder.path().join("sdk"), folder.path().join("fetched"));
        make(&fetched, &FETCHED);
        for version in ["9.0.0", "35.0.0", "35.0.1", "36.0.0-rc1"] {
            let tools = ["aapt2", "lib/apksigner.jar"];
            make(&sdk.join("build-tools").join(version), &tools);
        }
        for platform in ["android-9", "android-35"] {
            make(&sdk.join("platforms").join(platform), &["android.jar"]);
        }
        make(
            &sdk,
            &["build-tools/40.0.0/aapt2", "platforms/android-40/x"],
        );
        let found = of(&[("ANDROID_SDK_ROOT", &sdk)], &fetched).expect("the SDK's");
        assert_eq!(found.aapt2, sdk.join("build-tools/35.0.1/aapt2"));
        let platform = sdk.join("platforms/android-35/android.jar");
        assert_eq!(found.framework, platform);
        // A folder that is named goes before both.
        let named = [("ANDROID_HOME", sdk.as_path()), (FOLDER, &fetched)];
        let found = of(&named, &fetched).expect("the folder's");
        assert_eq!(found.aapt2, fetched.join("aapt2"));
    }

    #[test]
    fn an_sdk_without_a_platform_is_passed_over() {
        let folder = tempfile::tempdir().expect("a folder");
        let (sdk, fetched) = (folder.path().join("sdk"), folder.path().join("fetched"));
        make(&fetched, &FETCHED);
        let tools = ["aapt2", "lib/apksigner.jar"];
        make(&sdk.join("build-tools/35.0.0"), &tools);
        let found = of(&[("ANDROID_HOME", &sdk)], &fetched).expect("what was fetched");
        assert_eq!(found.aapt2, fetched.join("aapt2"));
    }

    #[test]
    fn what_is_missing_is_named_with_the_ways_to_get_it() {
        let folder = tempfile::tempdir().expect("a folder");
        for missing in FETCHED {
            let place = folder.path().join(missing);
            let others: Vec<&str> = FETCHED.into_iter().filter(|one| *one != missing).collect();
            make(&place, &others);
            let error = of(&[], &place).expect_err(missing).to_string();
            for word in [missing, "./run apk", "ANDROID_HOME"] {
                assert!(error.contains(word), "{error} should speak of {word}");
            }
        }
    }
}
