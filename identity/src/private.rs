//! Files for their owner alone.

use crate::IdentityError;
use std::fs::File;
use std::path::Path;

/// Opens a file that holds a secret, or says whom one trusts. Other users must neither read nor write it; of what is no file on a disk, such as a pipe, nothing is
/// asked. On Android, where each app is a user and files beside an avatar have the modes that the system gives them, neither.
///
/// # Errors
/// [`IdentityError::File`] if it cannot be read, [`IdentityError::NotPrivate`] if others may read or write it.
pub fn open_private(path: &Path) -> Result<File, IdentityError> {
    let failed = |source| IdentityError::File {
        action: "read",
        path: path.to_owned(),
        source,
    };
    let file = File::open(path).map_err(failed)?;
    #[cfg(all(unix, not(target_os = "android")))]
    {
        use std::os::unix::fs::PermissionsExt;
        /// Read, write and execute, of the group and of all others.
        const OTHERS: u32 = 0o077;
        let metadata = file.metadata().map_err(failed)?;
        if metadata.is_file() && metadata.permissions().mode() & OTHERS != 0 {
            let path = path.to_owned();
            return Err(IdentityError::NotPrivate { path });
        }
    }
    Ok(file)
}

#[cfg(all(test, unix))]
mod tests {
    use super::*;
    use std::os::unix::fs::PermissionsExt;

    #[test]
    fn a_file_that_others_may_read_or_write_is_refused_with_the_command_that_mends_it() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("it's a key");
        assert!(matches!(
            open_private(&path),
            Err(IdentityError::File { .. })
        ));
        std::fs::write(&path, "secret").expect("written");
        for (mode, is_taken) in [
            (0o600, true),
            (0o400, true),
            (0o700, true),
            (0o640, false),
            (0o620, false),
            (0o604, false),
            (0o602, false),
            (0o777, false),
        ] {
            let mode = std::fs::Permissions::from_mode(mode);
            std::fs::set_permissions(&path, mode.clone()).expect("its owner's");
            match open_private(&path) {
                Ok(_) => assert!(is_taken, "{mode:?}"),
                Err(why) => {
                    assert!(!is_taken, "{mode:?}: {why}");
                    let command = format!(r"chmod 600 '{}/it'\''s a key'", folder.path().display());
                    assert!(why.to_string().contains(&command), "{why}");
                }
            }
        }
        assert!(
            open_private(Path::new("/dev/null")).is_ok(),
            "it is no file on a disk"
        );
    }
}
