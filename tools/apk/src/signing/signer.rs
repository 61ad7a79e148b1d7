//! Who signs: a key with its certificate, from a file.

use std::fmt;
use std::fs;
use std::io::Write;
use std::path::Path;

use rcgen::{
    CertificateParams, DistinguishedName, DnType, KeyPair, PKCS_ECDSA_P256_SHA256, PKCS_RSA_SHA256,
    PublicKeyData, SigningKey, date_time_ymd,
};
use sha2::{Digest, Sha256};
use tempfile::NamedTempFile;
use x509_parser::parse_x509_certificate;
use x509_parser::pem::Pem;

use super::key_store;
use crate::ApkError;
use crate::small;

/// The algorithms' numbers in the schemes: RSA is with the padding of PKCS #1 v1.5.
const RSA_SHA256: u32 = 0x0103;
const ECDSA_SHA256: u32 = 0x0201;

/// A key that signs packages, and its certificate. Android takes an update only from the key that signed what is installed.
pub struct Signer {
    key: KeyPair,
    algorithm: u32,
    /// The signer's own first, in DER.
    certificates: Vec<Vec<u8>>,
    /// The public key as the certificate has it.
    public_key: Vec<u8>,
}

/// Nothing of the key.
impl fmt::Debug for Signer {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter
            .debug_struct("Signer")
            .field("certificate_sha256", &self.certificate_sha256())
            .finish_non_exhaustive()
    }
}

impl Signer {
    /// The key in the file `path`, which is made if it is not there: ECDSA on P-256, readable for its owner only, with a certificate
    /// called as Android's own tools call debug certificates, so that stores refuse what it signs.
    ///
    /// # Errors
    /// [`ApkError`] if the file cannot be read or made, or holds something else.
    pub fn debug(path: &Path) -> Result<Self, ApkError> {
        match small::read_text(path) {
            Ok(text) => Self::from_blocks(path, &text, path, &text),
            Err(error) if error.kind() == std::io::ErrorKind::NotFound => {
                make_debug_key(path)?;
                Self::from_pem(path, path)
            }
            Err(source) => Err(ApkError::Io {
                what: "could not read the debug key",
                path: path.to_owned(),
                source,
            }),
        }
    }

    /// A key in PKCS #8 and its certificate, or a chain that starts with it, both in PEM; they may be in one file.
    ///
    /// # Errors
    /// [`ApkError`] if a file cannot be read, does not hold that, or the certificate is another key's.
    pub fn from_pem(key: &Path, certificate: &Path) -> Result<Self, ApkError> {
        let key_text =
            small::read_text(key).map_err(ApkError::io("could not read the key", key))?;
        let certificate_text = small::read_text(certificate)
            .map_err(ApkError::io("could not read the certificate", certificate))?;
        Self::from_blocks(key, &key_text, certificate, &certificate_text)
    }

    /// A key with its certificate in a PKCS #12 key store (`.p12`, `.pfx`, `.keystore`), as `keytool` and `openssl pkcs12` make them.
    /// The alias can be left out where the store has one key.
    ///
    /// # Errors
    /// [`ApkError`] if the store cannot be read, the password is wrong, or there is no such key.
    pub fn from_pkcs12(
        store: &Path,
        password: &str,
        alias: Option<&str>,
    ) -> Result<Self, ApkError> {
        let (key, certificates) = key_store::read(store, password, alias)?;
        Self::new(store, &key, store, certificates)
    }

    fn from_blocks(
        key_path: &Path,
        key: &str,
        certificate_path: &Path,
        certificates: &str,
    ) -> Result<Self, ApkError> {
        let mut keys = Vec::new();
        for block in blocks(key_path, key)? {
            let convert = |how: &str| {
                Err(ApkError::key(
                    key_path,
                    format!(
                        "the key is not in PKCS #8; convert it: openssl pkcs8 -topk8 -nodes -in {} -out key.pem{how}",
                        key_path.display()
                    ),
                ))
            };
            match block.label.as_str() {
                "PRIVATE KEY" => keys.push(block.contents),
                "ENCRYPTED PRIVATE KEY" => return convert(" (it asks for the password)"),
                "RSA PRIVATE KEY" | "EC PRIVATE KEY" => return convert(""),
                _ => {}
            }
        }
        let [key] = keys.as_slice() else {
            return Err(ApkError::key(
                key_path,
                format!(
                    "has {} blocks \"PRIVATE KEY\" in PEM, and one is wanted",
                    keys.len()
                ),
            ));
        };
        let certificates: Vec<Vec<u8>> = blocks(certificate_path, certificates)?
            .into_iter()
            .filter(|block| block.label == "CERTIFICATE")
            .map(|block| block.contents)
            .collect();
        Self::new(key_path, key, certificate_path, certificates)
    }

    /// From DER.
    fn new(
        key_path: &Path,
        key: &[u8],
        certificate_path: &Path,
        certificates: Vec<Vec<u8>>,
    ) -> Result<Self, ApkError> {
        let wrong = |why: String| ApkError::key(certificate_path, why);
        let first = certificates
            .first()
            .ok_or_else(|| wrong("has no certificate (\"CERTIFICATE\" in PEM)".into()))?;
        let (rest, parsed) = parse_x509_certificate(first)
            .map_err(|error| wrong(format!("the certificate cannot be read: {error}")))?;
        if !rest.is_empty() {
            return Err(wrong(
                "there is something behind the certificate's end".into(),
            ));
        }
        let public_key = parsed.public_key();
        let public_bits = public_key.subject_public_key.data.as_ref();
        let (key, algorithm) =
            read_key(key, public_bits).map_err(|why| ApkError::key(key_path, why))?;
        if public_bits != key.der_bytes() {
            return Err(wrong(format!(
                "the certificate is not that of the key in {}",
                key_path.display()
            )));
        }
        let public_key = public_key.raw.to_vec();
        Ok(Self {
            key,
            algorithm,
            certificates,
            public_key,
        })
    }

