//! Signatures and keys, by apksigner and keytool.

mod common;

use std::fs;
use std::path::Path;

use apk::Signer;
use common::{PASSWORD, Tools, contents, signing_block, text, tools, write};

fn folder() -> tempfile::TempDir {
    tempfile::tempdir().expect("a temporary folder")
}

/// An RSA key in a store of OpenSSL's, which was made for these tests by `openssl req -x509 -newkey rsa:2048` and
/// `openssl pkcs12 -export -name openssl -passout "pass:correct horse"`: as OpenSSL 3 does it, and as it did before (`-legacy`).
fn openssl(name: &str) -> Signer {
    let path = common::fixture().with_file_name("keys").join(name);
    Signer::from_pkcs12(&path, PASSWORD, Some("openssl")).unwrap_or_else(|error| panic!("{error}"))
}

/// An RSA key as keytool makes it.
fn rsa(tools: &Tools, folder: &Path) -> Signer {
    let store = folder.join("rsa.p12");
    tools.make_key_store(&store, "PKCS12", "upload", &["RSA", "-keysize", "2048"]);
    Signer::from_pkcs12(&store, PASSWORD, None).unwrap_or_else(|error| panic!("{error}"))
}

#[test]
fn apksigner_takes_packages_signed_by_either_kind_of_key() {
    let Some(tools) = tools() else { return };
    let folder = folder();
    let path = folder.path().join("test.apk");
    let debug = Signer::debug(&folder.path().join("debug.pem")).expect("a debug key");
    let ec = folder.path().join("ec.p12");
    tools.make_key_store(&ec, "PKCS12", "upload", &["EC", "-groupname", "secp256r1"]);
    let ec = Signer::from_pkcs12(&ec, PASSWORD, Some("Upload"))
        .unwrap_or_else(|error| panic!("{error}"));
    for (signer, key) in [
        (debug, "key algorithm: EC"),
        (ec, "key algorithm: EC"),
        (rsa(&tools, folder.path()), "key algorithm: RSA"),
    ] {
        let report = write(&contents(), &signer, &path);
        let said = tools.assert_signed(&path);
        assert!(said.contains(key), "{said}");
        assert!(
            said.contains(&format!(
                "certificate SHA-256 digest: {}",
                report.certificate_sha256
            )),
            "{said}"
        );
    }
}

#[test]
fn two_builds_are_the_same_but_for_what_is_random_in_a_signature() {
    let folder = folder();
    let build = |signer: &Signer, name: &str| {
        let path = folder.path().join(name);
        write(&contents(), signer, &path);
        fs::read(&path).expect("the package")
    };
    let debug = Signer::debug(&folder.path().join("debug.pem")).expect("a debug key");
    let (first, second) = (build(&debug, "a.apk"), build(&debug, "b.apk"));
    let block = signing_block(&first);
    assert_eq!(block, signing_block(&second));
    assert_eq!(block.len() % 4096, 0, "the block fills pages");
    assert!(
        first[..block.start] == second[..block.start],
        "the members are the same"
    );
    assert!(
        first[block.end..] == second[block.end..],
        "the directory is the same"
    );
    assert!(
        first[block.clone()] != second[block],
        "ECDSA signatures hold something random"
    );

    let rsa = openssl("openssl.p12");
    assert!(
        build(&rsa, "a.apk") == build(&rsa, "b.apk"),
        "RSA signatures are the same for the same contents"
    );
}

