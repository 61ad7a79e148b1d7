//! The hashes of a side's certificate (RFC 8122, section 5).

use data_encoding::HEXLOWER;
use ring::digest::{self, Algorithm, SHA256, SHA384, SHA512};
use std::collections::BTreeMap;
use std::fmt;

/// The hash functions that are taken, by their names.
const HASHES: [(&str, &Algorithm); 3] = [
    ("sha-256", &SHA256),
    ("sha-384", &SHA384),
    ("sha-512", &SHA512),
];

/// The one certificate of a description, by each hash function that it names.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub(crate) struct Fingerprints(BTreeMap<&'static str, Vec<u8>>);

impl Fingerprints {
    /// Adds the value of an attribute.
    pub(super) fn add(&mut self, value: &str) -> Result<(), &'static str> {
        let malformed =
            "a fingerprint is a hash function and pairs of hex digits with colons between";
        let (name, digits) = value.split_once(' ').ok_or(malformed)?;
        let hash = HASHES
            .iter()
            .find(|(known, _)| known.eq_ignore_ascii_case(name));
        let (name, algorithm) = hash.ok_or("a fingerprint is by SHA-256, SHA-384 or SHA-512")?;
        let mut bytes = Vec::with_capacity(algorithm.output_len());
        for pair in digits.split(':') {
            let byte = HEXLOWER.decode(pair.to_ascii_lowercase().as_bytes());
            match byte.as_deref() {
                Ok([byte]) => bytes.push(*byte),
                _ => return Err(malformed),
            }
        }
        if bytes.len() != algorithm.output_len() {
            return Err(malformed);
        }
        match self.0.insert(name, bytes.clone()) {
            Some(before) if before != bytes => Err("the description has two certificates"),
            _ => Ok(()),
        }
    }

    /// That by SHA-256, the one that the WebRTC library knows.
    pub(super) fn sha_256(&self) -> Option<String> {
        self.0.get("sha-256").map(|bytes| colons(bytes))
    }

    /// Whether there is one by SHA-256, which every program that speaks WebRTC writes.
    pub(crate) fn is_complete(&self) -> bool {
        self.0.contains_key("sha-256")
    }

    /// Whether all of them are of this certificate, in DER.
    pub(crate) fn are_of(&self, certificate: &[u8]) -> bool {
        let is_of = |(name, bytes): (&&str, &Vec<u8>)| {
            let known = HASHES.iter().find(|(known, _)| known == name);
            known.is_some_and(|(_, hash)| digest::digest(hash, certificate).as_ref() == bytes)
        };
        self.is_complete() && self.0.iter().all(is_of)
    }
}

fn colons(bytes: &[u8]) -> String {
    let pairs: Vec<String> = bytes.iter().map(|byte| format!("{byte:02x}")).collect();
    pairs.join(":")
}

/// As they are signed: `sha-256 aa:bb:...`, with commas between.
impl fmt::Display for Fingerprints {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let each = self
            .0
            .iter()
            .map(|(name, bytes)| format!("{name} {}", colons(bytes)));
        f.write_str(&each.collect::<Vec<_>>().join(","))
    }
}
