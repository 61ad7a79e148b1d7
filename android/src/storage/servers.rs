//! The servers whose rooms, and the calls, that the wearer has agreed to go to, a line each.

use identity::LineFile;
use link_protocol::Name;
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

    /// Whether this one is among them, or this call there: by scheme, host, port and path, for each may lead to someone else.
    #[must_use]
    pub fn has(&self, server: &ServerUrl, call: Option<&Name>) -> bool {
        self.lines().contains(&line(server, call))
    }

    /// Keeps this one, too.
    ///
    /// # Errors
    /// If the file cannot be written.
    pub fn add(&self, server: &ServerUrl, call: Option<&Name>) -> std::io::Result<()> {
        let mut lines = self.lines();
        lines.push(line(server, call));
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

fn line(server: &ServerUrl, call: Option<&Name>) -> String {
    match call {
        Some(call) => format!("{server}/calls/{call}"),
        None => server.to_string(),
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
        assert!(!known.has(&first, None));
        known.add(&first, None).expect("kept");
        assert!(known.has(&first, None));
        let [ours, theirs] = ["c1", "c2"].map(|name| name.parse::<Name>().expect("a name"));
        assert!(
            !known.has(&first, Some(&ours)),
            "to watch is not to be seen"
        );
        known.add(&first, Some(&ours)).expect("kept");
        assert!(known.has(&first, Some(&ours)) && !known.has(&first, Some(&theirs)));
        for other in [
            "http://call.example:8480",
            "https://call.example",
            "https://call.example:8480/other",
            "https://call.example.evil:8480",
        ] {
            assert!(!known.has(&server(other), None), "{other}");
        }
        for number in 0..MOST {
            known
                .add(&server(&format!("https://h{number}.example")), None)
                .expect("kept");
        }
        assert!(!known.has(&first, None), "the oldest");
        assert!(known.has(&server("https://h0.example"), None));
    }
}