#[test]
fn apksigner_refuses_a_package_with_any_part_of_what_is_signed_changed() {
    let Some(tools) = tools() else { return };
    let folder = folder();
    let path = folder.path().join("test.apk");
    write(
        &contents(),
        &Signer::debug(&folder.path().join("debug.pem")).expect("a debug key"),
        &path,
    );
    let good = fs::read(&path).expect("the package");
    tools.assert_signed(&path);
    let block = signing_block(&good);
    let end = good.len() - 22;
    // Both borders of each part that is digested, of pieces of a megabyte, and places between; then the first scheme's signed data.
    let mut places = vec![
        0,
        40,
        5000,
        (1 << 20) - 1,
        1 << 20,
        (2 << 20) - 1,
        2 << 20,
        block.start - 1,
    ];
    places.extend([block.start, block.start + 40, block.end - 1]);
    places.extend([
        block.end,
        block.end + 60,
        end - 1,
        end + 4,
        end + 11,
        good.len() - 1,
    ]);
    for place in places {
        let mut bad = good.clone();
        bad[place] ^= 0x10;
        fs::write(&path, bad).expect("a file");
        let output = tools.verify(&path, 24);
        assert!(
            !output.status.success(),
            "byte {place} of {} changed, and apksigner says: {}",
            good.len(),
            text(&output)
        );
    }
}

#[test]
fn the_newer_signature_cannot_be_taken_out_unseen() {
    let Some(tools) = tools() else { return };
    let folder = folder();
    let path = folder.path().join("test.apk");
    write(
        &contents(),
        &Signer::debug(&folder.path().join("debug.pem")).expect("a debug key"),
        &path,
    );
    let mut package = fs::read(&path).expect("the package");
    let block = signing_block(&package);
    let v3 = 0xf053_68c0_u32.to_le_bytes();
    let at = package[block.clone()]
        .windows(4)
        .position(|one| one == v3)
        .expect("a v3 signature")
        + block.start;
    package[at] ^= 1;
    fs::write(&path, package).expect("a file");
    let output = tools.verify(&path, 24);
    assert!(
        !output.status.success() && text(&output).contains("v3"),
        "{}",
        text(&output)
    );
}

#[test]
fn a_debug_key_is_made_once_and_for_its_owner_only() {
    let folder = folder();
    let path = folder.path().join("new/folder/debug.pem");
    let first = format!("{:?}", Signer::debug(&path).expect("a debug key"));
    let text = fs::read_to_string(&path).expect("the key's file");
    assert!(
        text.contains("BEGIN PRIVATE KEY") && text.contains("BEGIN CERTIFICATE"),
        "PEM, as other tools read it"
    );
    #[cfg(unix)]
    {
        use std::os::unix::fs::PermissionsExt;
        let mode = fs::metadata(&path)
            .expect("the key's file")
            .permissions()
            .mode();
        assert_eq!(mode & 0o777, 0o600);
    }
    let second = format!("{:?}", Signer::debug(&path).expect("the same key"));
    assert_eq!(first, second);
    assert_eq!(text, fs::read_to_string(&path).expect("the key's file"));
    assert!(
        !first.contains("PRIVATE"),
        "a signer shows nothing of its key"
    );
    fs::write(&path, "not a key").expect("a file");
    let error = Signer::debug(&path)
        .expect_err("this is no key")
        .to_string();
    assert!(
        error.contains("debug.pem") && error.contains("PRIVATE KEY"),
        "{error}"
    );
}

