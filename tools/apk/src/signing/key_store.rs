//! Keys in key stores.

use std::path::Path;

use p12_keystore::{KeyStore, KeyStoreEntry, Pkcs12ImportPolicy, PrivateKeyChain};

use crate::ApkError;
use crate::small;

/// A key in PKCS #8 and its certificates, all in DER.
type KeyAndCertificates = (Vec<u8>, Vec<Vec<u8>>);

/// Java's own formats begin so.
const JKS: [u8; 4] = [0xfe, 0xed, 0xfe, 0xed];
const JCEKS: [u8; 4] = [0xce, 0xce, 0xce, 0xce];

/// The key called `alias` in a PKCS #12 store, or the only one.
pub(super) fn read(
    path: &Path,
    password: &str,
    alias: Option<&str>,
) -> Result<KeyAndCertificates, ApkError> {
    let bytes = small::read(path).map_err(ApkError::io("could not read the key store", path))?;
    if bytes.starts_with(&JKS) || bytes.starts_with(&JCEKS) {
        let why = format!(
            "is a key store in Java's old format; convert it: keytool -importkeystore -srckeystore {} -destkeystore new.p12 -deststoretype pkcs12",
            path.display()
        );
        return Err(ApkError::key(path, why));
    }
    let store =
        KeyStore::from_pkcs12(&bytes, password, Pkcs12ImportPolicy::Relaxed).map_err(|error| {
            match error {
                p12_keystore::error::Error::MacError(_) => {
                    ApkError::key(path, "the password is wrong, or the key store was changed")
                }
                other => ApkError::key(
                    path,
                    format!("cannot be read as a PKCS #12 key store: {other}"),
                ),
            }
        })?;
    let keys: Vec<(&str, &PrivateKeyChain)> = store
        .entries()
        .filter_map(|(alias, entry)| match entry {
            KeyStoreEntry::PrivateKeyChain(chain) => Some((alias.as_str(), chain)),
            _ => None,
        })
        .collect();
    let mut names: Vec<&str> = keys.iter().map(|(name, _)| *name).collect();
    names.sort_unstable();
    let has = if names.is_empty() {
        "no key".to_owned()
    } else {
        names.join(", ")
    };
    let chosen = match (alias, keys.as_slice()) {
        (None, [(_, only)]) => only,
        (None, []) => return Err(ApkError::key(path, "holds no private key")),
        (None, _) => {
            return Err(ApkError::key(
                path,
                format!("holds several keys, so the alias of one has to be given: {has}"),
            ));
        }
        (Some(alias), keys) => keys
            .iter()
            .find(|(name, _)| name.eq_ignore_ascii_case(alias))
            .map(|(_, chain)| chain)
            .ok_or_else(|| {
                ApkError::key(path, format!("holds no key called {alias:?}, but {has}"))
            })?,
    };
    let certificates = chosen
        .certs()
        .iter()
        .map(|one| one.as_der().to_vec())
        .collect();
    Ok((chosen.key().as_der().to_vec(), certificates))
}
