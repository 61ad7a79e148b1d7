//! Who signs: a key in a key store, as Java's keytool makes and lists them.

use super::tools::{PASSWORD, Tools, printed, run};
use anyhow::{Context, bail, ensure};
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

/// Android's own tools call debug keys so, and give them this password. Stores refuse what is signed with a key that is called so.
const DEBUG_ALIAS: &str = "androiddebugkey";
const DEBUG_NAME: &str = "CN=Android Debug,O=Android,C=US";
const DEBUG_PASSWORD: &str = "android";

/// A key that was found in its key store, where the password opened it.
pub(super) struct Key {
    store: PathBuf,
    password: String,
    alias: String,
    /// Of its certificate, in hexadecimal, as `apksigner verify --print-certs` prints it.
    pub(super) certificate_sha256: String,
}

/// A key in a key store, as keytool lists it.
#[derive(Debug, PartialEq, Eq)]
struct Entry {
    alias: String,
    certificate_sha256: String,
}

impl Key {
    /// The key called `alias` in a key store of any format that Java reads, or its only one.
    pub(super) fn read(
        tools: &Tools,
        store: &Path,
        password: &str,
        alias: Option<&str>,
    ) -> anyhow::Result<Self> {
        let shown = store.display();
        let mut keytool = tools.keytool(password);
        let output = run(keytool.args(["-list", "-v", "-keystore"]).arg(store))?;
        let said = printed(&output);
        if !output.status.success() {
            if said.contains("password was incorrect") {
                bail!("{shown}: the password is wrong, or the key store was changed");
            }
            bail!("{shown} cannot be read as a key store: {}", reason(&said));
        }
        let mut entries = private_keys(&said);
        entries.sort_by(|a, b| a.alias.cmp(&b.alias));
        let names: Vec<&str> = entries.iter().map(|entry| entry.alias.as_str()).collect();
        let names = names.join(", ");
        ensure!(!entries.is_empty(), "{shown} holds no private key");
        ensure!(
            alias.is_some() || entries.len() == 1,
            "{shown} holds several keys, so the alias of one has to be given: {names}"
        );
        let entry = entries
            .into_iter()
            .find(|entry| alias.is_none_or(|alias| entry.alias.eq_ignore_ascii_case(alias)))
            .with_context(|| {
                let alias = alias.unwrap_or_default();
                format!("{shown} holds no key called {alias:?}, but {names}")
            })?;
        Ok(Self {
            store: store.to_owned(),
            password: password.to_owned(),
            alias: entry.alias,
            certificate_sha256: entry.certificate_sha256,
        })
    }

    /// The key in the file `store`, which is made if it is not there, readable for its owner only.
    pub(super) fn debug(tools: &Tools, store: &Path) -> anyhow::Result<Self> {
        if !store.is_file() {
            make_debug_key(tools, store)
                .with_context(|| format!("could not make a debug key, {}", store.display()))?;
        }
        Self::read(tools, store, DEBUG_PASSWORD, None)
    }

    /// apksigner, told to sign with it.
    pub(super) fn sign(&self, tools: &Tools) -> Command {
        let mut command = tools.apksigner(&self.password);
        command.args(["sign", "--ks"]).arg(&self.store);
        command.args(["--ks-key-alias", &self.alias]);
        command.args(["--ks-pass", &format!("env:{PASSWORD}")]);
        command
    }
}

/// A new key, on P-256, in `store`: whole or not at all.
fn make_debug_key(tools: &Tools, store: &Path) -> anyhow::Result<()> {
    let folder = store.parent().unwrap_or(Path::new("."));
    // Only the owner sees into it.
    let place = tempfile::tempdir_in(folder)?;
    let new = place.path().join("new.p12");
    let mut keytool = tools.keytool(DEBUG_PASSWORD);
    keytool.args(["-genkeypair", "-storetype", "PKCS12", "-keystore"]);
    keytool.arg(&new).args(["-alias", DEBUG_ALIAS]);
    keytool.args(["-dname", DEBUG_NAME, "-validity", "14610"]);
    keytool.args(["-keyalg", "EC", "-groupname", "secp256r1"]);
    let output = run(&mut keytool)?;
    ensure!(output.status.success(), "{}", reason(&printed(&output)));
    #[cfg(unix)]
    {
        use std::os::unix::fs::PermissionsExt as _;
        fs::set_permissions(&new, fs::Permissions::from_mode(0o600))?;
    }
    match fs::hard_link(&new, store) {
        Ok(()) => log::info!("made a debug key: {}", store.display()),
        // Another process made one meanwhile: both sign with that one.
        Err(error) if error.kind() == std::io::ErrorKind::AlreadyExists => {}
        Err(error) => return Err(error.into()),
    }
    Ok(())
}

/// The private keys of what `keytool -list -v` prints: lines of names and values, where each key's certificate comes before those
/// that vouch for it.
fn private_keys(said: &str) -> Vec<Entry> {
    let mut found = Vec::new();
    for entry in said.split("Alias name: ").skip(1) {
        let mut lines = entry.lines().map(str::trim);
        let alias = lines.next().unwrap_or_default().to_owned();
        let fingerprint = entry
            .lines()
            .find_map(|line| line.trim().strip_prefix("SHA256: "));
        if let Some(fingerprint) = fingerprint
            && lines.any(|line| line == "Entry type: PrivateKeyEntry")
        {
            found.push(Entry {
                alias,
                certificate_sha256: fingerprint.replace(':', "").to_ascii_lowercase(),
            });
        }
    }
    found
}

/// Why keytool failed, without the name of Java's exception.
fn reason(said: &str) -> &str {
    let line = said.lines().next().unwrap_or_default();
    line.rsplit_once("Exception: ").map_or(line, |(_, why)| why)
}