#[test]
fn keys_in_pem_are_read_and_what_is_wrong_with_them_is_said() {
    let folder = folder();
    let path = |name: &str| folder.path().join(name);
    Signer::debug(&path("a.pem")).expect("a key");
    Signer::debug(&path("b.pem")).expect("a key");
    let both = fs::read_to_string(path("a.pem")).expect("the key's file");
    let (key, certificate) =
        both.split_at(both.find("-----BEGIN CERTIFICATE").expect("a certificate"));
    let other = rcgen::KeyPair::generate_for(&rcgen::PKCS_ECDSA_P384_SHA384).expect("a key");
    let garbled = certificate.replace("MII", "AAA").replace("MI", "AA");
    for (name, text) in [
        ("key.pem", key.to_owned()),
        ("certificate.pem", certificate.to_owned()),
        ("two.pem", key.repeat(2)),
        ("p384.pem", other.serialize_pem()),
        ("sec1.pem", key.replace("PRIVATE KEY", "EC PRIVATE KEY")),
        (
            "encrypted.pem",
            key.replace("PRIVATE KEY", "ENCRYPTED PRIVATE KEY"),
        ),
        ("garbled.pem", garbled),
        ("cut.pem", key[..key.len() / 2].to_owned()),
    ] {
        fs::write(path(name), text).expect("a file");
    }
    Signer::from_pem(&path("key.pem"), &path("certificate.pem"))
        .unwrap_or_else(|error| panic!("{error}"));
    for (key, certificate, why) in [
        ("no.pem", "certificate.pem", "could not read the key"),
        ("key.pem", "no.pem", "could not read the certificate"),
        ("key.pem", "b.pem", "not that of the key"),
        ("key.pem", "key.pem", "has no certificate"),
        (
            "certificate.pem",
            "certificate.pem",
            "0 blocks \"PRIVATE KEY\"",
        ),
        ("two.pem", "certificate.pem", "2 blocks \"PRIVATE KEY\""),
        (
            "p384.pem",
            "certificate.pem",
            "no key that can sign packages",
        ),
        ("sec1.pem", "certificate.pem", "openssl pkcs8 -topk8"),
        ("encrypted.pem", "certificate.pem", "asks for the password"),
        ("key.pem", "garbled.pem", "the certificate cannot be read"),
        ("cut.pem", "certificate.pem", "PEM"),
    ] {
        let error = Signer::from_pem(&path(key), &path(certificate))
            .expect_err(why)
            .to_string();
        assert!(error.contains(why), "{error} should speak of {why}");
    }
}

#[test]
fn key_stores_are_read_and_what_is_wrong_with_them_is_said() {
    let Some(tools) = tools() else { return };
    let folder = folder();
    let path = |name: &str| folder.path().join(name);
    let ec = ["EC", "-groupname", "secp256r1"];
    tools.make_key_store(&path("one.p12"), "PKCS12", "first", &ec);
    fs::copy(path("one.p12"), path("two.p12")).expect("a copy");
    tools.make_key_store(&path("two.p12"), "PKCS12", "second", &ec);
    tools.make_key_store(&path("old.jks"), "JKS", "first", &ec);
    tools.make_key_store(
        &path("p521.p12"),
        "PKCS12",
        "first",
        &["EC", "-groupname", "secp521r1"],
    );
    fs::write(path("text.p12"), "not a key store").expect("a file");
    let whole = fs::read(path("one.p12")).expect("a key store");
    fs::write(path("cut.p12"), &whole[..whole.len() / 2]).expect("a file");
    let read =
        |name: &str, password: &str, alias| Signer::from_pkcs12(&path(name), password, alias);
    let first = read("two.p12", PASSWORD, Some("first")).unwrap_or_else(|error| panic!("{error}"));
    let only = read("one.p12", PASSWORD, None).unwrap_or_else(|error| panic!("{error}"));
    assert_eq!(format!("{first:?}"), format!("{only:?}"), "the same key");
    for (name, password, alias, why) in [
        ("no.p12", PASSWORD, None, "could not read the key store"),
        ("one.p12", "wrong", None, "the password is wrong"),
        ("one.p12", "", None, "the password is wrong"),
        (
            "one.p12",
            PASSWORD,
            Some("third"),
            "holds no key called \"third\", but first",
        ),
        (
            "two.p12",
            PASSWORD,
            None,
            "the alias of one has to be given: first, second",
        ),
        ("old.jks", PASSWORD, None, "keytool -importkeystore"),
        ("p521.p12", PASSWORD, None, "no key that can sign packages"),
        (
            "text.p12",
            PASSWORD,
            None,
            "cannot be read as a PKCS #12 key store",
        ),
    ] {
        let error = read(name, password, alias).expect_err(why).to_string();
        assert!(error.contains(why), "{error} should speak of {why}");
    }
}

#[test]
fn key_stores_of_openssl_are_read_new_and_old() {
    let (new, old) = (openssl("openssl.p12"), openssl("openssl-legacy.p12"));
    assert_eq!(format!("{new:?}"), format!("{old:?}"), "the same key");
    let Some(tools) = tools() else { return };
    let folder = folder();
    let path = folder.path().join("test.apk");
    write(&contents(), &old, &path);
    tools.assert_signed(&path);
}
