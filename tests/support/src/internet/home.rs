//! A home: a machine, and as a rule a router with NAT between it and the internet.

use super::namespace::Namespace;
use std::fmt::{self, Display, Formatter};
use std::net::Ipv4Addr;

/// What a home's router does to packets.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum HomeKind {
    /// There is no router: the machine has a public address, and everything reaches it.
    Open,
    /// NAT as most routers at home have it: a port keeps its number towards everyone (endpoint-independent mapping), and packets come in
    /// only from an address and port that one was sent to (address and port-dependent filtering, RFC 4787). It is nftables'
    /// `masquerade`, which keeps a port's number unless two machines behind it use the same one.
    Cone,
    /// NAT that gives a port another number towards each address and port (address and port-dependent mapping), as providers and offices
    /// have it: `masquerade fully-random`.
    Symmetric,
    /// The same, and nothing but TCP passes.
    UdpBlocked,
}

impl HomeKind {
    /// All of them.
    pub const ALL: [Self; 4] = [Self::Open, Self::Cone, Self::Symmetric, Self::UdpBlocked];

    /// The router's rules.
    fn rules(self) -> String {
        let how = match self {
            Self::Open | Self::Cone => "",
            Self::Symmetric | Self::UdpBlocked => " random,fully-random",
        };
        let passes = match self {
            Self::UdpBlocked => "meta l4proto != tcp drop",
            _ => "accept",
        };
        // Routers drop what nobody asked for, and say nothing: an ICMP answer would end what a NAT is to be opened for.
        format!(
            r#"table ip home {{
                chain leave {{
                    type nat hook postrouting priority srcnat
                    oifname "wan" masquerade{how}
                }}
                chain forward {{
                    type filter hook forward priority filter
                    iifname "wan" ct state != {{ established, related }} drop
                    {passes}
                }}
                chain input {{
                    type filter hook input priority filter
                    iifname "wan" drop
                }}
            }}
            "#
        )
    }
}

impl Display for HomeKind {
    fn fmt(&self, to: &mut Formatter<'_>) -> fmt::Result {
        to.write_str(match self {
            Self::Open => "no NAT",
            Self::Cone => "cone NAT",
            Self::Symmetric => "symmetric NAT",
            Self::UdpBlocked => "UDP blocked",
        })
    }
}

/// The network behind a router: the same in all homes, as at home.
const ROUTER: Ipv4Addr = Ipv4Addr::new(192, 168, 1, 1);

/// A home, with one machine.
#[derive(Debug)]
pub struct Home {
    kind: HomeKind,
    machine: Namespace,
    router: Option<Namespace>,
    /// The address that the internet sees.
    public: Ipv4Addr,
    /// The machine's own address.
    own: Ipv4Addr,
}

impl Home {
    /// Builds a home whose line is plugged into the bridge `internet` of `provider`, with an address of 203.0.113.0/24.
    pub(super) fn build(
        kind: HomeKind,
        provider: &Namespace,
        public: Ipv4Addr,
    ) -> Result<Self, String> {
        let machine = provider.beside()?;
        let router = match kind {
            HomeKind::Open => None,
            _ => Some(provider.beside()?),
        };
        let (outside, line) = match &router {
            Some(router) => (router, "wan"),
            None => (&machine, "eth0"),
        };
        let [.., number] = public.octets();
        provider.ip(&[
            format!(
                "link add home{number} type veth peer name {line} netns {}",
                outside.id()
            ),
            format!("link set home{number} master internet up"),
        ])?;
        outside.ip(&[
            format!("address add {public}/24 dev {line}"),
            format!("link set {line} up"),
        ])?;
        let mut own = public;
        if let Some(router) = &router {
            own = Ipv4Addr::new(192, 168, 1, 2);
            router.ip(&[
                format!(
                    "link add lan type veth peer name eth0 netns {}",
                    machine.id()
                ),
                format!("address add {ROUTER}/24 dev lan"),
                "link set lan up".to_owned(),
            ])?;
            router.nft(&kind.rules())?;
            router.forward()?;
            machine.ip(&[
                format!("address add {own}/24 dev eth0"),
                "link set eth0 up".to_owned(),
                format!("route add default via {ROUTER}"),
            ])?;
        }
        machine.ip(&["link set lo up".to_owned()])?;
        Ok(Self {
            kind,
            machine,
            router,
            public,
            own,
        })
    }

    /// What its router does.
    #[must_use]
    pub fn kind(&self) -> HomeKind {
        self.kind
    }

    /// Where its programs run.
    #[must_use]
    pub fn machine(&self) -> &Namespace {
        &self.machine
    }

    /// The address that the internet sees.
    #[must_use]
    pub fn public(&self) -> Ipv4Addr {
        self.public
    }

    /// Has the router lose so many of a hundred UDP packets, each way.
    ///
    /// # Panics
    /// If that fails, or there is no router.
    pub fn lose(&self, percent: u32) {
        let router = self.router.as_ref().expect("a home with a router");
        let rules = format!(
            r#"table ip loss {{
                chain forward {{
                    type filter hook forward priority -1
                    meta l4proto udp numgen random mod 100 < {percent} drop
                }}
            }}
            "#
        );
        router.nft(&rules).unwrap_or_else(|why| panic!("{why}"));
    }

    /// Gives the machine another address and takes the one it had, as where it goes from one network of the house to another.
    ///
    /// # Panics
    /// If that fails.
    pub fn move_machine(&mut self) {
        let next = neighbour(self.own);
        let mut lines = vec![
            format!("address del {}/24 dev eth0", self.own),
            format!("address add {next}/24 dev eth0"),
        ];
        match self.router {
            // It went with the address.
            Some(_) => lines.push(format!("route replace default via {ROUTER}")),
            None => self.public = next,
        }
        self.machine
            .ip(&lines)
            .unwrap_or_else(|why| panic!("{why}"));
        self.own = next;
    }

    /// Gives the router another public address and takes the one it had, as providers do; the machine is told nothing. The kernel then
    /// forgets the ports that `masquerade` gave.
    ///
    /// # Panics
    /// If that fails, or there is no router.
    pub fn move_router(&mut self) {
        let next = neighbour(self.public);
        let router = self.router.as_ref().expect("a home with a router");
        let lines = [
            format!("address del {}/24 dev wan", self.public),
            format!("address add {next}/24 dev wan"),
        ];
        router.ip(&lines).unwrap_or_else(|why| panic!("{why}"));
        self.public = next;
    }
}

/// Another address of the same network, which nobody has: homes are numbered from 10 to 109.
fn neighbour(address: Ipv4Addr) -> Ipv4Addr {
    let [a, b, c, number] = address.octets();
    Ipv4Addr::new(
        a,
        b,
        c,
        if number < 110 {
            number + 110
        } else {
            number - 110
        },
    )
}
