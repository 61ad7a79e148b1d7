//! The servers that the wearer has agreed to go to, a line each.

use identity::LineFile;
use link_protocol::room_link::ServerUrl;
use std::path::PathBuf;

/// Servers that are kept, the newest.
const MOST: usize = 100;
/// Bytes of the file that are looked at.
const MOST_BYTES: u64 = 256 << 10;

/// The file of them, in the folder that no other app can read.
#[derive(Debug, Clone)]
pub struct KnownServers(LineFile);

impl KnownServers {
    pub(super) fn new(file: PathBuf) -> Self {
        Self(LineFile::new(file, MOST_BYTES))
    }

    /// Whether this one is among them: by scheme, host, port and path, for each may lead to someone else.
    #[must_use]
    pub fn has(&self, server: &ServerUrl) -> bool {
        self.lines().contains(&server.to_string())
    }

    /// Keeps this one, too.
    ///
    /// # Errors
    /// If the file cannot be written.
    pub fn add(&self, server: &ServerUrl) -> std::io::Result<()> {
        let mut lines = self.lines();
        lines.push(server.to_string());
        let newest = lines.len().saturating_sub(MOST);
        self.0.write(lines.iter().skip(newest))
    }

    fn lines(&self) -> Vec<String> {
        self.0.read().unwrap_or_else(|error| {
            log::warn!(
                "which servers are known cannot be read ({error}): each is asked about again"
            );
            Vec::new()
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_server_is_known_as_it_was_agreed_to_and_the_oldest_are_forgotten() {
        let folder = tempfile::tempdir().expect("a folder");
        let known = KnownServers::new(folder.path().join("servers"));
        let server = |text: &str| -> ServerUrl { text.parse().expect("an address") };
        let first = server("https://call.example:8480");
        assert!(!known.has(&first));
        known.add(&first).expect("kept");
        assert!(known.has(&first));
        for other in [
            "http://call.example:8480",
            "https://call.example",
            "https://call.example:8480/other",
            "https://call.example.evil:8480",
        ] {
            assert!(!known.has(&server(other)), "{other}");
        }
        for number in 0..MOST {
            known
                .add(&server(&format!("https://h{number}.example")))
                .expect("kept");
        }
        assert!(!known.has(&first), "the oldest");
        assert!(known.has(&server("https://h0.example")));
    }
}