    /// The SHA-256 of the certificate, in hexadecimal.
    pub(crate) fn certificate_sha256(&self) -> String {
        let first = self
            .certificates
            .first()
            .map(Vec::as_slice)
            .unwrap_or_default();
        Sha256::digest(first)
            .iter()
            .map(|byte| format!("{byte:02x}"))
            .collect()
    }

    /// The algorithm's number in the schemes.
    pub(super) fn algorithm(&self) -> u32 {
        self.algorithm
    }

    pub(super) fn certificates(&self) -> &[Vec<u8>] {
        &self.certificates
    }

    pub(super) fn public_key(&self) -> &[u8] {
        &self.public_key
    }

    pub(super) fn sign(&self, message: &[u8]) -> Result<Vec<u8>, ApkError> {
        self.key.sign(message).map_err(ApkError::Sign)
    }
}

/// The key and its algorithm's number. `public_key` is its certificate's, for keys that are stored without their own.
fn read_key(key: &[u8], public_key: &[u8]) -> Result<(KeyPair, u32), String> {
    let why = "is no key that can sign packages here: RSA of 2048 to 4096 bits, or ECDSA on P-256, in PKCS #8";
    let completed = completed_p256(key, public_key);
    let key =
        KeyPair::try_from(completed.as_deref().unwrap_or(key)).map_err(
            |error| match completed {
                Some(_) => format!("the certificate is not that of the key ({error})"),
                None => format!("{why} ({error})"),
            },
        )?;
    let algorithm = KeyPair::algorithm(&key);
    if algorithm == &PKCS_RSA_SHA256 {
        Ok((key, RSA_SHA256))
    } else if algorithm == &PKCS_ECDSA_P256_SHA256 {
        Ok((key, ECDSA_SHA256))
    } else {
        Err(why.to_owned())
    }
}

/// Java stores a key on P-256 without its public half, which is wanted here: then the same key with it, in DER.
fn completed_p256(key: &[u8], public_key: &[u8]) -> Option<Vec<u8>> {
    // PKCS #8 version 0, a key on P-256, an ECPrivateKey version 1 of nothing but 32 bytes.
    const WITHOUT: &[u8] = &[
        0x30, 0x41, 0x02, 0x01, 0x00, 0x30, 0x13, 0x06, 0x07, 0x2a, 0x86, 0x48, 0xce, 0x3d, 0x02,
        0x01, 0x06, 0x08, 0x2a, 0x86, 0x48, 0xce, 0x3d, 0x03, 0x01, 0x07, 0x04, 0x27, 0x30, 0x25,
        0x02, 0x01, 0x01, 0x04, 0x20,
    ];
    // Behind the 32 bytes then: field 1, a string of bits, none of its last byte unused.
    const PUBLIC: &[u8] = &[0xa1, 0x44, 0x03, 0x42, 0x00];
    let secret = key
        .strip_prefix(WITHOUT)
        .filter(|secret| secret.len() == 32)?;
    if public_key.len() != 65 {
        return None;
    }
    let algorithm = WITHOUT.get(2..26)?;
    let inner: &[u8] = &[0x04, 0x6d, 0x30, 0x6b, 0x02, 0x01, 0x01, 0x04, 0x20];
    Some(
        [
            &[0x30, 0x81, 0x87],
            algorithm,
            inner,
            secret,
            PUBLIC,
            public_key,
        ]
        .concat(),
    )
}

/// The blocks of a text in PEM.
fn blocks(path: &Path, text: &str) -> Result<Vec<Pem>, ApkError> {
    Pem::iter_from_buffer(text.as_bytes())
        .collect::<Result<_, _>>()
        .map_err(|error| ApkError::key(path, format!("is not in PEM: {error}")))
}

/// A new key and certificate in `path`, unless another has made one in the meantime.
fn make_debug_key(path: &Path) -> Result<(), ApkError> {
    let failed = |error: rcgen::Error| {
        ApkError::key(path, format!("a debug key could not be made: {error}"))
    };
    let key = KeyPair::generate_for(&PKCS_ECDSA_P256_SHA256).map_err(failed)?;
    let mut name = DistinguishedName::new();
    name.push(DnType::CountryName, "US");
    name.push(DnType::OrganizationName, "Android");
    name.push(DnType::CommonName, "Android Debug");
    let mut params = CertificateParams::default();
    params.distinguished_name = name;
    (params.not_before, params.not_after) = (date_time_ymd(2020, 1, 1), date_time_ymd(2060, 1, 1));
    let certificate = params.self_signed(&key).map_err(failed)?;

    let folder = path
        .parent()
        .filter(|folder| !folder.as_os_str().is_empty())
        .unwrap_or(Path::new("."));
    fs::create_dir_all(folder).map_err(ApkError::io("could not make the folder", folder))?;
    // Its mode is 0600, and whoever looks sees the whole key or none.
    let mut file = NamedTempFile::new_in(folder)
        .map_err(ApkError::io("could not create a file in", folder))?;
    let text = format!("{}{}", key.serialize_pem(), certificate.pem());
    file.write_all(text.as_bytes())
        .map_err(ApkError::io("could not write", path))?;
    match file.persist_noclobber(path) {
        Ok(_) => {
            log::info!("made a debug key: {}", path.display());
            Ok(())
        }
        Err(error) if error.error.kind() == std::io::ErrorKind::AlreadyExists => Ok(()),
        Err(error) => Err(ApkError::Io {
            what: "could not write",
            path: path.to_owned(),
            source: error.error,
        }),
    }
}
