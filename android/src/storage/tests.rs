use super::Folders;
use link_protocol::PackageId;
use std::fs::{self, File};
use std::path::{Path, PathBuf};
use std::time::{Duration, SystemTime};

const DAY: Duration = Duration::from_secs(24 * 3600);

/// A package of so many bytes that was used so long ago.
fn put(
    folder: &Path,
    seed: u8,
    extension: &str,
    bytes: usize,
    age: Duration,
) -> (PackageId, PathBuf) {
    fs::create_dir_all(folder).expect("a folder");
    let contents = vec![seed; bytes];
    let package = PackageId::of_bytes(&contents);
    let path = folder.join(format!("{package}.{extension}"));
    fs::write(&path, contents).expect("written");
    let file = File::options().append(true).open(&path).expect("opened");
    file.set_modified(SystemTime::now() - age).expect("aged");
    (package, path)
}

fn there(paths: &[&PathBuf]) -> Vec<bool> {
    paths.iter().map(|path| path.exists()).collect()
}

#[test]
fn the_least_recently_used_packages_are_removed_first_and_those_in_use_stay() {
    let root = tempfile::tempdir().expect("a folder");
    let folders = Folders::new(root.path().join("own"), root.path().join("shared"));
    let folder = root.path().join("own/packages");
    let (oldest, used) = put(&folder, 1, "m3a", 1000, 9 * DAY);
    let (_, older) = put(&folder, 2, "m3a", 1000, 8 * DAY);
    let (_, newer) = put(&folder, 3, "m3a", 1000, DAY);
    let (_, newest) = put(&folder, 4, "m3a", 1000, Duration::ZERO);
    let all = folders.packages(4000).expect("a cache");
    assert_eq!(
        there(&[&used, &older, &newer, &newest]),
        [true; 4],
        "within the bound"
    );
    let in_use = all
        .in_use(&oldest)
        .expect("a lock")
        .expect("no program writes");
    folders.packages(2500).expect("a cache");
    assert_eq!(
        there(&[&used, &older, &newer, &newest]),
        [true, false, false, true],
        "two had to go, and the oldest is in use"
    );
    drop(in_use);
    folders.packages(1500).expect("a cache");
    assert_eq!(there(&[&used, &newest]), [false, true], "now it is not");
    folders.packages(0).expect("a cache");
    assert!(!newest.exists(), "nothing is used, so nothing need stay");
}

#[test]
fn downloads_that_were_not_resumed_are_removed_and_others_stay() {
    let root = tempfile::tempdir().expect("a folder");
    let folders = Folders::new(root.path(), root.path());
    let folder = root.path().join("packages");
    let (_, abandoned) = put(&folder, 1, "part", 10, 8 * DAY);
    let (_, interrupted) = put(&folder, 2, "part", 10, DAY);
    let (_, whole) = put(&folder, 3, "m3a", 10, 80 * DAY);
    folders.packages(1000).expect("a cache");
    assert_eq!(
        there(&[&abandoned, &interrupted, &whole]),
        [false, true, true],
        "what may be gone on from is kept"
    );
}

#[test]
fn files_that_are_not_the_caches_stay() {
    let root = tempfile::tempdir().expect("a folder");
    let folders = Folders::new(root.path(), root.path());
    let folder = root.path().join("packages");
    let (_, outside) = put(root.path(), 1, "m3a", 5000, 90 * DAY);
    let (_, inside) = put(&folder, 2, "m3a", 10, DAY);
    let stranger = folder.join("notes.m3a");
    fs::write(&stranger, [0; 5000]).expect("written");
    // Named like a package: to a file outside, and a folder with a file in it.
    let name = |seed: u8| folder.join(format!("{}.m3a", PackageId::of_bytes(&[seed])));
    #[cfg(unix)]
    std::os::unix::fs::symlink(&outside, name(7)).expect("a link");
    fs::create_dir(name(8)).expect("a folder");
    let nested = name(8).join("inner.m3a");
    fs::write(&nested, [0; 5000]).expect("written");
    folders.packages(0).expect("a cache");
    assert_eq!(
        there(&[&outside, &stranger, &nested, &inside]),
        [true, true, true, false],
        "only the package"
    );
    assert_eq!(
        fs::read(&outside).expect("read").len(),
        5000,
        "not through a link either"
    );
}

#[test]
fn a_folder_that_cannot_be_made_is_named() {
    let file = tempfile::NamedTempFile::new().expect("a file");
    let folders = Folders::new(file.path(), file.path());
    let error = folders.packages(1).expect_err("a file is no folder");
    let path = file.path().display().to_string();
    assert!(error.to_string().contains(&path), "{error}");
}
