//! Where this machine's user has their key, and what it is used for. It lies with the user's other settings, for nothing makes it again.

use anyhow::{Context, anyhow};
use identity::Keyring;
use link_call::Credentials;
use spmm3::Avatar;
use std::path::{Path, PathBuf};

/// Another file for one's own key.
const VARIABLE: &str = "MON3TR_KEY";

/// One's own key, made now if there is none, and the permits beside it.
///
/// # Errors
/// If there is no place for it, or it cannot be read.
pub fn open() -> anyhow::Result<Keyring> {
    let file = file()?;
    let permits = file.with_extension("permits");
    Ok(Keyring::open(file, permits)?)
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
    let avatar = Avatar::load(path).with_context(told)?;
    if let Some(signer) = avatar.signer.filter(|signer| *signer != own.public()) {
        let signer = signer.fingerprint();
        return Err(anyhow!("another key, {signer}, has signed it").context(told()));
    }
    avatar.save_signed(path, own).with_context(told)?;
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
