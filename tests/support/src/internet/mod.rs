//! An internet on this machine: a server with a public address, and homes behind routers with NAT, each in a network namespace. Packets
//! pass the kernel's own routing and NAT. There is no delay and no loss: that is what `netlab` has.
//!
//! ```text
//! machine -- eth0 192.168.1.2 -- router -- wan 203.0.113.N -- bridge `internet` -- server, 203.0.113.1
//! ```

mod call;
mod home;
mod namespace;

pub use call::{CallWorld, Receiving, Sending};
pub use home::{Home, HomeKind};
pub use namespace::Namespace;

use std::net::Ipv4Addr;
use std::process::{Command, Stdio};

/// The server's address. The network is one of those reserved for documentation (RFC 5737).
pub const SERVER: Ipv4Addr = Ipv4Addr::new(203, 0, 113, 1);

/// Another address of the same machine: who tells destinations apart by address takes it for another one.
pub const OTHER_SERVER: Ipv4Addr = Ipv4Addr::new(203, 0, 113, 2);

/// Number of the first home, and homes at most: the other half of the network is for moves.
const FIRST_HOME: u8 = 10;
const HOMES: u8 = 100;

/// A server's namespace, and homes. All of it ends with this.
#[derive(Debug)]
pub struct Internet {
    server: Namespace,
    homes: u8,
}

impl Internet {
    /// An internet without homes; nothing, and a line that says why, where this machine cannot have one. On CI that is a failure.
    ///
    /// # Panics
    /// On CI, where there cannot be one.
    #[must_use]
    pub fn open() -> Option<Self> {
        match Self::try_open() {
            Ok(internet) => Some(internet),
            Err(why) => {
                assert!(
                    std::env::var("CI").as_deref() != Ok("true"),
                    "no network namespaces: {why}"
                );
                crate::tell(&format!("skipped: no network namespaces: {why}"));
                None
            }
        }
    }

    /// The same.
    ///
    /// # Errors
    /// Why there cannot be one, in words.
    pub fn try_open() -> Result<Self, String> {
        for (variable, name, asks) in [("MON3TR_IP", "ip", "-V"), ("MON3TR_NFT", "nft", "-v")] {
            let path = namespace::program(variable, name);
            let asked = Command::new(&path)
                .arg(asks)
                .stdout(Stdio::null())
                .stderr(Stdio::null())
                .status();
            asked.map_err(|why| format!("{name} ({variable}): {why}; `./run test` fetches it"))?;
        }
        let server = Namespace::first()?;
        server.ip(&[
            "link set lo up".to_owned(),
            "link add internet type bridge".to_owned(),
            format!("address add {SERVER}/24 dev internet"),
            format!("address add {OTHER_SERVER}/24 dev internet"),
            "link set internet up".to_owned(),
        ])?;
        let mut internet = Self { server, homes: 0 };
        // A kernel may lack NAT, and a container may not let routers forward: that is found out now.
        internet.build(HomeKind::Symmetric)?;
        Ok(internet)
    }

    /// Where the server's programs run.
    #[must_use]
    pub fn server(&self) -> &Namespace {
        &self.server
    }

    /// Adds a home.
    ///
    /// # Panics
    /// If there is no room for more, or it cannot be built.
    pub fn home(&mut self, kind: HomeKind) -> Home {
        self.build(kind).unwrap_or_else(|why| panic!("{why}"))
    }

    fn build(&mut self, kind: HomeKind) -> Result<Home, String> {
        assert!(self.homes < HOMES, "there are {HOMES} homes already");
        let [a, b, c, _] = SERVER.octets();
        let public = Ipv4Addr::new(a, b, c, FIRST_HOME + self.homes);
        self.homes += 1;
        Home::build(kind, &self.server, public)
    }
}
