//! The certificate authorities that Android trusts, read from its own folder. The verifier used elsewhere asks Android through Java code
//! of the app; a native activity has none, and the process would end at its first https request.

use reqwest::Certificate;
use rustls::RootCertStore;
use rustls::pki_types::CertificateDer;
use rustls::pki_types::pem::PemObject;
use std::fs;
use std::path::Path;

/// Where Android keeps them: since version 14 in a module with its own updates, before that in the system.
const FOLDERS: [&str; 2] = [
    "/apex/com.android.conscrypt/cacerts",
    "/system/etc/security/cacerts",
];

/// The system's certificates, from the first folder that has any; nothing on other systems.
pub(crate) fn of_android() -> Option<Vec<Certificate>> {
    if !cfg!(target_os = "android") {
        return None;
    }
    let found = FOLDERS
        .into_iter()
        .map(|folder| of_folder(Path::new(folder)))
        .find(|certificates| !certificates.is_empty());
    Some(found.unwrap_or_default())
}

/// All usable certificates in the files of a folder, each PEM with any text around. Unusable ones are left out.
fn of_folder(folder: &Path) -> Vec<Certificate> {
    let Ok(files) = fs::read_dir(folder) else {
        return Vec::new();
    };
    files
        .flatten()
        .filter_map(|file| CertificateDer::pem_file_iter(file.path()).ok())
        .flatten()
        .flatten()
        .filter(|der| RootCertStore::empty().add(der.clone()).is_ok())
        .filter_map(|der| Certificate::from_der(&der).ok())
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use rcgen::{BasicConstraints, CertificateParams, IsCa, KeyPair};

    fn authority() -> String {
        let mut authority = CertificateParams::new([]).expect("parameters");
        authority.is_ca = IsCa::Ca(BasicConstraints::Unconstrained);
        let key = KeyPair::generate().expect("a key");
        authority.self_signed(&key).expect("signed").pem()
    }

    #[test]
    fn a_folder_of_authorities_is_read_as_android_writes_it() {
        let folder = tempfile::tempdir().expect("a folder");
        let put = |name: &str, text: &[u8]| {
            fs::write(folder.path().join(name), text).expect("written");
        };
        // As in /system/etc/security/cacerts: PEM, then what openssl says of it.
        let with_text = format!(
            "{}Certificate:\n    Data:\n        Version: 3 (0x2)\n",
            authority()
        );
        put("00673b5b.0", with_text.as_bytes());
        put("00673b5b.1", authority().as_bytes());
        put("ffffffff.0", &[0xff; 100]);
        put(
            "eeeeeeee.0",
            b"-----BEGIN CERTIFICATE-----\nAAAA\n-----END CERTIFICATE-----\n",
        );
        fs::create_dir(folder.path().join("dddddddd.0")).expect("a folder");
        let found = of_folder(folder.path());
        assert_eq!(found.len(), 2, "the good ones");
        assert!(
            of_folder(&folder.path().join("none")).is_empty(),
            "nothing there"
        );
    }
}
