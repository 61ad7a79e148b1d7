//! Where a relay is that another process runs.

use std::str::FromStr;

/// Where the relay of another process is reached.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct TurnAt {
    /// Its host's name or address; nothing where callers reach it by the name of the signaling.
    pub host: Option<String>,
    /// Its port, over UDP and TCP.
    pub port: u16,
}

impl FromStr for TurnAt {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let (host, port) = match text.rsplit_once(':') {
            Some((host, port)) => (Some(host), port),
            None => (None, text),
        };
        let wrong = || format!("{text:?} is neither PORT nor HOST:PORT");
        let port = port.parse().ok().filter(|port| *port != 0);
        let host = host.map(|host| host.trim_matches(['[', ']']).to_owned());
        if host.as_deref() == Some("") {
            return Err(wrong());
        }
        Ok(Self {
            host,
            port: port.ok_or_else(wrong)?,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::TurnAt;

    #[test]
    fn a_relays_place_is_a_port_or_a_host_and_a_port() {
        let read = |text: &str| text.parse::<TurnAt>().ok();
        let at = |host: Option<&str>, port| {
            let host = host.map(str::to_owned);
            Some(TurnAt { host, port })
        };
        assert_eq!(read("3478"), at(None, 3478));
        assert_eq!(read("relay.example:3478"), at(Some("relay.example"), 3478));
        assert_eq!(read("[2001:db8::1]:3478"), at(Some("2001:db8::1"), 3478));
        for wrong in [
            "",
            "0",
            ":3478",
            "relay.example",
            "relay.example:",
            "70000",
            "[]:1",
        ] {
            assert_eq!(read(wrong), None, "{wrong}");
        }
    }
}
