//! Addresses that an operator has blocked: a file with an address or a prefix (`203.0.113.0/24`, `2001:db8::/32`) in
//! each line, which is looked at every two seconds. What follows a `#` is the operator's own note.

use crate::ServerError;
use crate::reread::{Reread, text_of};
use std::collections::{BTreeSet, HashSet};
use std::io::{Error, ErrorKind};
use std::net::{IpAddr, Ipv4Addr};
use std::path::{Path, PathBuf};

/// The prefixes in the file, as far as it was read.
#[derive(Debug)]
pub(crate) struct Blocked(Reread<Prefixes>);

/// Prefixes by length and bits. IPv4 addresses stand as the IPv6 addresses that map them.
#[derive(Debug, Default, PartialEq, Eq)]
struct Prefixes {
    lengths: BTreeSet<u32>,
    prefixes: HashSet<(u32, u128)>,
}

impl Prefixes {
    fn read(path: &Path) -> Result<Self, ServerError> {
        let unusable = |source| ServerError::BlockedFile {
            path: path.to_path_buf(),
            source,
        };
        let mut all = Self::default();
        for (number, line) in text_of(path).map_err(unusable)?.lines().enumerate() {
            let prefix = line.split('#').next().unwrap_or_default().trim();
            if prefix.is_empty() {
                continue;
            }
            let wrong = || {
                let why = format!("line {} is no address and no prefix", number + 1);
                unusable(Error::new(ErrorKind::InvalidData, why))
            };
            let (length, bits) = prefix_of(prefix).ok_or_else(wrong)?;
            all.lengths.insert(length);
            all.prefixes.insert((length, bits));
        }
        Ok(all)
    }

    fn has(&self, address: IpAddr) -> bool {
        let bits = bits_of(address);
        let mut lengths = self.lengths.iter();
        lengths.any(|&length| self.prefixes.contains(&(length, first(bits, length))))
    }
}

/// A prefix's length and bits.
fn prefix_of(text: &str) -> Option<(u32, u128)> {
    let (address, length) = match text.split_once('/') {
        Some((address, length)) => (address, Some(length.parse::<u32>().ok()?)),
        None => (text, None),
    };
    let address: IpAddr = address.trim().parse().ok()?;
    let most = if address.is_ipv4() { 32 } else { 128 };
    let length = length.unwrap_or(most);
    let length = (length <= most).then_some(length + 128 - most)?;
    Some((length, first(bits_of(address), length)))
}

fn bits_of(address: IpAddr) -> u128 {
    match address {
        IpAddr::V4(v4) => Ipv4Addr::to_ipv6_mapped(&v4).to_bits(),
        IpAddr::V6(v6) => v6.to_bits(),
    }
}

fn first(bits: u128, length: u32) -> u128 {
    bits & !u128::MAX.checked_shr(length).unwrap_or(0)
}

impl Blocked {
    /// Those of `file`, which need not be there yet; none without one.
    ///
    /// # Errors
    /// If the file cannot be read, or has something else in it.
    pub(crate) fn open(file: Option<PathBuf>) -> Result<Self, ServerError> {
        Ok(Self(Reread::open(file, Prefixes::read)?))
    }

    /// Whether this address is blocked.
    pub(crate) fn has(&self, address: IpAddr) -> bool {
        self.0.says().has(address)
    }

    /// Reads the file again if it has changed; whether it blocks others now.
    pub(crate) fn look(&self) -> bool {
        let has_changed = self.0.look();
        if has_changed {
            let count = self.0.says().prefixes.len();
            log::info!("{count} addresses and prefixes are blocked");
        }
        has_changed
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::fs;

    #[test]
    fn prefixes_block_what_is_in_them_and_a_wrong_line_changes_nothing()
    -> Result<(), Box<dyn std::error::Error>> {
        let folder = tempfile::tempdir()?;
        let file = folder.path().join("blocked");
        let blocked = Blocked::open(Some(file.clone()))?;
        let has = |text: &str| blocked.has(text.parse().expect("an address"));
        assert!(!has("203.0.113.7"), "there is no file");
        fs::write(
            &file,
            "# abuse\n203.0.113.0/24 # case 7\n\n198.51.100.9\n2001:db8::/32\n",
        )?;
        assert!(blocked.look(), "read");
        for (address, is_blocked) in [
            ("203.0.113.7", true),
            ("::ffff:203.0.113.7", true),
            ("203.0.114.7", false),
            ("198.51.100.9", true),
            ("198.51.100.8", false),
            ("2001:db8:1::1", true),
            ("2001:db9::1", false),
            ("::1", false),
        ] {
            assert_eq!(has(address), is_blocked, "{address}");
        }
        for wrong in [
            "203.0.113.0/33",
            "2001:db8::/129",
            "here",
            "1.2.3",
            "10.0.0.0/x",
        ] {
            fs::write(&file, wrong)?;
            assert!(!blocked.look() && has("203.0.113.7"), "{wrong}");
            let error = Blocked::open(Some(file.clone())).err().ok_or(wrong)?;
            let why = std::error::Error::source(&error).map(ToString::to_string);
            assert!(why.is_some_and(|why| why.contains("line 1")), "{wrong}");
        }
        fs::write(&file, "0.0.0.0/0\n")?;
        assert!(blocked.look() && has("192.0.2.1") && !has("2001:db8::1"));
        fs::remove_file(&file)?;
        assert!(blocked.look() && !has("192.0.2.1"), "none any more");
        Ok(())
    }
}
