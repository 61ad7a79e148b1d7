//! The tools that compile and link the library: an NDK, or without one Rust's own linker and lists of symbols.

use std::env;
use std::ffi::OsStr;
use std::fs;
use std::path::{Path, PathBuf};

use super::NativeError;
use super::processor::Processor;

/// Android's level that is linked for: the manifest's `minSdkVersion`.
pub const API_LEVEL: u32 = 29;
/// Where the environment may name an NDK, in the order asked.
const NDK: [&str; 2] = ["ANDROID_NDK_HOME", "ANDROID_NDK_ROOT"];
/// Where it may name an SDK, which may hold NDKs side by side.
const SDK: [&str; 2] = ["ANDROID_HOME", "ANDROID_SDK_ROOT"];
/// Names a clang for where there is no NDK.
pub const CLANG: &str = "MON3TR_CLANG";

/// The tools of a build.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Route {
    /// Google's Native Development Kit, as applications are built that are given to others.
    Ndk {
        /// Its folder.
        root: PathBuf,
        /// Its version, from `source.properties`.
        version: String,
        /// The folder of its programs.
        bin: PathBuf,
    },
    /// Rust's own linker against libraries made from lists of the platform's symbols. The result loads as the other does; that it
    /// was made so is written into the package.
    WithoutNdk {
        /// Compiles the C and assembler in dependencies.
        clang: PathBuf,
    },
}

impl Route {
    /// The NDK that the environment names, else the newest below the SDK it names, else the build without one; `clang` is then the one to
    /// use where the environment names none.
    ///
    /// # Errors
    /// [`NativeError`], if what the environment names is no NDK for this machine, or there is neither NDK nor clang.
    pub fn find(clang: Option<&Path>) -> Result<Self, NativeError> {
        Self::of(
            &|name| env::var_os(name).filter(|value| !value.is_empty()),
            clang,
        )
    }

    /// As [`Self::find`], in another environment.
    pub(super) fn of(
        variable: &dyn Fn(&str) -> Option<std::ffi::OsString>,
        clang: Option<&Path>,
    ) -> Result<Self, NativeError> {
        for name in NDK {
            if let Some(root) = variable(name) {
                return Self::ndk(name, Path::new(&root));
            }
        }
        for name in SDK {
            if let Some(newest) = variable(name).and_then(|sdk| newest_ndk(Path::new(&sdk))) {
                return Self::ndk(name, &newest);
            }
        }
        if let Some(clang) = variable(CLANG) {
            let clang = PathBuf::from(clang);
            if !clang.is_file() {
                return Err(NativeError::NoSuchClang(clang));
            }
            return Ok(Self::WithoutNdk { clang });
        }
        let found = clang.filter(|path| path.is_file()).map(Path::to_owned);
        match found.or_else(|| on_path(variable("PATH").as_deref(), "clang")) {
            Some(clang) => Ok(Self::WithoutNdk { clang }),
            None => Err(NativeError::NoCompiler),
        }
    }

    fn ndk(variable: &str, root: &Path) -> Result<Self, NativeError> {
        let no_ndk = |why: String| NativeError::NoNdk {
            variable: variable.to_owned(),
            root: root.to_owned(),
            why,
        };
        let properties = fs::read_to_string(root.join("source.properties"))
            .map_err(|error| no_ndk(format!("its source.properties cannot be read ({error})")))?;
        let version = properties
            .lines()
            .filter_map(|line| line.split_once('='))
            .find(|(key, _)| key.trim() == "Pkg.Revision")
            .map(|(_, version)| version.trim().to_owned())
            .ok_or_else(|| no_ndk("its source.properties names no Pkg.Revision".to_owned()))?;
        let bin = root
            .join("toolchains/llvm/prebuilt")
            .join(host())
            .join("bin");
        let route = Self::Ndk {
            root: root.to_owned(),
            version,
            bin,
        };
        for needed in [route.compiler(Processor::Arm64), route.archiver()] {
            if !needed.is_file() {
                return Err(no_ndk(format!("it has no {}", needed.display())));
            }
        }
        Ok(route)
    }

    /// What compiles C, and with an NDK links too.
    #[must_use]
    pub fn compiler(&self, processor: Processor) -> PathBuf {
        match self {
            Self::Ndk { bin, .. } => bin.join(format!("{}{API_LEVEL}-clang", processor.target())),
            Self::WithoutNdk { clang } => clang.clone(),
        }
    }

    /// What puts object files into archives. Any will do: Rust writes the index itself.
    #[must_use]
    pub fn archiver(&self) -> PathBuf {
        match self {
            Self::Ndk { bin, .. } => bin.join("llvm-ar"),
            Self::WithoutNdk { .. } => PathBuf::from("ar"),
        }
    }

