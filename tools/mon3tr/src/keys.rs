//! Where this machine's user has their key, and what it is used for. It lies with the user's other settings, for nothing makes it again.

use anyhow::{Context, anyhow};
use identity::{Keyring, PublicKey};
use link_call::Credentials;
use spmm3::Avatar;
use std::path::{Path, PathBuf};

/// Another file for one's own key.
const VARIABLE: &str = "MON3TR_KEY";

/// One's own key, made now if there is none, and beside it the permits and the keys that this user trusts.
///
/// # Errors
/// If there is no place for it, or it cannot be read.
pub fn open() -> anyhow::Result<Keyring> {
    let file = file()?;
    let [permits, trusted] = ["permits", "trusted"].map(|name| file.with_extension(name));
    Ok(Keyring::open(file, permits, trusted)?)
}

/// Whose packages may bring compiled graphs: one's own key and those that one trusts. Where they cannot be read, nobody's may, and the log says why.
pub(crate) fn trusted() -> Vec<PublicKey> {
    let read = || -> anyhow::Result<Vec<PublicKey>> {
        // No key is made for this: who has none has signed no package, and trusts nobody yet.
        if !file()?.exists() {
            return Ok(Vec::new());
        }
        let keys = open()?;
        let own = keys.identity().public();
        let trusted = keys.trusted().with_context(|| {
            format!(
                "the keys that you trust, {}, are of no use",
                keys.trusted_file().display()
            )
        })?;
        Ok([vec![own], trusted].concat())
    };
    read().unwrap_or_else(|why| {
        log::warn!("no package's compiled graph is used: {why:#}");
        Vec::new()
    })
}

/// One's own key as viewers have it. Who has none can do without, and is told why.
pub(crate) fn of_viewer() -> Option<Credentials> {
    let opened = open().inspect_err(|why| log::warn!("others are not shown who you are: {why:#}"));
    Some(Credentials::new(opened.ok()?.identity().clone()))
}

/// With what this side drives `avatar`.
///
/// # Errors
/// If its owner does not let this machine's key drive it.
pub(crate) fn of_sender(avatar: &Avatar) -> anyhow::Result<Credentials> {
    let keys = open()?;
    let own = keys.identity();
    Credentials::for_avatar(own.clone(), avatar.signer, &keys.permits()?).with_context(|| {
        format!(
            "this machine may not drive that avatar: its owner runs `mon3tr keys allow {}`, and here `mon3tr keys accept` takes what that prints",
            own.public()
        )
    })
}

/// Signs the package at `path`, which is written anew.
///
/// # Errors
/// If it cannot be read or written, or someone else signed it.
pub fn sign(path: &Path) -> anyhow::Result<()> {
    let told = || format!("cannot sign {}", path.display());
    let keys = open()?;
    let own = keys.identity();
    let mut avatar = Avatar::load(path).with_context(told)?;
    if let Some(signer) = avatar.signer.filter(|signer| *signer != own.public()) {
        let signer = signer.fingerprint();
        return Err(anyhow!("another key, {signer}, has signed it").context(told()));
    }
    leave_out_foreign_code(&mut avatar)?;
    avatar.save_signed(path, own).with_context(told)?;
    Ok(())
}

/// Takes compiled graphs out of an avatar that is not signed by this user: whoever signs a package vouches for them.
///
/// # Errors
/// If one's own key cannot be read.
pub(crate) fn leave_out_foreign_code(avatar: &mut Avatar) -> anyhow::Result<()> {
    if !avatar.compiled.is_empty() && avatar.signer != Some(open()?.identity().public()) {
        println!(
            "the compiled graph in it is left out: you did not sign it (`mon3tr bake --qnn` compiles it here)"
        );
        avatar.compiled.clear();
    }
    Ok(())
}

/// The file of the people whom this user has met.
///
/// # Errors
/// If there is no place for it.
pub(crate) fn people_met() -> anyhow::Result<PathBuf> {
    Ok(file()?.with_extension("met"))
}

/// The folder of what this user has decided about rooms.
///
/// # Errors
/// If there is no place for it.
pub(crate) fn rooms() -> anyhow::Result<PathBuf> {
    Ok(file()?.with_extension("rooms"))
}

fn file() -> anyhow::Result<PathBuf> {
    let given = |name| std::env::var_os(name).filter(|path| !path.is_empty());
    if let Some(file) = given(VARIABLE) {
        return Ok(file.into());
    }
    let folder = given("XDG_CONFIG_HOME")
        .map(PathBuf::from)
        .or_else(|| Some(PathBuf::from(given("HOME")?).join(".config")));
    let folder =
        folder.with_context(|| format!("no place for your key: set {VARIABLE} to a file"))?;
    Ok(folder.join("mon3tr/key"))
}