    /// A short description, for people and for the package itself.
    #[must_use]
    pub fn describe(&self) -> String {
        match self {
            Self::Ndk { version, .. } => format!("Android NDK {version}"),
            Self::WithoutNdk { .. } => {
                format!("without an NDK: rust-lld and the symbols of Android API {API_LEVEL}")
            }
        }
    }
}

/// The folder of an NDK's programs for this machine; there is none of its own for arm64 Macs.
fn host() -> &'static str {
    match env::consts::OS {
        "macos" => "darwin-x86_64",
        "windows" => "windows-x86_64",
        _ => "linux-x86_64",
    }
}

/// Of `SDK/ndk/VERSION` the highest version.
fn newest_ndk(sdk: &Path) -> Option<PathBuf> {
    let version = |path: &PathBuf| -> Option<Vec<u64>> {
        let name = path.file_name()?.to_str()?;
        name.split('.').map(|part| part.parse().ok()).collect()
    };
    fs::read_dir(sdk.join("ndk"))
        .ok()?
        .filter_map(|entry| Some(entry.ok()?.path()))
        .filter(|path| version(path).is_some())
        .max_by_key(version)
}

fn on_path(path: Option<&OsStr>, program: &str) -> Option<PathBuf> {
    env::split_paths(path?)
        .map(|folder| folder.join(program))
        .find(|file| file.is_file())
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::HashMap;
    use std::ffi::OsString;

    fn fake_ndk(root: &Path, version: &str) {
        let bin = root
            .join("toolchains/llvm/prebuilt")
            .join(host())
            .join("bin");
        fs::create_dir_all(&bin).expect("a folder");
        fs::write(
            root.join("source.properties"),
            format!("Pkg.Desc = Android NDK\nPkg.Revision = {version}\n"),
        )
        .expect("a file");
        for program in ["aarch64-linux-android29-clang", "llvm-ar"] {
            fs::write(bin.join(program), "").expect("a file");
        }
    }

    fn route(variables: &[(&str, &Path)], clang: Option<&Path>) -> Result<Route, NativeError> {
        let variables: HashMap<&str, OsString> = variables
            .iter()
            .map(|(name, path)| (*name, path.as_os_str().to_owned()))
            .collect();
        Route::of(&|name| variables.get(name).cloned(), clang)
    }

    #[test]
    fn an_ndk_named_by_the_environment_is_preferred_to_a_clang() {
        let folder = tempfile::tempdir().expect("a folder");
        let (ndk, clang) = (folder.path().join("ndk"), folder.path().join("clang"));
        fake_ndk(&ndk, "27.2.12479018");
        fs::write(&clang, "").expect("a file");
        let found = route(&[("ANDROID_NDK_HOME", &ndk)], Some(&clang)).expect("a route");
        assert_eq!(found.describe(), "Android NDK 27.2.12479018");
        assert!(
            found.compiler(Processor::Arm64).starts_with(&ndk),
            "{found:?}"
        );
        let found = route(&[], Some(&clang)).expect("a route");
        assert_eq!(found, Route::WithoutNdk { clang });
    }

    #[test]
    fn of_several_ndks_in_an_sdk_the_newest_is_taken_by_number() {
        let folder = tempfile::tempdir().expect("a folder");
        for version in ["9.0.1", "27.2.12479018", "27.10.1"] {
            fake_ndk(&folder.path().join("ndk").join(version), version);
        }
        fs::create_dir(folder.path().join("ndk/unfinished")).expect("a folder");
        let found = route(&[("ANDROID_HOME", folder.path())], None).expect("a route");
        assert_eq!(found.describe(), "Android NDK 27.10.1");
    }

    #[test]
    fn a_variable_that_names_no_ndk_is_an_error_and_not_passed_over() {
        let folder = tempfile::tempdir().expect("a folder");
        let clang = folder.path().join("clang");
        fs::write(&clang, "").expect("a file");
        let error = route(&[("ANDROID_NDK_HOME", folder.path())], Some(&clang))
            .expect_err("there is no NDK")
            .to_string();
        assert!(error.contains("ANDROID_NDK_HOME"), "{error}");
        assert!(error.contains("source.properties"), "{error}");
    }

    #[test]
    fn without_ndk_and_clang_the_error_says_how_to_get_either() {
        let error = route(&[], None).expect_err("there is nothing").to_string();
        assert!(error.contains("ANDROID_NDK_HOME"), "{error}");
        assert!(error.contains("./run"), "{error}");
    }
}
